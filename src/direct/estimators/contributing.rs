//! Separate sampling of the contributing lights 𝓛_con, given by the visibility cache, and of all other lights [Keller
//! and Wald 2000, §3].
//!
//! S_con samples are taken on 𝓛_con in proportion to w_l = E_l·√V̂_l, the density of minimum variance. E_l is the
//! unshadowed irradiance of the light, on glossy surfaces weighted by the reflection. V̂_l is its visibility estimated
//! from photons ([`crate::lights::learned_visibility`]). With m_l = S_con·w_l/Σ w, light l gets ⌊m_l⌋ or ⌈m_l⌉ samples
//! by systematic resampling. If m_l ≥ 1, the light contributes the mean of its samples. Otherwise it has one sample
//! with probability m_l, whose weight is 1/m_l. If there are more than [`MAX_WEIGHTED`] contributing lights, S_con
//! lights are chosen in proportion to their photon counts.
//!
//! S_non samples are taken on the non-contributing lights. A descent of the light tree chooses them nearly in
//! proportion to E_l·√V̂_l, where V̂_l is the visibility of a light without photons. So lights with many expected
//! photons get few of these samples, and neighbours of lights with a single photon get more. A contributing light that
//! is chosen counts 0. A sample of light l, chosen with probability p_l, survives Russian roulette with probability q_l
//! = min(1, [`SURVIVAL`]·(E_l·√V̂_l/p_l)/Σ E·V̂), its expected contribution relative to the contributing lights. Its
//! weight is 1/(p_l·q_l). So every sum has the right expectation for any photons. Without these samples (S_non = 0),
//! the estimate is biased, and no BSDF samples are taken.
//!
//! Light samples alone leave fireflies on glossy surfaces. There, S_b BSDF samples are combined with them by multiple
//! importance sampling [Veach and Guibas 1995]. A direction towards light l has the light-sampling density r_l·p_l,
//! where p_l is the density of the samples of the light, and r_l the expected number of its samples at the point.
//!
//! If no light contributes, all S_con + S_non samples are taken on non-contributing lights, without roulette. Without a
//! visibility cache, or with an empty one, light samples are drawn as by `mc`.

use super::mc;
use crate::bsdfs::Bsdf;
use crate::direct::candidates::{Candidate, Candidates, SampleAllocation};
use crate::direct::domain;
use crate::direct::light_samples::{self, unshadowed_candidate};
use crate::direct::point::ShadingPoint;
use crate::direct::t1::T1;
use crate::lights::learned_visibility::{ExpectedContribution, NoncontributingDraw, NoncontributingLight};
use crate::lights::visibility_cache::ContributingLights;
use crate::lights::{
    JobLights, LeAndPdf, LearnedVisibility, LightCtx, LightId, PhotonCount, SampleOfLight, SampledLight,
};
use crate::scene::RenderJob;
use lumiris_numbers::estimators::heuristics::Heuristic;
use lumiris_numbers::math::cumulative;
use std::ops::Range;
use std::time::Instant;

/// Maximum number of contributing lights that are weighted at a point.
pub const MAX_WEIGHTED: usize = 64;
/// Survival probability of a sample of non-contributing lights, per expected contribution relative to the contributing
/// lights.
const SURVIVAL: f32 = 3.0;

/// Separate light sampling of contributing and non-contributing lights, and BSDF sampling of glossy surfaces.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Contributing {
    /// Samples on contributing lights (S_con).
    pub samples: u32,
    /// Samples on non-contributing lights (S_non).
    pub noncontributing_samples: u32,
    /// BSDF samples at BSDFs that are not diffuse (S_b).
    pub bsdf_samples: u32,
    /// Weights of light and BSDF samples.
    pub heuristic: Heuristic,
}

impl Contributing {
    /// Number of BSDF samples at a point that are combined with the light samples.
    fn bsdf_samples_at(&self, bsdf: &Bsdf<'_>) -> u32 {
        if bsdf.is_wide() { 0 } else { self.bsdf_samples }
    }

    /// The allocation at a point. The expected number of light samples is 1, since their densities include their
    /// numbers.
    fn allocation(&self, point: &ShadingPoint<'_>) -> SampleAllocation {
        let only = mc::allocation_at(point);
        match self.bsdf_samples_at(&point.bsdf.bsdf) {
            n if n > 0 && only.light_draws > 0 => {
                SampleAllocation { n_light: 1.0, ..SampleAllocation::fixed(only.light_draws, n) }
            }
            _ => SampleAllocation { n_light: 1.0, ..only },
        }
    }

