//! Files of film sums.
//!
//! A file has eight magic bytes and a version, then chunks. A chunk is a letter, its number of bytes, these bytes, and
//! the CRC-32 of all of that. `H` is the header as text, `T` holds tiles, `C` the progress of cells where pixels share
//! paths. `E` is last and holds the number of tile chunks. All numbers are little-endian.

use super::error::PartError;
use super::header::FilmHeader;
use super::partial::Partial;
use super::stored_tile::{self, StoredTile};
use crate::film::PixelBounds;
use crate::film::encoding::{Decoder, Encoder};
use crate::render::cell_progress::CellProgress;
use crate::render::tile_share::SHARE_TILE;
use crate::render::tiles::{Tile, Tiles};
use rayon::prelude::*;
use std::fs::File;
use std::io::{self, BufReader, Read, Write};
use std::path::{Path, PathBuf};

/// Magic bytes.
const MAGIC: &[u8; 8] = b"LUMIFILM";
/// Version of the format.
const VERSION: u32 = 5;
/// Letters of the chunks.
const HEADER: u8 = b'H';
const TILES: u8 = b'T';
const CELLS: u8 = b'C';
const END: u8 = b'E';
/// Approximate number of pixels in a chunk of tiles.
const CHUNK_PIXELS: usize = 1 << 14;
/// Chunks that are encoded at the same time, which limits the memory.
const CHUNKS_AT_ONCE: usize = 16;

/// Writes a file of sums. It has a temporary name until it is complete, so that `path` is never a partial file.
pub fn write_film(path: &Path, header: &FilmHeader, tiles: &Tiles) -> Result<(), PartError> {
    let written = Partial::write(path, |file| write_tiles(file, header, tiles)).and_then(Partial::end);
    written.map_err(|error| PartError::io(path, error))
}

