//! Looks: camera rays that see lights directly, more of them than paths where that is most of the noise.
//!
//! What a camera sample sees of lights without any bounce has another variance than the light that its path gathers, and a
//! far lower cost. At the edge of a lamp nearly all of the variance is that of the former: so the sample is *split* there
//! [Arvo and Kirk 1990] into several camera rays, of which only one becomes a path. With the emission e that its own ray
//! sees, and that of m − 1 others, the sample f becomes f − e + (e + Σ e_i)/m, which has the same expected value. How many
//! there are follows from a pilot ([`crate::planning::allocation`]) and not from the samples themselves.

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

/// Combined with the seed of the samples to give that of their looks.
const SEED: u32 = 0x6c_6f_6f_6b;

/// Traces looks; holds the buffers of one worker.
#[derive(Default)]
pub(super) struct Looks {
    tracer: PathTracer,
    split: Vec<Split>,
    samples: Vec<CameraSample>,
    results: Vec<PixelSample>,
    scratch: Scratch,
}

/// A sample that has more looks than its own.
struct Split {
    /// Its index among those of the batch.
    of_batch: usize,
    pixel: [u32; 2],
    /// Its index among those of the pixel.
    sample: u32,
    looks: u32,
}

impl Split {
    /// The indices of all looks but its own. After some 10⁷ samples they begin again.
    fn others(&self) -> Range<u32> {
        let first = self.sample.wrapping_mul(self.looks - 1) & (u32::MAX >> 1);
        first..first + self.looks - 1
    }
}

impl Looks {
    /// Beside a tracer that keeps so many layers by lights.
    pub(super) fn new(light_layers: usize) -> Self {
        let mut tracer = PathTracer::new(FeatureSet::None);
        tracer.keep_light_layers(light_layers);
        Looks { tracer, ..Looks::default() }
    }

    /// Replaces what the samples of a batch see of lights by the means over all of their looks, in what they found altogether
    /// and in their layers by lights. `pixels` are those of the samples, in the order of these, with the indices of their
    /// samples; `seed` is that of the samples.
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
        let all = std::mem::take(&mut self.split);
        for part in batches(0..all.len() as u32, |i| all[i as usize].looks as usize) {
            let part = &all[part.start as usize..part.end as usize];
            self.samples.clear();
            let others = part.iter().map(|split| (0, split.pixel, split.others()));
            camera.samples(others, seed, &mut self.scratch, &mut self.samples);
            self.samples.extend(part.iter().map(|split| samples[split.of_batch]));
            self.tracer.trace(job, &settings, &self.samples, &mut Default::default(), &mut self.results);
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

    /// The counts and times since the last call.
    pub(super) fn take_stats(&mut self) -> PathStats {
        Tracer::take_stats(&mut self.tracer)
    }
}

/// Replaces what samples see by the mean of what all of their looks do, where `at` finds what a sample has found in `found`. A
/// batch of looks has all but their own first, sample by sample, then their own.
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
