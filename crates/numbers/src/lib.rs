//! The numerics of Lumiris: numbers in, numbers out. Nothing here depends on scenes, rays, files, or foreign code.
//!
//! | module | content |
//! |---|---|
//! | [`math`] | vectors, frames, colour, warps with their densities, tabulated distributions, robust ray origins |
//! | [`estimators`] | Monte Carlo, MIS, RIS, OCV and their relatives; running moments and statistical tests |
//! | [`samplers`] | stateless random numbers `u(pixel, sample, domain)` |

pub mod estimators;
pub mod math;
pub mod samplers;
