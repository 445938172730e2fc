//! Reads grids from files and from memory.

use super::error::NanoError;
use super::grid::{NanoGrid, NanoSize};
use super::{file, tree};
use crate::source::open_regular;
use std::fs::File;
use std::io::{self, BufReader, Cursor};
use std::path::Path;

/// Reads the first grid with a name from a file.
pub fn read_nanovdb(path: &Path, name: &str) -> Result<NanoGrid, NanoError> {
    opened(path, |reader, size| read_any(reader, size, name))
}

/// The size of the first grid with a name in a file, without its data.
pub fn nanovdb_size(path: &Path, name: &str) -> Result<NanoSize, NanoError> {
    opened(path, |mut reader, size| file::grid_size(&mut reader, size, name))
}

/// Calls `read` with a file and its size.
fn opened<T>(path: &Path, read: impl FnOnce(BufReader<File>, u64) -> Result<T, NanoError>) -> Result<T, NanoError> {
    let read = || {
        let file = open_regular(path)?;
        let size = file.metadata()?.len();
        read(BufReader::new(file), size)
    };
    read().map_err(|error| match error {
        NanoError::Io { source, .. } => NanoError::Io { path: path.to_owned(), source },
        other => other,
    })
}

/// Reads the first grid with a name from the bytes of a file.
pub fn parse_nanovdb(bytes: &[u8], name: &str) -> Result<NanoGrid, NanoError> {
    read_any(Cursor::new(bytes), bytes.len() as u64, name)
}

fn read_any(mut reader: impl io::Read + io::Seek, size: u64, name: &str) -> Result<NanoGrid, NanoError> {
    let bytes = file::grid_bytes(&mut reader, size, name)?;
    tree::grid(name.to_owned(), &bytes)
}
