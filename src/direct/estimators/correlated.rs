//! Combined correlated and importance sampling [Szécsi, Sbert and Szirmay-Kalos 2004]. All N samples of a point are
//! drawn by one technique with density p. They are also samples of a control variate g with the known integral G.
//!
//! g(wi) = (1/π) Σ L̄ cos θ over the lights crossed by the ray towards wi, and G = E/π. This is the radiance that a
//! white Lambertian surface would reflect to wo if all lights were unoccluded, even by one another, and had their mean
//! radiance L̄ everywhere. θ is measured from the shading normal on the side of wo, and g = 0 on the other side.
//! [`crate::lights::irradiance`] decides which lights contribute to g. The estimate is ȳ − λ c̄ with y = f·V/p and c =
//! g/p − G, see [`lumiris_numbers::estimators::correlated`].
//!
//! * **BSDF sampling.** g is summed over all lights along the ray. E(c) = 0 requires p > 0 wherever g > 0, and a low
//!   variance requires a bounded g/p. Both hold for BSDFs that sample a cosine or uniform lobe on the side of wo with a
//!   probability of at least [`MIN_WIDE_LOBE`] ([`crate::bsdfs::Bsdf::wide_lobe`]): diffuse BSDFs, most coated and
//!   layered ones, and BSDFs that can only be evaluated. Mirror directions of a smooth coat are samples with g = 0. All
//!   other BSDFs (metal, glass) have a negligible density over most of the hemisphere. For them g = 0 everywhere, which
//!   leaves importance sampling. Delta lights have separate samples, one in four and at least one, whose estimate is
//!   added. If N = 1, the sample is of a delta light or of the BSDF at random.
//! * **Light sampling.** The domain is the set of points on lights. A sample has the g of its own light, and p includes
//!   the choice of that light, so p is positive wherever g is, for any BSDF. Delta lights are samples with g = 0.
//!   Specular lobes get one additional BSDF sample. BSDFs with specular lobes only are sampled by the BSDF.
//!
//! Zero-valued samples count with their g like all others.

use crate::accel::{Hit, RayBatch};
use crate::direct::bsdf_samples::{EmitterInDirection, PendingBsdf, bsdf_candidate, find_emitters};
use crate::direct::candidates::{Candidate, Candidates, SampleAllocation};
use crate::direct::domain;
use crate::direct::light_samples::{light_candidate, with_infinite};
use crate::direct::point::ShadingPoint;
use crate::direct::shadow_segments::Segments;
use crate::direct::t1::{T1, choice_by_sampler};
use crate::lights::{LightId, LightSample, SampleOfLight, SurfacePoint};
use crate::scene::{EmitterHit, EmitterScratch, RenderJob};
use crate::settings::SamplingTechnique;
use lumiris_numbers::estimators::correlated::{self, SUMS};
use lumiris_numbers::math::ray::offset_origin;
use lumiris_numbers::math::{Ray, Rgb, Vec3};
use std::f32::consts::FRAC_1_PI;
use std::time::Instant;

/// Minimum probability of a wide lobe for a control variate of BSDF samples.
pub const MIN_WIDE_LOBE: f32 = 0.01;
/// One in this many samples is drawn for delta lights.
pub const DELTA_DIVISOR: u32 = 4;

/// Samples of one technique with a control variate.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Correlated {
    /// Samples (N).
    pub samples: u32,
    /// Technique of the samples.
    pub technique: SamplingTechnique,
}

/// Allocation of the samples of a point.
#[derive(Clone, Copy, Debug)]
struct Plan {
    technique: SamplingTechnique,
    /// Samples of the combined estimate.
    n: u32,
    /// Samples drawn by the technique; 0 if the only sample is of a delta light.
    draws: u32,
    /// Probability that a sample of the combined estimate is drawn by the technique.
    probability: f32,
    /// Samples of delta lights, and their expected number.
    delta_draws: u32,
    n_delta: f32,
    /// BSDF samples of specular lobes, outside the combined estimate.
    specular_draws: u32,
}

impl Plan {
    fn new(job: &RenderJob, technique: SamplingTechnique, point: &ShadingPoint<'_>) -> Self {
        let n = point.sample_counts.samples;
        let bsdf = &point.bsdf.bsdf;
        let technique = if bsdf.has_non_specular() { technique } else { SamplingTechnique::Bsdf };
        let all = Plan { technique, n, draws: n, probability: 1.0, delta_draws: 0, n_delta: 0.0, specular_draws: 0 };
        match technique {
            SamplingTechnique::Light => Plan { specular_draws: u32::from(n > 0 && bsdf.has_specular()), ..all },
            SamplingTechnique::Bsdf if job.lights.delta.is_none() || !bsdf.has_non_specular() || n == 0 => all,
            SamplingTechnique::Bsdf if n == 1 => {
                let is_delta = u32::from(point.stream.domain(domain::TECHNIQUE).draw::<1>()[0] < 0.5);
                Plan { draws: 1 - is_delta, probability: 0.5, delta_draws: is_delta, n_delta: 0.5, ..all }
            }
            SamplingTechnique::Bsdf => {
                let delta = (n / DELTA_DIVISOR).max(1);
                Plan { n: n - delta, draws: n - delta, delta_draws: delta, n_delta: delta as f32, ..all }
            }
        }
    }

