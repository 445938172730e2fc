//! T1: candidates with their unshadowed integrands and the densities of all techniques, one at a time.

use super::contributing::Contributing;
use super::domain;
use super::mixture::Mixture;
use super::point::ShadingPoint;
use crate::accel::{Hit, RayBatch};
use crate::lights::groups::MAX_GROUPS;
use crate::lights::{LightCtx, LightHit, LightId, LightSample};
use crate::scene::{EmitterHit, EmitterScratch, RenderJob};
use crate::settings::{EstimatorKind, IntegratorSettings};
use lumiris_numbers::estimators::mc;
use lumiris_numbers::estimators::mis::{Heuristic, Technique};
use lumiris_numbers::math::{Ray, Rgb, Vec3};
use lumiris_numbers::samplers::SampleStream;
use std::time::{Duration, Instant};

/// Tolerance for an expected number of samples that should be whole.
const COUNT_ROUNDING: f32 = 1e-3;

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
    /// The light; one of those at infinity for a direction of BSDF sampling that meets no surface.
    pub light: LightId,
    /// Density of light sampling at the direction (per steradian, light choice included; a probability for deltas).
    pub p_light: f32,
    /// Density of BSDF sampling (per steradian; as the BSDF gives it for specular lobes).
    pub p_bsdf: f32,
    /// Expected number of light samples of the point.
    pub n_light: f32,
    /// Expected number of BSDF samples of the point.
    pub n_bsdf: f32,
    /// The part of `p_bsdf` that is the first lobe's; kept for estimators with components.
    pub p_lobe: f32,
    /// Group of the light; kept for estimators with components. Without meaning where `p_light` is 0.
    pub group: u8,
    /// The segment that must be unoccluded for the candidate to count.
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
            Drawn::Light => heuristic.factor(light, bsdf),
            Drawn::Bsdf => heuristic.factor(bsdf, light),
        }
    }
}

/// All candidates of a batch, in the order of their shading points.
#[derive(Debug, Default)]
pub struct Candidates {
    /// Those with a non-zero integrand.
    pub records: Vec<Candidate>,
    /// The mixture of each point, for estimators with components.
    pub mixtures: Vec<Mixture>,
    /// Samples drawn, including zero-valued and failed ones.
    pub proposals: u64,
    /// Light samples among them.
    pub light_proposals: u64,
    /// Rays traced against emitters.
    pub emitter_rays: u64,
    /// Time for light samples.
    pub light_time: Duration,
    pub(super) spare: Vec<Candidate>,
    contributing: Contributing,
    pending: Vec<PendingBsdf>,
    rays: RayBatch,
    hits: EmitterScratch,
    emitter_hits: Vec<Option<EmitterHit>>,
}

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

/// The number of samples per technique at a point.
#[derive(Clone, Copy, Debug)]
pub(super) struct SampleAllocation {
    pub light_draws: u32,
    pub bsdf_draws: u32,
    /// Expected numbers.
    pub n_light: f32,
    pub n_bsdf: f32,
}

impl SampleAllocation {
    /// Fixed numbers of samples.
    pub(super) fn fixed(light: u32, bsdf: u32) -> Self {
        SampleAllocation { light_draws: light, bsdf_draws: bsdf, n_light: light as f32, n_bsdf: bsdf as f32 }
    }

    /// A single sample that chooses its technique at random: the expected numbers are one half each.
    pub(super) fn one_of_both(point: &ShadingPoint<'_>) -> Self {
        let light = point.stream.domain(domain::TECHNIQUE).draw::<1>()[0] < 0.5;
        SampleAllocation { light_draws: u32::from(light), bsdf_draws: u32::from(!light), n_light: 0.5, n_bsdf: 0.5 }
    }

    /// Allocates the samples, or the proposals, to the techniques.
    fn new(settings: &IntegratorSettings, point: &ShadingPoint<'_>) -> Self {
        let n = point.sample_counts.samples;
        if point.bsdf_by_path {
            return SampleAllocation { bsdf_draws: 0, ..SampleAllocation::fixed(point.light_samples_beside_path(), 1) };
        }
        if !point.bsdf.bsdf.has_non_specular() {
            return SampleAllocation::fixed(0, n);
        }
        match settings.estimator {
            EstimatorKind::Mc | EstimatorKind::Contributing => {
                SampleAllocation::fixed(n, u32::from(point.bsdf.bsdf.has_specular()))
            }
            EstimatorKind::Mis | EstimatorKind::Ocv | EstimatorKind::OptimalMis if n == 1 => {
                SampleAllocation::one_of_both(point)
            }
            EstimatorKind::Mis | EstimatorKind::Ocv | EstimatorKind::OptimalMis => {
                let by_bsdf = settings.bsdf_samples(n);
                SampleAllocation::fixed(n - by_bsdf, by_bsdf)
            }
            EstimatorKind::Ris => super::ris::allocation(point),
            EstimatorKind::Correlated => SampleAllocation::fixed(0, n),
        }
    }
}

