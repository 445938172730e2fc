//! Files of sums: eight bytes and a version, then chunks. A chunk is a letter, the number of its bytes, these bytes, and
//! the CRC-32 of all that. `H` is the header as text, `T` holds tiles, and `E`, which is last, says how many chunks of
//! tiles there are. All numbers are little-endian.

use super::error::PartError;
use super::header::FilmHeader;
use super::stored_tile::{self, StoredTile};
use crate::film::encoding::{Decoder, Encoder};
use crate::render::tiles::{Tile, Tiles};
use lumiris_formats::output::sync_and_rename;
use rayon::prelude::*;
use std::fs::File;
use std::io::{self, BufReader, Read, Write};
use std::path::{Path, PathBuf};

/// What files begin with.
const MAGIC: &[u8; 8] = b"LUMIFILM";
/// Version of the format.
const VERSION: u32 = 2;
/// Letters of chunks.
const HEADER: u8 = b'H';
const TILES: u8 = b'T';
const END: u8 = b'E';
/// Pixels of a chunk of tiles, about.
const CHUNK_PIXELS: usize = 1 << 14;
/// Chunks that are made at the same time, which limits the memory that they take.
const CHUNKS_AT_ONCE: usize = 16;

/// Writes a file of sums under a name beside `path`, which is then renamed: `path` is never half of a file.
pub fn write_film(path: &Path, header: &FilmHeader, tiles: &Tiles) -> Result<(), PartError> {
    let partial = partial_path(path);
    let written = write_tiles(&partial, header, &tiles.0).and_then(|()| sync_and_rename(&partial, path));
    written.map_err(|error| {
        let _ = std::fs::remove_file(&partial);
        PartError::io(path, error)
    })
}

/// The name under which a file is written.
pub(super) fn partial_path(path: &Path) -> PathBuf {
    let mut name = path.as_os_str().to_owned();
    name.push(".tmp");
    PathBuf::from(name)
}

/// Writes a file of sums.
pub(super) fn write_tiles(path: &Path, header: &FilmHeader, tiles: &[Tile]) -> io::Result<()> {
    let mut file = File::create(path)?;
    file.write_all(MAGIC)?;
    file.write_all(&VERSION.to_le_bytes())?;
    write_chunk(&mut file, HEADER, header.text().as_bytes())?;

    let per_chunk = (CHUNK_PIXELS / tiles.first().map_or(1, |t| t.bounds.area()).max(1)).max(1);
    let chunks: Vec<&[Tile]> = tiles.chunks(per_chunk).collect();
    for chunks in chunks.chunks(CHUNKS_AT_ONCE) {
        let encoded: Vec<Vec<u8>> = chunks.par_iter().map(|tiles| chunk_of(tiles)).collect();
        encoded.iter().try_for_each(|bytes| write_chunk(&mut file, TILES, bytes))?;
    }
    write_chunk(&mut file, END, &(chunks.len() as u64).to_le_bytes())?;
    file.flush()
}

fn chunk_of(tiles: &[Tile]) -> Vec<u8> {
    let mut encoder = Encoder::default();
    encoder.word(tiles.len() as u32);
    tiles.iter().for_each(|tile| stored_tile::write(tile, &mut encoder));
    encoder.bytes
}

fn write_chunk(file: &mut File, letter: u8, bytes: &[u8]) -> io::Result<()> {
    let head = chunk_head(letter, bytes.len() as u64);
    file.write_all(&head)?;
    file.write_all(bytes)?;
    file.write_all(&checksum(&head, bytes).to_le_bytes())
}

fn chunk_head(letter: u8, len: u64) -> [u8; 9] {
    let mut head = [letter; 9];
    head[1..].copy_from_slice(&len.to_le_bytes());
    head
}

fn checksum(head: &[u8], bytes: &[u8]) -> u32 {
    let mut hasher = crc32fast::Hasher::new();
    hasher.update(head);
    hasher.update(bytes);
    hasher.finalize()
}

/// Reads a file of sums, some tiles at a time.
#[derive(Debug)]
pub struct FilmReader {
    path: PathBuf,
    file: BufReader<File>,
    /// Bytes that are not read yet.
    left: u64,
    header: FilmHeader,
    chunks: u64,
}