/// Writes a file of sums.
pub(super) fn write_tiles(file: &mut File, header: &FilmHeader, tiles: &Tiles) -> io::Result<()> {
    let Tiles { tiles, cells } = tiles;
    // Header
    file.write_all(MAGIC)?;
    file.write_all(&VERSION.to_le_bytes())?;
    write_chunk(file, HEADER, header.text().as_bytes())?;

    let per_chunk = (CHUNK_PIXELS / tiles.first().map_or(1, |t| t.bounds.area()).max(1)).max(1);
    let chunks: Vec<&[Tile]> = tiles.chunks(per_chunk).collect();
    for chunks in chunks.chunks(CHUNKS_AT_ONCE) {
        let encoded: Vec<Vec<u8>> = chunks.par_iter().map(|tiles| chunk_of(tiles)).collect();
        encoded.iter().try_for_each(|bytes| write_chunk(file, TILES, bytes))?;
    }

    // Progress of cells, and the end
    if !cells.is_empty() {
        let mut encoder = Encoder::default();
        cells.write(&mut encoder);
        write_chunk(file, CELLS, &encoder.bytes)?;
    }
    write_chunk(file, END, &(chunks.len() as u64).to_le_bytes())?;
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

/// Reads a file of sums, a chunk of tiles at a time.
#[derive(Debug)]
pub struct FilmReader {
    path: PathBuf,
    file: BufReader<File>,
    /// Bytes that were not read yet.
    left: u64,
    header: FilmHeader,
    chunks: u64,
    /// Progress of cells, if it is stored.
    cells: CellProgress,
    /// Pixels read so far.
    pixels: PixelSet,
}

impl FilmReader {
    /// Opens a file and reads its header.
    pub fn open(path: &Path) -> Result<Self, PartError> {
        // Open the file
        let file = File::open(path).map_err(|error| PartError::io(path, error))?;
        let metadata = file.metadata().map_err(|error| PartError::io(path, error))?;
        if metadata.is_dir() {
            return Err(PartError::foreign(path, "is a folder"));
        }

        // Check magic bytes and version
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

        // Read the header
        let left = metadata.len().saturating_sub(start.len() as u64);
        let Chunk { letter, bytes } = read_chunk(&mut file, left).map_err(|e| e.at(path))?;
        let header = std::str::from_utf8(&bytes).ok().filter(|_| letter == HEADER).and_then(FilmHeader::parse);
        let header = header.ok_or_else(|| PartError::damaged(path, "its header means nothing"))?;
        let left = left - (bytes.len() as u64 + CHUNK_OVERHEAD);
        let (cells, pixels) = Default::default();
        Ok(FilmReader { path: path.to_owned(), file, left, header, chunks: 0, cells, pixels })
    }

    /// The header.
    pub fn header(&self) -> &FilmHeader {
        &self.header
    }

    /// The file.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// The next tiles; `None` at the end of the file. All tiles together have each pixel of the header's extent once.
    pub fn tiles(&mut self) -> Result<Option<Vec<StoredTile>>, PartError> {
        // Read a chunk
        let damaged = |reason| PartError::damaged(&self.path, reason);
        let Chunk { letter, bytes } = read_chunk(&mut self.file, self.left).map_err(|e| e.at(&self.path))?;
        self.left -= bytes.len() as u64 + CHUNK_OVERHEAD;

        // Decode and check it
        match letter {
            TILES => {
                self.chunks += 1;
                let mut decoder = Decoder::new(&bytes);
                let count = decoder.word().ok_or_else(|| damaged("there are no tiles where some should be"))?;
                let tiles = (0..count).map(|_| StoredTile::read(&mut decoder, &self.header));
                let tiles = tiles.collect::<Option<Vec<_>>>().filter(|_| decoder.is_at_end());
                let tiles = tiles.ok_or_else(|| damaged("its tiles mean nothing"))?;
                if !tiles.iter().all(|tile| self.pixels.insert(&tile.bounds, &self.header)) {
                    return Err(damaged("it has a pixel twice, or one that is of another part"));
                }
                Ok(Some(tiles))
            }
            CELLS => {
                let cells = CellProgress::read(&mut Decoder::new(&bytes));
                self.cells = cells.ok_or_else(|| damaged("its cells mean nothing"))?;
                Ok(Some(Vec::new()))
            }
            END if bytes == self.chunks.to_le_bytes() && self.left == 0 => {
                let is_whole = self.pixels.count == pixels_of(&self.header);
                is_whole.then_some(None).ok_or_else(|| damaged("it does not have the pixels that its header says"))
            }
            END => Err(damaged("there is more or less than its end says")),
            _ => Err(damaged("it holds something unknown")),
        }
    }

    /// Progress of cells; valid after all tiles were read.
    pub fn cells(self) -> CellProgress {
        self.cells
    }

    /// All tiles.
    pub fn all_tiles(&mut self) -> Result<Vec<StoredTile>, PartError> {
        let mut all = Vec::new();
        while let Some(tiles) = self.tiles()? {
            all.extend(tiles);
        }
        Ok(all)
    }
}

/// Set of pixels of an image, one bit each.
#[derive(Debug, Default)]
struct PixelSet {
    words: Vec<u64>,
    count: usize,
}

impl PixelSet {
    /// Inserts the pixels of a tile inside the image. Returns false if a pixel is in the set already or belongs to
    /// another part.
    fn insert(&mut self, tile: &PixelBounds, header: &FilmHeader) -> bool {
        let image = &header.bounds;
        self.words.resize(image.area().div_ceil(64), 0);
        self.count += tile.area();
        let columns = image.width().div_ceil(SHARE_TILE) as usize;
        let cell = |v: u32, origin: u32| ((v - origin) / SHARE_TILE) as usize;
        let mut is_new = |x: u32, y: u32| {
            let at = image.index_of([x, y]);
            let (word, bit) = (&mut self.words[at / 64], 1 << (at % 64));
            let is_ours = header.share.is_none_or(|share| share.has(cell(y, image.y0) * columns + cell(x, image.x0)));
            let is_new = *word & bit == 0;
            *word |= bit;
            is_ours && is_new
        };
        (tile.y0..tile.y1).all(|y| (tile.x0..tile.x1).all(|x| is_new(x, y)))
    }
}

/// Number of pixels in the extent of a file.
fn pixels_of(header: &FilmHeader) -> usize {
    match header.share {
        Some(share) => share.tiles(&header.bounds).map(|tile| tile.area()).sum(),
        None => header.bounds.area(),
    }
}

/// Bytes of a chunk in addition to its content.
const CHUNK_OVERHEAD: u64 = 13;

/// Reason why a chunk cannot be read.
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

/// A chunk of a file.
struct Chunk {
    /// Kind of the content.
    letter: u8,
    bytes: Vec<u8>,
}

/// Reads a chunk of a file with `left` remaining bytes.
fn read_chunk(file: &mut impl Read, left: u64) -> Result<Chunk, ChunkError> {
    const CUT: ChunkError = ChunkError::Damaged("it is cut off");
    if left < CHUNK_OVERHEAD {
        return Err(CUT);
    }

    // Letter and length. The length is checked before memory is allocated
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

    // Content and checksum
    let mut bytes = vec![0; len as usize];
    let mut stored = [0; 4];
    read(&mut bytes)?;
    read(&mut stored)?;
    if u32::from_le_bytes(stored) != checksum(&head, &bytes) {
        return Err(ChunkError::Damaged("a checksum is wrong"));
    }
    Ok(Chunk { letter: head[0], bytes })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::direct::Fits;
    use crate::film::packed::PackedSums;
    use crate::render::TileShare;
    use std::sync::Arc;

    const IMAGE: PixelBounds = PixelBounds { x0: 3, x1: 43, y0: 1, y1: 21 };

    fn header(share: Option<TileShare>) -> FilmHeader {
        FilmHeader {
            resolution: [64, 48],
            bounds: IMAGE,
            samples: 4..8,
            spp: 32,
            share,
            is_finished: true,
            replicas: None,
            controls: 0,
            light_layers: Vec::new(),
            fingerprint: 0,
            settings: Vec::new(),
            notes: Vec::new(),
        }
    }

    fn tile(bounds: PixelBounds, done: u32) -> Tile {
        let sums = Arc::new(PackedSums::new(bounds.area()));
        Tile { bounds, done, sums, layers: Arc::default(), replicas: Vec::new(), fits: Fits::default() }
    }

    /// The error of a file with these tiles, whose checksums are correct.
    fn fault(share: Option<TileShare>, tiles: Vec<Tile>) -> Option<String> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.part");
        let tiles = Tiles { tiles, cells: CellProgress::default() };
        write_tiles(&mut File::create(&path).unwrap(), &header(share), &tiles).unwrap();
        FilmReader::open(&path).unwrap().all_tiles().err().map(|error| error.to_string())
    }

    #[test]
    fn tiles_that_are_not_those_of_the_header_are_damage() {
        let whole = || -> Vec<Tile> { IMAGE.tiles(7).into_iter().map(|bounds| tile(bounds, 8)).collect() };
        assert_eq!(fault(None, whole()), None);
        assert!(fault(None, whole().split_off(1)).unwrap().contains("does not have the pixels"));
        let mut tiles = whole();
        tiles[1] = tile(tiles[0].bounds, 8);
        assert!(fault(None, tiles).unwrap().contains("a pixel twice"));
        for (k, wrong) in [
            tile(PixelBounds { x1: 44, ..IMAGE }, 8),
            tile(PixelBounds { x0: 43, x1: 3, ..IMAGE }, 8),
            tile(IMAGE, 3),
            tile(IMAGE, 9),
        ]
        .into_iter()
        .enumerate()
        {
            assert!(fault(None, vec![wrong]).unwrap().contains("its tiles mean nothing"), "{k}");
        }

        let share = TileShare { index: 1, count: 3 };
        let ours = || -> Vec<Tile> { share.tiles(&IMAGE).map(|bounds| tile(bounds, 4)).collect() };
        assert_eq!(fault(Some(share), ours()), None);
        let mut tiles = ours();
        tiles[0].bounds = IMAGE.tiles(SHARE_TILE)[0];
        assert!(fault(Some(share), tiles).unwrap().contains("of another part"));
        // With more parts than tiles, some parts have no tile
        assert_eq!(fault(Some(TileShare { index: 6, count: 7 }), Vec::new()), None);
    }
}
