//! T1: the samples of both techniques at all points of a batch.

use super::bsdf_samples::{self, EmitterInDirection, PendingBsdf, bsdf_candidate, find_emitters};
use super::candidates::{Candidate, Candidates, SampleAllocation};
use super::domain;
use super::mixture::Mixture;
use super::point::ShadingPoint;
use crate::accel::RayBatch;
use crate::lights::{LightCtx, LightId};
use crate::scene::{EmitterHit, EmitterScratch, RenderJob};
use std::time::Instant;

/// Input and output of T1.
pub(super) struct T1<'a> {
    pub job: &'a RenderJob,
    pub points: &'a [ShadingPoint<'a>],
    pub bsdf: &'a mut BsdfBuffers,
    pub candidates: &'a mut Candidates,
}

/// Buffers of BSDF samples.
#[derive(Debug, Default)]
pub(super) struct BsdfBuffers {
    pending: Vec<PendingBsdf>,
    rays: RayBatch,
    hits: EmitterScratch,
    emitter_hits: Vec<Option<EmitterHit>>,
    far: Vec<u32>,
    emitters: Vec<Option<EmitterInDirection>>,
}

/// The probability with which the light sampler chooses a light.
pub(super) fn choice_by_sampler(job: &RenderJob) -> impl Fn(u32, &LightCtx, LightId) -> f32 {
    |_, ctx, light| job.lights.sampler.pmf(ctx, light)
}

impl T1<'_> {
    /// Draws the samples of both techniques; see [`Self::draw_lights`].
    pub(super) fn propose(
        &mut self,
        allocate: impl Fn(&ShadingPoint<'_>) -> SampleAllocation,
        draw: impl FnMut(&RenderJob, u32, &ShadingPoint<'_>, &SampleAllocation, &mut Vec<Candidate>) -> u32,
    ) {
        self.draw_lights(&allocate, draw);
        self.draw_bsdf(allocate, &mut [], choice_by_sampler(self.job));
    }

    /// Draws the light samples of all points. `draw` adds the candidates of a point and returns its number of samples.
    /// Counts the samples of both techniques, without those that `contributing` draws later.
    pub(super) fn draw_lights(
        &mut self,
        allocate: impl Fn(&ShadingPoint<'_>) -> SampleAllocation,
        mut draw: impl FnMut(&RenderJob, u32, &ShadingPoint<'_>, &SampleAllocation, &mut Vec<Candidate>) -> u32,
    ) {
        let Candidates { records, stats, .. } = &mut *self.candidates;
        let start = Instant::now();
        for (index, point) in (0..).zip(self.points) {
            let allocation = allocate(point);
            let drawn = draw(self.job, index, point, &allocation, records);
            stats.proposals += u64::from(drawn + allocation.bsdf_draws);
            stats.light_proposals += u64::from(drawn);
        }
        stats.t1_light += start.elapsed();
    }

    /// Draws the BSDF samples of all points; samples that hit an emitter become candidates. `mixtures` belong to the
    /// points, or are empty. `pmf(point, ctx, light)` is the probability of the choice of a light, or its expected
    /// number of samples.
    pub(super) fn draw_bsdf(
        &mut self,
        allocate: impl Fn(&ShadingPoint<'_>) -> SampleAllocation,
        mixtures: &mut [Mixture],
        pmf: impl Fn(u32, &LightCtx, LightId) -> f32,
    ) {
        // Directions
        let BsdfBuffers { pending, rays, hits, emitter_hits, far, emitters } = &mut *self.bsdf;
        pending.clear();
        rays.clear();
        for (index, point) in self.points.iter().enumerate() {
            let allocation = allocate(point);
            let mut mixture = mixtures.get_mut(index);
            for i in 0..allocation.bsdf_draws {
                let u = point.stream.split(domain::BSDF, allocation.bsdf_draws, i).draw::<3>();
                let lobe = mixture.as_ref().map_or(0, |mixture| mixture.lobe(u[0]));
                if let Some(sample) = bsdf_samples::draw(index as u32, point, allocation, u, lobe) {
                    rays.push(&point.ray(sample.wi));
                    pending.push(sample);
                } else if let Some(mixture) = &mut mixture {
                    mixture.zero_valued[lobe] += 1;
                }
            }
        }

        // Emitters in these directions
        self.candidates.stats.emitter_rays += rays.len() as u64;
        self.job.world.intersect_emitters(rays, hits, emitter_hits);
        find_emitters(self.job, self.points, pending, emitter_hits, pmf, far, emitters);
        for ((pending, hit), emitter) in pending.iter().zip(emitter_hits).zip(emitters) {
            let point = &self.points[pending.point as usize];
            let mut candidate = bsdf_candidate(self.job, point, pending, hit.as_ref(), *emitter);
            if let Some(mixture) = mixtures.get_mut(pending.point as usize) {
                match &mut candidate {
                    Some(c) if pending.specular => c.p_lobe = if pending.lobe == 0 { c.p_bsdf } else { 0.0 },
                    Some(c) => c.p_lobe = mixture.p_lobe(point, pending.wi, c.p_bsdf),
                    None => mixture.zero_valued[pending.lobe] += 1,
                }
            }
            self.candidates.records.extend(candidate);
        }
    }
}
