//! The list of the grids of a file, and the bytes of a grid.
//!
//! A segment begins with 16 bytes: magic number, version, number of grids, and compression. For each grid follow 176
//! bytes and its name; then the data of all grids, with the sizes in the list.

use super::blosc;
use super::bytes::Bytes;
use super::error::NanoError;
use super::grid::{NanoSize, TYPES, ValueType};
use flate2::read::ZlibDecoder;
use std::io::{Read, Seek, SeekFrom};

/// Magic number of files up to 32.5, and of their grids.
const MAGIC_EITHER: &[u8; 8] = b"NanoVDB0";
/// Magic number of grids, and of files with grids only.
const MAGIC_GRID: &[u8; 8] = b"NanoVDB1";
/// Magic number of files.
const MAGIC_FILE: &[u8; 8] = b"NanoVDB2";

/// The supported major version.
const MAJOR: u32 = 32;

/// Sizes of the header of a segment, of the header of a list entry, and of the header of a grid.
const SEGMENT: usize = 16;
const ENTRY: usize = 176;
pub(super) const GRID: usize = 672;
/// Size of the header of a tree, which follows.
const TREE: usize = 64;

/// Maximum length of a name.
const MAX_NAME: u32 = 1 << 16;
/// Maximum expansion factor of deflate.
const MAX_DEFLATE: u64 = 1032;
/// Maximum expansion factor of LZ4, with a margin for headers.
const MAX_LZ4: u64 = 300;

/// Compression of a grid.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Codec {
    None,
    Zip,
    Blosc,
}

/// A grid of a file.
struct Entry {
    name: String,
    /// Its offset and size in the file.
    start: u64,
    stored: u64,
    /// Its size in memory.
    size: u64,
    ty: u32,
    codec: Codec,
    /// Numbers of leaves, of nodes of 16³ and of 32³.
    nodes: [u32; 3],
}

/// Part of a file.
struct Segment {
    entries: Vec<Entry>,
    /// Its end in the file; `None` if the sizes are wrong.
    end: Option<u64>,
}

/// Bytes of the first grid with a name. Of the rest of the file, only headers are read.
pub(super) fn grid_bytes(reader: &mut (impl Read + Seek), size: u64, name: &str) -> Result<Vec<u8>, NanoError> {
    let entry = find(reader, size, name)?;
    read_entry(reader, &entry, size)
}

/// Size of the first grid with a name, as in its header.
pub(super) fn grid_size(reader: &mut (impl Read + Seek), size: u64, name: &str) -> Result<NanoSize, NanoError> {
    let entry = find(reader, size, name)?;
    entry.check(size)?;
    let [leaves, small, large] = entry.nodes.map(u64::from);
    // Damaged numbers are limited by the smallest nodes
    let most = |count: u64, bytes: u64| count.min(entry.size / bytes);
    Ok(NanoSize { bytes: entry.size, leaves: most(leaves, 160), nodes: [most(small, 1 << 15), most(large, 1 << 18)] })
}

/// The first grid with a name.
fn find(reader: &mut (impl Read + Seek), size: u64, name: &str) -> Result<Entry, NanoError> {
    let mut found = Vec::new();
    let mut at = 0;
    while at < size {
        let mut magic = [0; 8];
        reader.seek(SeekFrom::Start(at))?;
        reader.read_exact(&mut magic).map_err(|_| foreign(at, &[]))?;
        let Segment { entries, end } = match &magic {
            MAGIC_GRID => raw_grid(reader, at)?,
            MAGIC_EITHER | MAGIC_FILE => segment(reader, at)?,
            other => return Err(foreign(at, other)),
        };
        for entry in entries {
            if entry.name == name {
                return Ok(entry);
            }
            found.push(entry.name);
        }
        at = end.filter(|&end| end > at).ok_or_else(|| NanoError::damaged("its list of grids has wrong sizes"))?;
    }
    Err(NanoError::no_grid(name, found))
}

/// An error about a file with `magic` at the position of a segment.
fn foreign(at: u64, magic: &[u8]) -> NanoError {
    if at > 0 {
        return NanoError::damaged(format!("there is no segment at byte {at}"));
    }
    let reversed: Vec<u8> = magic.iter().rev().copied().collect();
    match magic {
        [0x20, b'B', b'D', b'V', ..] => NanoError::Format(", but an OpenVDB file: convert it with nanovdb_convert"),
        _ if reversed.starts_with(b"NanoVDB") => {
            NanoError::Format(" of this kind of machine: its numbers have their high bytes first")
        }
        _ => NanoError::Format(": it does not begin with `NanoVDB`"),
    }
}

fn check_version(version: u32) -> Result<(), NanoError> {
    let (major, minor) = (version >> 21, version >> 10 & 0x7ff);
    if major == MAJOR { Ok(()) } else { Err(NanoError::Version { major, minor }) }
}

