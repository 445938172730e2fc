//! Samples of pilots: of some pixels, with random numbers of their own, and outside the film.

use super::worker::Worker;
use super::{BATCH_PATHS, Run, position};
use crate::direct::Fits;
use crate::film::accumulator::RadianceAccumulator;
use crate::film::{FeatureSet, PixelBounds, PixelSample};
use crate::integrators::light_paths::{self, LightPilot};
use crate::integrators::reuse::{self, Groups};
use crate::integrators::{PathStats, PathTracer};
use crate::scene::RenderJob;
use crate::settings::IntegratorSettings;
use std::ops::Range;

/// Part of a pilot of light paths whose whole is traced before the image.
const LIGHT_PILOT: u64 = 4;

/// Cost of a tentative collision in a medium, a lookup: as measured in a sparse volume.
const COLLISION_COST: f64 = 1.5;
/// Cost of a ray that only sees visible lights, where [`cost`] has 1: measured as 0.9 to 2.5 in four scenes, beside samples of a
/// camera ray and 8 proposals.
pub(super) const LOOK_COST: f64 = 2.0;

/// What light paths find in an image that has them: pilots leave it to them as the image does.
pub(super) struct LeftToLightPaths(Option<(LightPilot, f64)>);

impl LeftToLightPaths {
    /// Traces a pilot of light paths, if there are any. On the threads of the current pool.
    pub(super) fn new(job: &RenderJob) -> Self {
        let per_sample = f64::from(light_paths::per_sample(job));
        let pilot = (per_sample > 0.0).then(|| LightPilot::new(job, LIGHT_PILOT)).flatten();
        LeftToLightPaths(pilot.map(|pilot| (pilot, per_sample)))
    }

    /// A worker whose paths leave that, and in which pixels share paths as they do in the image.
    pub(super) fn worker(&self, job: &RenderJob, features: FeatureSet) -> Worker<PathTracer> {
        let groups = if reuse::edge(job) > 1 { Groups::Grid } else { Groups::None };
        let mut tracer = PathTracer::sharing(groups, features);
        tracer.leave(job, self.0.as_ref().map(|(pilot, per_sample)| (pilot, *per_sample)));
        Worker::new(tracer)
    }
}

/// The sums of some samples of the pixels of a tile, with random numbers of a seed.
pub(super) fn pilot_images(
    run: &Run<'_>,
    worker: &mut Worker<PathTracer>,
    settings: &IntegratorSettings,
    tile: &PixelBounds,
    (samples, seed): (Range<u32>, u32),
) -> Vec<[f64; 3]> {
    let mut sums = vec![RadianceAccumulator::default(); tile.area()];
    let all: Vec<u32> = (0..tile.area() as u32).collect();
    trace_pixels(run, worker, settings, (tile, &all), (samples, seed), |i, sample| {
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

/// Mean cost of so many camera samples; that of one which hits nothing is 1. Rays that go on where a medium begins or ends are more
/// than samples.
pub(super) fn cost(stats: &PathStats, samples: usize) -> f64 {
    let work = stats.camera_rays + 2 * stats.bounce_rays + stats.direct.proposals;
    let collisions = (stats.collisions + stats.direct.collisions) as f64 * COLLISION_COST;
    (work as f64 + collisions) / samples.max(1) as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_cost_of_samples_is_that_of_all_their_rays_and_collisions() {
        let mut stats = PathStats { camera_rays: 12, bounce_rays: 5, collisions: 4, ..PathStats::default() };
        (stats.direct.proposals, stats.direct.collisions) = (8, 6);
        // Two of the camera rays went on behind the bounds of a medium
        assert_eq!(cost(&stats, 10), (12.0 + 10.0 + 8.0 + 10.0 * COLLISION_COST) / 10.0);
        assert_eq!(cost(&PathStats::default(), 0), 0.0);
    }
}
