//! File formats: pbrt-v4 text to validated directives, PLY files to meshes, Ptex files to textures of faces, NanoVDB
//! files to sparse grids, glTF files to validated JSON and arrays, measured BSDFs to tables, measured spectra to
//! colours; and atomic writing of files.
//!
//! User input never panics. Errors are collected with their positions in [`diagnostic::Diagnostics`]. The renderer
//! defines the semantics of directives and builds the scene.
//!
//! Reading order: `gzip`, [`source`], [`names`], [`diagnostic`], [`number`], [`pbrt`], [`ply`], [`ptex`], [`nanovdb`],
//! [`gltf`], [`spectra`], [`upsampling`], [`bsdf_file`], [`color_space`], [`output`].

pub mod bsdf_file;
pub mod color_space;
pub mod diagnostic;
pub mod gltf;
mod gzip;
pub mod names;
pub mod nanovdb;
pub mod number;
pub mod output;
pub mod pbrt;
pub mod ply;
pub mod ptex;
pub mod source;
pub mod spectra;
pub mod spectra_data;
pub mod upsampling;
