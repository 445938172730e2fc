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

/// Per-group sums of the samples of a batch. Only samples and layers with light have an entry.
#[derive(Debug, Default)]
pub struct LayerSums {
    /// Number of layers; 0 if disabled.
    layers: usize,
    entries: Vec<LayerSum>,
    /// Index of the entry by sample, then by layer. Valid if that entry has this sample and layer, so that a batch
    /// begins without clearing all indices.
    indices: Vec<u32>,
}

/// Sum of the radiance of a light-group layer in a sample.
#[derive(Clone, Copy, Debug)]
pub struct LayerSum {
    /// Index of the sample in the batch.
    pub sample: u32,
    /// The layer.
    pub layer: u32,
    /// The sum.
    pub radiance: Rgb,
}

impl LayerSums {
    /// Sums for `layers` layers from the next batch on.
    pub(super) fn keep(&mut self, layers: usize) {
        *self = LayerSums { layers, ..LayerSums::default() };
    }

    /// Begins a batch of `samples` camera samples.
    pub(super) fn begin(&mut self, samples: usize) {
        self.entries.clear();
        if self.indices.len() < samples * self.layers {
            self.indices.resize(samples * self.layers, 0);
        }
    }

    /// True if layers are enabled.
    #[inline]
    pub(super) fn are_kept(&self) -> bool {
        self.layers > 0
    }

    /// The sums of the last batch that are not known to be black, in any order, each layer of a sample once.
    pub fn entries(&self) -> &[LayerSum] {
        &self.entries
    }

    /// Position of a sum in `indices`.
    #[inline]
    fn position(&self, sample: u32, layer: u32) -> usize {
        sample as usize * self.layers + layer as usize
    }

    /// Index of the entry of a sum, unless it is black.
    #[inline]
    fn find(&self, sample: u32, layer: u32) -> Option<usize> {
        let index = self.indices[self.position(sample, layer)] as usize;
        let is_here = |entry: &LayerSum| (entry.sample, entry.layer) == (sample, layer);
        self.entries.get(index).is_some_and(is_here).then_some(index)
    }

    /// The sum of a layer in a sample.
    pub fn of(&self, sample: u32, layer: u32) -> Rgb {
        self.find(sample, layer).map_or(Rgb::BLACK, |index| self.entries[index].radiance)
    }

    /// The sum of a layer in a sample, to be changed.
    #[inline]
    pub fn at(&mut self, sample: u32, layer: u32) -> &mut Rgb {
        let index = self.find(sample, layer).unwrap_or_else(|| {
            let position = self.position(sample, layer);
            self.indices[position] = self.entries.len() as u32;
            self.entries.push(LayerSum { sample, layer, radiance: Rgb::BLACK });
            self.entries.len() - 1
        });
        &mut self.entries[index].radiance
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
        *self.at(sample, lights.layers.of(light)) += value;
    }

    /// Adds surface emission that a path has hit.
    #[inline]
    pub(super) fn add_emission(&mut self, job: &RenderJob, sample: u32, hit: &Hit, value: Rgb) {
        if !self.are_kept() || value.is_black() {
            return;
        }
        if let Some(light) = job.lights.light_of(hit.geometry, hit.primitive) {
            *self.at(sample, job.lights.layers.of(light)) += value;
        }
    }

    /// Adds the sum of all infinite lights at `p` from the direction `wi`, divided among their layers.
    #[inline]
    pub(super) fn add_infinite(&mut self, lights: &JobLights, sample: u32, p: Vec3, wi: Vec3, value: Rgb) {
        if !self.are_kept() || value.is_black() {
            return;
        }
        if let [light] = lights.infinite[..] {
            *self.at(sample, lights.layers.of(light)) += value;
            return;
        }
        let whole = lights.le(p, wi);
        for &light in &lights.infinite {
            let le = lights.lights[light as usize].le(p, wi);
            let share = |c: usize| if whole[c] == 0.0 { 0.0 } else { value[c] * (le[c] / whole[c]) };
            *self.at(sample, lights.layers.of(light)) += Rgb::new(share(0), share(1), share(2));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_batch_forgets_the_sums_of_the_last_one() {
        let mut sums = LayerSums::default();
        sums.keep(3);
        sums.begin(4);
        for (sample, layer) in [(0, 2), (3, 1), (0, 2), (2, 0)] {
            *sums.at(sample, layer) += Rgb::splat(0.5);
        }
        assert_eq!(sums.entries().len(), 3);
        assert_eq!([(0, 2), (3, 1), (1, 2)].map(|(sample, layer)| sums.of(sample, layer).r), [1.0, 0.5, 0.0]);
        sums.begin(2);
        *sums.at(1, 1) += Rgb::splat(0.25);
        assert_eq!([(0, 2), (1, 1)].map(|(sample, layer)| sums.of(sample, layer).r), [0.0, 0.25]);
        assert_eq!(sums.entries().len(), 1);
    }
}
