//! Stanford PLY meshes: ASCII and binary of both byte orders, plain or gzip.
//!
//! The file is streamed through a small buffer, which is faster than memory mapping (no page faults), needs no
//! `unsafe`, and allocates only the mesh. Counts in the header are compared with the size of the file before anything
//! is allocated, and every index is checked. Faces with three vertices become triangles, faces with four become quads
//! (bilinear patches in pbrt), larger ones triangle fans; triangle strips are expanded. If corners of faces have
//! texture coordinates, vertices at seams are split.
//!
//! Reading order: `header`, `stream`, `numbers`, `vertices`, `faces`, `wedges`, `unread`.

mod faces;
mod header;
mod numbers;
mod stream;
mod unread;
mod vertices;
mod wedges;

use crate::gzip;
use header::{Encoding, Header};
use lumiris_numbers::math::{DVec3, Vec2, Vec3};
use numbers::{Ascii, Binary, Numbers};
use std::fmt;
use std::fs::File;
use std::io::{self, BufReader, Read};
use std::path::{Path, PathBuf};
use stream::Stream;

/// The content of a PLY file.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct PlyMesh {
    /// Vertex positions relative to `origin`, all finite; there is capacity for one more.
    pub positions: Vec<Vec3>,
    /// An origin near the vertices, which is subtracted before numbers of double precision are rounded.
    pub origin: DVec3,
    /// Normals as written, one per vertex, or empty.
    pub normals: Vec<Vec3>,
    /// Texture coordinates, one per vertex, or empty.
    pub uvs: Vec<Vec2>,
    /// Faces of three vertices, fans of larger ones, and strips; indices are in range.
    pub triangles: Vec<[u32; 3]>,
    /// Faces of four vertices in circular order, as in the file; indices are in range. A bilinear patch p00, p10, p01,
    /// p11 has the corners 0, 1, 3, 2.
    pub quads: Vec<[u32; 4]>,
    /// Numbers of the faces (`face_indices`) of the triangles, or empty.
    pub triangle_numbers: Vec<u32>,
    /// Numbers of the faces of the quads, or empty.
    pub quad_numbers: Vec<u32>,
    /// Irregularities of the file.
    pub warnings: Vec<String>,
}

/// A position in a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Place {
    /// Line of a text, from 1.
    Line(u64),
    /// Offset from the start (bytes), after decompression.
    Byte(u64),
}

impl fmt::Display for Place {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Place::Line(line) => write!(f, "line {line}"),
            Place::Byte(byte) => write!(f, "byte {byte}"),
        }
    }
}

/// Errors of PLY files.
#[derive(Debug, thiserror::Error)]
pub enum PlyError {
    /// Reading or decompression failed.
    #[error("{}{source}", if path.as_os_str().is_empty() { String::new() } else { format!("{}: ", path.display()) })]
    Io {
        /// The file; empty if bytes were given.
        path: PathBuf,
        /// The reason.
        source: io::Error,
    },
    /// The header is invalid, or does not describe a mesh.
    #[error("line {line} of the header: {message}")]
    Header {
        /// Line, from 1.
        line: u64,
        /// The error.
        message: String,
    },
    /// The header declares more than the file can hold.
    #[error(
        "{count} of `{element}` are announced, which takes at least {needed} bytes, but at most {available} follow the \
         header"
    )]
    Counts {
        /// Name of the element.
        element: String,
        /// Number of its rows.
        count: u64,
        /// Minimum size of this element and the elements before it (bytes).
        needed: u64,
        /// Maximum size of the data after the header (bytes).
        available: u64,
    },
    /// The file ends too early.
    #[error("the file ends at {place}, inside `{element}`")]
    Truncated {
        /// Position of the end, or of a list that does not fit.
        place: Place,
        /// The element that is incomplete.
        element: String,
    },
    /// A word of an ASCII file is not a number of the expected kind.
    #[error("{place}: `{word}` in `{element}`, where {expected} is expected")]
    Number {
        /// Its position.
        place: Place,
        /// The word.
        word: String,
        /// Its element.
        element: String,
        /// The expected kind.
        expected: &'static str,
    },
    /// A list has a negative length.
    #[error("{place}: a list of {length} items in `{element}`")]
    ListLength {
        /// Position of the list.
        place: Place,
        /// Its length.
        length: i64,
        /// Its element.
        element: String,
    },
    /// A face refers to a vertex that does not exist.
    #[error("{place}: face {face} refers to vertex {index}, but there are {vertices} vertices")]
    IndexOutOfRange {
        /// Position of the index, or of the face.
        place: Place,
        /// The face, from 0; of strips, the strip.
        face: u64,
        /// The index; −1 if it is not an integer.
        index: i64,
        /// Number of vertices.
        vertices: u64,
    },
}

