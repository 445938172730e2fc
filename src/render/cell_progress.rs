//! Progress of cells where pixels share paths, so that a rendering that stopped within a pass can be resumed.
//!
//! Samples with the same share group may share paths. [`GROUPS_PER_LAYOUT`] consecutive share groups have the same
//! layout of cells.

use crate::film::encoding::{Decoder, Encoder};
use crate::integrators::cells::GROUPS_PER_LAYOUT;
use std::collections::BTreeMap;

/// The next share group of every cell, and of the replicas of every tile, that is ahead of the common sample count.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct CellProgress {
    /// By layout: the next share group of each cell.
    cells: BTreeMap<u32, Vec<u32>>,
    /// The next share group of the replicas of each tile.
    replicas: Vec<u32>,
}

impl CellProgress {
    /// True if no cell is ahead.
    pub(super) fn is_empty(&self) -> bool {
        self.cells.is_empty() && self.replicas.is_empty()
    }

    /// The largest next share group.
    pub(super) fn end(&self) -> Option<u32> {
        self.cells.values().flatten().chain(&self.replicas).copied().max()
    }

    /// True if every layout has the cells that `cells` counts, there are `tiles` tiles, and all share groups are in
    /// their layouts.
    pub(super) fn fits(&self, cells: impl Fn(u32) -> usize, tiles: usize) -> bool {
        let is_of_layout = |(&layout, next): (&u32, &Vec<u32>)| {
            let share_groups =
                layout.checked_mul(GROUPS_PER_LAYOUT).map(|first| first..=first.saturating_add(GROUPS_PER_LAYOUT));
            share_groups.is_some_and(|share_groups| {
                next.iter().all(|n| *n == 0 || share_groups.contains(n)) && next.len() == cells(layout)
            })
        };
        self.cells.iter().all(is_of_layout) && [0, tiles].contains(&self.replicas.len())
    }

    /// The next share group of a cell; 0 if nothing is stored.
    pub(super) fn of_cell(&self, layout: u32, cell: usize) -> u32 {
        self.cells.get(&layout).map_or(0, |next| next[cell])
    }

    /// The next share group of the replicas of a tile; 0 if nothing is stored.
    pub(super) fn of_replicas(&self, tile: usize) -> u32 {
        self.replicas.get(tile).copied().unwrap_or(0)
    }

    /// Stores the next share group of a cell; `count` is the number of cells in the layout.
    pub(super) fn set_cell(&mut self, layout: u32, cell: usize, count: usize, next: u32) {
        self.cells.entry(layout).or_insert_with(|| vec![0; count])[cell] = next;
    }

    /// Stores the next share group of the replicas of a tile; `count` is the number of tiles.
    pub(super) fn set_replicas(&mut self, tile: usize, count: usize, next: u32) {
        self.replicas.resize(count, 0);
        self.replicas[tile] = next;
    }

    /// Drops entries that are not ahead of `share_group`, the next share group of all pixels.
    pub(super) fn forget_before(&mut self, share_group: u32) {
        let is_further = |next: &[u32]| next.iter().any(|n| *n > share_group);
        self.cells.retain(|_, next| is_further(next));
        if !is_further(&self.replicas) {
            self.replicas.clear();
        }
    }

    /// Appends the progress to an encoder.
    pub(super) fn write(&self, encoder: &mut Encoder) {
        let mut list = |values: &[u32]| {
            encoder.word(values.len() as u32);
            values.iter().for_each(|value| encoder.word(*value));
        };
        list(&self.replicas);
        self.cells.iter().for_each(|(layout, next)| {
            list(&[*layout]);
            list(next);
        });
    }

    /// Reads the output of [`Self::write`], to the end; `None` if it is invalid.
    pub(super) fn read(decoder: &mut Decoder<'_>) -> Option<Self> {
        let list = |decoder: &mut Decoder<'_>| {
            let len = decoder.word()?;
            (0..len).map(|_| decoder.word()).collect::<Option<Vec<u32>>>()
        };
        let mut progress = CellProgress { cells: BTreeMap::new(), replicas: list(decoder)? };
        while !decoder.is_at_end() {
            let [layout] = list(decoder)?[..] else { return None };
            progress.cells.insert(layout, list(decoder)?);
        }
        Some(progress)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_written_is_read_and_fits_the_same_cells_alone() {
        // Write and read
        let mut progress = CellProgress::default();
        progress.set_cell(2, 1, 3, 10);
        progress.set_cell(3, 2, 5, 16);
        progress.set_replicas(6, 7, 12);
        let mut encoder = Encoder::default();
        progress.write(&mut encoder);
        let read = |bytes: &[u8]| CellProgress::read(&mut Decoder::new(bytes));
        assert_eq!(read(&encoder.bytes).as_ref(), Some(&progress));
        assert_eq!(read(&encoder.bytes[..encoder.bytes.len() - 1]), None);
        assert_eq!([progress.of_cell(2, 1), progress.of_cell(2, 0), progress.of_cell(4, 9)], [10, 0, 0]);
        assert_eq!([progress.of_replicas(6), progress.of_replicas(0)], [12, 0]);

        // Counts of cells and tiles have to match
        let cells = |layout: u32| if layout == 2 { 3 } else { 5 };
        assert!(progress.fits(cells, 7) && !progress.fits(cells, 8) && !progress.fits(|_| 3, 7));
        assert_eq!(progress.end(), Some(16));

        // Entries that are not ahead are dropped
        progress.forget_before(12);
        assert_eq!((progress.cells.len(), progress.replicas.len()), (1, 0));
        progress.set_cell(2, 0, 3, 13);
        assert!(!progress.fits(cells, 7), "a share group beyond those of its layout");
        progress.forget_before(16);
        assert!(progress.is_empty() && progress.fits(cells, 7));
    }
}