    pub(super) fn propose(&self, t1: &mut T1<'_>, buffers: &mut ContributingBuffers) {
        buffers.rates.clear();
        buffers.singles.clear();
        let job = t1.job;
        let mut samples = BatchSamples { estimator: *self, job, buffers, of_points: Vec::new() };
        let allocate = |point: &ShadingPoint<'_>| self.allocation(point);
        t1.draw_lights(allocate, |_, index, point, allocation, records| {
            samples.draw(index, point, allocation, records)
        });

        // Samples of non-contributing lights, of all points together
        let Candidates { records, stats, .. } = &mut *t1.candidates;
        let start = Instant::now();
        let drawn = samples.draw_noncontributing(t1.points, records);
        stats.proposals += u64::from(drawn);
        stats.light_proposals += u64::from(drawn);
        stats.t1_light += start.elapsed();

        // BSDF samples
        let BatchSamples { buffers, of_points, .. } = samples;
        let samples_at = |point: u32| of_points.get(point as usize).and_then(Option::as_ref);
        t1.draw_bsdf(allocate, &mut [], |point, ctx, light| {
            samples_at(point).map_or(0.0, |samples| samples.rate(&job.lights, buffers, ctx, light))
        });
    }

    pub(super) fn select(&self, candidates: &mut Candidates) {
        if self.bsdf_samples == 0 {
            mc::select(candidates);
        } else {
            candidates.weigh(|c| c.factor(self.heuristic));
        }
    }
}

/// Buffers kept from batch to batch.
#[derive(Debug, Default)]
pub(super) struct ContributingBuffers {
    /// Expected contributions of the contributing lights of a point, and their weights.
    expected: Vec<ExpectedContribution>,
    weights: Vec<f32>,
    /// Expected sample counts of contributing lights, point by point.
    rates: Vec<f32>,
    /// Contributing lights with one photon, by [`LearnedVisibility::find_singles`], point by point.
    singles: Vec<u32>,
}

/// The light samples of a batch.
struct BatchSamples<'a, 'b> {
    estimator: Contributing,
    job: &'a RenderJob,
    buffers: &'b mut ContributingBuffers,
    /// The light samples of each point; `None` if it draws none. May be shorter than the points.
    of_points: Vec<Option<PointSamples<'a>>>,
}

/// The light samples drawn at a point.
#[derive(Clone, Debug)]
struct PointSamples<'a> {
    /// 𝓛_con with photon counts.
    contributing: ContributingLights<'a>,
    /// Samples on 𝓛_con (S_con).
    n: u32,
    /// Range of their rates in [`ContributingBuffers::rates`]; empty if lights are chosen by photon counts.
    rates: Range<usize>,
    /// Range in [`ContributingBuffers::singles`].
    singles: Range<usize>,
    others: Others,
    /// Number of BSDF samples that are combined with them.
    n_bsdf: f32,
}

/// Sampling of lights outside 𝓛_con.
#[derive(Clone, Copy, Debug)]
enum Others {
    /// n samples of lights without photons, which survive with a probability of their expected contribution times
    /// `scale`.
    Noncontributing { n: u32, scale: f32 },
    /// n samples of all lights by the light sampler.
    BySampler { n: u32 },
}

impl PointSamples<'_> {
    /// Expected number of samples of a light.
    #[inline]
    fn rate(&self, lights: &JobLights, buffers: &ContributingBuffers, ctx: &LightCtx, light: LightId) -> f32 {
        let n = match self.others {
            Others::BySampler { n } => return n as f32 * lights.sampler.pmf(ctx, light),
            Others::Noncontributing { n, .. } => n as f32,
        };
        // A contributing light
        if let Some(k) = self.contributing.index_of(light) {
            let weighted = buffers.rates[self.rates.clone()].get(k).copied();
            return weighted.unwrap_or_else(|| self.rate_by_photons(k));
        }

        // Another light, which survives roulette
        let (Others::Noncontributing { scale, .. }, Some(learned)) = (self.others, lights.learned_visibility()) else {
            return 0.0;
        };
        let noncontributing =
            learned.noncontributing_light(ctx, &self.contributing, &buffers.singles[self.singles.clone()], light);
        let pmf = noncontributing.sampled.pmf;
        if pmf > 0.0 && noncontributing.expected.importance > 0.0 {
            n * pmf * survival(&noncontributing, scale)
        } else {
            0.0
        }
    }

    /// Expected number of samples of contributing light number `k`, chosen in proportion to photon counts.
    #[inline]
    fn rate_by_photons(&self, k: usize) -> f32 {
        let total = self.contributing.sums.last().map_or(1.0, |&total| total as f32);
        self.n as f32 * cumulative::weight(self.contributing.sums, k) / total
    }
}

