//! Reading of scene files: pbrt-v4 text to checked directives, PLY files to meshes, measured spectra to colours.
//!
//! User input never panics. What is wrong with it is collected, with places, in [`diagnostic::Diagnostics`]. What directives mean is
//! not decided here: the renderer builds its scene from them.
//!
//! Reading order: [`source`], [`diagnostic`], [`number`], [`pbrt`], [`ply`], [`spectra`], [`upsampling`], [`color_space`].

pub mod color_space;
pub mod diagnostic;
pub mod number;
pub mod pbrt;
pub mod ply;
pub mod source;
pub mod spectra;
pub mod spectra_data;
pub mod upsampling;
