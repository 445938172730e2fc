//! T1 by BSDF sampling, one sample at a time: a direction, and the emitter that it points at.

use super::candidates::{Candidate, Drawn, SampleAllocation};
use super::point::ShadingPoint;
use crate::accel::Hit;
use crate::lights::{LightCtx, LightHit, LightId};
use crate::scene::{EmitterHit, RenderJob};
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

/// Draws a BSDF sample up to the question which emitter it points at; `None` if its value is zero.
pub(super) fn draw(
    (index, point): (u32, &ShadingPoint<'_>),
    allocation: SampleAllocation,
    [uc, u0, u1]: [f32; 3],
    lobe: usize,
) -> Option<PendingBsdf> {
    let s = point.bsdf.sample(point.wo, uc, [u0, u1])?;
    let f_cos = s.f * point.bsdf.cos(s.wi);
    let specular = s.lobe.is_specular();
    (!f_cos.is_black()).then_some(PendingBsdf { point: index, wi: s.wi, f_cos, pdf: s.pdf, specular, lobe, allocation })
}

/// Completes a BSDF sample with the emitter that it has found; `None` if it points at none.
pub(super) fn bsdf_candidate(
    job: &RenderJob,
    point: &ShadingPoint<'_>,
    pending: &PendingBsdf,
    (hit, found): (Option<&EmitterHit>, Option<EmitterInDirection>),
) -> Option<Candidate> {
    let lights = &job.lights;
    let found = found?;
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
#[derive(Clone, Copy, Debug)]
pub(super) struct EmitterInDirection {
    /// Radiance.
    pub(super) li: Rgb,
    /// Density of light sampling (1/sr).
    pub(super) p_light: f32,
    /// The point on the light, the bound of its error, and its normal; `None` at infinity.
    pub(super) end: Option<(Vec3, Vec3, Vec3)>,
}

/// What the samples of some points point at, whose rays among the emitters have met `hits`; `None` where that is dark.
/// `pmf` is the probability of the choice of a light at a point, and `far` is memory.
pub(super) fn find_emitters(
    job: &RenderJob,
    points: &[ShadingPoint<'_>],
    (pending, hits): (&[PendingBsdf], &[Option<EmitterHit>]),
    pmf: impl Fn(u32, &LightCtx, LightId) -> f32,
    far: &mut Vec<u32>,
    out: &mut Vec<Option<EmitterInDirection>>,
) {
    let ctx = |sample: &PendingBsdf| points[sample.point as usize].light_ctx();
    far.clear();
    far.extend((0_u32..).zip(hits).filter(|(_, hit)| hit.is_none()).map(|(i, _)| i));
    out.clear();
    out.extend(pending.iter().zip(hits).map(|(sample, hit)| {
        let (time, pmf) = (points[sample.point as usize].time, |ctx: &_, light| pmf(sample.point, ctx, light));
        emitter_at(job, &ctx(sample), sample.wi, hit.as_ref()?, time, pmf)
    }));
    let sample = |k: usize| &pending[far[k] as usize];
    job.lights.infinite_in_directions_by(
        far.len(),
        |k| ctx(sample(k)),
        |k| sample(k).wi,
        |k, ctx, light| pmf(sample(k).point, ctx, light),
        |k, li, p_light| {
            out[far[k] as usize] = (!li.is_black()).then_some(EmitterInDirection { li, p_light, end: None });
        },
    );
}

/// What the direction `wi` points at by meeting `hit`, where lights are chosen with probability `pmf`; `None` if that is
/// dark.
pub(super) fn emitter_at(
    job: &RenderJob,
    ctx: &LightCtx,
    wi: Vec3,
    hit: &EmitterHit,
    time: f32,
    pmf: impl FnOnce(&LightCtx, LightId) -> f32,
) -> Option<EmitterInDirection> {
    let lights = &job.lights;
    let light = hit.light.filter(|&light| !lights.lights[light as usize].is_dark_from(ctx.p))?;
    let surface = job.world.scene.geometry.surface_hit(hit.geometry, hit.primitive, Hit::NO_INSTANCE, hit.uv, time);
    let light_hit = LightHit { t: hit.t, p: surface.p, n: surface.n, uv: surface.uv };
    let li = lights.lights[light as usize].l(&light_hit, -wi);
    (!li.is_black()).then(|| {
        let pdf = lights.lights[light as usize].pdf_li(ctx, wi, &light_hit);
        let p_light = if pdf > 0.0 { pdf * pmf(ctx, light) } else { 0.0 };
        EmitterInDirection { li, p_light, end: Some((surface.p, surface.p_error, surface.n)) }
    })
}