    /// Expected number of samples drawn by the technique.
    fn n_technique(&self) -> f32 {
        self.n as f32 * self.probability
    }

    /// True if samples of delta lights belong to the combined estimate.
    fn has_delta_inside(&self) -> bool {
        self.probability < 1.0
    }
}

/// Intermediate state of the estimate of a point.
#[derive(Clone, Copy, Debug)]
struct Estimate {
    plan: Plan,
    /// G; black if g = 0 everywhere.
    integral: Rgb,
    /// Shading normal on the side of wo.
    n: Vec3,
    sums: [f32; SUMS],
    /// Estimate of the light outside the combined estimate.
    outside: Rgb,
}

impl Estimate {
    fn new(job: &RenderJob, technique: SamplingTechnique, point: &ShadingPoint<'_>) -> Self {
        let plan = Plan::new(job, technique, point);
        let is_controlled = match plan.technique {
            SamplingTechnique::Light => true,
            SamplingTechnique::Bsdf => point.bsdf.wide_lobe(point.wo) >= MIN_WIDE_LOBE,
        };
        let z = point.bsdf.frame.z;
        let n = if z.dot(point.wo) < 0.0 { -z } else { z };
        let integral = if is_controlled && plan.n > 0 {
            job.irradiances.irradiance(&job.lights, point.p, n) * FRAC_1_PI
        } else {
            Rgb::BLACK
        };
        let integral = if integral.is_finite() { integral } else { Rgb::BLACK };
        Estimate { plan, integral, n, sums: [0.0; SUMS], outside: Rgb::BLACK }
    }

    /// True if g can be positive in the direction `wi`.
    fn has_g(&self, wi: Vec3) -> bool {
        !self.integral.is_black() && self.n.dot(wi) > 0.0
    }

    /// c of a sample towards `wi`, drawn with the density `pdf` by the technique. `l` is Σ L̄ of its lights.
    fn control(&self, l: Rgb, wi: Vec3, pdf: f32) -> [f32; 3] {
        if !self.has_g(wi) {
            return self.without_g();
        }
        (l * (self.n.dot(wi) * FRAC_1_PI / (self.plan.probability * pdf)) - self.integral).to_array()
    }

    /// c of a sample with g = 0.
    fn without_g(&self) -> [f32; 3] {
        (self.integral * -1.0).to_array()
    }
}

/// The estimates of a batch, and buffers.
#[derive(Debug, Default)]
pub(super) struct CorrelatedBuffers {
    estimates: Vec<Estimate>,
    /// c of each candidate; `None` outside the combined estimate.
    controls: Vec<Option<[f32; 3]>>,
    /// BSDF samples, Σ L̄ along their rays, and their candidates.
    pending: Vec<PendingBsdf>,
    crossed: Vec<Rgb>,
    bsdf_candidates: Vec<Option<Candidate>>,
    rays: RayBatch,
    ray_of: Vec<u32>,
    next_rays: RayBatch,
    next_ray_of: Vec<u32>,
    hits: EmitterScratch,
    emitter_hits: Vec<Option<EmitterHit>>,
    far: Vec<u32>,
    emitters: Vec<Option<EmitterInDirection>>,
}

impl Correlated {
    /// T1. Zero-valued samples are added to the sums; all others become candidates.
    pub(super) fn propose(&self, t1: &mut T1<'_>, b: &mut CorrelatedBuffers) {
        let T1 { job, points, candidates, .. } = t1;
        b.controls.clear();
        b.pending.clear();
        b.rays.clear();
        b.estimates.clear();
        b.estimates.extend(points.iter().map(|point| Estimate::new(job, self.technique, point)));

        // Light samples
        let start = Instant::now();
        for (index, point) in points.iter().enumerate() {
            b.draw_delta(job, index, point, candidates);
            if b.estimates[index].plan.technique == SamplingTechnique::Light {
                b.draw_light(job, index, point, candidates);
            }
        }
        candidates.stats.t1_light += start.elapsed();

        // BSDF samples, and their emitters
        for (index, point) in points.iter().enumerate() {
            b.draw_bsdf(index, point, candidates);
        }
        b.follow(job, points, candidates);
        b.add_bsdf(candidates);
    }

    pub(super) fn select(candidates: &mut Candidates) {
        candidates.weigh(Candidate::own_factor);
    }

