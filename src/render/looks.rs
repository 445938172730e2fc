//! Emission rays: additional camera rays that measure only the emission of visible lights, at pixels where it dominates
//! the noise.
//!
//! The emission that a camera ray meets has another variance than the light gathered by its path, at a far lower cost.
//! At the edge of a lamp it causes nearly all of the variance. There the sample is *split* [Arvo and Kirk 1990] into
//! several camera rays, one of which continues as a path. Let e be the emission met by that ray and e_i the emission
//! met by the m − 1 others. The sample f becomes f − e + (e + Σ e_i)/m, which has the same expected value. The number m
//! follows from a pilot ([`crate::planning::allocation`]), never from the samples themselves.

use super::tiles::batches;
use crate::film::{FeatureSet, PixelSample};
use crate::integrators::camera_samples::{CameraSampler, Scratch};
use crate::integrators::path::CameraSample;
use crate::integrators::{PathStats, PathTracer, Tracer};
use crate::scene::RenderJob;
use crate::settings::IntegratorSettings;
use lumiris_numbers::math::Rgb;
use lumiris_numbers::math::hash::pcg4d;
use std::ops::Range;

/// Combined with the seed of the samples to give the seed of emission rays.
const SEED: u32 = 0x6c_6f_6f_6b;

/// Traces emission rays. Holds the buffers of one worker.
#[derive(Default)]
pub(super) struct Looks {
    tracer: PathTracer,
    split: Vec<Split>,
    samples: Vec<CameraSample>,
    results: Vec<PixelSample>,
    scratch: Scratch,
}

/// A sample with more than one emission ray.
struct Split {
    /// Index of the sample in the batch.
    of_batch: usize,
    pixel: [u32; 2],
    /// Index of the sample in its pixel.
    sample: u32,
    looks: u32,
}

impl Split {
    /// Indices of the additional rays. They repeat after about 10⁷ samples.
    fn others(&self) -> Range<u32> {
        let first = self.sample.wrapping_mul(self.looks - 1) & (u32::MAX >> 1);
        first..first + self.looks - 1
    }
}

impl Looks {
    /// For a tracer with the given number of light-group layers.
    pub(super) fn new(light_layers: usize) -> Self {
        let mut tracer = PathTracer::new(FeatureSet::None);
        tracer.keep_light_layers(light_layers);
        Looks { tracer, ..Looks::default() }
    }

    /// Replaces the emission in the results of a batch by the mean over all emission rays of the sample, in the total
    /// and in each light-group layer. `pixels` lists the pixels in the order of the samples, with the indices of their
    /// samples. `seed` is the seed of the samples.
    pub(super) fn replace(
        &mut self,
        (job, camera): (&RenderJob, &CameraSampler<'_>),
        (samples, seed): (&[CameraSample], u32),
        pixels: impl Iterator<Item = ([u32; 2], Range<u32>)>,
        (found, layers): (&mut [PixelSample], &mut [Rgb]),
    ) {
        let Some(of_pixels) = job.pixel_samples.as_ref().filter(|of_pixels| !of_pixels.looks.is_empty()) else {
            return;
        };

        // List the samples with additional rays
        let settings = IntegratorSettings { max_depth: 0, ..job.settings().integrator };
        let seed = pcg4d([seed, SEED, 0, 0])[0];
        self.split.clear();
        let mut first = 0;
        for (pixel, samples) in pixels {
            let (looks, count) = (of_pixels.looks(pixel), samples.len());
            if looks > 1 {
                let split = |(k, sample)| Split { of_batch: first + k, pixel, sample, looks };
                self.split.extend(samples.enumerate().map(split));
            }
            first += count;
        }

        // Trace their rays in batches: additional rays first, then each sample's own
        let all = std::mem::take(&mut self.split);
        for part in batches(0..all.len() as u32, |i| all[i as usize].looks as usize) {
            let part = &all[part.start as usize..part.end as usize];
            self.samples.clear();
            let others = part.iter().map(|split| (0, split.pixel, split.others()));
            camera.samples(others, seed, &mut self.scratch, &mut self.samples);
            self.samples.extend(part.iter().map(|split| samples[split.of_batch]));
            self.tracer.trace(job, &settings, &self.samples, &mut Default::default(), &mut self.results);

            // Replace the emission in the results and in the layers
            let results = &self.results;
            exchange(part, |look| results[look].radiance, found, |found, i| &mut found[i].radiance);
            let seen = self.tracer.light_layers();
            let count = seen.len() / self.samples.len().max(1);
            for layer in 0..count {
                exchange(part, |look| seen[look * count + layer], layers, |layers, i| &mut layers[i * count + layer]);
            }
        }
        self.split = all;
    }

    /// Counts and times since the last call.
    pub(super) fn take_stats(&mut self) -> PathStats {
        Tracer::take_stats(&mut self.tracer)
    }
}

/// Replaces the emission of samples by the mean over their emission rays. `seen` is the emission of a ray; `at`
/// accesses the value of a sample in `found`. A batch has the additional rays first, sample by sample, then each
/// sample's own.
fn exchange<T: ?Sized>(
    part: &[Split],
    seen: impl Fn(usize) -> Rgb,
    found: &mut T,
    at: impl Fn(&mut T, usize) -> &mut Rgb,
) {
    let others = |split: &Split| split.looks as usize - 1;
    let (mut first, own) = (0, part.iter().map(others).sum::<usize>());
    for (i, split) in part.iter().enumerate() {
        let others = first..first + others(split);
        first = others.end;
        let own = seen(own + i);
        let sum = others.fold(own, |sum, look| sum + seen(look));
        let found = at(found, split.of_batch);
        *found = *found - own + sum / split.looks as f32;
    }
}
