//! Stanford PLY meshes: ASCII and binary of both byte orders, plain or gzip.
//!
//! The file is streamed through a small buffer, so that reading costs no memory but the mesh. Counts in the
//! header are compared with the size of the file before anything is allocated, and every index is checked. Faces of
//! three vertices become triangles, of four bilinear patches (as in pbrt), of more a fan of triangles.
//!
//! Reading order: [`header`], [`stream`], `body`.

mod body;
pub mod header;
pub mod stream;

use crate::math::{Vec2, Vec3};
use flate2::read::GzDecoder;
use std::fs::File;
use std::io::{self, Read};
use std::path::Path;
use stream::Stream;

/// Largest factor by which deflate expands; bounds what a gzip file can hold.
const MAX_INFLATION: u64 = 1032;

/// What a PLY file holds.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct PlyMesh {
    /// Vertex positions; there is capacity for one more.
    pub positions: Vec<Vec3>,
    /// Normals as written, one per vertex, or empty.
    pub normals: Vec<Vec3>,
    /// Texture coordinates, one per vertex, or empty.
    pub uvs: Vec<Vec2>,
    /// Faces of three vertices, and fans of larger ones; indices are in range.
    pub triangles: Vec<[u32; 3]>,
    /// Faces of four vertices in the order of a bilinear patch, p00, p10, p01, p11; indices are in range.
    pub quads: Vec<[u32; 4]>,
    /// What was odd.
    pub warnings: Vec<String>,
}

/// Why a PLY file cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum PlyError {
    /// It cannot be read.
    #[error("{0}")]
    Io(#[from] io::Error),
    /// It is no PLY file, or a broken one.
    #[error("{0}")]
    Format(String),
}

impl PlyError {
    fn format(message: impl Into<String>) -> Self {
        PlyError::Format(message.into())
    }
}

/// Reads a PLY file.
pub fn read_ply(path: &Path) -> Result<PlyMesh, PlyError> {
    let mut file = File::open(path)?;
    let metadata = file.metadata()?;
    if metadata.is_dir() {
        return Err(PlyError::format("is a folder"));
    }
    let mut magic = [0; 2];
    let read = read_up_to(&mut file, &mut magic)?;
    let rest = io::Cursor::new(magic).take(read as u64).chain(file);
    if magic == [0x1f, 0x8b] {
        parse_ply(GzDecoder::new(rest), metadata.len().saturating_mul(MAX_INFLATION))
    } else {
        parse_ply(rest, metadata.len())
    }
}

/// Reads a PLY file from `reader`, which yields at most `size_limit` bytes.
pub fn parse_ply(reader: impl Read, size_limit: u64) -> Result<PlyMesh, PlyError> {
    let mut stream = Stream::new(reader, size_limit);
    let header = header::read_header(&mut stream)?;
    header.check_counts(stream.remaining_limit())?;
    body::read_body(&header, &mut stream)
}

fn read_up_to(reader: &mut impl Read, out: &mut [u8]) -> io::Result<usize> {
    let mut filled = 0;
    while filled < out.len() {
        match reader.read(&mut out[filled..]) {
            Ok(0) => break,
            Ok(n) => filled += n,
            Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
            Err(error) => return Err(error),
        }
    }
    Ok(filled)
}

#[cfg(test)]
mod tests;
