//! Files of measured materials.

use crate::bsdfs::MeasuredTables;
use lumiris_formats::bsdf_file::{BsdfFileError, read_bsdf};
use std::path::Path;

/// Errors of measured materials.
#[derive(Debug, thiserror::Error)]
pub enum MeasuredError {
    /// The file cannot be read.
    #[error(transparent)]
    File(#[from] BsdfFileError),
    /// The content is inconsistent.
    #[error("{0}")]
    Tables(String),
}

/// The tables of a file.
pub fn load_tables(path: &Path) -> Result<MeasuredTables, MeasuredError> {
    MeasuredTables::new(read_bsdf(path)?)
        .map_err(|reason| MeasuredError::Tables(format!("{}: {reason}", path.display())))
}
