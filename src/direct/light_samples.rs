//! T1 by light sampling, one sample at a time.

use super::candidates::{Candidate, SampleAllocation};
use super::domain;
use super::point::ShadingPoint;
use crate::lights::{LeAndPdf, LightCtx, SampleOfLight};
use crate::scene::RenderJob;

/// Draws the light samples of a point, with lights chosen by the light sampler. Returns the number of samples.
pub(super) fn draw(
    job: &RenderJob,
    index: u32,
    point: &ShadingPoint<'_>,
    allocation: &SampleAllocation,
    records: &mut Vec<Candidate>,
) -> u32 {
    let n = allocation.light_draws;
    for i in 0..n {
        let [u_choice, u0, u1] = point.stream.split(domain::LIGHT, n, i).draw::<3>();
        let drawn = job.lights.sample(&point.light_ctx(), u_choice, [u0, u1]);
        records.extend(drawn.and_then(|drawn| light_candidate(job, index, point, allocation, drawn)));
    }
    n
}

/// A light sample. If the light is infinite, the radiance is the sum of all infinite lights, and the density the sum of
/// their densities.
pub(super) fn with_infinite(job: &RenderJob, ctx: &LightCtx, mut drawn: SampleOfLight) -> SampleOfLight {
    let (lights, sample) = (&job.lights, &mut drawn.sample);
    if lights.infinite.len() > 1 && lights.infinite.contains(&drawn.light) {
        LeAndPdf { le: sample.li, pdf: sample.pdf } = lights.infinite_in_direction(ctx, sample.wi);
    }
    drawn
}

/// The candidate of a light sample, whose density includes the choice of the light; `None` if its integrand is zero.
pub(super) fn light_candidate(
    job: &RenderJob,
    index: u32,
    point: &ShadingPoint<'_>,
    allocation: &SampleAllocation,
    drawn: SampleOfLight,
) -> Option<Candidate> {
    // Nearby, no other technique would sample the emission of media: it is left to the next segment of the path
    if job.lights.medium_of(drawn.light).is_some() {
        return None;
    }
    // Infinite lights overlap: all of them contribute to a direction
    unshadowed_candidate(index, point, allocation, with_infinite(job, &point.light_ctx(), drawn))
}

/// The candidate of a light sample without other infinite lights. Its density includes the choice of the light. `None`
/// if its integrand is zero.
pub(super) fn unshadowed_candidate(
    index: u32,
    point: &ShadingPoint<'_>,
    allocation: &SampleAllocation,
    drawn: SampleOfLight,
) -> Option<Candidate> {
    // Unshadowed integrand
    let sample = &drawn.sample;
    let f_cos = point.bsdf.f(point.wo, sample.wi) * point.bsdf.cos(sample.wi);
    let f = f_cos * sample.li;
    if f.is_black() || !(sample.pdf > 0.0) {
        return None;
    }

    // A technique without samples has no weight
    let p_bsdf = if sample.is_delta || allocation.n_bsdf == 0.0 { 0.0 } else { point.bsdf.pdf(point.wo, sample.wi) };
    let SampleAllocation { n_light, n_bsdf, .. } = *allocation;
    let segment = point.light_segment(sample);
    Some(Candidate { p_bsdf, n_light, n_bsdf, ..Candidate::of_light(index, f, &drawn, segment) })
}
