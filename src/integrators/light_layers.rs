//! What the samples of a batch find of each light group.
//!
//! Every contribution to a sample is of one light: what a path meets, and what a light sample or a BSDF sample brings. Only
//! directions that meet nothing are of all infinite lights together; their light is divided by what each of them sends.

use super::features::{self, Feature};
use crate::accel::Hit;
use crate::lights::{LightId, LightSampling};
use crate::scene::RenderJob;
use lumiris_numbers::math::{Rgb, Vec3};

/// Names of the layers by lights that a rendering has.
pub fn names(job: &RenderJob) -> &[String] {
    let is_kept = job.settings().integrator.light_groups && features::allows(job, Feature::LightGroups);
    if is_kept { job.lights.layers.names() } else { &[] }
}

/// Number of these layers.
pub fn count(job: &RenderJob) -> usize {
    names(job).len()
}

/// The light of each layer that the samples of a batch find.
#[derive(Debug, Default)]
pub(super) struct LayerSums {
    /// Number of layers; 0: none are kept.
    pub(super) layers: usize,
    /// By sample, then by layer.
    sums: Vec<Rgb>,
}

impl LayerSums {
    /// Begins a batch of samples.
    pub(super) fn begin(&mut self, samples: usize) {
        self.sums.clear();
        self.sums.resize(samples * self.layers, Rgb::BLACK);
    }

    /// True if there are any.
    #[inline]
    pub(super) fn are_kept(&self) -> bool {
        self.layers > 0
    }

    /// By sample, then by layer.
    pub(super) fn sums(&mut self) -> &mut [Rgb] {
        &mut self.sums
    }

    /// Adds what a sample has of a light at the point `p`. `wi` is the direction to it, unit.
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

    /// Adds what a sample has of the emission of a surface.
    #[inline]
    pub(super) fn add_emission(&mut self, job: &RenderJob, sample: u32, hit: &Hit, value: Rgb) {
        if !self.are_kept() || value.is_black() {
            return;
        }
        if let Some(light) = job.lights.light_of(hit.geometry, hit.primitive) {
            self.sums[sample as usize * self.layers + job.lights.layers.of(light)] += value;
        }
    }

    /// Adds what a sample has of all infinite lights together, at `p` from the direction `wi`.
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