    /// Computes the estimates from the traced candidates; `out[i]` belongs to point `i`.
    pub(super) fn resolve(candidates: &Candidates, segments: &Segments, b: &mut CorrelatedBuffers, out: &mut [Rgb]) {
        let are_free = segments.are_free(&candidates.contributions);
        let traced = candidates.records.iter().zip(&candidates.contributions).zip(are_free);
        for (((c, contribution), is_free), control) in traced.zip(&b.controls) {
            let value = if is_free { *contribution } else { Rgb::BLACK };
            let estimate = &mut b.estimates[c.point as usize];
            match control {
                Some(control) => {
                    correlated::add(&mut estimate.sums, *control, (value * estimate.plan.n as f32).to_array());
                }
                None => estimate.outside += value,
            }
        }
        for (out, e) in out.iter_mut().zip(&b.estimates) {
            *out = Rgb::from_array(correlated::combined(&e.sums)) + e.outside;
        }
    }
}

impl CorrelatedBuffers {
    /// Draws samples of delta lights.
    fn draw_delta(&mut self, job: &RenderJob, index: usize, point: &ShadingPoint<'_>, candidates: &mut Candidates) {
        let estimate = self.estimates[index];
        let Plan { delta_draws, n_delta, .. } = estimate.plan;
        let Some(sampler) = job.lights.delta.as_ref().filter(|_| delta_draws > 0) else { return };
        let allocation = SampleAllocation { light_draws: delta_draws, bsdf_draws: 0, n_light: n_delta, n_bsdf: 0.0 };
        let control = estimate.plan.has_delta_inside().then_some(estimate.without_g());
        let ctx = point.light_ctx();
        candidates.stats.proposals += u64::from(delta_draws);
        candidates.stats.light_proposals += u64::from(delta_draws);

        // Samples with g = 0
        for i in 0..delta_draws {
            let [u_choice, u0, u1] = point.stream.split(domain::DELTA, delta_draws, i).draw::<3>();
            let candidate = sampler
                .sample(&ctx, u_choice)
                .and_then(|choice| job.lights.sample_choice(&ctx, choice, [u0, u1]))
                .and_then(|drawn| light_candidate(job, index as u32, point, &allocation, drawn));
            self.add(index, candidate, control, candidates);
        }
    }

    /// Draws light samples of the combined estimate.
    fn draw_light(&mut self, job: &RenderJob, index: usize, point: &ShadingPoint<'_>, candidates: &mut Candidates) {
        let estimate = self.estimates[index];
        let n = estimate.plan.draws;
        let allocation = SampleAllocation::fixed(n, 0);
        let ctx = point.light_ctx();
        candidates.stats.proposals += u64::from(n);
        candidates.stats.light_proposals += u64::from(n);
        for i in 0..n {
            let [u_choice, u0, u1] = point.stream.split(domain::LIGHT, n, i).draw::<3>();

            // Sample, c, and candidate
            let drawn = job.lights.sample(&ctx, u_choice, [u0, u1]);
            let drawn = drawn.map(|drawn| with_infinite(job, &ctx, drawn));
            let control = match &drawn {
                Some(SampleOfLight { light, sample: s }) if !s.is_delta => {
                    estimate.control(sampled_l(job, &estimate, point.p, *light, s), s.wi, s.pdf)
                }
                Some(_) | None => estimate.without_g(),
            };
            let candidate = drawn.and_then(|drawn| light_candidate(job, index as u32, point, &allocation, drawn));
            self.add(index, candidate, Some(control), candidates);
        }
    }

    /// Draws BSDF samples without their emitters.
    fn draw_bsdf(&mut self, index: usize, point: &ShadingPoint<'_>, candidates: &mut Candidates) {
        let estimate = self.estimates[index];
        let plan = estimate.plan;
        let (n, expected) = match plan.technique {
            SamplingTechnique::Bsdf => (plan.draws, plan.n_technique()),
            SamplingTechnique::Light => (plan.specular_draws, plan.specular_draws as f32),
        };
        candidates.stats.proposals += u64::from(n);
        for i in 0..n {
            let [uc, u0, u1] = point.stream.split(domain::BSDF, n, i).draw::<3>();

            // Light sampling only keeps samples of specular lobes
            let is_inside = plan.technique == SamplingTechnique::Bsdf;
            let sample = point.bsdf.sample_direction(point.wo, uc, [u0, u1]);
            let Some(s) = sample.filter(|s| is_inside || s.lobe.is_specular()) else {
                self.add(index, None, is_inside.then_some(estimate.without_g()), candidates);
                continue;
            };

            // The ray, to be traced with all others
            let f_cos = s.f * point.bsdf.cos(s.wi);
            self.rays.push(&point.ray(s.wi));
            self.pending.push(PendingBsdf {
                point: index as u32,
                wi: s.wi,
                f_cos: if f_cos.is_finite() { f_cos } else { Rgb::BLACK },
                pdf: s.pdf,
                specular: s.lobe.is_specular(),
                lobe: 0,
                allocation: SampleAllocation { light_draws: 0, bsdf_draws: n, n_light: 0.0, n_bsdf: expected },
            });
        }
    }

