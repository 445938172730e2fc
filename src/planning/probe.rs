//! Samples of some pixels with random numbers of their own, outside the film: the measuring instrument of pilots.

use crate::direct::Fits;
use crate::film::accumulator::RadianceAccumulator;
use crate::film::{FeatureSet, PixelSample};
use crate::integrators::CameraSamples;
use crate::integrators::camera_sampler::{CameraSampler, PixelSampleRange, Scratch};
use crate::integrators::cells::Blocks;
use crate::integrators::exclusions::{self, Feature};
use crate::integrators::light_paths::{self, LightPilot};
use crate::integrators::path::BATCH_PATHS;
use crate::integrators::{PathStats, PathTracer};
use crate::scene::RenderJob;
use crate::settings::IntegratorSettings;
use std::ops::Range;

use super::constants::{COLLISION_COST, LIGHT_PILOT};
use super::preparation::Preparation;

/// Light that an image leaves to light paths. Pilots leave out the same light.
pub(super) struct LeftToLightPaths(Option<(LightPilot, f64)>);

impl LeftToLightPaths {
    /// Traces a pilot of light paths, if the image has any, on the threads of the current pool.
    pub(super) fn new(job: &RenderJob, how: &Preparation<'_>) -> Self {
        let per_sample = f64::from(light_paths::per_sample(job));
        if per_sample > 0.0 {
            (how.observe)("tracing light paths", None);
        }
        let pilot = (per_sample > 0.0).then(|| LightPilot::new(job, LIGHT_PILOT)).flatten();
        LeftToLightPaths(pilot.map(|pilot| (pilot, per_sample)))
    }
}

/// Traces samples. Holds the buffers of a thread.
pub(super) struct Probe<'a> {
    job: &'a RenderJob,
    camera: CameraSampler<'a>,
    tracer: PathTracer,
    samples: CameraSamples,
    scratch: Scratch,
    results: Vec<PixelSample>,
}

impl<'a> Probe<'a> {
    /// A probe of an image. It leaves out the light of `left`, and pixels share paths as in the image.
    pub(super) fn new(job: &'a RenderJob, left: &LeftToLightPaths, features: FeatureSet) -> Self {
        let blocks = if exclusions::allows(job, Feature::Sharing) { Blocks::Grid } else { Blocks::None };
        let mut tracer = PathTracer::sharing(blocks, features);
        if let Some((pilot, per_sample)) = &left.0 {
            tracer.weigh_against_light_paths(job, pilot, *per_sample);
        }
        let camera = CameraSampler::new(job, 0);
        Probe {
            job,
            camera,
            tracer,
            samples: CameraSamples::default(),
            scratch: Scratch::default(),
            results: Vec::new(),
        }
    }

    /// Traces samples of some pixels with the random numbers of a seed. `add` receives them with the index of their
    /// pixel. Pixels that share paths must be in one batch.
    pub(super) fn trace(
        &mut self,
        settings: &IntegratorSettings,
        pixels: &[[u32; 2]],
        samples: Range<u32>,
        seed: u32,
        mut add: impl FnMut(usize, &PixelSample),
    ) {
        // As many pixels at once as fit into a batch
        let size = (BATCH_PATHS / samples.len().max(1)).max(1);
        let sample_counts = settings.sample_counts();
        for (part, pixels) in pixels.chunks(size).enumerate() {
            // Draw the camera samples
            let of_pixels = pixels.iter().map(|&pixel| PixelSampleRange { fit: 0, pixel, samples: samples.clone() });
            self.camera.samples(of_pixels, seed, &mut self.scratch, &mut self.samples);
            self.samples.sample_counts.fill(sample_counts);

            // Trace them
            self.tracer.trace(self.job, settings, &self.samples, &mut Fits::default(), &mut self.results);
            for (i, results) in self.results.chunks(samples.len().max(1)).enumerate() {
                results.iter().for_each(|result| add(part * size + i, result));
            }
        }
    }

    /// Sums of samples of some pixels.
    pub(super) fn sums(
        &mut self,
        settings: &IntegratorSettings,
        pixels: &[[u32; 2]],
        samples: Range<u32>,
        seed: u32,
    ) -> Vec<[f64; 3]> {
        let mut sums = vec![RadianceAccumulator::default(); pixels.len()];
        self.trace(settings, pixels, samples, seed, |i, sample| {
            sums[i].add(sample.radiance);
        });
        sums.iter().map(RadianceAccumulator::values).collect()
    }

    /// Mean cost of the camera samples since the last call; `samples` is their number. A sample that hits nothing costs
    /// 1. Camera rays that continue behind the boundary of a medium count as rays, not as samples.
    pub(super) fn take_cost(&mut self, samples: usize) -> f64 {
        cost(&crate::integrators::Tracer::take_stats(&mut self.tracer), samples)
    }
}

/// The pixels of an image with this width and height that are at most `radius` from pixel `i` in both directions.
pub(super) fn around(i: usize, [width, height]: [usize; 2], radius: usize) -> impl Iterator<Item = usize> {
    let window = |i: usize, len: usize| i.saturating_sub(radius)..i.saturating_add(radius + 1).min(len);
    let columns = window(i % width, width);
    window(i / width, height).flat_map(move |y| columns.clone().map(move |x| y * width + x))
}

fn cost(stats: &PathStats, samples: usize) -> f64 {
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
        // Two of the camera rays continued behind the boundary of a medium
        assert_eq!(cost(&stats, 10), (12.0 + 10.0 + 8.0 + 10.0 * COLLISION_COST) / 10.0);
        assert_eq!(cost(&PathStats::default(), 0), 0.0);
    }
}
