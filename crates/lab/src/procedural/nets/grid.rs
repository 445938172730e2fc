//! A grid of cubic cells, in blocks.

use super::field::Ball;
use lumiris_numbers::math::Vec3;

/// Cells of a block along an axis.
pub(super) const BLOCK: usize = 16;

/// A grid of cubic cells.
#[derive(Clone, Copy, Debug)]
pub struct Grid {
    origin: Vec3,
    pub(super) cell: f32,
    blocks: [usize; 3],
}

impl Grid {
    /// Cells of edge `cell` that cover the box from `low` to `high`.
    pub fn new(low: Vec3, high: Vec3, cell: f32) -> Self {
        let count = |extent: f32| ((extent / cell).ceil() as usize).div_ceil(BLOCK).max(1);
        let extent = high - low;
        Grid { origin: low, cell, blocks: [count(extent.x), count(extent.y), count(extent.z)] }
    }

    pub(super) fn block_count(&self) -> usize {
        self.blocks.iter().product()
    }

    /// The first cell of a block.
    pub(super) fn first_cell(&self, block: usize) -> [usize; 3] {
        let [nx, ny, _] = self.blocks;
        [block % nx * BLOCK, block / nx % ny * BLOCK, block / (nx * ny) * BLOCK]
    }

    pub(super) fn block_of(&self, cell: [usize; 3]) -> usize {
        let [x, y, z] = cell.map(|c| c / BLOCK);
        (z * self.blocks[1] + y) * self.blocks[0] + x
    }

    pub(super) fn corner(&self, [x, y, z]: [usize; 3]) -> Vec3 {
        self.origin + self.cell * Vec3::new(x as f32, y as f32, z as f32)
    }

    pub(super) fn ball(&self, first: [usize; 3], cells: usize) -> Ball {
        let half = 0.5 * cells as f32 * self.cell;
        Ball { center: self.corner(first) + half, radius: half * 1.7321 }
    }
}
