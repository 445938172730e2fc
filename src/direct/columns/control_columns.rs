//! Control variates of the estimates of a batch: means of r_j = h_j/p_α minus their expectations, for every component j
//! of the mixture.
//!
//! The columns are defined in [`crate::direct::mixture`]. Here they cover the groups of lights, and the first of two
//! lobes if BSDFs may have two; the column of the other lobe depends on these. As there, a sample with a zero
//! unshadowed integrand belongs to the component that drew it, and the density of BSDF sampling is 0 for a light sample
//! hidden by another emitter. Columns do not depend on MIS weights: a sample with the weight 0 has the densities of
//! both techniques. `render/control_variates.rs` fits their coefficients and subtracts them.

use super::emitters::EmitterRays;
use super::samples::{SampleColumns, TracedSegments};
use crate::accel::RayBatch;
use crate::direct::vertices::Vertices;
use crate::lights::sample_columns::Scratch;
use crate::scene::RenderJob;
use lumiris_numbers::estimators::ocv::MAX_COMPONENTS;
use lumiris_numbers::math::Vec3;

/// Sums of the columns of all vertices.
#[derive(Debug, Default)]
pub(super) struct ControlColumns {
    /// Groups, then the lobe.
    sums: Vec<[f32; MAX_COMPONENTS]>,
    /// Index of the lobe, if BSDFs may have two.
    lobe: Option<usize>,
    /// r_j/N of light sampling of the last sample of each vertex.
    parts: Vec<f32>,
    is_hidden: Vec<bool>,
    /// Rows without control variates.
    is_left_out: Vec<bool>,
    hidden: RayBatch,
    hidden_of: Vec<u32>,
    occluded: Vec<bool>,
}

impl ControlColumns {
    /// Begins a batch: sets the columns of each vertex to the negative expectation.
    pub(super) fn begin(&mut self, job: &RenderJob, vertices: &Vertices<'_>) {
        self.sums.clear();
        self.sums.resize(vertices.len(), [0.0; MAX_COMPONENTS]);
        self.is_left_out.clear();
        self.is_left_out.resize(vertices.len(), false);

        // Groups of lights
        let (lights, at) = (&job.lights, vertices.surface.lit_points());
        if let Some(light) = lights.sampler.only_light() {
            let group = lights.groups.group_of(light).unwrap_or(0);
            self.sums.iter_mut().for_each(|sums| sums[group] = -1.0);
        } else {
            for (i, sums) in self.sums.iter_mut().enumerate() {
                let pmfs = lights.groups.pmfs(&lights.sampler, &at.get(i));
                sums.iter_mut().zip(pmfs).for_each(|(sum, pmf)| *sum = -pmf);
            }
        }

        // Lobe
        self.lobe = job.has_two_lobes().then(|| lights.groups.len());
        if let Some(lobe) = self.lobe {
            for (i, bsdf) in vertices.bsdfs.iter().enumerate() {
                self.sums[i][lobe] = -bsdf.first_lobe(vertices.surface.wo.vec3(i));
            }
        }
    }

    /// Adds a traced light sample of each vertex. `n_light` and `n_bsdf` are the sample counts of the techniques.
    pub(super) fn add_light_samples(
        &mut self,
        job: &RenderJob,
        [n_light, n_bsdf]: [f32; 2],
        samples: &SampleColumns,
        traced: &TracedSegments,
        scratch: &Scratch,
        vertices: &Vertices<'_>,
    ) {
        self.find_hidden(job, samples, traced);
        self.divide([n_light, n_bsdf], samples, true);
        for (&i, _) in self.hidden_of.iter().zip(&self.occluded).filter(|(_, occluded)| **occluded) {
            self.parts[i as usize] = 1.0 / n_light;
        }

        // Groups of lights
        let groups = &job.lights.groups;
        let group_of_only = job.lights.sampler.only_light().map(|light| groups.group_of(light));
        for (i, (sums, part)) in self.sums.iter_mut().zip(&self.parts).enumerate() {
            if let Some(group) = group_of_only.unwrap_or_else(|| groups.group_of(scratch.chosen(i))) {
                sums[group] += part;
            }
        }

        // Lobe
        let Some(lobe) = self.lobe else { return };
        for (i, bsdf) in vertices.bsdfs.iter().enumerate() {
            let (p_light, p_bsdf) = (samples.incident.pdf[i], samples.bsdf.pdf[i]);
            if !self.is_hidden[i] && samples.has_integrand(i, true) && p_bsdf > 0.0 {
                let wo = vertices.surface.wo.vec3(i);
                let p_lobe = bsdf.pdf_first_lobe(wo, samples.incident.wi.vec3(i), p_bsdf);
                self.sums[i][lobe] += p_lobe / (n_light * p_light + n_bsdf * p_bsdf);
            }
        }
    }

