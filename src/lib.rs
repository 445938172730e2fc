//! Lumiris: an offline CPU renderer for lighting integrals that are hard to sample.
//!
//! The code is layered; a module imports only from layers above it in this list (`tests/it/layering.rs` holds it):
//!
//! | layer | modules |
//! |---|---|
//! | 0 | [`math`], [`estimators`], [`simd`] |
//! | 1 | [`samplers`], [`imaging`] |
//! | 2 | [`textures`], [`geometry`], [`bsdfs`], [`cameras`], [`film`] |
//! | 3 | [`materials`], [`lights`], [`accel`] |
//! | 4 | [`settings`] |
//! | 5 | [`scene`] |
//! | 6 | [`import`], [`direct`], [`photons`], [`procedural`] |
//! | 7 | [`integrators`] |
//! | 8 | [`render`] |
//! | 9 | [`cli`], [`compare`], [`reproduce`] |

pub mod accel;
pub mod bsdfs;
pub mod cameras;
pub mod cli;
pub mod compare;
pub mod direct;
pub mod estimators;
pub mod film;
pub mod geometry;
pub mod imaging;
pub mod import;
pub mod integrators;
pub mod lights;
pub mod materials;
pub mod math;
pub mod photons;
pub mod procedural;
pub mod render;
pub mod reproduce;
pub mod samplers;
pub mod scene;
pub mod settings;
pub mod simd;
pub mod textures;
