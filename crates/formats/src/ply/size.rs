//! The size of a mesh, from the header of its file.

use super::error::PlyError;
use super::header;
use super::mesh::PlySize;
use super::stream::Stream;
use crate::gzip;
use crate::source::open_regular;
use std::io::{self, BufReader, Read};
use std::path::Path;

/// The size of the mesh of a PLY file, which may be compressed by gzip. Reads the header only.
pub fn ply_size(path: &Path) -> Result<PlySize, PlyError> {
    let mut file = open_regular(path)?;
    let size = file.metadata()?.len();
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
