//! Numbers and compressed blocks.

use super::error::PtexError;
use flate2::read::ZlibDecoder;
use half::f16;
use std::io::Read;

/// Maximum expansion factor of deflate.
const MOST_RATIO: usize = 1032;

/// Bytes that are read sequentially.
pub(super) struct Blocks<'a> {
    bytes: &'a [u8],
    /// Their offset in the file.
    base: usize,
    at: usize,
}

impl<'a> Blocks<'a> {
    /// Bytes at the offset `base` of the file.
    pub(super) fn new(bytes: &'a [u8], base: usize) -> Self {
        Blocks { bytes, base, at: 0 }
    }

    /// Offset in the file of the next byte.
    pub(super) fn at(&self) -> usize {
        self.base + self.at
    }

    /// The next `count` bytes; `what` names them in errors.
    pub(super) fn take(&mut self, count: usize, what: &str) -> Result<&'a [u8], PtexError> {
        let end = self.at.checked_add(count).filter(|&end| end <= self.bytes.len());
        let end = end.ok_or_else(|| {
            let left = self.bytes.len() - self.at;
            PtexError::wrong(self.at(), format!("{what} should have {count} bytes, but {left} are left"))
        })?;
        let taken = &self.bytes[self.at..end];
        self.at = end;
        Ok(taken)
    }

    pub(super) fn u16(&mut self) -> Result<u16, PtexError> {
        let b = self.take(2, "a number")?;
        Ok(u16::from_le_bytes([b[0], b[1]]))
    }

    pub(super) fn u32(&mut self) -> Result<u32, PtexError> {
        let b = self.take(4, "a number")?;
        Ok(u32::from_le_bytes([b[0], b[1], b[2], b[3]]))
    }

    /// Sizes of blocks.
    pub(super) fn sizes(&mut self) -> Result<[usize; 4], PtexError> {
        let mut sizes = [0; 4];
        for size in &mut sizes {
            *size = self.u32()? as usize;
        }
        Ok(sizes)
    }
}

/// Type of the numbers of a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum NumberType {
    U8,
    U16,
    F16,
    F32,
}

impl NumberType {
    pub(super) fn from_code(code: u32) -> Option<Self> {
        [NumberType::U8, NumberType::U16, NumberType::F16, NumberType::F32].get(code as usize).copied()
    }

    /// Size of a number (bytes).
    pub(super) fn size(self) -> usize {
        match self {
            NumberType::U8 => 1,
            NumberType::U16 | NumberType::F16 => 2,
            NumberType::F32 => 4,
        }
    }

    /// Decodes a number of [`Self::size`] bytes; integers are fractions of their maximum.
    pub(super) fn number(self, bytes: &[u8]) -> f32 {
        match (self, bytes) {
            (NumberType::U8, &[a]) => f32::from(a) / 255.0,
            (NumberType::U16, &[a, b]) => f32::from(u16::from_le_bytes([a, b])) / 65535.0,
            (NumberType::F16, &[a, b]) => f16::from_le_bytes([a, b]).to_f32(),
            (NumberType::F32, &[a, b, c, d]) => f32::from_le_bytes([a, b, c, d]),
            _ => 0.0,
        }
    }

    /// Reverses difference coding of neighbours, which is only used for integers.
    fn undo_differences(self, bytes: &mut [u8]) {
        match self {
            NumberType::U8 => {
                let mut last = 0_u8;
                for byte in bytes {
                    last = last.wrapping_add(*byte);
                    *byte = last;
                }
            }
            NumberType::U16 => {
                let mut last = 0_u16;
                for word in bytes.chunks_exact_mut(2) {
                    last = last.wrapping_add(u16::from_le_bytes([word[0], word[1]]));
                    word.copy_from_slice(&last.to_le_bytes());
                }
            }
            NumberType::F16 | NumberType::F32 => {}
        }
    }
}

/// Storage of texels.
#[derive(Clone, Copy, Debug)]
pub(super) enum Encoding {
    /// One value for all texels.
    Constant,
    Compressed,
    /// Each number minus the one before it.
    Differences,
    /// In tiles, each with its own encoding.
    Tiled,
}

/// Encoding and size (bytes) of a block.
pub(super) struct BlockHeader {
    pub(super) encoding: Encoding,
    pub(super) size: usize,
}