/// Survival probability of a sample of a light without photons; `scale` is the probability per expected contribution.
#[inline]
fn survival(noncontributing: &NoncontributingLight, scale: f32) -> f32 {
    let ExpectedContribution { importance, visibility } = noncontributing.expected;
    (importance * visibility.sqrt() / noncontributing.sampled.pmf * scale).min(1.0)
}

/// A sample of a light without photons, whose light is to be chosen.
struct PendingSample<'s, 'a, 'p> {
    at: At<'a, 'p>,
    samples: &'s PointSamples<'a>,
    u_survival: f32,
    /// Random numbers of the direction.
    u: [f32; 2],
}

/// A point with its lights.
#[derive(Clone)]
struct At<'a, 'p> {
    lights: &'a JobLights,
    learned: &'a LearnedVisibility,
    index: u32,
    point: &'p ShadingPoint<'p>,
    ctx: LightCtx,
    n_bsdf: f32,
}

impl At<'_, '_> {
    /// The candidate of a light sample. `rate` is the expected number of samples of the light.
    fn sample(
        &self,
        light: LightId,
        rate: f32,
        u: [f32; 2],
        samples: &PointSamples<'_>,
        buffers: &ContributingBuffers,
    ) -> Option<Candidate> {
        let mut sample = self.lights.lights[light as usize].sample_li(&self.ctx, u)?;
        sample.pdf *= rate;
        if self.n_bsdf > 0.0 && self.overlaps(light) {
            // Infinite lights overlap: all of them contribute to a direction
            let rate = |ctx: &LightCtx, light| samples.rate(self.lights, buffers, ctx, light);
            LeAndPdf { le: sample.li, pdf: sample.pdf } =
                self.lights.infinite_in_direction_by(&self.ctx, sample.wi, rate);
        }
        let allocation = SampleAllocation { n_bsdf: self.n_bsdf, ..SampleAllocation::fixed(1, 0) };
        unshadowed_candidate(self.index, self.point, &allocation, SampleOfLight { light, sample })
    }

    /// True if other infinite lights overlap with the light.
    fn overlaps(&self, light: LightId) -> bool {
        self.lights.infinite.len() > 1 && self.lights.infinite.contains(&light)
    }

    /// Expected number of samples of a contributing light.
    fn rate(&self, light: LightId, LightCounts { ideal, drawn }: LightCounts) -> f32 {
        // The counts of overlapping lights depend on the same random number, so their drawn numbers cannot be used
        if ideal < 1.0 || self.n_bsdf > 0.0 && self.overlaps(light) { ideal } else { drawn as f32 }
    }
}

/// Sample counts of a light.
#[derive(Clone, Copy, Debug, PartialEq)]
struct LightCounts {
    /// m_l.
    ideal: f32,
    /// ⌊m_l⌋ or ⌈m_l⌉.
    drawn: u32,
}

/// Ideal sample counts weight·`scale`, and the counts drawn by systematic resampling with `offset` in [0, 1).
fn systematic(weights: &[f32], scale: f32, offset: f32) -> impl Iterator<Item = LightCounts> {
    let (mut upto, mut given) = (offset, 0);
    weights.iter().map(move |&weight| {
        let ideal = weight * scale;
        upto += ideal;
        // Rounding must not remove the sample of a light with an ideal count of 1 or more
        let drawn = (upto as u32).saturating_sub(given).max(u32::from(ideal >= 1.0));
        given = upto as u32;
        LightCounts { ideal, drawn }
    })
}

