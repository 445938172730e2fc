//! Samples of tiles and cells: drawn and traced in batches, and added to the sums of their pixels and replicas.

use super::run::Run;
use super::tiles::{Tile, batches};
use super::worker::AnyWorker;
use crate::direct::{Estimator, Fits};
use crate::film::PixelBounds;
use crate::film::replicas::ReplicaAccumulator;
use crate::integrators::CameraSamples;
use crate::integrators::PathStats;
use crate::integrators::camera_sampler::{self, PixelSampleRange};
use crate::integrators::cells::{self, REPLICA_CELL};
use crate::integrators::path::BATCH_PATHS;
use lumiris_numbers::estimators::ocv::block_of;
use lumiris_numbers::math::hash::pcg4d;
use std::ops::Range;
use std::time::Instant;

// All samples of a cell with the same share group are in one batch
const _: () = assert!(BATCH_PATHS >= cells::CELL.pow(2) as usize && BATCH_PATHS >= REPLICA_CELL.pow(2) as usize);

/// Combined with the seed of the image to give the seed of replicas.
const REPLICA_SEED: u32 = 0x72_65_70_73;

/// Samples that are traced together.
struct Batch {
    /// Indices of the pixels.
    pixels: Range<usize>,
    /// The part of the pass.
    pass: Range<u32>,
}

impl Run<'_> {
    /// Adds a range of samples to one tile.
    pub(super) fn render_tile(&self, worker: &mut AnyWorker<'_>, tile: &mut Tile, samples: Range<u32>) -> PathStats {
        let mut ill_conditioned = 0;
        let done = samples.start - self.settings.first_sample;

        // Solve for the coefficients at the beginning of a block
        let start = Instant::now();
        let is_progressive = Estimator::at_vertex(&self.job.settings().integrator, 0).is_progressive();
        let begins_block = is_progressive && done > 0 && block_of(done).first == done;
        if begins_block {
            ill_conditioned = tile.fits.solve();
        }
        let solve = start.elapsed();

        // Trace the pixels and the replicas
        worker.read(tile);
        self.trace_pixels_of(worker, &mut tile.fits, &tile.bounds, &samples);
        worker.write(tile);
        self.render_replicas(worker, &tile.bounds, &mut tile.replicas, &mut tile.fits, &samples);
        tile.fits.pack(&mut worker.packing);

        // Add the time and the number of systems to the statistics
        let mut stats = worker.take_stats();
        if begins_block {
            let direct = &mut stats.direct;
            direct.systems += (tile.sums.len() + tile.replicas.len()) as u64;
            direct.ill_conditioned += ill_conditioned;
            direct.solve += solve;
            direct.select += solve;
        }
        stats
    }

    /// Adds the samples of a pass to the sums of all pixels within `bounds`, in batches: whole pixels, or whole share
    /// indices where pixels share paths.
    pub(super) fn trace_pixels_of(
        &self,
        worker: &mut AnyWorker<'_>,
        fits: &mut Fits,
        bounds: &PixelBounds,
        pass: &Range<u32>,
    ) {
        let seed = self.job.settings().sampling.seed;
        let of_pixel = |index: usize| bounds.pixel_at(index as u32);
        for Batch { pixels, pass: samples } in self.batches(bounds.area(), of_pixel, pass) {
            let start = Instant::now();
            self.camera_samples(bounds, pixels.clone(), &samples, &mut worker.scratch, &mut worker.samples);
            worker.times.camera_samples += start.elapsed();
            worker.trace(&self.camera, fits, self.ranges(bounds, pixels.clone(), &samples), seed);
            worker.add(&self.job.world.scene.film, self.ranges(bounds, pixels, &samples));
        }
    }

    /// Splits a pass over some pixels into batches: ranges of pixels, or ranges of the pass where pixels share paths.
    fn batches(&self, pixels: usize, pixel: impl Fn(usize) -> [u32; 2], pass: &Range<u32>) -> Vec<Batch> {
        let of = |index: usize, pass: &Range<u32>| self.samples_of(pixel(index), pass).len();
        if self.shares_paths {
            let paths = |i: u32| (0..pixels).map(|index| of(index, &(i..i + 1))).sum();
            return batches(pass.clone(), paths).into_iter().map(|pass| Batch { pixels: 0..pixels, pass }).collect();
        }
        let parts = batches(0..pixels as u32, |index| of(index as usize, pass));
        let batch = |part: Range<u32>| Batch { pixels: part.start as usize..part.end as usize, pass: pass.clone() };
        parts.into_iter().map(batch).collect()
    }

    /// Adds the samples of a pass to the replicas of a tile.
    pub(super) fn render_replicas(
        &self,
        worker: &mut AnyWorker<'_>,
        bounds: &PixelBounds,
        all: &mut [ReplicaAccumulator],
        fits: &mut Fits,
        pass: &Range<u32>,
    ) {
        // Replicas have random numbers of their own
        let seed = pcg4d([self.job.settings().sampling.seed, REPLICA_SEED, 0, 0])[0];
        let pixels: Vec<[u32; 2]> = all.iter().map(|r| bounds.pixel_at(r.pixel)).collect();
        if pixels.is_empty() {
            return;
        }
        for Batch { pixels: replicas, pass } in self.batches(pixels.len(), |i| pixels[i], pass) {
            let range = |i: usize| {
                let (fit, pixel) = ((bounds.area() + i) as u32, pixels[i]);
                PixelSampleRange { fit, pixel, samples: self.samples_of(pixel, &pass) }
            };
            // Draw the camera samples
            let start = Instant::now();
            self.camera.samples(replicas.clone().map(range), seed, &mut worker.scratch, &mut worker.samples);
            worker.samples.are_replicas = true;
            worker.times.camera_samples += start.elapsed();

            // Trace them and add the results
            worker.trace(&self.camera, fits, replicas.clone().map(range), seed);
            let mut results = worker.results.iter();
            for i in replicas {
                results.by_ref().take(range(i).samples.len()).for_each(|result| all[i].add(result));
            }
        }
    }

    /// Camera samples of some pixels of a tile in a pass. Pixels are numbered row by row.
    pub(super) fn camera_samples(
        &self,
        tile: &PixelBounds,
        pixels: Range<usize>,
        pass: &Range<u32>,
        scratch: &mut camera_sampler::Scratch,
        out: &mut CameraSamples,
    ) {
        self.camera.samples(self.ranges(tile, pixels, pass), self.job.settings().sampling.seed, scratch, out);
    }

    /// The samples of some pixels of a tile in a pass. Pixels are numbered row by row.
    fn ranges(
        &self,
        tile: &PixelBounds,
        pixels: Range<usize>,
        pass: &Range<u32>,
    ) -> impl Iterator<Item = PixelSampleRange> {
        pixels.map(move |index| {
            let pixel = tile.pixel_at(index as u32);
            PixelSampleRange { fit: index as u32, pixel, samples: self.samples_of(pixel, pass) }
        })
    }

    /// Indices of the samples of a pixel in a pass. With adaptive sampling their number differs between pixels.
    #[inline]
    fn samples_of(&self, pixel: [u32; 2], pass: &Range<u32>) -> Range<u32> {
        let Some(of_pixels) = &self.job.pixel_samples else { return pass.clone() };
        let first = self.settings.first_sample;
        let [start, end] = [pass.start, pass.end].map(|i| first + of_pixels.until(pixel, i - first));
        start..end
    }
}
