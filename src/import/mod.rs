//! Scene files to scenes: the pbrt-v4 format, PLY meshes, measured spectra.
//!
//! User input never panics. What is wrong with it is collected, with places, in [`diagnostic::Diagnostics`].
//!
//! Reading order: [`source`], [`diagnostic`], [`number`], [`pbrt`], [`ply`], [`spectra`].

pub mod diagnostic;
pub mod number;
pub mod pbrt;
pub mod ply;
pub mod source;
pub mod spectra;
pub mod spectra_data;
