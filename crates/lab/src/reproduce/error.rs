//! Errors of a reproduction, and operations on files that name the file.

use crate::procedural::files::ProceduralError;
use lumiris_formats::output::write_text;
use std::path::{Path, PathBuf};

/// Errors of a reproduction.
#[derive(Debug, thiserror::Error)]
pub enum ReproduceError {
    /// A scene could not be read.
    #[error("{path} could not be loaded:\n{report}")]
    Scene {
        /// Its file.
        path: PathBuf,
        /// Errors and warnings.
        report: Box<lumiris_formats::diagnostic::Report>,
    },
    /// A scene could not be generated.
    #[error(transparent)]
    Procedural(#[from] ProceduralError),
    /// A ray tracer could not be built.
    #[error("cannot build a ray tracer: {0}")]
    Accel(#[from] lumiris::accel::embree::EmbreeError),
    /// A rendering ended without an image.
    #[error(transparent)]
    Render(#[from] lumiris::render::RenderError),
    /// A photon map could not be built.
    #[error(transparent)]
    Photons(#[from] lumiris::photons::PhotonError),
    /// An image could not be written.
    #[error(transparent)]
    Image(#[from] lumiris::imaging::oiio::ImageError),
    /// A file could not be written.
    #[error("{path}: {cause}")]
    File {
        /// Its path.
        path: PathBuf,
        /// The reason.
        cause: std::io::Error,
    },
    /// The observer stopped it.
    #[error("ended before it was done")]
    Stopped,
}

/// Writes a file; errors contain its path.
pub(crate) fn write_file(path: PathBuf, text: &str) -> Result<(), ReproduceError> {
    write_text(&path, text).map_err(|cause| ReproduceError::File { path, cause })
}

/// Creates a folder; errors contain its path.
pub(crate) fn make_folder(path: &Path) -> Result<(), ReproduceError> {
    std::fs::create_dir_all(path).map_err(|cause| ReproduceError::File { path: path.to_owned(), cause })
}
