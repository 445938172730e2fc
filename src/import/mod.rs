//! Scene files to scenes: the pbrt-v4 format, PLY meshes, measured spectra.
//!
//! User input never panics. What is wrong with it is collected, with places, in [`diagnostic::Diagnostics`].
//!
//! Reading order: [`source`], [`diagnostic`], [`number`], [`pbrt`], [`ply`], [`resources`], [`spectra`], [`upsampling`],
//! [`color_space`].

pub mod color_space;
pub mod diagnostic;
pub mod number;
pub mod pbrt;
pub mod ply;
pub mod resources;
pub mod source;
pub mod spectra;
pub mod spectra_data;
pub mod upsampling;

use crate::scene::Scene;
use diagnostic::{Diagnostics, Report};
use pbrt::state::Builder;
use source::SourceMap;
use std::path::Path;

/// What a caller overrides of a scene file.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct LoadOptions {
    /// Size of the picture (width, height).
    pub resolution: Option<[u32; 2]>,
    /// Crop window x0, x1, y0, y1 in fractions of the picture.
    pub crop: Option<[f32; 4]>,
}

/// A scene, and what its author may want to know.
#[derive(Debug)]
pub struct Loaded {
    /// The scene.
    pub scene: Scene,
    /// Warnings.
    pub warnings: Report,
}

/// Loads a scene file. `Err` holds all errors that were found, and the warnings.
pub fn load(path: &Path, options: &LoadOptions) -> Result<Loaded, Box<Report>> {
    let mut sources = SourceMap::new();
    let mut diagnostics = Diagnostics::new();
    let folder = path.parent().map(Path::to_path_buf).unwrap_or_default();
    let mut builder = Builder::new(folder, options);
    pbrt::parser::parse_file(path, &mut sources, &mut diagnostics, &mut builder);
    let scene = builder.finish(&mut diagnostics);
    let failed = diagnostics.has_errors();
    let report = diagnostics.finish(&sources);
    match scene {
        Some(scene) if !failed => Ok(Loaded { scene, warnings: report }),
        _ => Err(Box::new(report)),
    }
}