/// A grid without a list, after its magic number.
fn raw_grid(reader: &mut impl Read, at: u64) -> Result<Segment, NanoError> {
    // Its magic number has been read
    let mut head = [0; GRID + TREE];
    reader.read_exact(&mut head[8..])?;
    let head = Bytes(&head);
    check_version(head.u32(16)?)?;
    let size = head.u64(32)?;
    let (name, ty) = (head.text(40, 256)?, head.u32(636)?);
    let nodes = counts(head, GRID as u64 + 32)?;
    let entry = Entry { name, start: at, stored: size, size, ty, codec: Codec::None, nodes };
    Ok(Segment { entries: vec![entry], end: at.checked_add(size) })
}

/// A segment, after its magic number.
fn segment(reader: &mut impl Read, at: u64) -> Result<Segment, NanoError> {
    let mut head = [0; SEGMENT];
    reader.read_exact(&mut head[8..])?;
    let head = Bytes(&head);
    check_version(head.u32(8)?)?;
    let codec = match head.u16(14)? {
        0 => Codec::None,
        1 => Codec::Zip,
        2 => Codec::Blosc,
        other => return Err(NanoError::Codec(format!("codec {other}"))),
    };
    let mut entries = Vec::new();
    let mut start = at + SEGMENT as u64;
    for _ in 0..head.u16(12)? {
        let mut bytes = [0; ENTRY];
        reader.read_exact(&mut bytes)?;
        let bytes = Bytes(&bytes);
        let length = bytes.u32(136)?;
        if length > MAX_NAME {
            return Err(NanoError::damaged(format!("the name of a grid has {length} bytes")));
        }
        let mut name = vec![0; length as usize];
        reader.read_exact(&mut name)?;
        let name = Bytes(&name).text(0, length as usize)?;
        start += ENTRY as u64 + u64::from(length);
        let (stored, size, ty, nodes) = (bytes.u64(8)?, bytes.u64(0)?, bytes.u32(32)?, counts(bytes, 140)?);
        entries.push(Entry { name, start: 0, stored, size, ty, codec, nodes });
    }
    let mut end = Some(start);
    for entry in &mut entries {
        entry.start = end.ok_or_else(|| NanoError::damaged("its list of grids has wrong sizes"))?;
        end = entry.start.checked_add(entry.stored);
    }
    Ok(Segment { entries, end })
}

/// Three numbers from an offset on.
fn counts(bytes: Bytes<'_>, at: u64) -> Result<[u32; 3], NanoError> {
    Ok([bytes.u32(at)?, bytes.u32(at + 4)?, bytes.u32(at + 8)?])
}

impl Entry {
    /// `Err` unless the type is supported and the sizes are possible in a file of `file` bytes.
    fn check(&self, file: u64) -> Result<(), NanoError> {
        if ValueType::from_code(self.ty).is_none() {
            let ty = TYPES.get(self.ty as usize).map_or_else(|| format!("{}", self.ty), |name| (*name).to_owned());
            return Err(NanoError::Values { name: self.name.clone(), ty });
        }
        let available = file.saturating_sub(self.start).min(self.stored);
        let most = match self.codec {
            Codec::None => available,
            Codec::Zip => available.saturating_mul(MAX_DEFLATE),
            Codec::Blosc => available.saturating_mul(MAX_LZ4),
        };
        if self.size > most || self.size < GRID as u64 || available < self.stored {
            let message = format!("its grid `{}` of {} bytes does not fit into the file", self.name, self.size);
            return Err(NanoError::damaged(message));
        }
        Ok(())
    }
}

/// The bytes of a grid, decompressed.
fn read_entry(reader: &mut (impl Read + Seek), entry: &Entry, file: u64) -> Result<Vec<u8>, NanoError> {
    entry.check(file)?;
    reader.seek(SeekFrom::Start(entry.start))?;
    let mut stored = reader.take(entry.stored);
    match entry.codec {
        Codec::None => {
            let mut bytes = Vec::with_capacity(entry.size as usize);
            stored.take(entry.size).read_to_end(&mut bytes)?;
            whole(bytes, entry)
        }
        Codec::Zip => {
            // Skip the compressed size
            stored.read_exact(&mut [0; 8])?;
            let mut bytes = Vec::new();
            let inflated = ZlibDecoder::new(stored).take(entry.size).read_to_end(&mut bytes);
            inflated.map_err(|error| NanoError::damaged(format!("its zip data: {error}")))?;
            whole(bytes, entry)
        }
        Codec::Blosc => blosc::read_chunks(&mut stored, entry.size).and_then(|bytes| whole(bytes, entry)),
    }
}

fn whole(bytes: Vec<u8>, entry: &Entry) -> Result<Vec<u8>, NanoError> {
    let (has, wanted) = (bytes.len() as u64, entry.size);
    if has != wanted {
        return Err(NanoError::damaged(format!("its grid `{}` has {has} bytes, and not {wanted}", entry.name)));
    }
    Ok(bytes)
}
