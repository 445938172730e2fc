//! Blue noise of blocks of pixels.

use openqmc::bntables::{self, table_value};

/// Edge of the blocks of blue noise (pixels): small relative to the table of openqmc (256 pixels), so that blocks use
/// different parts of it.
pub(super) const BLOCK: u32 = 16;

/// Entry of the table of blue noise.
#[derive(Clone, Copy, Debug)]
pub struct BlueNoise {
    /// Seed of the sequence.
    pub seed: u32,
    /// Combined with the index of a point by exclusive or.
    pub rank: u32,
}

impl BlueNoise {
    /// The entry of a pixel of a block; x of the pixel is in the lowest byte of `pixel`, y above it. Neighbouring
    /// pixels of a block have errors of opposite signs: they have neighbouring entries, with an offset and a reflection
    /// by the first word of the key, and the block has a single scramble.
    #[inline]
    pub fn of(key: u32, pixel: u32) -> Self {
        let [mut x, mut y] = [pixel as u8, (pixel >> 8) as u8].map(u16::from);
        if key >> 16 & 1 != 0 {
            (x, y) = (y, x);
        }
        if key >> 17 & 1 != 0 {
            x = BLOCK as u16 - 1 - x;
        }
        if key >> 18 & 1 != 0 {
            y = BLOCK as u16 - 1 - y;
        }
        let (keys, ranks) = (bntables::sobol::key_table(), bntables::sobol::rank_table());
        let entry = table_value::<8, 8, 0>(y << 8 | x, key as u16, keys, ranks);
        BlueNoise { seed: entry.key, rank: entry.rank }
    }
}
