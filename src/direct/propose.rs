//! T1: candidates with their unshadowed integrand and the densities of every technique. Scalar.

use super::ShadePoint;
use crate::accel::{Hit, RayBatch};
use crate::lights::{LightCtx, LightHit};
use crate::math::ray::{SEGMENT_END, offset_origin};
use crate::math::{Ray, Rgb, Vec3};
use crate::samplers::SampleStream;
use crate::scene::{EmitterHit, EstimatorKind, IntegratorSettings, World};
use std::time::{Duration, Instant};

/// Domains below the stream of a shading point.
mod domain {
    pub const LIGHT: u32 = 0;
    pub const BSDF: u32 = 1;
    pub const TECHNIQUE: u32 = 2;
}

/// Which technique drew a candidate.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Drawn {
    /// Light sampling.
    Light,
    /// Light sampling of a light without extent in solid angle.
    DeltaLight,
    /// BSDF sampling.
    Bsdf,
    /// A specular lobe.
    DeltaBsdf,
}

/// A candidate: one direction of light at one point.
#[derive(Clone, Copy, Debug)]
pub struct Candidate {
    /// Index of the shading point.
    pub point: u32,
    /// Technique.
    pub drawn: Drawn,
    /// Unshadowed integrand f_s·|cos θ|·L.
    pub f: Rgb,
    /// Density of light sampling at the direction (per steradian, light choice included; a probability for deltas).
    pub p_light: f32,
    /// Density of BSDF sampling (per steradian; as the BSDF gives it for specular lobes).
    pub p_bsdf: f32,
    /// Expected number of light samples of the point.
    pub n_light: f32,
    /// Expected number of BSDF samples of the point.
    pub n_bsdf: f32,
    /// What must be free for the candidate to count.
    pub segment: Ray,
}

/// All candidates of a batch, in the order of their shading points.
#[derive(Debug, Default)]
pub struct Candidates {
    /// Those whose integrand is not zero.
    pub records: Vec<Candidate>,
    /// How many were drawn, zeros included.
    pub proposals: u64,
    /// How many of them were light samples.
    pub light_proposals: u64,
    /// How many rays were traced among emitters.
    pub emitter_rays: u64,
    /// Time in light samples.
    pub light_time: Duration,
    pending: Vec<PendingBsdf>,
    rays: RayBatch,
    hits: Vec<Option<Hit>>,
    emitter_hits: Vec<Option<EmitterHit>>,
}

/// A BSDF sample that waits for the emitter it points at.
#[derive(Clone, Copy, Debug)]
struct PendingBsdf {
    point: u32,
    wi: Vec3,
    f_cos: Rgb,
    pdf: f32,
    specular: bool,
    share: Share,
}

/// How many samples each technique has at a point.
#[derive(Clone, Copy, Debug)]
struct Share {
    light_draws: u32,
    bsdf_draws: u32,
    n_light: f32,
    n_bsdf: f32,
}

/// Splits N samples between the techniques. A single sample of `mis` chooses its technique at random, so that
/// the expected numbers are one half each.
fn share(settings: &IntegratorSettings, point: &ShadePoint<'_>) -> Share {
    let n = point.split.samples;
    let fixed = |light: u32, bsdf: u32| Share {
        light_draws: light,
        bsdf_draws: bsdf,
        n_light: light as f32,
        n_bsdf: bsdf as f32,
    };
    if !point.bsdf.bsdf.has_non_specular() {
        return fixed(0, n);
    }
    match settings.estimator {
        EstimatorKind::Mc if point.bsdf.bsdf.has_specular() => fixed(n, 1),
        EstimatorKind::Mc => fixed(n, 0),
        EstimatorKind::Mis | EstimatorKind::Ris if n == 1 => {
            let light = point.stream.domain(domain::TECHNIQUE).draw::<1>()[0] < 0.5;
            Share { light_draws: u32::from(light), bsdf_draws: u32::from(!light), n_light: 0.5, n_bsdf: 0.5 }
        }
        EstimatorKind::Mis | EstimatorKind::Ris => fixed(n.div_ceil(2), n / 2),
    }
}