impl Candidates {
    /// Removes all.
    pub(super) fn clear(&mut self) {
        self.records.clear();
        self.mixtures.clear();
        (self.proposals, self.light_proposals, self.emitter_rays) = (0, 0, 0);
        self.light_time = Duration::ZERO;
    }

    /// Draws the candidates of all points; for `ris` only those by BSDF sampling, since [`super::ris`] makes the many
    /// light samples itself.
    pub fn propose(&mut self, job: &RenderJob, settings: &IntegratorSettings, points: &[ShadingPoint<'_>]) {
        self.clear();
        self.pending.clear();
        self.rays.clear();
        let has_components = settings.estimator.has_components();

        // Light samples
        let start = Instant::now();
        for (index, point) in points.iter().enumerate() {
            let allocation = SampleAllocation::new(settings, point);
            self.proposals += u64::from(allocation.light_draws + allocation.bsdf_draws);
            self.light_proposals += u64::from(allocation.light_draws);
            if settings.estimator == EstimatorKind::Ris {
                continue;
            }
            if settings.estimator == EstimatorKind::Contributing {
                if allocation.light_draws > 0 {
                    let noncontributing = settings.contributing.noncontributing_samples;
                    let drawn = self.contributing.draw(job, (index as u32, point), noncontributing, &mut self.records);
                    self.proposals = self.proposals + u64::from(drawn) - u64::from(allocation.light_draws);
                    self.light_proposals = self.light_proposals + u64::from(drawn) - u64::from(allocation.light_draws);
                }
                continue;
            }
            if has_components {
                self.draw_groups(job, index as u32, point, &allocation);
                continue;
            }
            for i in 0..allocation.light_draws {
                let stream = point.stream.split(domain::LIGHT, allocation.light_draws, i);
                let [u_choice, u0, u1] = stream.draw::<3>();
                let ctx = point.light_ctx();
                let candidate = job.lights.sample(&ctx, u_choice, [u0, u1]).and_then(|(light, sample)| {
                    light_candidate(job, index as u32, point, &allocation, (light, sample))
                });
                self.records.extend(candidate);
            }
        }
        self.light_time = start.elapsed();

        // BSDF samples up to the question which emitter they point at
        for (index, point) in points.iter().enumerate() {
            let allocation = SampleAllocation::new(settings, point);
            for i in 0..allocation.bsdf_draws {
                let stream = point.stream.split(domain::BSDF, allocation.bsdf_draws, i);
                self.draw_bsdf(index as u32, point, allocation, stream);
            }
        }

        // The emitters that the BSDF samples point at
        self.emitter_rays = self.rays.len() as u64;
        job.world.intersect_emitters(&self.rays, &mut self.hits, &mut self.emitter_hits);
        for (pending, hit) in self.pending.iter().zip(&self.emitter_hits) {
            let point = &points[pending.point as usize];
            let mut candidate = bsdf_candidate(job, point, pending, hit.as_ref());
            if let Some(mixture) = self.mixtures.get_mut(pending.point as usize) {
                match &mut candidate {
                    Some(c) if pending.specular => c.p_lobe = if pending.lobe == 0 { c.p_bsdf } else { 0.0 },
                    Some(c) => c.p_lobe = mixture.p_lobe(point, pending.wi, c.p_bsdf),
                    None => mixture.zero_valued[pending.lobe] += 1,
                }
            }
            self.records.extend(candidate);
        }
    }

    /// Draws the light samples of a point separately for each group of lights, N times its probability, rounded by one
    /// random number for all groups.
    fn draw_groups(&mut self, job: &RenderJob, index: u32, point: &ShadingPoint<'_>, allocation: &SampleAllocation) {
        let lights = &job.lights;
        let ctx = point.light_ctx();
        let n = allocation.light_draws;
        let pmfs = if allocation.n_light > 0.0 { lights.groups.pmfs(&lights.sampler, &ctx) } else { [0.0; MAX_GROUPS] };
        let mut mixture = Mixture::new(job, point, allocation, &pmfs);

        // Samples stand at (i + u)/N; those of a group lie between the sums of probabilities
        let [u] = point.stream.domain(domain::GROUPS).draw::<1>();
        let (mut first, mut sum) = (0, 0.0);
        for (group, &pmf) in pmfs[..lights.groups.len()].iter().enumerate().filter(|(_, pmf)| **pmf > 0.0) {
            sum += f64::from(pmf) * f64::from(n);
            let end = ((sum - f64::from(u)).ceil() as u32).clamp(first, n);
            // A count that does not depend on u, so that the samples of a pixel are points of one set
            let count = ((pmf * n as f32 - COUNT_ROUNDING).ceil() as u32).max(end - first);
            for i in 0..end - first {
                let stream = point.stream.split(domain::GROUP + group as u32, count, i);
                let [u0, u1, u_choice] = stream.draw::<3>();
                let sample = lights.sample_group(&ctx, (group, pmf), u_choice, [u0, u1]);
                let candidate = sample.and_then(|(light, sample)| {
                    let c = light_candidate(job, index, point, allocation, (light, sample))?;
                    let p_lobe = mixture.p_lobe(point, sample.wi, c.p_bsdf);
                    Some(Candidate { group: group as u8, p_lobe, ..c })
                });
                if candidate.is_none() {
                    mixture.zero_valued[mixture.component(group)] += 1;
                }
                self.records.extend(candidate);
            }
            first = end;
        }
        mixture.failed = n - first;
        self.mixtures.push(mixture);
    }

    fn draw_bsdf(&mut self, index: u32, point: &ShadingPoint<'_>, allocation: SampleAllocation, stream: SampleStream) {
        let [uc, u0, u1] = stream.draw::<3>();
        let lobe = self.mixtures.get(index as usize).map_or(0, |mixture| mixture.lobe(uc));
        let sample = point.bsdf.sample(point.wo, uc, [u0, u1]);
        let sample =
            sample.map(|s| (s.f * s.wi.dot(point.bsdf.frame.z).abs(), s)).filter(|(f_cos, _)| !f_cos.is_black());
        let Some((f_cos, sample)) = sample else {
            if let Some(mixture) = self.mixtures.get_mut(index as usize) {
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

/// A light sample; for an infinite light, with the radiance of all infinite lights and the density of choosing any of
/// them.
pub(super) fn with_infinite(
    job: &RenderJob,
    ctx: &LightCtx,
    (light, mut sample): (LightId, LightSample),
) -> (LightId, LightSample) {
    let lights = &job.lights;
    if lights.infinite.len() > 1 && lights.infinite.contains(&light) {
        (sample.li, sample.pdf) = lights.infinite_in_direction(ctx, sample.wi);
    }
    (light, sample)
}

/// A sample of a light, whose density includes the choice; `None` if its integrand is zero.
pub(super) fn light_candidate(
    job: &RenderJob,
    index: u32,
    point: &ShadingPoint<'_>,
    allocation: &SampleAllocation,
    drawn: (LightId, LightSample),
) -> Option<Candidate> {
    // Infinite lights overlap: a direction belongs to all of them together
    unshadowed_candidate(index, point, allocation, with_infinite(job, &point.light_ctx(), drawn))
}

/// A sample of a light by itself, whose density includes the choice; `None` if its integrand is zero.
pub(super) fn unshadowed_candidate(
    index: u32,
    point: &ShadingPoint<'_>,
    allocation: &SampleAllocation,
    (light, sample): (LightId, LightSample),
) -> Option<Candidate> {
    // Unshadowed integrand
    let f_cos = point.bsdf.f(point.wo, sample.wi) * sample.wi.dot(point.bsdf.frame.z).abs();
    let f = f_cos * sample.li;
    if f.is_black() || !(sample.pdf > 0.0) {
        return None;
    }

    // A technique without samples has no weight, whatever its density
    let drawn = if sample.is_delta { Drawn::DeltaLight } else { Drawn::Light };
    let p_bsdf = if sample.is_delta || allocation.n_bsdf == 0.0 { 0.0 } else { point.bsdf.pdf(point.wo, sample.wi) };
    Some(Candidate {
        point: index,
        drawn,
        f,
        li: sample.li,
        light,
        p_light: sample.pdf,
        p_bsdf,
        n_light: allocation.n_light,
        n_bsdf: allocation.n_bsdf,
        p_lobe: 0.0,
        group: 0,
        segment: point.light_segment(&sample),
    })
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
pub(crate) fn emitter_in_direction(
    job: &RenderJob,
    ctx: &LightCtx,
    wi: Vec3,
    hit: Option<&EmitterHit>,
    time: f32,
) -> Option<EmitterInDirection> {
    let lights = &job.lights;
    let Some(hit) = hit else {
        let (li, p_light) = lights.infinite_in_direction(ctx, wi);
        return (!li.is_black()).then_some(EmitterInDirection { li, p_light, end: None });
    };
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
