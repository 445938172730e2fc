//! Common code of `ocv` and `optimal-mis`: samples of a mixture of densities, the component densities of each sample,
//! and the sums of the normal equations.

use super::candidates::{Candidates, SampleAllocation, SampledBy};
use super::mixture::{Mixture, draw_groups};
use super::point::ShadingPoint;
use super::shadow_segments::Segments;
use super::t1::{T1, choice_by_sampler};
use crate::accel::RayBatch;
use crate::scene::RenderJob;
use lumiris_numbers::estimators::ocv::NormalEquations;
use lumiris_numbers::math::Rgb;

/// The mixtures of a batch, and their normal equations.
#[derive(Debug)]
pub(super) struct Components {
    /// Layout of `sums`.
    pub equations: NormalEquations,
    /// The mixture of each point.
    pub mixtures: Vec<Mixture>,
    /// Normal equations of each point in the columns r_j, as sums over samples.
    pub sums: Vec<f32>,
    /// Coefficients fitted to these sums.
    pub beta: Vec<f32>,
    is_free: Vec<bool>,
    hidden: RayBatch,
    hidden_of: Vec<u32>,
    is_hidden: Vec<bool>,
}

impl Default for Components {
    fn default() -> Self {
        let (mixtures, sums, beta, is_free, hidden, hidden_of, is_hidden) = Default::default();
        let equations = NormalEquations::new(0);
        Components { equations, mixtures, sums, beta, is_free, hidden, hidden_of, is_hidden }
    }
}

impl Components {
    /// T1: light samples by group, and BSDF samples.
    pub(super) fn propose(&mut self, t1: &mut T1<'_>, allocate: impl Fn(&ShadingPoint<'_>) -> SampleAllocation) {
        self.mixtures.clear();
        t1.draw_lights(&allocate, |job, index, point, allocation, records| {
            self.mixtures.push(draw_groups(job, index, point, allocation, records));
            allocation.light_draws
        });
        t1.draw_bsdf(allocate, &mut self.mixtures, choice_by_sampler(t1.job));
    }

    /// Accumulates the normal equations of each point from its traced candidates.
    pub(super) fn sum(&mut self, job: &RenderJob, candidates: &mut Candidates, segments: &Segments) {
        self.find_hidden(job, candidates, segments);
        let equations = NormalEquations::new(job.components());
        self.equations = equations;
        let (m, len) = (equations.components(), equations.len());

        // Candidates; y = 0 if occluded
        self.sums.clear();
        self.sums.resize(self.mixtures.len() * len, 0.0);
        let traced = candidates.records.iter().zip(&candidates.contributions).zip(&self.is_free);
        for ((c, contribution), &is_free) in traced {
            let mixture = &self.mixtures[c.point as usize];
            let y = if is_free { *contribution * mixture.n } else { Rgb::BLACK };
            let sums = &mut self.sums[c.point as usize * len..][..len];
            equations.add_sparse(sums, mixture.columns(c).as_slice(), y.to_array());
        }

        // Zero-valued and failed samples
        for (mixture, sums) in self.mixtures.iter().zip(self.sums.chunks_mut(len)) {
            for (component, &count) in mixture.zero_valued[..m].iter().enumerate().filter(|(_, count)| **count > 0) {
                equations.add_zeros(sums, component, mixture.zero_column(component), count);
            }
            equations.add_zeros(sums, 0, 0.0, mixture.failed);
        }
    }

    /// Determines the visibility of the samples. Sets the density of BSDF sampling to zero for samples hidden by an
    /// emitter.
    fn find_hidden(&mut self, job: &RenderJob, candidates: &mut Candidates, segments: &Segments) {
        self.is_free.clear();
        self.is_free.extend(segments.are_free(&candidates.contributions));
        self.hidden.clear();
        self.hidden_of.clear();
        for (i, (c, &is_free)) in candidates.records.iter().zip(&self.is_free).enumerate() {
            if !is_free && c.sampled_by == SampledBy::Light && c.p_bsdf > 0.0 && job.world.emitters_hide() {
                self.hidden.push(&c.segment);
                self.hidden_of.push(i as u32);
            }
        }
        candidates.stats.emitter_rays += self.hidden.len() as u64;
        job.world.occluded_by_emitters(&self.hidden, &mut self.is_hidden);
        for (&i, _) in self.hidden_of.iter().zip(&self.is_hidden).filter(|(_, is_hidden)| **is_hidden) {
            let c = &mut candidates.records[i as usize];
            (c.p_bsdf, c.p_lobe) = (0.0, 0.0);
        }
    }
}