impl Candidates {
    /// Draws the candidates of all points.
    pub fn propose(&mut self, world: &World, settings: &IntegratorSettings, points: &[ShadePoint<'_>]) {
        self.records.clear();
        self.pending.clear();
        self.rays.clear();
        (self.proposals, self.light_proposals) = (0, 0);

        // Light samples
        let start = Instant::now();
        for (index, point) in points.iter().enumerate() {
            let share = share(settings, point);
            self.proposals += u64::from(share.light_draws + share.bsdf_draws);
            self.light_proposals += u64::from(share.light_draws);
            for i in 0..share.light_draws {
                let stream = point.stream.split(domain::LIGHT, share.light_draws, i);
                self.records.extend(light_candidate(world, index as u32, point, share, stream));
            }
        }
        self.light_time = start.elapsed();

        // BSDF samples up to the question which emitter they point at
        for (index, point) in points.iter().enumerate() {
            let share = share(settings, point);
            for i in 0..share.bsdf_draws {
                let stream = point.stream.split(domain::BSDF, share.bsdf_draws, i);
                self.draw_bsdf(index as u32, point, share, stream);
            }
        }

        // The emitters that the BSDF samples point at
        self.emitter_rays = self.rays.len() as u64;
        world.intersect_emitters(&self.rays, &mut self.hits, &mut self.emitter_hits);
        for (pending, hit) in self.pending.iter().zip(&self.emitter_hits) {
            self.records.extend(bsdf_candidate(world, &points[pending.point as usize], pending, hit.as_ref()));
        }
    }

    fn draw_bsdf(&mut self, index: u32, point: &ShadePoint<'_>, share: Share, stream: SampleStream) {
        let [uc, u0, u1] = stream.draw::<3>();
        let Some(sample) = point.bsdf.sample(point.wo, uc, [u0, u1]) else { return };
        let f_cos = sample.f * sample.wi.dot(point.bsdf.frame.z).abs();
        if f_cos.is_black() {
            return;
        }
        let ray = Ray { o: point.origin(sample.wi), d: sample.wi, t_max: f32::INFINITY, time: point.time };
        self.rays.push(&ray);
        self.pending.push(PendingBsdf {
            point: index,
            wi: sample.wi,
            f_cos,
            pdf: sample.pdf,
            specular: sample.lobe.is_specular(),
            share,
        });
    }
}

/// One light sample; `None` if its integrand is zero.
fn light_candidate(
    world: &World,
    index: u32,
    point: &ShadePoint<'_>,
    share: Share,
    stream: SampleStream,
) -> Option<Candidate> {
    // Choose a light and a point on it
    let lights = &world.scene.lights;
    let [u_choice, u0, u1] = stream.draw::<3>();
    let ctx = LightCtx { p: point.p, n: point.bsdf.n, ns: point.bsdf.frame.z };
    let (light, mut sample) = lights.sample(&ctx, u_choice, [u0, u1])?;

    // Lights at infinity overlap: a direction belongs to all of them together
    if lights.infinite.contains(&light) {
        (sample.li, sample.pdf) = (lights.le(sample.wi), lights.pdf_infinite(&ctx, sample.wi));
    }

    // Unshadowed integrand
    let f_cos = point.bsdf.f(point.wo, sample.wi) * sample.wi.dot(point.bsdf.frame.z).abs();
    let f = f_cos * sample.li;
    if f.is_black() || !(sample.pdf > 0.0) {
        return None;
    }

    let (drawn, p_bsdf) =
        if sample.is_delta { (Drawn::DeltaLight, 0.0) } else { (Drawn::Light, point.bsdf.pdf(point.wo, sample.wi)) };
    let end = sample.t.is_finite().then_some((sample.p, sample.p_error, sample.n));
    Some(Candidate {
        point: index,
        drawn,
        f,
        p_light: sample.pdf,
        p_bsdf,
        n_light: share.n_light,
        n_bsdf: share.n_bsdf,
        segment: segment(point, sample.wi, end),
    })
}

/// Completes a BSDF sample with the emitter that it points at; `None` if it points at none.
fn bsdf_candidate(
    world: &World,
    point: &ShadePoint<'_>,
    pending: &PendingBsdf,
    hit: Option<&EmitterHit>,
) -> Option<Candidate> {
    let lights = &world.scene.lights;
    let ctx = LightCtx { p: point.p, n: point.bsdf.n, ns: point.bsdf.frame.z };
    let (li, p_light, segment) = match hit {
        Some(hit) => {
            let light = hit.light?;
            let surface =
                world.scene.geometry.surface_hit(hit.geometry, hit.primitive, Hit::NO_INSTANCE, hit.uv, point.time);
            let light_hit = LightHit { t: hit.t, p: surface.p, n: surface.n, uv: surface.uv };
            let li = lights.lights[light as usize].l(&light_hit, -pending.wi);
            let pdf = if pending.specular { 0.0 } else { lights.pdf(&ctx, light, pending.wi, &light_hit) };
            (li, pdf, segment(point, pending.wi, Some((surface.p, surface.p_error, surface.n))))
        }
        None => {
            let pdf = if pending.specular { 0.0 } else { lights.pdf_infinite(&ctx, pending.wi) };
            (lights.le(pending.wi), pdf, segment(point, pending.wi, None))
        }
    };
    let f = pending.f_cos * li;
    if f.is_black() {
        return None;
    }
    Some(Candidate {
        point: pending.point,
        drawn: if pending.specular { Drawn::DeltaBsdf } else { Drawn::Bsdf },
        f,
        p_light,
        p_bsdf: pending.pdf,
        n_light: pending.share.n_light,
        n_bsdf: pending.share.n_bsdf,
        segment,
    })
}

/// The segment from a point to a point on a light `(p, p_error, n)`, or to infinity.
fn segment(point: &ShadePoint<'_>, wi: Vec3, end: Option<(Vec3, Vec3, Vec3)>) -> Ray {
    let o = point.origin(wi);
    match end {
        None => Ray { o, d: wi, t_max: f32::INFINITY, time: point.time },
        Some((p, p_error, n)) => {
            let end = offset_origin(p, p_error, n, o - p);
            Ray { o, d: end - o, t_max: SEGMENT_END, time: point.time }
        }
    }
}
