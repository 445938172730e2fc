//! Control variates of the estimates of a batch: what each component of the mixture has of the samples, less its share.
//!
//! The means of r_j = h_j/p_α over the samples of a vertex, as in [`crate::direct::mixture`], for the groups of lights,
//! and for the first of two lobes where the BSDF may have two: the other column of the BSDF depends on these. As there, a
//! sample without a contribution belongs to the group that drew it, and the density of BSDF sampling is 0 for a light
//! sample that another emitter hides.

use super::columns::{SampleColumns, Single, Surface, Traced, others};
use super::emitters::EmitterRays;
use crate::accel::RayBatch;
use crate::lights::many::{NO_LIGHT, Scratch};
use crate::scene::RenderJob;
use lumiris_numbers::estimators::ocv::MAX_COMPONENTS;
use lumiris_numbers::math::Vec3;

/// Sums of the columns of all vertices.
#[derive(Debug, Default)]
pub(super) struct Controls {
    /// Groups, then the lobe.
    sums: Vec<[f32; MAX_COMPONENTS]>,
    /// The place of the lobe, if BSDFs may have two.
    lobe: Option<usize>,
    is_hidden: Vec<bool>,
    hidden: RayBatch,
    hidden_of: Vec<u32>,
    occluded: Vec<bool>,
}

impl Controls {
    /// Begins `n` vertices, with their columns at the negative of the expectation.
    pub(super) fn begin(&mut self, job: &RenderJob, n: usize, (surface, singles): (&Surface, &[Single<'_>])) {
        self.sums.clear();
        let (lights, at) = (&job.lights, surface.lit_points());
        self.sums.extend((0..n).map(|i| {
            let mut sums = [0.0; MAX_COMPONENTS];
            let pmfs = lights.groups.pmfs(&lights.sampler, &at.get(i));
            sums.iter_mut().zip(pmfs).for_each(|(sum, pmf)| *sum = -pmf);
            sums
        }));
        self.lobe = job.has_two_lobes().then(|| lights.groups.len());
        if let Some(lobe) = self.lobe {
            others(singles).for_each(|s| self.sums[s.index as usize][lobe] = -s.bsdf.first_lobe(s.wo));
        }
    }

    /// Adds a traced light sample of each vertex; there are `n_light` and `n_bsdf` of both techniques.
    pub(super) fn add_light_samples(
        &mut self,
        job: &RenderJob,
        [n_light, n_bsdf]: [f32; 2],
        (samples, traced, scratch): (&SampleColumns, &Traced, &Scratch),
        singles: &[Single<'_>],
    ) {
        self.find_hidden(job, samples, traced);
        let only = job.lights.sampler.only_light();
        for (i, (sums, is_hidden)) in self.sums.iter_mut().zip(&self.is_hidden).enumerate() {
            let light = only.unwrap_or_else(|| scratch.chosen(i));
            if light == NO_LIGHT {
                continue;
            }
            let Some(group) = job.lights.groups.group_of(light) else { continue };
            let (p_light, p_bsdf) = (samples.light.pdf[i], samples.p_bsdf[i]);
            let is_own = *is_hidden || samples.c.rgb(i).is_black();
            sums[group] += if is_own { 1.0 / n_light } else { p_light / (n_light * p_light + n_bsdf * p_bsdf) };
        }
        let Some(lobe) = self.lobe else { return };
        for single in others(singles) {
            let i = single.index as usize;
            let (p_light, p_bsdf) = (samples.light.pdf[i], samples.p_bsdf[i]);
            if !self.is_hidden[i] && !samples.c.rgb(i).is_black() && p_bsdf > 0.0 {
                let p_lobe = single.bsdf.pdf_first_lobe(single.wo, samples.light.wi.vec3(i), p_bsdf);
                self.sums[i][lobe] += p_lobe / (n_light * p_light + n_bsdf * p_bsdf);
            }
        }
    }

    /// Adds a traced BSDF sample of each vertex.
    pub(super) fn add_bsdf_samples(
        &mut self,
        job: &RenderJob,
        [n_light, n_bsdf]: [f32; 2],
        (samples, emitters): (&SampleColumns, &EmitterRays),
        singles: &[Single<'_>],
    ) {
        let lights = &job.lights;
        let infinite = lights.infinite.iter().find_map(|l| lights.groups.group_of(*l));
        for (i, sums) in self.sums.iter_mut().enumerate() {
            let (p_light, p_bsdf) = (samples.light.pdf[i], samples.p_bsdf[i]);
            if samples.c.rgb(i).is_black() || !(p_light > 0.0) {
                continue;
            }
            let group = emitters.lights[i].map_or(infinite, |light| lights.groups.group_of(light));
            if let Some(group) = group {
                sums[group] += p_light / (n_light * p_light + n_bsdf * p_bsdf);
            }
        }
        self.add_lobes([n_light, n_bsdf], samples, singles);
    }

    /// Adds the part of the first lobe in a BSDF sample of each vertex.
    fn add_lobes(&mut self, [n_light, n_bsdf]: [f32; 2], samples: &SampleColumns, singles: &[Single<'_>]) {
        let Some(lobe) = self.lobe else { return };
        for single in others(singles) {
            let i = single.index as usize;
            let is_first = samples.u[0][i] < single.bsdf.first_lobe(single.wo);
            let (p_light, p_bsdf) = (samples.light.pdf[i], samples.p_bsdf[i]);
            let is_own = samples.c.rgb(i).is_black();
            self.sums[i][lobe] += if is_own || samples.light.is_delta[i] {
                if is_first { 1.0 / n_bsdf } else { 0.0 }
            } else {
                let wi: Vec3 = samples.light.wi.vec3(i);
                single.bsdf.pdf_first_lobe(single.wo, wi, p_bsdf) / (n_light * p_light + n_bsdf * p_bsdf)
            };
        }
    }

    /// The controls of a vertex, of which the first ones are there.
    pub(super) fn of(&self, i: usize) -> &[f32; MAX_COMPONENTS] {
        &self.sums[i]
    }

    /// Determines which samples of light that BSDF sampling could draw as well are hidden by another emitter.
    fn find_hidden(&mut self, job: &RenderJob, samples: &SampleColumns, traced: &Traced) {
        self.is_hidden.clear();
        self.is_hidden.resize(self.sums.len(), false);
        if !job.world.emitters_hide() {
            return;
        }
        self.hidden.clear();
        self.hidden_of.clear();
        for (k, &i) in traced.index.iter().enumerate() {
            if traced.occluded[k] && samples.p_bsdf[i as usize] > 0.0 {
                self.hidden.push(&traced.rays.get(k));
                self.hidden_of.push(i);
            }
        }
        job.world.occluded_by_emitters(&self.hidden, &mut self.occluded);
        for (&i, _) in self.hidden_of.iter().zip(&self.occluded).filter(|(_, occluded)| **occluded) {
            self.is_hidden[i as usize] = true;
        }
    }
}
