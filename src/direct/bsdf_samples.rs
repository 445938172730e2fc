//! T1 by BSDF sampling, one sample at a time: a direction, and the emitter in that direction.

use super::candidates::{Candidate, SampleAllocation, SampledBy};
use super::point::{LightPoint, ShadingPoint};
use crate::accel::Hit;
use crate::lights::{LightCtx, LightHit, LightId};
use crate::scene::{EmitterHit, RenderJob};
use lumiris_numbers::math::{Rgb, Vec3};

/// A BSDF sample before the lookup of its emitter.
#[derive(Clone, Copy, Debug)]
pub(super) struct PendingBsdf {
    pub point: u32,
    pub wi: Vec3,
    pub f_cos: Rgb,
    pub pdf: f32,
    pub specular: bool,
    /// The sampled lobe: index of a mixture component.
    pub lobe: usize,
    pub allocation: SampleAllocation,
}

/// Draws a BSDF sample without its emitter; `None` if its value is zero.
pub(super) fn draw(
    index: u32,
    point: &ShadingPoint<'_>,
    allocation: SampleAllocation,
    [uc, u0, u1]: [f32; 3],
    lobe: usize,
) -> Option<PendingBsdf> {
    let s = point.bsdf.sample(point.wo, uc, [u0, u1])?;
    let f_cos = s.f * point.bsdf.cos(s.wi);
    let specular = s.lobe.is_specular();
    (!f_cos.is_black()).then_some(PendingBsdf { point: index, wi: s.wi, f_cos, pdf: s.pdf, specular, lobe, allocation })
}

/// Completes a BSDF sample with its emitter; `None` if it hits none.
pub(super) fn bsdf_candidate(
    job: &RenderJob,
    point: &ShadingPoint<'_>,
    pending: &PendingBsdf,
    hit: Option<&EmitterHit>,
    emitter: Option<EmitterInDirection>,
) -> Option<Candidate> {
    let lights = &job.lights;
    let emitter = emitter?;
    let light = match hit {
        Some(hit) => hit.light,
        None => {
            // Prefer an infinite light that belongs to a group
            let has_group = |&&l: &&LightId| lights.groups.group_of(l).is_some();
            lights.infinite.iter().find(has_group).or(lights.infinite.first()).copied()
        }
    };
    let f = pending.f_cos * emitter.li;
    let light = light.filter(|_| !f.is_black())?;
    Some(Candidate {
        point: pending.point,
        sampled_by: if pending.specular { SampledBy::DeltaBsdf } else { SampledBy::Bsdf },
        f,
        li: emitter.li,
        light,
        p_light: if pending.specular { 0.0 } else { emitter.p_light },
        p_bsdf: pending.pdf,
        n_light: pending.allocation.n_light,
        n_bsdf: pending.allocation.n_bsdf,
        p_lobe: 0.0,
        group: lights.groups.group_of(light).unwrap_or(0) as u8,
        segment: point.segment(pending.wi, emitter.end),
    })
}

/// The emitter in the direction of a BSDF sample.
#[derive(Clone, Copy, Debug)]
pub(super) struct EmitterInDirection {
    /// Radiance.
    pub(super) li: Rgb,
    /// Density of light sampling (1/sr).
    pub(super) p_light: f32,
    /// Point on the light; `None` for infinite lights.
    pub(super) end: Option<LightPoint>,
}

/// The emitters of pending samples, whose rays have the emitter hits `hits`; `None` if an emitter is dark. `pmf` is the
/// probability of the choice of a light at a point; `far` is a buffer.
pub(super) fn find_emitters(
    job: &RenderJob,
    points: &[ShadingPoint<'_>],
    pending: &[PendingBsdf],
    hits: &[Option<EmitterHit>],
    pmf: impl Fn(u32, &LightCtx, LightId) -> f32,
    far: &mut Vec<u32>,
    out: &mut Vec<Option<EmitterInDirection>>,
) {
    let ctx = |sample: &PendingBsdf| points[sample.point as usize].light_ctx();
    far.clear();
    far.extend((0_u32..).zip(hits).filter(|(_, hit)| hit.is_none()).map(|(i, _)| i));

    // Emitters hit
    out.clear();
    out.extend(pending.iter().zip(hits).map(|(sample, hit)| {
        let (time, pmf) = (points[sample.point as usize].time, |ctx: &_, light| pmf(sample.point, ctx, light));
        emitter_at(job, &ctx(sample), sample.wi, hit.as_ref()?, time, pmf)
    }));

    // Infinite lights for rays without a hit
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

/// The emitter in the direction `wi` for the emitter hit `hit`; `None` if it is dark. Lights are chosen with
/// probability `pmf`.
pub(super) fn emitter_at(
    job: &RenderJob,
    ctx: &LightCtx,
    wi: Vec3,
    hit: &EmitterHit,
    time: f32,
    pmf: impl FnOnce(&LightCtx, LightId) -> f32,
) -> Option<EmitterInDirection> {
    // Emission towards the point
    let lights = &job.lights;
    let light = hit.light.filter(|&light| !lights.lights[light as usize].is_dark_from(ctx.p))?;
    let surface = job.world.scene.geometry.surface_hit(hit.geometry, hit.primitive, Hit::NO_INSTANCE, hit.uv, time);
    let light_hit = LightHit { t: hit.t, p: surface.p, n: surface.n, uv: surface.uv };
    let li = lights.lights[light as usize].l(&light_hit, -wi);

    // Density of the same direction by light sampling
    (!li.is_black()).then(|| {
        let pdf = lights.lights[light as usize].pdf_li(ctx, wi, &light_hit);
        let p_light = if pdf > 0.0 { pdf * pmf(ctx, light) } else { 0.0 };
        EmitterInDirection {
            li,
            p_light,
            end: Some(LightPoint { p: surface.p, p_error: surface.p_error, n: surface.n }),
        }
    })
}
