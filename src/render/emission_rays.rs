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
use crate::integrators::camera_samples::{CameraSampler, PixelSampleRange, Scratch};
use crate::integrators::light_layers::LayerSums;
use crate::integrators::path::CameraSample;
use crate::integrators::{PathStats, PathTracer, Tracer};
use crate::settings::IntegratorSettings;
use lumiris_numbers::math::Rgb;
use lumiris_numbers::math::hash::pcg4d;
use std::ops::Range;

/// Combined with the seed of the samples to give the seed of emission rays.
const SEED: u32 = 0x6c_6f_6f_6b;

/// Traces emission rays. Holds the buffers of one worker.
#[derive(Default)]
pub(super) struct EmissionRays {
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
    rays: u32,
}

impl Split {
    /// Indices of the additional rays. They repeat after about 10⁷ samples.
    fn others(&self) -> Range<u32> {
        let first = self.sample.wrapping_mul(self.rays - 1) & (u32::MAX >> 1);
        first..first + self.rays - 1
    }
}

impl EmissionRays {
    /// For a tracer with the given number of light-group layers.
    pub(super) fn new(light_layers: usize) -> Self {
        let mut tracer = PathTracer::new(FeatureSet::None);
        tracer.keep_light_layers(light_layers);
        EmissionRays { tracer, ..EmissionRays::default() }
    }

    /// Replaces the emission in the results of a batch by the mean over all emission rays of the sample, in the total
    /// and in each light-group layer. `pixels` lists the pixels in the order of the samples, with the indices of their
    /// samples. `seed` is the seed of the samples.
    pub(super) fn replace(
        &mut self,
        camera: &CameraSampler<'_>,
        samples: &[CameraSample],
        seed: u32,
        pixels: impl Iterator<Item = PixelSampleRange>,
        out: &mut [PixelSample],
        mut layers: Option<&mut LayerSums>,
    ) {
        let job = camera.job();
        let Some(of_pixels) = job.pixel_samples.as_ref().filter(|of_pixels| !of_pixels.emission_rays.is_empty()) else {
            return;
        };

        // List the samples with additional rays
        let settings = IntegratorSettings { max_depth: 0, ..job.settings().integrator };
        let seed = pcg4d([seed, SEED, 0, 0])[0];
        self.split.clear();
        let mut first = 0;
        for PixelSampleRange { pixel, samples, .. } in pixels {
            let (rays, count) = (of_pixels.emission_rays(pixel), samples.len());
            if rays > 1 {
                let split = |(k, sample)| Split { of_batch: first + k, pixel, sample, rays };
                self.split.extend(samples.enumerate().map(split));
            }
            first += count;
        }

        // Trace their rays in batches: additional rays first, then each sample's own
        let all = std::mem::take(&mut self.split);
        for part in batches(0..all.len() as u32, |i| all[i as usize].rays as usize) {
            let part = &all[part.start as usize..part.end as usize];
            self.samples.clear();
            let others =
                part.iter().map(|split| PixelSampleRange { fit: 0, pixel: split.pixel, samples: split.others() });
            camera.samples(others, seed, &mut self.scratch, &mut self.samples);
            self.samples.extend(part.iter().map(|split| samples[split.of_batch]));
            self.tracer.trace(job, &settings, &self.samples, &mut Default::default(), &mut self.results);

            // Replace the emission in the results
            let results = &self.results;
            let rays = rays(part);
            for (split, (own, others)) in part.iter().zip(&rays) {
                let radiance = &mut out[split.of_batch].radiance;
                *radiance = exchanged(*radiance, (*own, others), |ray| results[ray as usize].radiance);
            }

            // Replace it in the layers that any ray of a sample meets
            let (Some(layers), Some(seen)) = (layers.as_deref_mut(), self.tracer.light_layers()) else { continue };
            let mut split_of_ray = vec![0; samples_of(part)];
            for (i, (own, others)) in rays.iter().enumerate() {
                others.clone().chain([*own]).for_each(|ray| split_of_ray[ray as usize] = i);
            }
            let mut met: Vec<(usize, u32)> =
                seen.entries().iter().map(|sum| (split_of_ray[sum.sample as usize], sum.layer)).collect();
            met.sort_unstable();
            met.dedup();
            for (i, layer) in met {
                let (own, others) = &rays[i];
                let radiance = layers.at(part[i].of_batch as u32, layer);
                *radiance = exchanged(*radiance, (*own, others), |ray| seen.of(ray, layer));
            }
        }
        self.split = all;
    }

    /// Counts and times since the last call.
    pub(super) fn take_stats(&mut self) -> PathStats {
        Tracer::take_stats(&mut self.tracer)
    }
}

/// Number of emission rays of some samples.
fn samples_of(part: &[Split]) -> usize {
    part.iter().map(|split| split.rays as usize).sum()
}

/// The emission rays of some samples: the sample's own, and the additional ones. A batch has the additional rays first,
/// sample by sample, then each sample's own.
fn rays(part: &[Split]) -> Vec<(u32, Range<u32>)> {
    let (mut first, own) = (0, (samples_of(part) - part.len()) as u32);
    let of_split = |(split, own): (&Split, u32)| {
        let others = first..first + split.rays - 1;
        first = others.end;
        (own, others)
    };
    part.iter().zip(own..).map(of_split).collect()
}

/// The radiance of a sample with the mean over its emission rays in place of the emission of its own. `seen` is the
/// emission of a ray.
fn exchanged(radiance: Rgb, (own, others): (u32, &Range<u32>), seen: impl Fn(u32) -> Rgb) -> Rgb {
    let (emission, rays) = (seen(own), 1 + others.len());
    let sum = others.clone().fold(emission, |sum, ray| sum + seen(ray));
    radiance - emission + sum / rays as f32
}
