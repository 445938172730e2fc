//! T1 by BSDF sampling: directions, and the emitters that they point at.

use super::candidates::{Candidate, Candidates, Drawn, SampleAllocation};
use super::domain;
use super::mixture::Mixture;
use super::point::ShadingPoint;
use crate::accel::{Hit, RayBatch};
use crate::lights::{LightCtx, LightHit, LightId};
use crate::scene::{EmitterHit, EmitterScratch, RenderJob};
use lumiris_numbers::math::{Rgb, Vec3};

/// A BSDF sample whose emitter has not been determined yet.
#[derive(Clone, Copy, Debug)]
pub(super) struct PendingBsdf {
    pub point: u32,
    pub wi: Vec3,
    pub f_cos: Rgb,
    pub pdf: f32,
    pub specular: bool,
    /// The sampled lobe, as a component of the mixture.
    pub lobe: usize,
    pub allocation: SampleAllocation,
}

/// The BSDF samples of a batch.
#[derive(Debug, Default)]
pub(super) struct BsdfSamples {
    pending: Vec<PendingBsdf>,
    rays: RayBatch,
    hits: EmitterScratch,
    emitter_hits: Vec<Option<EmitterHit>>,
}

impl BsdfSamples {
    /// Draws the BSDF samples of all points; those that point at an emitter become candidates. `mixtures` are those of
    /// the points, or none.
    pub(super) fn propose(
        &mut self,
        job: &RenderJob,
        points: &[ShadingPoint<'_>],
        allocate: impl Fn(&ShadingPoint<'_>) -> SampleAllocation,
        mixtures: &mut [Mixture],
        candidates: &mut Candidates,
    ) {
        // Samples up to the question which emitter they point at
        self.pending.clear();
        self.rays.clear();
        for (index, point) in points.iter().enumerate() {
            let allocation = allocate(point);
            for i in 0..allocation.bsdf_draws {
                let u = point.stream.split(domain::BSDF, allocation.bsdf_draws, i).draw::<3>();
                self.draw((index as u32, point), allocation, u, mixtures.get_mut(index));
            }
        }

        // The emitters
        candidates.stats.emitter_rays += self.rays.len() as u64;
        job.world.intersect_emitters(&self.rays, &mut self.hits, &mut self.emitter_hits);
        for (pending, hit) in self.pending.iter().zip(&self.emitter_hits) {
            let point = &points[pending.point as usize];
            let mut candidate = bsdf_candidate(job, point, pending, hit.as_ref());
            if let Some(mixture) = mixtures.get_mut(pending.point as usize) {
                match &mut candidate {
                    Some(c) if pending.specular => c.p_lobe = if pending.lobe == 0 { c.p_bsdf } else { 0.0 },
                    Some(c) => c.p_lobe = mixture.p_lobe(point, pending.wi, c.p_bsdf),
                    None => mixture.zero_valued[pending.lobe] += 1,
                }
            }
            candidates.records.extend(candidate);
        }
    }

    /// Draws a sample. A zero-valued one is only counted.
    fn draw(
        &mut self,
        (index, point): (u32, &ShadingPoint<'_>),
        allocation: SampleAllocation,
        [uc, u0, u1]: [f32; 3],
        mixture: Option<&mut Mixture>,
    ) {
        let lobe = mixture.as_ref().map_or(0, |mixture| mixture.lobe(uc));
        let sample = point.bsdf.sample(point.wo, uc, [u0, u1]);
        let sample =
            sample.map(|s| (s.f * s.wi.dot(point.bsdf.frame.z).abs(), s)).filter(|(f_cos, _)| !f_cos.is_black());
        let Some((f_cos, sample)) = sample else {
            if let Some(mixture) = mixture {
                mixture.zero_valued[lobe] += 1;
            }
            return;
        };
        self.rays.push(&point.ray(sample.wi));
        self.pending.push(PendingBsdf {
            point: index,
            wi: sample.wi,
            f_cos,
            pdf: sample.pdf,
            specular: sample.lobe.is_specular(),
            lobe,
            allocation,
        });
    }
}

/// Completes a BSDF sample with the emitter that it points at; `None` if it points at none.
pub(super) fn bsdf_candidate(
    job: &RenderJob,
    point: &ShadingPoint<'_>,
    pending: &PendingBsdf,
    hit: Option<&EmitterHit>,
) -> Option<Candidate> {
    let lights = &job.lights;
    let found = emitter_in_direction(job, &point.light_ctx(), pending.wi, hit, point.time)?;
    let light = match hit {
        Some(hit) => hit.light,
        None => {
            // An infinite light that can be chosen, if there is one, so that it has a group
            let has_group = |&&l: &&LightId| lights.groups.group_of(l).is_some();
            lights.infinite.iter().find(has_group).or(lights.infinite.first()).copied()
        }
    };
    let f = pending.f_cos * found.li;
    let light = light.filter(|_| !f.is_black())?;
    Some(Candidate {
        point: pending.point,
        drawn: if pending.specular { Drawn::DeltaBsdf } else { Drawn::Bsdf },
        f,
        li: found.li,
        light,
        p_light: if pending.specular { 0.0 } else { found.p_light },
        p_bsdf: pending.pdf,
        n_light: pending.allocation.n_light,
        n_bsdf: pending.allocation.n_bsdf,
        p_lobe: 0.0,
        group: lights.groups.group_of(light).unwrap_or(0) as u8,
        segment: point.segment(pending.wi, found.end),
    })
}

/// What a direction of BSDF sampling points at.
pub(crate) struct EmitterInDirection {
    /// Radiance.
    pub(crate) li: Rgb,
    /// Density of light sampling (1/sr).
    pub(crate) p_light: f32,
    /// The point on the light, the bound of its error, and its normal; `None` at infinity.
    pub(crate) end: Option<(Vec3, Vec3, Vec3)>,
}

/// What the direction `wi` points at, whose ray among the emitters has met `hit`; `None` if that is dark.
fn emitter_in_direction(
    job: &RenderJob,
    ctx: &LightCtx,
    wi: Vec3,
    hit: Option<&EmitterHit>,
    time: f32,
) -> Option<EmitterInDirection> {
    let Some(hit) = hit else {
        let (li, p_light) = job.lights.infinite_in_direction(ctx, wi);
        return (!li.is_black()).then_some(EmitterInDirection { li, p_light, end: None });
    };
    emitter_at(job, ctx, wi, hit, time)
}

/// What the direction `wi` points at by meeting `hit`; `None` if that is dark.
pub(crate) fn emitter_at(
    job: &RenderJob,
    ctx: &LightCtx,
    wi: Vec3,
    hit: &EmitterHit,
    time: f32,
) -> Option<EmitterInDirection> {
    let lights = &job.lights;
    let light = hit.light?;
    let surface = job.world.scene.geometry.surface_hit(hit.geometry, hit.primitive, Hit::NO_INSTANCE, hit.uv, time);
    let light_hit = LightHit { t: hit.t, p: surface.p, n: surface.n, uv: surface.uv };
    let li = lights.lights[light as usize].l(&light_hit, -wi);
    (!li.is_black()).then(|| EmitterInDirection {
        li,
        p_light: lights.pdf(ctx, light, wi, &light_hit),
        end: Some((surface.p, surface.p_error, surface.n)),
    })
}
