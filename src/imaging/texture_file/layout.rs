//! Positions in a texture file, and its header.
//!
//! | from | content |
//! |---|---|
//! | 0 | header of BigTIFF |
//! | 16 | header of our own, with its checksum |
//! | [`DIRECTORIES`] | directories of BigTIFF, the full image first |
//! | [`Layout::tiles_begin`] | tiles of all levels, the full image first, row-major; each is followed by its CRC-32 |
//!
//! All numbers are little-endian.

use crate::imaging::tiles::TILE;

/// Length of the header of BigTIFF.
const TIFF_HEADER: usize = 16;
/// Begins our own header; the digit is the version of the layout.
const MAGIC: [u8; 8] = *b"lumiris1";
/// Length of our own header: magic, five numbers, position of the tiles, byte table, checksum.
const HEADER: usize = 8 + 4 * 4 + 8 + 4 * 256 + 4;
/// Position of the directories.
pub(super) const DIRECTORIES: u64 = (TIFF_HEADER + HEADER).next_multiple_of(8) as u64;
/// Bytes of a checksum.
pub(super) const CHECKSUM: usize = 4;

/// Sizes of a texture file.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Layout {
    /// Columns and rows of each level, the full image first.
    pub(super) sizes: Vec<[usize; 2]>,
    pub(super) channels: usize,
    /// Bytes per channel: 1 for the byte table, 4 for floats.
    pub(super) channel_bytes: usize,
    /// Position of the first tile.
    pub(super) tiles_begin: u64,
}

/// The first bytes of a BigTIFF file whose first directory is at [`DIRECTORIES`].
fn tiff_header() -> [u8; TIFF_HEADER] {
    let mut header = *b"II\x2b\0\x08\0\0\0        ";
    header[8..].copy_from_slice(&DIRECTORIES.to_le_bytes());
    header
}

/// Columns and rows of all levels of an image, down to one pixel.
fn level_sizes(size: [usize; 2]) -> Vec<[usize; 2]> {
    let next = |size: &[usize; 2]| (*size != [1, 1]).then(|| size.map(|n| (n / 2).max(1)));
    std::iter::successors(Some(size), next).collect()
}

impl Layout {
    /// The layout of an image of one pixel or more.
    pub(super) fn new(size: [usize; 2], channels: usize, channel_bytes: usize) -> Self {
        Layout { sizes: level_sizes(size), channels, channel_bytes, tiles_begin: 0 }
    }

    /// Columns and rows of tiles of a level.
    pub(super) fn grid(&self, level: usize) -> [usize; 2] {
        self.sizes[level].map(|n| n.div_ceil(TILE))
    }

    /// Tiles of all finer levels than `level`.
    pub(super) fn tiles_before(&self, level: usize) -> usize {
        (0..level).map(|level| self.grid(level).iter().product::<usize>()).sum()
    }

    /// Bytes of a tile without its checksum.
    pub(super) fn tile_bytes(&self) -> usize {
        TILE * TILE * self.channels * self.channel_bytes
    }

    /// Position of a tile.
    pub(super) fn tile_at(&self, index: usize) -> u64 {
        self.tiles_begin + index as u64 * (self.tile_bytes() + CHECKSUM) as u64
    }

    /// Length of the file.
    pub(super) fn len(&self) -> u64 {
        self.tile_at(self.tiles_before(self.sizes.len()))
    }

    /// Everything in front of the directories. `table` has the linear values of bytes.
    pub(super) fn header(&self, table: &[f32; 256]) -> Vec<u8> {
        let [width, height] = self.sizes[0];
        let mut header = tiff_header().to_vec();
        header.extend(MAGIC);
        let numbers = [width, height, self.channels, self.channel_bytes];
        header.extend(numbers.iter().flat_map(|&n| (n as u32).to_le_bytes()));
        header.extend(self.tiles_begin.to_le_bytes());
        header.extend(table.iter().flat_map(|v| v.to_le_bytes()));
        header.extend(crc32fast::hash(&header[TIFF_HEADER..]).to_le_bytes());
        header.resize(DIRECTORIES as usize, 0);
        header
    }

    /// The layout and byte table of a header. `None` if it is damaged or of another version.
    pub(super) fn parse(header: &[u8; DIRECTORIES as usize]) -> Option<(Self, Box<[f32; 256]>)> {
        let (tiff, own) = header[..TIFF_HEADER + HEADER].split_at(TIFF_HEADER);
        let (content, checksum) = own.split_at(HEADER - CHECKSUM);
        let (magic, numbers) = content.split_at(MAGIC.len());
        if tiff != tiff_header() || magic != MAGIC || crc32fast::hash(content).to_le_bytes() != checksum {
            return None;
        }
        let (numbers, table) = numbers.split_at(4 * 4 + 8);
        let word = |i: usize| numbers[4 * i..].first_chunk().map_or(0, |word| u32::from_le_bytes(*word));
        let [width, height, channels, channel_bytes] = [0, 1, 2, 3].map(|i| word(i) as usize);
        let tiles_begin = u64::from(word(4)) | u64::from(word(5)) << 32;
        let values = table.as_chunks().0.iter().map(|word| f32::from_le_bytes(*word)).collect::<Box<[f32]>>();
        let layout = Layout { tiles_begin, ..Layout::new([width, height], channels, channel_bytes) };
        Some((layout, values.try_into().ok()?))
    }
}
