//! Emission rays: additional camera rays that measure only the emission of visible lights, at pixels where it dominates
//! the noise.
//!
//! The emission that a camera ray meets has another variance than the light gathered by its path, at a far lower cost.
//! At the edge of a lamp it causes nearly all of the variance. There the sample is *split* [Arvo and Kirk 1990] into
//! several camera rays, one of which continues as a path. Let e be the emission met by that ray and e_i the emission
//! met by the m − 1 others. The sample f becomes f − e + (e + Σ e_i)/m, which has the same expected value. The number m
//! follows from a pilot ([`crate::planning::allocation`]), never from the samples themselves. `worker` traces these
//! rays after each batch.

use super::tiles::batches;
use crate::film::{FeatureSet, PixelSample};
use crate::integrators::CameraSamples;
use crate::integrators::camera_sampler::{CameraSampler, PixelSampleRange, Scratch};
use crate::integrators::light_layers::LayerSums;
use crate::integrators::{PathStats, PathTracer, Tracer};
use crate::scene::PixelSamples;
use crate::settings::IntegratorSettings;
use lumiris_numbers::math::Rgb;
use lumiris_numbers::math::hash::pcg4d;
use std::collections::BTreeSet;
use std::ops::Range;

/// Combined with the seed of the samples to give the seed of emission rays.
const SEED: u32 = 0x6c_6f_6f_6b;

/// Traces emission rays. Holds the buffers of one worker.
#[derive(Default)]
pub(super) struct EmissionRays {
    tracer: PathTracer,
    samples: CameraSamples,
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
        samples: &CameraSamples,
        seed: u32,
        pixels: impl Iterator<Item = PixelSampleRange>,
        out: &mut [PixelSample],
        mut layers: Option<&mut LayerSums>,
    ) {
        let job = camera.job();
        let Some(of_pixels) = job.pixel_samples.as_ref().filter(|of_pixels| !of_pixels.emission_rays.is_empty()) else {
            return;
        };

        // Trace the rays of the samples with additional rays, in batches
        let settings = IntegratorSettings { max_depth: 0, ..job.settings().integrator };
        let seed = pcg4d([seed, SEED, 0, 0])[0];
        let split = split_samples(of_pixels, pixels);
        for part in batches(0..split.len() as u32, |i| split[i as usize].rays as usize) {
            let part = &split[part.start as usize..part.end as usize];
            let others =
                part.iter().map(|split| PixelSampleRange { fit: 0, pixel: split.pixel, samples: split.others() });
            camera.samples(others, seed, &mut self.scratch, &mut self.samples);
            self.samples.extend(part.iter().map(|split| samples.get(split.of_batch)));
            self.samples.are_replicas = samples.are_replicas;
            self.tracer.trace(job, &settings, &self.samples, &mut Default::default(), &mut self.results);

            // Replace the emission in the results
            let rays = rays(part);
            for (split, rays) in part.iter().zip(&rays) {
                let Emission { own, mean } = rays.emission(|ray| self.results[ray as usize].radiance);
                let radiance = &mut out[split.of_batch].radiance;
                *radiance = *radiance - own + mean;
            }
            if let (Some(layers), Some(met)) = (layers.as_deref_mut(), self.tracer.light_layers()) {
                replace_in_layers(part, &rays, met, layers);
            }
        }
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

/// Replaces the emission in each layer that any ray of a sample meets. `met` has the layers of the rays.
fn replace_in_layers(part: &[Split], rays: &[Rays], met: &mut LayerSums, layers: &mut LayerSums) {
    let (mut split_of_ray, mut emission) = (vec![0; samples_of(part)], vec![Rgb::BLACK; samples_of(part)]);
    for (i, Rays { own, others }) in rays.iter().enumerate() {
        others.clone().chain([*own]).for_each(|ray| split_of_ray[ray as usize] = i);
    }
    for layer in 0..met.count() {
        let sums = met.sums(layer);
        sums.iter().for_each(|sum| emission[sum.sample as usize] = sum.radiance);
        let met_by: BTreeSet<usize> = sums.iter().map(|sum| split_of_ray[sum.sample as usize]).collect();
        for i in met_by {
            let (sample, Emission { own, mean }) =
                (part[i].of_batch as u32, rays[i].emission(|ray| emission[ray as usize]));
            layers.add_to(layer, sample, own * -1.0);
            layers.add_to(layer, sample, mean);
        }
        sums.iter().for_each(|sum| emission[sum.sample as usize] = Rgb::BLACK);
    }
}

/// The samples with more than one emission ray.
fn split_samples(of_pixels: &PixelSamples, pixels: impl Iterator<Item = PixelSampleRange>) -> Vec<Split> {
    let (mut split, mut first) = (Vec::new(), 0);
    for PixelSampleRange { pixel, samples, .. } in pixels {
        let (rays, count) = (of_pixels.emission_rays(pixel), samples.len());
        if rays > 1 {
            split.extend(samples.zip(first..).map(|(sample, of_batch)| Split { of_batch, pixel, sample, rays }));
        }
        first += count;
    }
    split
}

/// The emission rays of a sample, by their indices in a batch.
struct Rays {
    /// The ray that continues as a path.
    own: u32,
    /// The additional rays.
    others: Range<u32>,
}

/// Emission met by the emission rays of a sample.
struct Emission {
    /// By the own ray.
    own: Rgb,
    /// The mean over all rays.
    mean: Rgb,
}

impl Rays {
    /// The emission met, given the emission of a ray.
    fn emission(&self, emission_of: impl Fn(u32) -> Rgb) -> Emission {
        let (own, rays) = (emission_of(self.own), 1 + self.others.len());
        let sum = self.others.clone().fold(own, |sum, ray| sum + emission_of(ray));
        Emission { own, mean: sum / rays as f32 }
    }
}

/// The emission rays of some samples. A batch has the additional rays first, sample by sample, then each sample's own.
fn rays(part: &[Split]) -> Vec<Rays> {
    let (mut first, own) = (0, (samples_of(part) - part.len()) as u32);
    let of_split = |(split, own): (&Split, u32)| {
        let others = first..first + split.rays - 1;
        first = others.end;
        Rays { own, others }
    };
    part.iter().zip(own..).map(of_split).collect()
}
