//! Samples of pilots: of some pixels, with random numbers of their own, and outside the film.

use super::worker::Worker;
use super::{BATCH_PATHS, Run, position};
use crate::direct::Fits;
use crate::film::accumulator::RadianceAccumulator;
use crate::film::{PixelBounds, PixelSample};
use crate::integrators::PathTracer;
use crate::settings::IntegratorSettings;
use std::ops::Range;

/// The sums of some samples of the pixels of a tile, with random numbers of a seed.
pub(super) fn pilot_images(run: &Run<'_>, tile: &PixelBounds, samples: Range<u32>, seed: u32) -> Vec<[f64; 3]> {
    let mut sums = vec![RadianceAccumulator::default(); tile.area()];
    let all: Vec<u32> = (0..tile.area() as u32).collect();
    let mut worker = Worker::new(PathTracer::new(false));
    let settings = &run.job.settings().integrator;
    trace_pixels(run, &mut worker, settings, (tile, &all), (samples, seed), |i, sample| {
        sums[i as usize].add(sample.radiance);
    });
    sums.iter().map(RadianceAccumulator::values).collect()
}

/// Traces samples of some pixels of a tile, with random numbers of a seed, and passes them on with the indices of their pixels.
pub(super) fn trace_pixels(
    run: &Run<'_>,
    worker: &mut Worker<PathTracer>,
    settings: &IntegratorSettings,
    (tile, pixels): (&PixelBounds, &[u32]),
    (samples, seed): (Range<u32>, u32),
    mut add: impl FnMut(u32, &PixelSample),
) {
    for pixels in pixels.chunks((BATCH_PATHS / samples.len().max(1)).max(1)) {
        worker.samples.clear();
        let of_pixels = pixels.iter().map(|&i| (0, position(tile, i), samples.clone()));
        run.camera.samples(of_pixels, seed, &mut worker.scratch, &mut worker.samples);
        worker.tracer.trace(run.job, settings, &worker.samples, &mut Fits::default(), &mut worker.results);
        for (&i, results) in pixels.iter().zip(worker.results.chunks(samples.len())) {
            results.iter().for_each(|r| add(i, r));
        }
    }
}
