//! Passes over images whose pixels share paths.
//!
//! The unit of work is a cell with some share groups ([`cells`], [`super::cell_progress`]). Its pixels are traced
//! together; their sums are then added to the tiles that overlap the cell. The sums are exact, so the order does not
//! matter. Replicas share paths in cells of their own, which are the tiles. Finished units are recorded until all
//! pixels have the samples of the pass.

use super::run::{Pass, Run};
use super::tiles::{Tile, Tiles};
use super::worker::{AnyWorker, Workers};
use crate::direct::{Estimator, Fits};
use crate::film::fixed_sums::FixedSum;
use crate::film::replicas::ReplicaAccumulator;
use crate::film::{Film, PixelBounds};
use crate::integrators::PathStats;
use crate::integrators::cells::{GROUPS_PER_LAYOUT, REPLICA_CELL, cells};
use rayon::prelude::*;
use std::ops::Range;
use std::sync::{Mutex, MutexGuard, PoisonError};

/// A unit of work.
struct Unit {
    of: Of,
    share_groups: Range<u32>,
    is_done: bool,
}

/// Pixels of a unit.
#[derive(Clone, Copy)]
enum Of {
    /// A cell, by its index among the `count` cells of a layout.
    Cell { bounds: PixelBounds, layout: u32, index: usize, count: usize },
    /// The replicas of the tile with this index.
    Replicas(usize),
}

/// Tiles that several threads add samples to.
struct SharedTiles<'a> {
    image: PixelBounds,
    tiles: Vec<Mutex<&'a mut Tile>>,
}

impl<'a> SharedTiles<'a> {
    /// The tiles that overlap `bounds`.
    fn touched(&self, bounds: &PixelBounds) -> impl Iterator<Item = MutexGuard<'_, &'a mut Tile>> {
        let columns = self.image.width().div_ceil(REPLICA_CELL);
        let range =
            |from: u32, to: u32, origin: u32| (from - origin) / REPLICA_CELL..(to - origin).div_ceil(REPLICA_CELL);
        let rows = range(bounds.y0, bounds.y1, self.image.y0);
        let of_row = range(bounds.x0, bounds.x1, self.image.x0);
        rows.flat_map(move |y| of_row.clone().map(move |x| self.tile((y * columns + x) as usize)))
    }

