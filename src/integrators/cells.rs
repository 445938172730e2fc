//! Blocks of pixels that share paths, and cells of pixels that are rendered together. A block lies within one cell.
//!
//! To keep the pattern invisible in the image, the offset of the cells changes every [`GROUPS_PER_LAYOUT`] share groups
//! ([`PixelSamples::share_group`]), and the offset of the blocks changes with the cell and the share group. Blocks
//! have no straight edges: near an edge, a pixel belongs to either block at random.

use crate::film::PixelBounds;
use crate::scene::PixelSamples;
use lumiris_numbers::math::hash::pcg4d;

/// Edge of the cells (pixels).
pub const CELL: u32 = 32;
/// Number of consecutive share groups with the same layout of cells. The pixels of a cell are added to the film once
/// for all of them.
pub const GROUPS_PER_LAYOUT: u32 = 4;
/// Edge of the cells of replicas (pixels that are estimated twice); these cells begin at the corner of the image.
pub const REPLICA_CELL: u32 = 16;

/// The border of a block varies per pixel by 1/[`REACH`] of its edge, which suffices to hide the squares. Variation
/// over the whole edge would increase the distance of pixels that share paths, and multiply the relMSE of the box and
/// of `ajar` by 1.3 (docs/measurements/path-reuse.md).
const REACH: u32 = 3;

/// Seeds of the hashes: offset of the cells, offset of the blocks in a cell, and block of a pixel near an edge.
mod seed {
    pub(super) const CELLS: u32 = 0x63_65_6c_6c;
    pub(super) const BLOCKS: u32 = 0x72_65_75_73;
    pub(super) const PIXEL: u32 = 0x70_69_78_6c;
}

/// The cells of a share group, row by row. Cells at the border of the image have fewer pixels.
pub fn cells(image: &PixelBounds, share_group: u32, seed: u32) -> Vec<PixelBounds> {
    let [dx, dy] = offset(share_group, seed);
    let columns: Vec<[u32; 2]> = spans([image.x0, image.x1], dx).collect();
    let row = |[y0, y1]: [u32; 2]| columns.iter().map(move |&[x0, x1]| PixelBounds { x0, x1, y0, y1 });
    spans([image.y0, image.y1], dy).flat_map(row).collect()
}

/// Divides a range at the multiples of the cell edge, less `offset`, from its beginning.
fn spans([begin, end]: [u32; 2], offset: u32) -> impl Iterator<Item = [u32; 2]> {
    let limit = move |i: u32| (begin + (i * CELL).saturating_sub(offset)).min(end);
    (0..(end - begin + offset).div_ceil(CELL)).map(move |i| [limit(i), limit(i + 1)])
}

/// Offset of the cells of a share group, to the left and upwards.
#[inline]
fn offset(share_group: u32, seed: u32) -> [u32; 2] {
    let [dx, dy, ..] = pcg4d([PixelSamples::step(share_group) / GROUPS_PER_LAYOUT, seed, seed::CELLS, 0]);
    [dx % CELL, dy % CELL]
}

/// Blocks of pixels within which the samples of a batch share paths.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Blocks {
    /// No sharing: the batch does not contain all samples of a cell.
    #[default]
    None,
    /// Blocks within cells.
    Cells,
    /// Blocks of a regular grid over the image.
    Grid,
}

impl Blocks {
    /// The block of a sample, together with its share group. The pixel coordinates begin at the corner of the image.
    #[inline]
    pub(super) fn of(self, edge: u32, seed: u32, [x, y]: [u32; 2], share_group: u32, is_replica: bool) -> u64 {
        let (cell, block) = match self {
            Blocks::None => return 0,
            Blocks::Grid => ([x / edge, y / edge], [0; 2]),
            Blocks::Cells => {
                let (size, [dx, dy]) =
                    if is_replica { (REPLICA_CELL, [0; 2]) } else { (CELL, offset(share_group, seed)) };
                let at = [x + dx, y + dy];
                let cell = at.map(|p| p / size);
                let [bx, by, ..] = pcg4d([cell[0], cell[1], share_group, seed ^ seed::BLOCKS]);
                let [px, py, ..] = pcg4d([x, y, share_group, seed ^ seed::PIXEL]);
                let reach = edge.div_ceil(REACH);
                let block = |p: u32, of_cell: u32, of_pixel: u32| (p % size + of_cell % edge + of_pixel % reach) / edge;
                (cell, [block(at[0], bx, px), block(at[1], by, py)])
            }
        };
        // A batch has few adjacent cells, and a cell has at most CELL blocks per row
        let ([cell_x, cell_y], [block_x, block_y]) = (cell.map(|c| u64::from(c & 0x7ff)), block.map(u64::from));
        u64::from(share_group) << 32 | cell_y << 21 | cell_x << 10 | block_y << 5 | block_x
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeMap;

    const IMAGE: PixelBounds = PixelBounds { x0: 5, x1: 95, y0: 2, y1: 60 };

    #[test]
    fn every_pixel_is_in_one_cell_and_blocks_are_within_cells() {
        let mut of_groups = Vec::new();
        for share_group in [0, 1, 4, 9, 1 << 20 | 4, (1 << 20) - 1] {
            let cells = cells(&IMAGE, share_group, 3);
            let mut cell_of = BTreeMap::<u64, usize>::new();
            let mut count = [0; 95 * 60];
            for (k, cell) in cells.iter().enumerate() {
                assert!(cell.area() > 0 && cell.width() <= CELL && cell.height() <= CELL);
                for y in cell.y0..cell.y1 {
                    for x in cell.x0..cell.x1 {
                        count[(y * 95 + x) as usize] += 1;
                        let block = Blocks::Cells.of(3, 3, [x - IMAGE.x0, y - IMAGE.y0], share_group, false);
                        assert_eq!(*cell_of.entry(block).or_insert(k), k, "a block of two cells");
                    }
                }
            }

            // Cells partition the image, and are the same for GROUPS_PER_LAYOUT share groups
            assert_eq!(count.iter().sum::<usize>(), IMAGE.area());
            assert!(count.iter().all(|&n| n <= 1));
            of_groups.push(cells);
        }
        assert_eq!(of_groups[0], of_groups[1]);
        assert_eq!(of_groups[2], of_groups[4], "samples of a pixel in one step");
        assert!(of_groups[0] != of_groups[2] && of_groups[2] != of_groups[3]);
    }
}
