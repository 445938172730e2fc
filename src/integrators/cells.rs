//! Which pixels share paths: those of a block, which are close together; and which are rendered together: those of a cell.
//!
//! None of that is to be seen in the image. So cells lie elsewhere every few turns, and blocks elsewhere in each cell and turn.
//! A block has no straight edge either: near one, a pixel is in either of the blocks by chance.

use crate::film::PixelBounds;
use lumiris_numbers::math::hash::pcg4d;

/// Edge of the cells of pixels that are rendered together.
pub const CELL: u32 = 32;
/// Turns whose cells are the same: pixels that were rendered in a cell are added to the film once.
pub const TURNS: u32 = 4;
/// Edge of the cells of pixels that are estimated twice, from the corner of the image.
pub const REPLICA_CELL: u32 = 16;

/// Part of the edge of a block by which its border is drawn to and fro for each pixel, 1/[`REACH`]: as far as squares are not seen.
/// Over the whole edge, pixels that share lie further apart, and relMSE of the box and of `ajar` is 1.3 times as much
/// (docs/measurements/path-reuse.md).
const REACH: u32 = 3;

/// Lower bits of a turn, which samples of a pixel in the same turn have in common ([`crate::scene::PixelSamples::turn`]).
const TURN: u32 = (1 << 20) - 1;

/// Seeds of hashes: where cells lie, where blocks lie in a cell, and which of them a pixel is in.
mod seed {
    pub(super) const CELLS: u32 = 0x63_65_6c_6c;
    pub(super) const BLOCKS: u32 = 0x72_65_75_73;
    pub(super) const PIXEL: u32 = 0x70_69_78_6c;
}

/// The cells of a turn in an image of a seed, row by row. Those at its border have fewer pixels.
pub fn cells(image: &PixelBounds, turn: u32, seed: u32) -> Vec<PixelBounds> {
    let [dx, dy] = offset(turn, seed);
    let columns: Vec<[u32; 2]> = spans([image.x0, image.x1], dx).collect();
    let row = |[y0, y1]: [u32; 2]| columns.iter().map(move |&[x0, x1]| PixelBounds { x0, x1, y0, y1 });
    spans([image.y0, image.y1], dy).flat_map(row).collect()
}

/// Parts of a range whose limits are multiples of the edge of cells, less an offset, from its beginning.
fn spans([begin, end]: [u32; 2], offset: u32) -> impl Iterator<Item = [u32; 2]> {
    let limit = move |i: u32| (begin + (i * CELL).saturating_sub(offset)).min(end);
    (0..(end - begin + offset).div_ceil(CELL)).map(move |i| [limit(i), limit(i + 1)])
}

/// How far the cells of a turn lie to the left and above those from the corner of the image.
#[inline]
fn offset(turn: u32, seed: u32) -> [u32; 2] {
    let [dx, dy, ..] = pcg4d([(turn & TURN) / TURNS, seed, seed::CELLS, 0]);
    [dx % CELL, dy % CELL]
}

/// Which samples of a batch share paths.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Groups {
    /// None: the batch does not have all samples of a cell.
    #[default]
    None,
    /// Those of a block of a cell.
    Cells,
    /// Those of a block of a grid over the image.
    Grid,
}

impl Groups {
    /// The group of a sample of a pixel, counted from the corner of the image.
    #[inline]
    pub(super) fn of(self, (edge, seed): (u32, u32), [x, y]: [u32; 2], (turn, is_replica): (u32, bool)) -> u64 {
        let (cell, block) = match self {
            Groups::None => return 0,
            Groups::Grid => ([x / edge, y / edge], [0; 2]),
            Groups::Cells => {
                let (size, [dx, dy]) = if is_replica { (REPLICA_CELL, [0; 2]) } else { (CELL, offset(turn, seed)) };
                let at = [x + dx, y + dy];
                let cell = at.map(|p| p / size);
                let [bx, by, ..] = pcg4d([cell[0], cell[1], turn, seed ^ seed::BLOCKS]);
                let [px, py, ..] = pcg4d([x, y, turn, seed ^ seed::PIXEL]);
                let reach = edge.div_ceil(REACH);
                let block = |p: u32, of_cell: u32, of_pixel: u32| (p % size + of_cell % edge + of_pixel % reach) / edge;
                (cell, [block(at[0], bx, px), block(at[1], by, py)])
            }
        };
        // A batch has few cells, near each other, and at most CELL blocks in a row of one
        let ([cell_x, cell_y], [block_x, block_y]) = (cell.map(|c| u64::from(c & 0x7ff)), block.map(u64::from));
        u64::from(turn) << 32 | cell_y << 21 | cell_x << 10 | block_y << 5 | block_x
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeMap;

    const IMAGE: PixelBounds = PixelBounds { x0: 5, x1: 95, y0: 2, y1: 60 };

    #[test]
    fn every_pixel_is_in_one_cell_and_blocks_are_within_cells() {
        let mut of_turns = Vec::new();
        for turn in [0, 1, 4, 9, 1 << 20 | 4, TURN] {
            let cells = cells(&IMAGE, turn, 3);
            let mut groups = BTreeMap::<u64, usize>::new();
            let mut count = [0; 95 * 60];
            for (k, cell) in cells.iter().enumerate() {
                assert!(cell.area() > 0 && cell.width() <= CELL && cell.height() <= CELL);
                for y in cell.y0..cell.y1 {
                    for x in cell.x0..cell.x1 {
                        count[(y * 95 + x) as usize] += 1;
                        let group = Groups::Cells.of((3, 3), [x - IMAGE.x0, y - IMAGE.y0], (turn, false));
                        assert_eq!(*groups.entry(group).or_insert(k), k, "a block of two cells");
                    }
                }
            }
            assert_eq!(count.iter().sum::<usize>(), IMAGE.area());
            assert!(count.iter().all(|&n| n <= 1));
            of_turns.push(cells);
        }
        assert_eq!(of_turns[0], of_turns[1]);
        assert_eq!(of_turns[2], of_turns[4], "samples of a pixel in one turn");
        assert!(of_turns[0] != of_turns[2] && of_turns[2] != of_turns[3]);
    }
}