impl PlyError {
    fn header(line: u64, message: impl Into<String>) -> Self {
        PlyError::Header { line, message: message.into() }
    }
}

impl From<io::Error> for PlyError {
    fn from(source: io::Error) -> Self {
        PlyError::Io { path: PathBuf::new(), source }
    }
}

/// Reads a PLY file, which may be compressed by gzip.
pub fn read_ply(path: &Path) -> Result<PlyMesh, PlyError> {
    open(path).map_err(PlyError::from).and_then(|(file, size)| read_any(file, size)).map_err(|error| match error {
        PlyError::Io { source, .. } => PlyError::Io { path: path.to_owned(), source },
        other => other,
    })
}

/// The size of a mesh, by the header of its file.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct PlySize {
    /// Bytes of positions, normals, texture coordinates and indices in memory.
    pub bytes: u64,
    /// Number of triangles; of faces, if the file does not tell their corners.
    pub triangles: u64,
}

/// The size of the mesh of a PLY file, which may be compressed by gzip. Reads the header only.
pub fn ply_size(path: &Path) -> Result<PlySize, PlyError> {
    let (mut file, size) = open(path)?;
    let mut magic = Vec::new();
    Read::by_ref(&mut file).take(2).read_to_end(&mut magic)?;
    let is_gzip = magic == gzip::MAGIC;
    let mut whole = io::Cursor::new(magic).chain(file);
    let of = |stream: &mut Stream<'_>| {
        let header = header::read_header(stream)?;
        header.check_counts(stream.remaining_limit())?;
        Ok(header.size(Some(stream.remaining_limit()).filter(|_| !is_gzip)))
    };
    if is_gzip {
        let mut decoder = gzip::Members::new(BufReader::new(whole));
        of(&mut Stream::inflated(&mut decoder, size))
    } else {
        of(&mut Stream::new(&mut whole, size))
    }
}

/// Reads the bytes of a PLY file, which may be compressed by gzip.
pub fn parse_ply(bytes: &[u8]) -> Result<PlyMesh, PlyError> {
    read_any(bytes, bytes.len() as u64)
}

fn open(path: &Path) -> io::Result<(File, u64)> {
    // Opening a pipe would block, and reading a folder gives an unclear message.
    let metadata = std::fs::metadata(path)?;
    if !metadata.is_file() {
        return Err(io::Error::new(io::ErrorKind::InvalidInput, "is not a regular file"));
    }
    Ok((File::open(path)?, metadata.len()))
}

/// Reads from `reader`, which returns `size` bytes.
fn read_any(mut reader: impl Read, size: u64) -> Result<PlyMesh, PlyError> {
    let mut magic = Vec::new();
    reader.by_ref().take(2).read_to_end(&mut magic)?;
    let is_gzip = magic == gzip::MAGIC;
    let mut whole = io::Cursor::new(magic).chain(reader);
    if is_gzip {
        let mut decoder = gzip::Members::new(BufReader::new(whole));
        let mut stream = Stream::inflated(&mut decoder, size);
        let mesh = read_stream(&mut stream)?;
        stream.drain()?;
        Ok(mesh)
    } else {
        read_stream(&mut Stream::new(&mut whole, size))
    }
}

fn read_stream(stream: &mut Stream<'_>) -> Result<PlyMesh, PlyError> {
    let header = header::read_header(stream)?;
    header.check_counts(stream.remaining_limit())?;
    match header.encoding {
        Encoding::Ascii => read_body(&header, &mut Ascii(stream)),
        Encoding::LittleEndian => read_body(&header, &mut Binary::<false>(stream)),
        Encoding::BigEndian => read_body(&header, &mut Binary::<true>(stream)),
    }
}

fn read_body<'a>(header: &Header, numbers: &mut impl Numbers<'a>) -> Result<PlyMesh, PlyError> {
    let vertices =
        header.element("vertex").ok_or_else(|| PlyError::header(header.lines, "there is no `vertex` element"))?;
    let mut mesh = PlyMesh { warnings: unread::warning(header).into_iter().collect(), ..PlyMesh::default() };
    let mut faces = faces::Faces::new(vertices.count);
    for element in &header.elements {
        match element.name.as_str() {
            "vertex" => vertices::read(element, numbers, &mut mesh)?,
            "face" => faces.read(element, numbers)?,
            "tristrips" => faces.read_strips(element, numbers)?,
            _ => numbers.skip_element(element)?,
        }
    }
    faces.finish(&mut mesh);
    Ok(mesh)
}

#[cfg(test)]
mod tests;
