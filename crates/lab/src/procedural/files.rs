//! Writing generated content to files.

use super::ply::write_ply;
use super::sky::{SkyOptions, sky};
use super::statue::{StatueOptions, statue};
use lumiris::imaging::oiio::{ImageError, Part, Storage, write_image};
use lumiris_formats::output::write_text;
use std::io;
use std::path::{Path, PathBuf};

/// Errors of generated content.
#[derive(Debug, thiserror::Error)]
pub enum ProceduralError {
    /// An option is out of range.
    #[error("{0}")]
    Option(String),
    /// A file cannot be written.
    #[error("cannot write {}: {cause}", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// The reason.
        cause: io::Error,
    },
    /// An image cannot be written.
    #[error(transparent)]
    Image(#[from] ImageError),
}

/// Statistics of the written files.
#[derive(Clone, Copy, Debug)]
pub struct Written {
    /// Triangles of the statue.
    pub triangles: usize,
}

/// Makes a statue and writes it as PLY.
pub fn write_statue(path: &Path, options: &StatueOptions) -> Result<Written, ProceduralError> {
    let mesh = statue(options).map_err(ProceduralError::Option)?;
    write_ply(path, &mesh).map_err(|cause| ProceduralError::Io { path: path.to_owned(), cause })?;
    Ok(Written { triangles: mesh.triangle_count() })
}

/// Makes a sky and writes it, usually as EXR.
pub fn write_sky(path: &Path, options: &SkyOptions) -> Result<(), ProceduralError> {
    let image = sky(options).map_err(ProceduralError::Option)?;
    let part = Part::linear(image.width, image.height, image.channels, image.data).stored_as(Storage::Float);
    Ok(write_image(path, &[part])?)
}

/// Writes files, by name and text, into a folder, which is created if necessary.
pub(super) fn write_texts(folder: &Path, texts: &[(&str, &str)]) -> Result<(), ProceduralError> {
    let failed = |path: &Path| {
        let path = path.to_owned();
        move |cause| ProceduralError::Io { path, cause }
    };
    std::fs::create_dir_all(folder).map_err(failed(folder))?;
    for (name, text) in texts {
        let path = folder.join(name);
        write_text(&path, text).map_err(failed(&path))?;
    }
    Ok(())
}
