//! Tiles: pixels that are rendered together, with their exact sums.

use super::cell_progress::CellProgress;
use super::render_settings::RenderSettings;
use super::tile_share::TileShare;
use crate::direct::{Estimator, Fits};
use crate::film::accumulator::PixelAccumulator;
use crate::film::light_layers::PackedLayers;
use crate::film::packed::PackedSums;
use crate::film::replicas::{ReplicaAccumulator, ReplicaChoice};
use crate::film::{Film, FilmTile, PixelBounds};
use crate::integrators::cells::REPLICA_CELL;
use crate::integrators::path::BATCH_PATHS;
use crate::integrators::{light_paths, reuse};
use crate::scene::RenderJob;
use crate::settings::IntegratorKind;
use rayon::prelude::*;
use std::collections::BTreeMap;
use std::ops::Range;
use std::sync::Arc;

/// A tile with the sums of its pixels.
#[derive(Debug)]
pub(super) struct Tile {
    pub(super) bounds: PixelBounds,
    /// Index of the next sample of its pixels.
    pub(super) done: u32,
    /// Sums of its pixels, row by row, shared with films.
    pub(super) sums: Arc<PackedSums>,
    /// Sums of the light-group layers, shared with films.
    pub(super) layers: Arc<PackedLayers>,
    pub(super) replicas: Vec<ReplicaAccumulator>,
    /// Fits of its pixels, row by row, then of its replicas.
    pub(super) fits: Fits,
}

impl Tile {
    /// Replaces the sums of the pixels. `scratch` is a buffer.
    pub(super) fn set_sums(&mut self, sums: &[PixelAccumulator], scratch: &mut Vec<u8>) {
        // Sums that a film shares stay unchanged
        if Arc::get_mut(&mut self.sums).is_none() {
            self.sums = Arc::new(PackedSums::new(sums.len()));
        }
        if let Some(packed) = Arc::get_mut(&mut self.sums) {
            packed.set(sums, scratch);
        }
    }
}

/// Tiles that cover an image, or a part of it.
#[derive(Debug)]
pub struct Tiles {
    pub(super) tiles: Vec<Tile>,
    /// Samples of cells and replicas beyond the common sample count of the tiles.
    pub(super) cells: CellProgress,
}

/// Tiles of at most `size` pixels per edge that cover the image, or one share of it.
pub(super) fn bounds_of_tiles(image: &PixelBounds, size: u32, share: Option<TileShare>) -> Vec<PixelBounds> {
    match share {
        None => image.tiles(size),
        Some(share) => share.tiles(image).flat_map(|tile| tile.tiles(size)).collect(),
    }
}

/// The pixels that are estimated twice. `None` if they are not requested or would not be informative: samples that
/// share photon maps are correlated. Where pixels share paths, whole cells are estimated twice.
pub(super) fn replica_choice(job: &RenderJob, render: &RenderSettings) -> Option<ReplicaChoice> {
    let settings = job.settings();
    let shares_noise =
        settings.integrator.kind == IntegratorKind::PhotonMap && settings.integrator.photons.progressive.is_some();
    let is_over_pixels = Estimator::at_vertex(&settings.integrator, 0).is_over_pixels();
    // Pixels with more samples than there are sets of light paths use some sets more than once
    let shares_light = job.pixel_samples.is_some() && light_paths::per_sample(job) > 0.0;
    let is_useful = !settings.sampling.sampler.has_independent_samples() || is_over_pixels || shares_light;
    let edge = if reuse::edge(job) > 1 { REPLICA_CELL } else { 1 };
    (render.with_replicas && is_useful && !shares_noise).then_some(ReplicaChoice { edge, seed: settings.sampling.seed })
}

/// The film of some tiles, which shares their sums. `layers` are the names of the light-group layers.
pub(super) fn film(resolution: [u32; 2], bounds: PixelBounds, tiles: &[Tile], layers: &[String]) -> Film {
    let index = |tile: &Tile, pixel: u32| bounds.index_of(tile.bounds.pixel_at(pixel)) as u32;

    // Replicas, with their pixel indices in the film
    let replicas = tiles.iter().flat_map(|t| t.replicas.iter().map(move |r| r.replica(index(t, r.pixel))));
    let replicas = replicas.collect();

    let tile = |t: &Tile| FilmTile { bounds: t.bounds, sums: Arc::clone(&t.sums), layers: Arc::clone(&t.layers) };
    Film::new(resolution, bounds, tiles.iter().map(tile).collect(), replicas).with_light_layers(layers.to_vec())
}

/// Adds the records of a cache, given by their pixels, to the sums of the tiles.
pub(super) fn add_records(records: &[[u32; 2]], tiles: &mut [Tile]) {
    let mut of_rows = BTreeMap::<u32, Vec<u32>>::new();
    records.iter().for_each(|&[x, y]| of_rows.entry(y).or_default().push(x));
    let add = |tile: &mut Tile| {
        let bounds = tile.bounds;
        let inside = of_rows.range(bounds.y0..bounds.y1).flat_map(|(y, row)| row.iter().map(move |x| [*x, *y]));
        let mut inside = inside.filter(|pixel| bounds.contains(*pixel)).peekable();
        if inside.peek().is_some() {
            let mut sums = tile.sums.unpacked();
            inside.for_each(|pixel| sums[bounds.index_of(pixel)].records += 1);
            tile.set_sums(&sums, &mut Vec::new());
        }
    };
    if !records.is_empty() {
        tiles.par_iter_mut().for_each(add);
    }
}

/// Splits a range into parts of at most [`BATCH_PATHS`] paths each. A part has at least one element.
pub(super) fn batches(range: Range<u32>, paths_of: impl Fn(u32) -> usize) -> Vec<Range<u32>> {
    let mut parts: Vec<Range<u32>> = Vec::new();
    let mut paths = 0;
    for i in range {
        let more = paths_of(i);
        match parts.last_mut() {
            Some(part) if paths + more <= BATCH_PATHS => (part.end, paths) = (i + 1, paths + more),
            _ => {
                parts.push(i..i + 1);
                paths = more;
            }
        }
    }
    parts
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shares_have_each_pixel_once_whatever_the_size_of_tiles() {
        let image = PixelBounds { x0: 3, x1: 203, y0: 5, y1: 77 };
        for (count, size) in [(1, 16), (3, 16), (5, 7), (7, 64), (200, 1)] {
            let mut covered = vec![0; 203 * 77];
            for index in 0..count {
                for tile in bounds_of_tiles(&image, size, Some(TileShare { index, count })) {
                    tile.pixels().for_each(|[x, y]| {
                        covered[(y * 203 + x) as usize] += 1;
                    });
                }
            }
            assert_eq!(covered.iter().sum::<usize>(), image.area());
            assert!(covered.iter().all(|&n| n <= 1));
        }
    }
}