    /// Finds the emitters along the rays of BSDF samples: the first one for the integrand, and all of them for g.
    fn follow(&mut self, job: &RenderJob, points: &[ShadingPoint<'_>], candidates: &mut Candidates) {
        self.bsdf_candidates.clear();
        self.crossed.clear();
        self.crossed.resize(self.pending.len(), job.irradiances.environment());
        self.ray_of.clear();
        self.ray_of.extend(0..self.pending.len() as u32);
        let lights = &job.lights;
        // A ray crosses a light at most twice
        for crossing in 0..=2 * lights.lights.len() {
            if self.rays.is_empty() {
                break;
            }
            candidates.stats.emitter_rays += self.rays.len() as u64;
            job.world.intersect_emitters(&self.rays, &mut self.hits, &mut self.emitter_hits);
            if crossing == 0 {
                let CorrelatedBuffers { pending, emitter_hits, far, emitters, .. } = &mut *self;
                find_emitters(job, points, pending, emitter_hits, choice_by_sampler(job), far, emitters);
            }
            self.next_rays.clear();
            self.next_ray_of.clear();
            for (&i, hit) in self.ray_of.iter().zip(&self.emitter_hits) {
                let pending = &self.pending[i as usize];
                let point = &points[pending.point as usize];
                if crossing == 0 {
                    let candidate = bsdf_candidate(job, point, pending, hit.as_ref(), self.emitters[i as usize]);
                    self.bsdf_candidates.push(candidate);
                }
                let estimate = &self.estimates[pending.point as usize];
                let Some(hit) = hit.filter(|_| !pending.specular && estimate.has_g(pending.wi)) else { continue };
                let surface = job.world.scene.geometry.surface_hit(
                    hit.geometry,
                    hit.primitive,
                    Hit::NO_INSTANCE,
                    hit.uv,
                    point.time,
                );
                if let Some(light) = hit.light {
                    let at = SurfacePoint { p: point.p, n: estimate.n };
                    self.crossed[i as usize] += job.irradiances.l(lights, light, at, pending.wi, surface.n);
                }
                // If emitters never hide each other, there is nothing behind the first one
                if job.world.emitters_hide() {
                    let o = offset_origin(surface.p, surface.p_error, surface.n, pending.wi);
                    self.next_rays.push(&Ray { o, d: pending.wi, t_max: f32::INFINITY, time: point.time });
                    self.next_ray_of.push(i);
                }
            }
            std::mem::swap(&mut self.rays, &mut self.next_rays);
            std::mem::swap(&mut self.ray_of, &mut self.next_ray_of);
        }
    }

    /// Adds the BSDF samples with their emitters.
    fn add_bsdf(&mut self, candidates: &mut Candidates) {
        for i in 0..self.pending.len() {
            let pending = &self.pending[i];
            let index = pending.point as usize;
            let estimate = &self.estimates[pending.point as usize];
            let control = if pending.specular {
                estimate.without_g()
            } else {
                estimate.control(self.crossed[i], pending.wi, pending.pdf)
            };
            let is_inside = estimate.plan.technique == SamplingTechnique::Bsdf;
            self.add(index, self.bsdf_candidates[i], is_inside.then_some(control), candidates);
        }
    }

    /// Adds a sample of a point. Without a candidate it is zero-valued. `control` is its c, or `None` outside the
    /// combined estimate.
    fn add(
        &mut self,
        index: usize,
        candidate: Option<Candidate>,
        control: Option<[f32; 3]>,
        candidates: &mut Candidates,
    ) {
        match (candidate, control) {
            (Some(candidate), control) => {
                candidates.records.push(candidate);
                self.controls.push(control);
            }
            (None, Some(control)) => correlated::add(&mut self.estimates[index].sums, control, [0.0; 3]),
            (None, None) => {}
        }
    }
}

/// Σ L̄ of a light sample: L̄ of its light, or the sum of all infinite lights.
fn sampled_l(job: &RenderJob, estimate: &Estimate, p: Vec3, light: LightId, sample: &LightSample) -> Rgb {
    let lights = &job.lights;
    if !estimate.has_g(sample.wi) {
        Rgb::BLACK
    } else if lights.infinite.contains(&light) {
        job.irradiances.environment()
    } else {
        job.irradiances.l(lights, light, SurfacePoint { p, n: estimate.n }, sample.wi, sample.n)
    }
}