impl BlockHeader {
    pub(super) fn of(word: u32) -> Self {
        let encoding = match word >> 30 {
            0 => Encoding::Constant,
            1 => Encoding::Compressed,
            2 => Encoding::Differences,
            _ => Encoding::Tiled,
        };
        BlockHeader { encoding, size: (word & 0x3fff_ffff) as usize }
    }
}

/// The `expected` bytes of a compressed block at byte `at` of the file.
pub(super) fn inflate(block: &[u8], expected: Option<usize>, at: usize) -> Result<Vec<u8>, PtexError> {
    let wrong = |what: String| PtexError::wrong(at, what);
    let possible = block.len().saturating_mul(MOST_RATIO);
    let expected = expected.filter(|&expected| expected <= possible).ok_or_else(|| {
        wrong(format!("a block of {} compressed bytes is too small for what it should hold", block.len()))
    })?;
    let mut bytes = Vec::with_capacity(expected);
    ZlibDecoder::new(block)
        .take(expected as u64 + 1)
        .read_to_end(&mut bytes)
        .map_err(|error| wrong(format!("a block cannot be decompressed: {error}")))?;
    if bytes.len() != expected {
        return Err(wrong(format!("a block holds {} bytes where {expected} are expected", bytes.len())));
    }
    Ok(bytes)
}

/// Appends the texels of a face or tile of 2^`log2` texels, planar by channel.
pub(super) fn read_texels(
    block: &[u8],
    encoding: Encoding,
    log2: [u8; 2],
    (channels, ty): (usize, NumberType),
    out: &mut Vec<u8>,
    at: usize,
) -> Result<(), PtexError> {
    let [columns, rows] = log2.map(|log2| 1_usize << log2);
    let plane = columns * rows * ty.size();
    match encoding {
        Encoding::Constant => {
            let texel = Blocks::new(block, at).take(channels * ty.size(), "a texel")?;
            texel.chunks_exact(ty.size()).for_each(|number| out.extend(number.repeat(columns * rows)));
        }
        Encoding::Compressed | Encoding::Differences => {
            let mut numbers = inflate(block, plane.checked_mul(channels), at)?;
            if matches!(encoding, Encoding::Differences) {
                ty.undo_differences(&mut numbers);
            }
            out.extend(numbers);
        }
        Encoding::Tiled => {
            let ([tile_columns, tile_rows], tiles) = read_tiles(block, log2, (channels, ty), at)?;
            let (tile_plane, row_bytes) = (tile_columns * tile_rows * ty.size(), tile_columns * ty.size());
            let across = columns / tile_columns;
            for channel in 0..channels {
                for y in 0..rows {
                    for tile in &tiles[y / tile_rows * across..][..across] {
                        let start = channel * tile_plane + y % tile_rows * row_bytes;
                        out.extend_from_slice(&tile[start..start + row_bytes]);
                    }
                }
            }
        }
    }
    Ok(())
}

/// Columns and rows of a tile, and the texels of all tiles.
type Tiles = ([usize; 2], Vec<Vec<u8>>);

fn read_tiles(block: &[u8], log2: [u8; 2], numbers: (usize, NumberType), at: usize) -> Result<Tiles, PtexError> {
    let mut blocks = Blocks::new(block, at);
    let tile_log2 = blocks.take(2, "the size of tiles")?;
    let tile_log2 = [tile_log2[0], tile_log2[1]];
    if tile_log2[0] > log2[0] || tile_log2[1] > log2[1] {
        return Err(PtexError::wrong(at, "tiles are larger than their face"));
    }
    let header_size = blocks.u32()? as usize;
    let count = 1_usize << (log2[0] - tile_log2[0] + log2[1] - tile_log2[1]);
    let sizes = inflate(blocks.take(header_size, "the sizes of tiles")?, count.checked_mul(4), at)?;
    let mut tiles = Vec::with_capacity(count);
    for size in sizes.chunks_exact(4) {
        let BlockHeader { encoding, size } = BlockHeader::of(u32::from_le_bytes([size[0], size[1], size[2], size[3]]));
        if matches!(encoding, Encoding::Tiled) {
            return Err(PtexError::wrong(at, "a tile has tiles"));
        }
        let (at, mut tile) = (blocks.at(), Vec::new());
        read_texels(blocks.take(size, "a tile")?, encoding, tile_log2, numbers, &mut tile, at)?;
        tiles.push(tile);
    }
    Ok((tile_log2.map(|log2| 1 << log2), tiles))
}
