//! Light-group layers: per-group sums of the radiance of the samples of a batch.
//!
//! Every contribution to a sample comes from one light: emission hit by a path, a light sample, or a BSDF sample. The
//! exception is a ray that escapes, which receives the sum of all infinite lights; this radiance is divided among them
//! in proportion to their emission.

use super::exclusions::{self, Feature};
use crate::accel::Hit;
use crate::lights::{JobLights, LightId};
use crate::scene::RenderJob;
use lumiris_numbers::math::{Rgb, Vec3};

/// Names of the light-group layers of the image.
pub fn names(job: &RenderJob) -> &[String] {
    let is_kept = job.settings().integrator.light_groups && exclusions::allows(job, Feature::LightGroups);
    if is_kept { job.lights.layers.names() } else { &[] }
}

/// Number of light-group layers of the image.
pub fn count(job: &RenderJob) -> usize {
    names(job).len()
}

/// Per-group sums of the samples of a batch. Contributions are appended to a list for each layer and summed at the end:
/// sums by sample and layer would not fit in the cache of a core.
#[derive(Debug, Default)]
pub struct LayerSums {
    /// Contributions by layer, in the order of their computation. Empty if layers are disabled.
    layers: Vec<Vec<SampleLight>>,
    /// Sum by sample. Black, except while a layer is summed.
    sums: Vec<Rgb>,
}

/// Radiance of a light-group layer in a sample.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SampleLight {
    /// Index of the sample in the batch.
    pub sample: u32,
    /// The radiance.
    pub radiance: Rgb,
}

impl LayerSums {
    /// Sums for `layers` layers from the next batch on.
    pub(super) fn keep(&mut self, layers: usize) {
        *self = LayerSums { layers: vec![Vec::new(); layers], ..LayerSums::default() };
    }

    /// Begins a batch of `samples` camera samples.
    pub(super) fn begin(&mut self, samples: usize) {
        self.layers.iter_mut().for_each(Vec::clear);
        self.sums.resize(samples, Rgb::BLACK);
    }

    /// True if layers are enabled.
    #[inline]
    pub(super) fn are_kept(&self) -> bool {
        !self.layers.is_empty()
    }

    /// Number of layers.
    pub fn count(&self) -> usize {
        self.layers.len()
    }

    /// The sums of a layer that are not black, in any order, each sample once. Contributions may be added afterwards.
    pub fn sums(&mut self, layer: usize) -> &[SampleLight] {
        let LayerSums { layers, sums } = self;
        let light = &mut layers[layer];
        light.iter().for_each(|light| sums[light.sample as usize] += light.radiance);

        // The first contribution of a sample becomes its sum
        light.retain_mut(|light| {
            light.radiance = std::mem::replace(&mut sums[light.sample as usize], Rgb::BLACK);
            !light.radiance.is_black()
        });
        light
    }

    /// Adds radiance to a layer of a sample.
    #[inline]
    pub fn add_to(&mut self, layer: usize, sample: u32, radiance: Rgb) {
        self.layers[layer].push(SampleLight { sample, radiance });
    }

    /// Adds the contribution `value` of a light to a sample, at the point `p`. `wi` is the unit direction to the light.
    #[inline]
    pub(super) fn add(&mut self, lights: &JobLights, sample: u32, light: LightId, p: Vec3, wi: Vec3, value: Rgb) {
        if !self.are_kept() || value.is_black() {
            return;
        }
        if lights.infinite.len() > 1 && lights.infinite.contains(&light) {
            return self.add_infinite(lights, sample, p, wi, value);
        }
        self.add_to(lights.layers.of(light) as usize, sample, value);
    }

    /// Adds surface emission that a path has hit.
    #[inline]
    pub(super) fn add_emission(&mut self, job: &RenderJob, sample: u32, hit: &Hit, value: Rgb) {
        if !self.are_kept() || value.is_black() {
            return;
        }
        if let Some(light) = job.lights.light_of(hit.geometry, hit.primitive) {
            self.add_to(job.lights.layers.of(light) as usize, sample, value);
        }
    }

    /// Adds the sum of all infinite lights at `p` from the direction `wi`, divided among their layers.
    #[inline]
    pub(super) fn add_infinite(&mut self, lights: &JobLights, sample: u32, p: Vec3, wi: Vec3, value: Rgb) {
        if !self.are_kept() || value.is_black() {
            return;
        }
        if let [light] = lights.infinite[..] {
            self.add_to(lights.layers.of(light) as usize, sample, value);
            return;
        }
        let whole = lights.le(p, wi);
        for &light in &lights.infinite {
            let le = lights.lights[light as usize].le(p, wi);
            let share = |c: usize| if whole[c] == 0.0 { 0.0 } else { value[c] * (le[c] / whole[c]) };
            self.add_to(lights.layers.of(light) as usize, sample, Rgb::new(share(0), share(1), share(2)));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_batch_forgets_the_sums_of_the_last_one() {
        let mut sums = LayerSums::default();
        let light = |sample, radiance| SampleLight { sample, radiance: Rgb::splat(radiance) };
        sums.keep(3);
        sums.begin(4);
        for (sample, layer) in [(0, 2), (3, 1), (0, 2), (3, 2), (2, 0)] {
            sums.add_to(layer, sample, Rgb::splat(0.5));
        }
        assert_eq!([0, 1, 2].map(|layer| sums.sums(layer).len()), [1, 1, 2]);
        assert_eq!(sums.sums(2), [light(0, 1.0), light(3, 0.5)]);

        // Further contributions, and sums that become black
        sums.add_to(2, 3, Rgb::splat(-0.5));
        sums.add_to(2, 0, Rgb::splat(0.25));
        assert_eq!(sums.sums(2), [light(0, 1.25)]);
        sums.begin(2);
        sums.add_to(1, 1, Rgb::splat(0.25));
        assert_eq!([0, 1, 2].map(|layer| sums.sums(layer).len()), [0, 1, 0]);
        assert_eq!(sums.sums(1), [light(1, 0.25)]);
    }
}
