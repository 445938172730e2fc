//! Reads files and bytes.

use super::error::PlyError;
use super::header::{self, Encoding, Header};
use super::mesh::PlyMesh;
use super::numbers::{Ascii, Binary, Numbers};
use super::stream::Stream;
use super::{faces, unread, vertices};
use crate::gzip;
use crate::source::open_regular;
use std::io::{self, BufReader, Read};
use std::path::Path;

/// Reads a PLY file, which may be compressed by gzip.
pub fn read_ply(path: &Path) -> Result<PlyMesh, PlyError> {
    let read = || {
        let file = open_regular(path)?;
        let size = file.metadata()?.len();
        read_any(file, size)
    };
    read().map_err(|error| match error {
        PlyError::Io { source, .. } => PlyError::Io { path: path.to_owned(), source },
        other => other,
    })
}

/// Reads the bytes of a PLY file, which may be compressed by gzip.
pub fn parse_ply(bytes: &[u8]) -> Result<PlyMesh, PlyError> {
    read_any(bytes, bytes.len() as u64)
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
