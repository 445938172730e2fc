//! The assignment of pixels to the parts of an image.

use crate::film::PixelBounds;

/// Edge of the tiles that are dealt to parts (pixels).
pub(super) const SHARE_TILE: u32 = 16;

/// The pixels of one of several parts. Tiles are dealt round-robin, row by row, so that every part gets some of all
/// regions.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TileShare {
    /// Index of the part, from 0.
    pub index: u32,
    /// Number of parts.
    pub count: u32,
}

impl TileShare {
    /// True if the part has the tile with this index.
    pub fn has(&self, tile: usize) -> bool {
        tile % self.count.max(1) as usize == self.index as usize
    }

    /// The tiles of the part.
    pub fn tiles(&self, image: &PixelBounds) -> impl Iterator<Item = PixelBounds> + use<> {
        let share = *self;
        image.tiles(SHARE_TILE).into_iter().enumerate().filter(move |(i, _)| share.has(*i)).map(|(_, tile)| tile)
    }
}
