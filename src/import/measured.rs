//! Files of measured materials.

use super::memory::FileSize;
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

/// Bytes of a file: tables with distributions; and the file with its numbers. Estimated from its size.
pub fn tables_size(path: &Path) -> FileSize {
    let bytes = path.metadata().map_or(0, |metadata| metadata.len()).saturating_mul(2);
    FileSize { kept: bytes, loading: bytes }
}