    /// Adds a traced BSDF sample of each vertex.
    pub(super) fn add_bsdf_samples(
        &mut self,
        job: &RenderJob,
        [n_light, n_bsdf]: [f32; 2],
        samples: &SampleColumns,
        emitters: &EmitterRays,
        vertices: &Vertices<'_>,
    ) {
        // Groups of lights; rays that hit nothing belong to the group of the infinite lights
        self.divide([n_light, n_bsdf], samples, false);
        let groups = &job.lights.groups;
        let infinite = job.lights.infinite.iter().find_map(|l| groups.group_of(*l));
        for ((sums, part), light) in self.sums.iter_mut().zip(&self.parts).zip(&emitters.lights) {
            if *part > 0.0
                && let Some(group) = light.map_or(infinite, |light| groups.group_of(light))
            {
                sums[group] += part;
            }
        }

        // Lobe
        self.add_lobes([n_light, n_bsdf], samples, vertices);
    }

    /// Sets the parts of light sampling in samples of one technique. A sample with a zero integrand belongs to its own
    /// technique.
    fn divide(&mut self, [n_light, n_bsdf]: [f32; 2], samples: &SampleColumns, by_light: bool) {
        let n = self.sums.len();
        self.parts.resize(n, 0.0);
        let alone = if by_light { 1.0 / n_light } else { 0.0 };
        let (p_light, p_bsdf) = (&samples.incident.pdf[..n], &samples.bsdf.pdf[..n]);
        for (i, part) in self.parts.iter_mut().enumerate() {
            let own = p_light[i] / (n_light * p_light[i] + n_bsdf * p_bsdf[i]);
            *part = if samples.has_integrand(i, by_light) & (p_light[i] > 0.0) { own } else { alone };
        }
    }

    /// Adds the column of the first lobe for a BSDF sample of each vertex.
    fn add_lobes(&mut self, [n_light, n_bsdf]: [f32; 2], samples: &SampleColumns, vertices: &Vertices<'_>) {
        let Some(lobe) = self.lobe else { return };
        for (i, bsdf) in vertices.bsdfs.iter().enumerate() {
            let wo = vertices.surface.wo.vec3(i);
            let is_first = samples.u[0][i] < bsdf.first_lobe(wo);
            let (p_light, p_bsdf) = (samples.incident.pdf[i], samples.bsdf.pdf[i]);
            let is_own = !samples.has_integrand(i, false);
            self.sums[i][lobe] += if is_own || samples.incident.is_delta[i] {
                if is_first { 1.0 / n_bsdf } else { 0.0 }
            } else {
                let wi: Vec3 = samples.incident.wi.vec3(i);
                bsdf.pdf_first_lobe(wo, wi, p_bsdf) / (n_light * p_light + n_bsdf * p_bsdf)
            };
        }
    }

    /// Excludes rows with a different allocation from control variates.
    pub(super) fn leave_out(&mut self, rows: impl Iterator<Item = usize>) {
        rows.for_each(|i| self.is_left_out[i] = true);
    }

    /// The controls of a vertex; only the first components are used.
    pub(super) fn of(&self, i: usize) -> &[f32; MAX_COMPONENTS] {
        if self.is_left_out[i] { &[0.0; MAX_COMPONENTS] } else { &self.sums[i] }
    }

    /// Determines which light samples that BSDF sampling could draw as well are hidden by another emitter.
    fn find_hidden(&mut self, job: &RenderJob, samples: &SampleColumns, traced: &TracedSegments) {
        self.is_hidden.clear();
        self.is_hidden.resize(self.sums.len(), false);
        self.hidden_of.clear();
        if !job.world.emitters_hide() {
            return;
        }
        self.hidden.clear();
        for (k, &i) in traced.rows.iter().enumerate() {
            if traced.occluded[k] && samples.bsdf.pdf[i as usize] > 0.0 {
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