    fn tile(&self, index: usize) -> MutexGuard<'_, &'a mut Tile> {
        self.tiles[index].lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Run<'_> {
    /// True if the tiles and the progress of their cells fit this rendering, so that it can resume from them.
    pub(super) fn has_cells(&self, Tiles { tiles, cells: progress }: &Tiles) -> bool {
        if !self.shares_paths {
            return progress.is_empty();
        }
        let image = &self.job.world.scene.film.bounds;
        let bounds = image.tiles(REPLICA_CELL);
        let are_alike = bounds.len() == tiles.len()
            && tiles.iter().zip(bounds).all(|(tile, bounds)| tile.bounds == bounds && tile.done == tiles[0].done);
        let count = |layout: u32| cells(image, layout.wrapping_mul(GROUPS_PER_LAYOUT), self.seed()).len();
        are_alike && progress.fits(count, tiles.len()) && progress.end().is_none_or(|end| end <= self.end())
    }

    /// Adds the samples of a pass to all tiles that do not have them yet.
    pub(super) fn pass_of_cells(&self, workers: &Workers<'_>, tiles: &mut Tiles, pass: &Pass<'_>) -> PathStats {
        // Units, and tiles behind locks
        let total = self.samples_total(&tiles.tiles);
        let mut units = self.units(tiles, &pass.samples);
        let image = self.job.world.scene.film.bounds;
        let shared = SharedTiles { image, tiles: tiles.tiles.iter_mut().map(Mutex::new).collect() };

        // Trace one unit
        let of_unit = |unit: &mut Unit| {
            if pass.is_over() || self.stops_at_once() || self.leaves(unit.share_groups.start) {
                return PathStats::default();
            }
            let watch = |film: Film| {
                if let Some(watch) = pass.watch {
                    watch(&film)
                }
            };
            let stats = workers.with_one(|worker| {
                match unit.of {
                    Of::Cell { bounds, .. } => self.render_cell(worker, &shared, &bounds, &unit.share_groups, watch),
                    Of::Replicas(tile) => self.render_replicas_of(worker, &shared, tile, &unit.share_groups),
                }
                worker.take_stats()
            });

            // Record it, and notify observers
            unit.is_done = true;
            let pixels = if let Of::Cell { bounds, .. } = unit.of { bounds.area() } else { 0 };
            self.note(&stats, pixels as u64 * unit.share_groups.len() as u64, total, pass.noise);
            stats
        };

        // Trace all units
        let stats = units.par_iter_mut().with_max_len(1).map(of_unit).sum();
        note_units(tiles, &units, pass.samples.end);
        stats
    }

    /// The unfinished units of a pass.
    fn units(&self, Tiles { tiles, cells: progress }: &Tiles, samples: &Range<u32>) -> Vec<Unit> {
        // Cells of each layout
        let unit = |of: Of, next: u32, end: u32| {
            let share_groups = next.max(samples.start)..end.min(samples.end);
            (!share_groups.is_empty()).then_some(Unit { of, share_groups, is_done: false })
        };
        let image = &self.job.world.scene.film.bounds;
        let of_layout = |layout: u32| {
            let cells = cells(image, layout * GROUPS_PER_LAYOUT, self.seed());
            let count = cells.len();
            cells.into_iter().enumerate().filter_map(move |(index, bounds)| {
                let next = progress.of_cell(layout, index).max(layout * GROUPS_PER_LAYOUT);
                unit(
                    Of::Cell { bounds, layout, index, count },
                    next,
                    (layout * GROUPS_PER_LAYOUT).saturating_add(GROUPS_PER_LAYOUT),
                )
            })
        };
        let of_cells = (samples.start / GROUPS_PER_LAYOUT..=(samples.end - 1) / GROUPS_PER_LAYOUT).flat_map(of_layout);

        // Tiles with replicas
        let twice = tiles.iter().enumerate().filter(|(_, tile)| !tile.replicas.is_empty());
        let of_replicas = twice.filter_map(|(i, _)| unit(Of::Replicas(i), progress.of_replicas(i), samples.end));
        of_cells.chain(of_replicas).collect()
    }

    /// Traces a cell and adds its samples to the overlapping tiles. `watch` receives their films.
    fn render_cell(
        &self,
        worker: &mut AnyWorker<'_>,
        tiles: &SharedTiles<'_>,
        cell: &PixelBounds,
        share_groups: &Range<u32>,
        watch: impl Fn(Film),
    ) {
        let mut fits = self.fits(cell.area());
        worker.begin(cell.area());
        self.trace_pixels_of(worker, &mut fits, cell, share_groups);
        let controls = fits.exact_sums();
        for mut tile in tiles.touched(cell) {
            worker.add_to(&mut tile, cell);
            merge_controls(&mut tile, cell, &controls);
            tile.fits.pack(&mut worker.packing);
            watch(self.film_of(&tile));
        }
    }

    /// Traces the replicas of a tile.
    fn render_replicas_of(
        &self,
        worker: &mut AnyWorker<'_>,
        tiles: &SharedTiles<'_>,
        tile: usize,
        share_groups: &Range<u32>,
    ) {
        // Start empty sums for the same replicas
        let (bounds, mut replicas) = {
            let tile = tiles.tile(tile);
            let none = |r: &ReplicaAccumulator| ReplicaAccumulator { pixel: r.pixel, ..ReplicaAccumulator::default() };
            (tile.bounds, tile.replicas.iter().map(none).collect::<Vec<_>>())
        };

        // Trace without a lock
        let mut fits = self.fits(bounds.area() + replicas.len());
        self.render_replicas(worker, &bounds, &mut replicas, &mut fits, share_groups);

        // Merge
        let mut tile = tiles.tile(tile);
        tile.replicas.iter_mut().zip(&replicas).for_each(|(sum, more)| sum.merge(more));
        let sums = fits.exact_sums();
        let row = sums.len() / (bounds.area() + replicas.len());
        (0..).zip(sums.chunks_exact(row.max(1))).for_each(|(fit, sums)| {
            tile.fits.merge_sums(fit, sums);
        });
        tile.fits.pack(&mut worker.packing);
    }

    fn fits(&self, count: usize) -> Fits {
        Estimator::at_vertex(&self.job.settings().integrator, 0).fits(self.job, count)
    }

    fn seed(&self) -> u32 {
        self.job.settings().sampling.seed
    }
}

/// Adds the control-variate sums of a cell to a tile.
fn merge_controls(tile: &mut Tile, cell: &PixelBounds, controls: &[FixedSum]) {
    let row = controls.len() / cell.area();
    if row == 0 {
        return;
    }
    let bounds = tile.bounds;
    for [of_tile, of_cell] in bounds.common_rows(cell) {
        for (to, from) in of_tile.zip(of_cell) {
            tile.fits.merge_sums(to as u32, &controls[from * row..][..row]);
        }
    }
}

/// Records the finished units of a pass. `end` is the end of the pass.
fn note_units(Tiles { tiles, cells: progress }: &mut Tiles, units: &[Unit], end: u32) {
    for unit in units.iter().filter(|unit| unit.is_done) {
        match unit.of {
            Of::Cell { layout, index, count, .. } => progress.set_cell(layout, index, count, unit.share_groups.end),
            Of::Replicas(tile) => progress.set_replicas(tile, tiles.len(), unit.share_groups.end),
        }
    }
    if units.iter().all(|unit| unit.is_done) {
        tiles.iter_mut().for_each(|tile| tile.done = end);
        progress.forget_before(end);
    }
}