impl FilmReader {
    /// Opens a file and reads its header.
    pub fn open(path: &Path) -> Result<Self, PartError> {
        let file = File::open(path).map_err(|error| PartError::io(path, error))?;
        let metadata = file.metadata().map_err(|error| PartError::io(path, error))?;
        if metadata.is_dir() {
            return Err(PartError::foreign(path, "is a folder"));
        }
        let mut file = BufReader::with_capacity(1 << 20, file);
        let mut start = [0; 12];
        match file.read_exact(&mut start) {
            Ok(()) if start[..8] == *MAGIC => {}
            Err(error) if error.kind() != io::ErrorKind::UnexpectedEof => return Err(PartError::io(path, error)),
            _ => return Err(PartError::foreign(path, "is neither a part of an image nor a checkpoint")),
        }
        let version = u32::from_le_bytes([start[8], start[9], start[10], start[11]]);
        if version != VERSION {
            let reason = format!("is of version {version} of the format; this program reads version {VERSION}");
            return Err(PartError::foreign(path, &reason));
        }
        let left = metadata.len().saturating_sub(start.len() as u64);
        let (letter, bytes) = read_chunk(&mut file, left).map_err(|e| e.at(path))?;
        let header = std::str::from_utf8(&bytes).ok().filter(|_| letter == HEADER).and_then(FilmHeader::parse);
        let header = header.ok_or_else(|| PartError::damaged(path, "its header means nothing"))?;
        let left = left - (bytes.len() as u64 + CHUNK_OVERHEAD);
        Ok(FilmReader { path: path.to_owned(), file, left, header, chunks: 0 })
    }

    /// The header.
    pub fn header(&self) -> &FilmHeader {
        &self.header
    }

    /// The file.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// The next tiles; `None` at the end of the file.
    pub fn tiles(&mut self) -> Result<Option<Vec<StoredTile>>, PartError> {
        let damaged = |reason| PartError::damaged(&self.path, reason);
        let (letter, bytes) = read_chunk(&mut self.file, self.left).map_err(|e| e.at(&self.path))?;
        self.left -= bytes.len() as u64 + CHUNK_OVERHEAD;
        match letter {
            TILES => {
                self.chunks += 1;
                let mut decoder = Decoder::new(&bytes);
                let count = decoder.word().ok_or_else(|| damaged("there are no tiles where some should be"))?;
                let tiles = (0..count).map(|_| StoredTile::read(&mut decoder, &self.header.bounds));
                let tiles = tiles.collect::<Option<Vec<_>>>().filter(|_| decoder.is_at_end());
                tiles.map(Some).ok_or_else(|| damaged("its tiles mean nothing"))
            }
            END if bytes == self.chunks.to_le_bytes() && self.left == 0 => Ok(None),
            END => Err(damaged("there is more or less than its end says")),
            _ => Err(damaged("it holds something unknown")),
        }
    }

    /// All tiles.
    pub fn all_tiles(mut self) -> Result<Vec<StoredTile>, PartError> {
        let mut all = Vec::new();
        while let Some(tiles) = self.tiles()? {
            all.extend(tiles);
        }
        let covered: usize = all.iter().map(|t| t.bounds.area()).sum();
        if covered != pixels_of(&self.header) {
            return Err(PartError::damaged(&self.path, "it does not have the pixels that its header says"));
        }
        Ok(all)
    }
}

/// Number of pixels that a file has.
pub(super) fn pixels_of(header: &FilmHeader) -> usize {
    match header.share {
        Some(share) => share.tiles(&header.bounds).map(|tile| tile.area()).sum(),
        None => header.bounds.area(),
    }
}

/// Bytes of a chunk besides its own.
const CHUNK_OVERHEAD: u64 = 13;

/// Why a chunk cannot be read.
enum ChunkError {
    Io(io::Error),
    Damaged(&'static str),
}

impl ChunkError {
    fn at(self, path: &Path) -> PartError {
        match self {
            ChunkError::Io(error) => PartError::io(path, error),
            ChunkError::Damaged(reason) => PartError::damaged(path, reason),
        }
    }
}

/// Reads a chunk of a file that has `left` more bytes.
fn read_chunk(file: &mut impl Read, left: u64) -> Result<(u8, Vec<u8>), ChunkError> {
    const CUT: ChunkError = ChunkError::Damaged("it is cut off");
    if left < CHUNK_OVERHEAD {
        return Err(CUT);
    }
    let mut head = [0; 9];
    let mut read = |bytes: &mut [u8]| match file.read_exact(bytes) {
        Err(error) if error.kind() == io::ErrorKind::UnexpectedEof => Err(CUT),
        other => other.map_err(ChunkError::Io),
    };
    read(&mut head)?;
    let len = u64::from_le_bytes(std::array::from_fn(|i| head[1 + i]));
    if len > left - CHUNK_OVERHEAD {
        return Err(CUT);
    }
    let mut bytes = vec![0; len as usize];
    let mut stored = [0; 4];
    read(&mut bytes)?;
    read(&mut stored)?;
    if u32::from_le_bytes(stored) != checksum(&head, &bytes) {
        return Err(ChunkError::Damaged("a checksum is wrong"));
    }
    Ok((head[0], bytes))
}