impl BatchSamples<'_, '_> {
    /// Draws the light samples of a point, without the non-contributing lights. Returns the number of samples.
    fn draw(
        &mut self,
        index: u32,
        point: &ShadingPoint<'_>,
        allocation: &SampleAllocation,
        records: &mut Vec<Candidate>,
    ) -> u32 {
        let (n, n_non, lights) = (allocation.light_draws, self.estimator.noncontributing_samples, &self.job.lights);
        if n == 0 {
            return 0;
        }
        let n_bsdf = if self.estimator.bsdf_samples > 0 { allocation.n_bsdf } else { 0.0 };
        let ContributingBuffers { rates, singles, .. } = &*self.buffers;
        let mut samples = PointSamples {
            contributing: ContributingLights::default(),
            n,
            rates: rates.len()..rates.len(),
            singles: singles.len()..singles.len(),
            others: Others::BySampler { n: n + n_non },
            n_bsdf,
        };

        // By the visibility cache, or else by the light sampler
        let by_cache = lights.learned_visibility().and_then(|learned| {
            let ctx = point.light_ctx();
            let at = At { lights, learned, index, point, ctx, n_bsdf };
            samples.contributing = lights.contributing_lights(&ctx);
            self.draw_by_cache(&at, [n, n_non], &mut samples, records)
        });
        let count = by_cache.unwrap_or_else(|| {
            let allocation = SampleAllocation { n_bsdf, ..SampleAllocation::fixed(n + n_non, 0) };
            light_samples::draw(self.job, index, point, &allocation, records)
        });

        // Samples of non-contributing lights follow. BSDF samples need the expected sample counts of the lights
        self.of_points.resize(index as usize, None);
        self.of_points.push(Some(samples));
        count
    }

    /// Draws the samples of contributing lights at a point. Returns the number of samples. Returns `None`, without
    /// samples, if the expected contribution is 0 or not finite.
    fn draw_by_cache(
        &mut self,
        at: &At<'_, '_>,
        [n, n_non]: [u32; 2],
        samples: &mut PointSamples<'_>,
        records: &mut Vec<Candidate>,
    ) -> Option<u32> {
        let contributing = samples.contributing.lights;
        if contributing.is_empty() {
            samples.others = Others::Noncontributing { n: n + n_non, scale: f32::INFINITY };
            return Some(0);
        }

        // Expected contribution Σ E·V̂
        let expected = if contributing.len() <= MAX_WEIGHTED {
            self.weigh(at, &samples.contributing)?
        } else {
            contributing.iter().map(|&PhotonCount { light, count }| at.learned.irradiance_of(light, count)).sum()
        };

        // Survival of samples of non-contributing lights
        at.learned.find_singles(&samples.contributing, &mut self.buffers.singles);
        samples.singles.end = self.buffers.singles.len();
        samples.others = Others::Noncontributing { n: n_non, scale: SURVIVAL / expected };
        if contributing.len() <= MAX_WEIGHTED {
            self.draw_weighted(at, samples, records);
        } else {
            self.draw_by_photons(at, samples, records);
        }
        Some(n)
    }

    /// Weights the contributing lights by E·√V̂. Returns Σ E·V̂; `None` if the sums are 0 or not finite.
    fn weigh(&mut self, at: &At<'_, '_>, contributing: &ContributingLights<'_>) -> Option<f32> {
        let ContributingBuffers { weights, expected: of_lights, .. } = &mut *self.buffers;
        weights.clear();
        of_lights.clear();
        at.learned.expect_many(&at.ctx, contributing.lights, of_lights);
        let (mut sum, mut expected) = (0.0, 0.0);
        for &ExpectedContribution { importance, visibility } in &*of_lights {
            let weight = importance * visibility.sqrt();
            sum += weight;
            expected += importance * visibility;
            weights.push(weight);
        }
        (sum > 0.0 && sum.is_finite() && expected > 0.0).then_some(expected)
    }

    /// Draws samples of the contributing lights, in proportion to their weights.
    fn draw_weighted(&mut self, at: &At<'_, '_>, samples: &mut PointSamples<'_>, records: &mut Vec<Candidate>) {
        let ContributingBuffers { weights, rates, .. } = &mut *self.buffers;
        let [offset] = at.point.stream.domain(domain::COUNTS).draw::<1>();
        let scale = samples.n as f32 / weights.iter().sum::<f32>();
        let lights = samples.contributing.lights;
        let numbers = || systematic(weights, scale, offset).zip(lights);
        rates.extend(numbers().map(|(counts, &PhotonCount { light, .. })| at.rate(light, counts)));
        samples.rates.end = rates.len();

        let buffers = &*self.buffers;
        let counts = systematic(&buffers.weights, scale, offset);
        for (k, (counts, &PhotonCount { light, .. })) in counts.zip(lights).enumerate() {
            let rate = buffers.rates[samples.rates.start + k];
            for i in 0..counts.drawn {
                let u = at.point.stream.split(domain::CONTRIBUTING + k as u32, counts.drawn, i).draw::<2>();
                records.extend(at.sample(light, rate, u, samples, buffers));
            }
        }
    }

