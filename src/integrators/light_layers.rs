//! Light-group layers: per-group sums of the radiance of the samples of a batch.
//!
//! Every contribution to a sample comes from one light: emission hit by a path, a light sample, or a BSDF sample. The
//! exception is a ray that escapes, which receives the sum of all infinite lights; this radiance is divided among them
//! in proportion to their emission.

use super::features::{self, Feature};
use crate::accel::Hit;
use crate::lights::{LightId, LightSampling};
use crate::scene::RenderJob;
use lumiris_numbers::math::{Rgb, Vec3};

/// Names of the light-group layers of the image.
pub fn names(job: &RenderJob) -> &[String] {
    let is_kept = job.settings().integrator.light_groups && features::allows(job, Feature::LightGroups);
    if is_kept { job.lights.layers.names() } else { &[] }
}

/// Number of light-group layers of the image.
pub fn count(job: &RenderJob) -> usize {
    names(job).len()
}

/// Per-group sums of the samples of a batch.
#[derive(Debug, Default)]
pub(super) struct LayerSums {
    /// Number of layers; 0 if disabled.
    pub(super) layers: usize,
    /// By sample, then by layer.
    sums: Vec<Rgb>,
}

impl LayerSums {
    /// Begins a batch of `samples` camera samples.
    pub(super) fn begin(&mut self, samples: usize) {
        self.sums.clear();
        self.sums.resize(samples * self.layers, Rgb::BLACK);
    }

    /// True if layers are enabled.
    #[inline]
    pub(super) fn are_kept(&self) -> bool {
        self.layers > 0
    }

    /// By sample, then by layer.
    pub(super) fn sums(&mut self) -> &mut [Rgb] {
        &mut self.sums
    }

    /// Adds the contribution `value` of a light to a sample, at the point `p`. `wi` is the unit direction to the light.
    #[inline]
    pub(super) fn add(
        &mut self,
        lights: &LightSampling,
        sample: u32,
        (light, p, wi): (LightId, Vec3, Vec3),
        value: Rgb,
    ) {
        if !self.are_kept() {
            return;
        }
        if lights.infinite.len() > 1 && lights.infinite.contains(&light) {
            return self.add_infinite(lights, sample, (p, wi), value);
        }
        self.sums[sample as usize * self.layers + lights.layers.of(light)] += value;
    }

    /// Adds surface emission that a path has hit.
    #[inline]
    pub(super) fn add_emission(&mut self, job: &RenderJob, sample: u32, hit: &Hit, value: Rgb) {
        if !self.are_kept() || value.is_black() {
            return;
        }
        if let Some(light) = job.lights.light_of(hit.geometry, hit.primitive) {
            self.sums[sample as usize * self.layers + job.lights.layers.of(light)] += value;
        }
    }

    /// Adds the sum of all infinite lights at `p` from the direction `wi`, divided among their layers.
    #[inline]
    pub(super) fn add_infinite(&mut self, lights: &LightSampling, sample: u32, (p, wi): (Vec3, Vec3), value: Rgb) {
        if !self.are_kept() {
            return;
        }
        let of_sample = &mut self.sums[sample as usize * self.layers..][..self.layers];
        if let [light] = lights.infinite[..] {
            of_sample[lights.layers.of(light)] += value;
            return;
        }
        let whole = lights.le(p, wi);
        for &light in &lights.infinite {
            let le = lights.lights[light as usize].le(p, wi);
            let share = |c: usize| if whole[c] == 0.0 { 0.0 } else { value[c] * (le[c] / whole[c]) };
            of_sample[lights.layers.of(light)] += Rgb::new(share(0), share(1), share(2));
        }
    }
}
