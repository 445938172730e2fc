//! T1: candidates with their unshadowed integrand and the densities of every technique, one at a time.

use super::ShadePoint;
use crate::accel::{Hit, RayBatch};
use crate::estimators::mc;
use crate::estimators::mis::{Heuristic, Technique};
use crate::lights::{LightHit, LightId, LightSample};
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

impl Drawn {
    /// True if no other technique can draw the direction.
    pub fn is_delta(self) -> bool {
        match self {
            Drawn::DeltaLight | Drawn::DeltaBsdf => true,
            Drawn::Light | Drawn::Bsdf => false,
        }
    }
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
    /// The radiance L in it.
    pub li: Rgb,
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

impl Candidate {
    /// The factor w/(n·p) of f in the estimate over all candidates of a point, if both techniques are used.
    #[inline]
    pub fn factor(&self, heuristic: Heuristic) -> f32 {
        let light = Technique { n: self.n_light, p: self.p_light };
        let bsdf = Technique { n: self.n_bsdf, p: self.p_bsdf };
        match self.drawn {
            Drawn::DeltaLight => mc::weight(light.n, light.p),
            Drawn::DeltaBsdf => mc::weight(bsdf.n, bsdf.p),
            Drawn::Light => heuristic.weight(light, bsdf) * mc::weight(light.n, light.p),
            Drawn::Bsdf => heuristic.weight(bsdf, light) * mc::weight(bsdf.n, bsdf.p),
        }
    }
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
    pub(super) spare: Vec<Candidate>,
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
    shares: Shares,
}

/// How many samples each technique has at a point.
#[derive(Clone, Copy, Debug)]
pub(super) struct Shares {
    pub light_draws: u32,
    pub bsdf_draws: u32,
    /// Expected numbers.
    pub n_light: f32,
    pub n_bsdf: f32,
}

impl Shares {
    /// So many of each.
    pub fn fixed(light: u32, bsdf: u32) -> Self {
        Shares { light_draws: light, bsdf_draws: bsdf, n_light: light as f32, n_bsdf: bsdf as f32 }
    }

    /// A single sample that chooses its technique at random, so that the expected numbers are one half each.
    pub fn one_of_both(point: &ShadePoint<'_>) -> Self {
        let light = point.stream.domain(domain::TECHNIQUE).draw::<1>()[0] < 0.5;
        Shares { light_draws: u32::from(light), bsdf_draws: u32::from(!light), n_light: 0.5, n_bsdf: 0.5 }
    }

    /// Splits the samples, or the proposals, between the techniques.
    fn new(settings: &IntegratorSettings, point: &ShadePoint<'_>) -> Self {
        let n = point.split.samples;
        if !point.bsdf.bsdf.has_non_specular() {
            return Shares::fixed(0, n);
        }
        match settings.estimator {
            EstimatorKind::Mc => Shares::fixed(n, u32::from(point.bsdf.bsdf.has_specular())),
            EstimatorKind::Mis if n == 1 => Shares::one_of_both(point),
            EstimatorKind::Mis => Shares::fixed(n.div_ceil(2), n / 2),
            EstimatorKind::Ris => super::ris::shares(point),
        }
    }
}

impl Candidates {
    /// Draws the candidates of all points; for `ris` only those by BSDF sampling, since light samples are many and stay
    /// with [`super::ris`].
    pub fn propose(&mut self, world: &World, settings: &IntegratorSettings, points: &[ShadePoint<'_>]) {
        self.records.clear();
        self.pending.clear();
        self.rays.clear();
        (self.proposals, self.light_proposals) = (0, 0);

        // Light samples
        let start = Instant::now();
        for (index, point) in points.iter().enumerate() {
            let shares = Shares::new(settings, point);
            self.proposals += u64::from(shares.light_draws + shares.bsdf_draws);
            self.light_proposals += u64::from(shares.light_draws);
            if settings.estimator == EstimatorKind::Ris {
                continue;
            }
            for i in 0..shares.light_draws {
                let stream = point.stream.split(domain::LIGHT, shares.light_draws, i);
                let [u_choice, u0, u1] = stream.draw::<3>();
                let ctx = point.light_ctx();
                let candidate =
                    world.scene.lights.sample(&ctx, u_choice, [u0, u1]).and_then(|(light, sample)| {
                        light_candidate(world, index as u32, point, &shares, (light, sample))
                    });
                self.records.extend(candidate);
            }
        }
        self.light_time = start.elapsed();

        // BSDF samples up to the question which emitter they point at
        for (index, point) in points.iter().enumerate() {
            let shares = Shares::new(settings, point);
            for i in 0..shares.bsdf_draws {
                let stream = point.stream.split(domain::BSDF, shares.bsdf_draws, i);
                self.draw_bsdf(index as u32, point, shares, stream);
            }
        }

        // The emitters that the BSDF samples point at
        self.emitter_rays = self.rays.len() as u64;
        world.intersect_emitters(&self.rays, &mut self.hits, &mut self.emitter_hits);
        for (pending, hit) in self.pending.iter().zip(&self.emitter_hits) {
            self.records.extend(bsdf_candidate(world, &points[pending.point as usize], pending, hit.as_ref()));
        }
    }

    fn draw_bsdf(&mut self, index: u32, point: &ShadePoint<'_>, shares: Shares, stream: SampleStream) {
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
            shares,
        });
    }
}

/// A sample of a light, whose density includes the choice; `None` if its integrand is zero.
pub(super) fn light_candidate(
    world: &World,
    index: u32,
    point: &ShadePoint<'_>,
    shares: &Shares,
    (light, mut sample): (LightId, LightSample),
) -> Option<Candidate> {
    // Lights at infinity overlap: a direction belongs to all of them together
    let lights = &world.scene.lights;
    if lights.infinite.len() > 1 && lights.infinite.contains(&light) {
        (sample.li, sample.pdf) = (lights.le(sample.wi), lights.pdf_infinite(&point.light_ctx(), sample.wi));
    }

    // Unshadowed integrand
    let f_cos = point.bsdf.f(point.wo, sample.wi) * sample.wi.dot(point.bsdf.frame.z).abs();
    let f = f_cos * sample.li;
    if f.is_black() || !(sample.pdf > 0.0) {
        return None;
    }

    // A technique without samples has no weight, whatever its density
    let drawn = if sample.is_delta { Drawn::DeltaLight } else { Drawn::Light };
    let p_bsdf = if sample.is_delta || shares.n_bsdf == 0.0 { 0.0 } else { point.bsdf.pdf(point.wo, sample.wi) };
    Some(Candidate {
        point: index,
        drawn,
        f,
        li: sample.li,
        p_light: sample.pdf,
        p_bsdf,
        n_light: shares.n_light,
        n_bsdf: shares.n_bsdf,
        segment: light_segment(point, &sample),
    })
}

/// The segment to a point on a light, or to infinity.
pub(super) fn light_segment(point: &ShadePoint<'_>, sample: &LightSample) -> Ray {
    let end = sample.t.is_finite().then_some((sample.p, sample.p_error, sample.n));
    segment(point, sample.wi, end)
}

/// Completes a BSDF sample with the emitter that it points at; `None` if it points at none.
fn bsdf_candidate(
    world: &World,
    point: &ShadePoint<'_>,
    pending: &PendingBsdf,
    hit: Option<&EmitterHit>,
) -> Option<Candidate> {
    let lights = &world.scene.lights;
    let ctx = point.light_ctx();
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
        li,
        p_light,
        p_bsdf: pending.pdf,
        n_light: pending.shares.n_light,
        n_bsdf: pending.shares.n_bsdf,
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