    /// Draws samples of contributing lights, chosen in proportion to their photon counts.
    fn draw_by_photons(&self, at: &At<'_, '_>, samples: &PointSamples<'_>, records: &mut Vec<Candidate>) {
        let (ContributingLights { lights, sums }, n) = (samples.contributing, samples.n);
        let Some(&total) = sums.last() else { return };
        for i in 0..n {
            let [u_choice, u0, u1] = at.point.stream.split(domain::LIGHT, n, i).draw::<3>();
            let k = cumulative::find(sums, u_choice * total as f32).min(lights.len() - 1);
            let rate = samples.rate_by_photons(k);
            records.extend(at.sample(lights[k].light, rate, [u0, u1], samples, self.buffers));
        }
    }

    /// Draws the samples of lights without photons at all points, with roulette by their expected contribution. Returns
    /// the number of surviving samples.
    fn draw_noncontributing(&self, points: &[ShadingPoint<'_>], records: &mut Vec<Candidate>) -> u32 {
        let (lights, buffers) = (&self.job.lights, &*self.buffers);
        let Some(learned) = lights.learned_visibility() else { return 0 };

        // The draws of all points
        let (mut draws, mut pending) = (Vec::new(), Vec::new());
        for ((index, point), samples) in (0..).zip(points).zip(&self.of_points) {
            let Some(samples) = samples else { continue };
            let Others::Noncontributing { n, .. } = samples.others else { continue };
            if samples.contributing.lights.len() == lights.lit.len() {
                continue;
            }
            let at = At { lights, learned, index, point, ctx: point.light_ctx(), n_bsdf: samples.n_bsdf };
            let (contributing, singles) = (samples.contributing, &buffers.singles[samples.singles.clone()]);
            for i in 0..n {
                let [u, u_survival, u0, u1] = point.stream.split(domain::NONCONTRIBUTING, n, i).draw::<4>();
                draws.push(NoncontributingDraw { ctx: at.ctx, contributing, singles, u });
                pending.push(PendingSample { at: at.clone(), samples, u_survival, u: [u0, u1] });
            }
        }

        // Choose their lights, and sample those that survive
        let mut count = 0;
        for (chosen, pending) in learned.sample_noncontributing(&draws).iter().zip(&pending) {
            let PendingSample { at, samples, u_survival, u } = pending;
            let (Some(noncontributing), Others::Noncontributing { n, scale }) = (chosen, samples.others) else {
                continue;
            };
            let SampledLight { light, pmf, .. } = noncontributing.sampled;
            // Contributing lights have their own samples
            if samples.contributing.index_of(light).is_some() || !(noncontributing.expected.importance > 0.0) {
                continue;
            }
            let survival = survival(noncontributing, scale);
            if *u_survival < survival {
                count += 1;
                records.extend(at.sample(light, n as f32 * pmf * survival, *u, samples, buffers));
            }
        }
        count
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn systematic_counts_are_floor_or_ceiling_and_have_the_ideal_mean() {
        let weights = [0.5, 3.0, 0.1, 0.9, 1.5];
        let scale = 10.0 / weights.iter().sum::<f32>();
        let mut sums = [0; 5];
        for k in 0..1000 {
            let offset = (k as f32 + 0.5) / 1000.0;
            let counts: Vec<LightCounts> = systematic(&weights, scale, offset).collect();
            for (LightCounts { ideal, drawn }, sum) in counts.iter().zip(&mut sums) {
                assert!((ideal.floor() as u32..=ideal.ceil() as u32).contains(drawn), "{counts:?}");
                *sum += drawn;
            }
            assert!((9..=11).contains(&counts.iter().map(|c| c.drawn).sum::<u32>()));
        }
        for (sum, weight) in sums.iter().zip(weights) {
            assert!((*sum as f32 / 1000.0 - weight * scale).abs() < 0.01, "{sums:?}");
        }
    }
}
