//! The arithmetic of Lumiris: numbers in, numbers out. Nothing here knows of scenes, rays or files, and nothing is foreign code.
//!
//! | module | what it holds |
//! |---|---|
//! | [`math`] | vectors, frames, colour, warps with their densities, tabulated distributions, robust ray origins |
//! | [`estimators`] | Monte Carlo, MIS, RIS, OCV and their relatives; running moments and statistical tests |
//! | [`samplers`] | stateless random numbers `u(pixel, sample, domain)` |

pub mod estimators;
pub mod math;
pub mod samplers;
