//! Direct light sampled separately from the contributing lights 𝓛_con, which the visibility cache finds, and from all
//! others [Keller and Wald 2000, §3].
//!
//! S_con samples are taken on 𝓛_con in proportion to w_l = E_l·√V̂_l, the density of least variance: E_l is the light's
//! irradiance without shadows, V̂_l its visibility as photons tell it ([`crate::lights::learned_visibility`]). With
//! m_l = S_con·w_l/Σ w, light l gets ⌊m_l⌋ or ⌈m_l⌉ samples by systematic resampling. If m_l ≥ 1, it counts their mean;
//! otherwise it has a sample with probability m_l, which counts 1/m_l times. Where there are more than
//! [`MAX_WEIGHTED`] such lights, S_con of them are chosen in proportion to their numbers of photons.
//!
//! S_non samples are taken on the non-contributing lights, which a descent of the light tree chooses nearly in proportion
//! to E_l·√V̂_l, where V̂_l is that of a light without photons: lights of which many photons were expected get few of these
//! samples, and those beside lights with a single photon more. A contributing light that is chosen counts 0. A sample of the light l, chosen with probability p_l, survives
//! Russian roulette with probability q_l = min(1, [`SURVIVAL`]·(E_l·√V̂_l/p_l)/Σ E·V̂), by what is expected of it relative to
//! the contributing lights, and counts 1/(p_l·q_l) times. So every sum has the right expectation whatever the photons
//! tell; without these samples (S_non = 0) the estimate is biased.
//!
//! Where no light contributes, all S_con + S_non samples are taken on non-contributing lights, without roulette. Without
//! a visibility cache, or one that is empty, they are drawn as by `mc`.

use super::mc;
use crate::direct::candidates::{Candidate, SampleAllocation};
use crate::direct::domain;
use crate::direct::light_samples::{self, unshadowed_candidate};
use crate::direct::point::ShadingPoint;
use crate::direct::t1::T1;
use crate::lights::visibility_cache::ContributingLights;
use crate::lights::{LearnedVisibility, LightCtx, LightId, LightSample, LightSampling, SampledLight};
use crate::scene::RenderJob;
use lumiris_numbers::math::cumulative;

/// Maximum number of contributing lights whose weights are compared at a point.
pub const MAX_WEIGHTED: usize = 64;
/// Survival probability of a sample of non-contributing lights, per part of the expected contribution of the others.
const SURVIVAL: f32 = 3.0;

/// Light sampling, separately of contributing and of non-contributing lights.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Contributing {
    /// Samples on contributing lights (S_con).
    pub samples: u32,
    /// Samples on non-contributing lights (S_non).
    pub noncontributing_samples: u32,
}

impl Contributing {
    pub(super) fn propose(&self, t1: &mut T1<'_>, buffers: &mut Buffers) {
        t1.propose(mc::allocation, |job, at, allocation, records| {
            if allocation.light_draws == 0 { 0 } else { buffers.draw(job, at, self.noncontributing_samples, records) }
        });
    }
}

/// What is kept from point to point, to save allocations.
#[derive(Debug, Default)]
pub(super) struct Buffers {
    /// Weights of the contributing lights.
    weights: Vec<f32>,
    /// Those with one photon, by [`LearnedVisibility::find_singles`].
    singles: Vec<u32>,
}

/// A point and the lights that are sampled from it.
struct At<'a> {
    lights: &'a LightSampling,
    learned: &'a LearnedVisibility,
    index: u32,
    point: &'a ShadingPoint<'a>,
    ctx: LightCtx,
    /// 𝓛_con with photon counts.
    seen: ContributingLights<'a>,
}

impl At<'_> {
    /// A sample of a light chosen with probability `pmf`, one of `n` drawn in this way.
    fn sample(&self, light: LightId, pmf: f32, n: u32, u: [f32; 2]) -> Option<Candidate> {
        let sample = self.lights.lights[light as usize].sample_li(&self.ctx, u)?;
        let drawn = (light, LightSample { pdf: sample.pdf * pmf, ..sample });
        unshadowed_candidate((self.index, self.point), &SampleAllocation::fixed(n, 0), drawn)
    }
}

impl Buffers {
    /// Draws the light samples of a point. Returns their number.
    fn draw(
        &mut self,
        job: &RenderJob,
        (index, point): (u32, &ShadingPoint<'_>),
        noncontributing: u32,
        records: &mut Vec<Candidate>,
    ) -> u32 {
        let n = point.sample_counts.samples;
        let lights = &job.lights;
        let Some(learned) = lights.learned_visibility() else {
            return light_samples::draw(job, (index, point), &SampleAllocation::fixed(n + noncontributing, 0), records);
        };
        let ctx = point.light_ctx();
        let at = At { lights, learned, index, point, ctx, seen: lights.contributing_lights(&ctx) };
        learned.find_singles(&at.seen, &mut self.singles);
        let expected = match at.seen.lights.len() {
            0 => return at.draw_unseen(n + noncontributing, (f32::INFINITY, &[]), records),
            1..=MAX_WEIGHTED => self.draw_weighted(&at, n, records),
            _ => Some(at.draw_by_photons(n, records)),
        };
        match expected {
            Some(expected) => n + at.draw_unseen(noncontributing, (SURVIVAL / expected, &self.singles), records),
            None => light_samples::draw(job, (index, point), &SampleAllocation::fixed(n + noncontributing, 0), records),
        }
    }

    /// Samples of the contributing lights, in proportion to E·√V̂. Returns Σ E·V̂; `None`, and no samples, if it
    /// is not known.
    fn draw_weighted(&mut self, at: &At<'_>, n: u32, records: &mut Vec<Candidate>) -> Option<f32> {
        // Weights
        self.weights.clear();
        let (mut sum, mut expected) = (0.0, 0.0);
        for &(light, count) in at.seen.lights {
            let importance = at.learned.importance(&at.ctx, light);
            let visibility = at.learned.visibility(light, importance, count);
            let weight = importance * visibility.sqrt();
            sum += weight;
            expected += importance * visibility;
            self.weights.push(weight);
        }
        if !(sum > 0.0 && sum.is_finite() && expected > 0.0) {
            return None;
        }

        // Samples
        let [offset] = at.point.stream.domain(domain::COUNTS).draw::<1>();
        let scale = n as f32 / sum;
        let (mut upto, mut given) = (offset, 0);
        for (k, (&(light, _), &weight)) in at.seen.lights.iter().zip(&self.weights).enumerate() {
            let wanted = weight * scale;
            upto += wanted;
            // At least one sample where one or more are wanted, whatever rounding does
            let count = (upto as u32).saturating_sub(given).max(u32::from(wanted >= 1.0));
            given = upto as u32;
            for i in 0..count {
                let u = at.point.stream.split(domain::CONTRIBUTING + k as u32, count, i).draw::<2>();
                records.extend(at.sample(light, wanted.min(1.0), if wanted >= 1.0 { count } else { 1 }, u));
            }
        }
        Some(expected)
    }
}

impl At<'_> {
    /// Contributing lights chosen in proportion to their numbers of photons. Returns the irradiance of all photons.
    fn draw_by_photons(&self, n: u32, records: &mut Vec<Candidate>) -> f32 {
        let ContributingLights { lights, sums } = self.seen;
        let Some(&total) = sums.last() else { return 0.0 };
        for i in 0..n {
            let [u_choice, u0, u1] = self.point.stream.split(domain::LIGHT, n, i).draw::<3>();
            let k = cumulative::find(sums, u_choice * total as f32).min(lights.len() - 1);
            let pmf = cumulative::weight(sums, k) / total as f32;
            records.extend(self.sample(lights[k].0, pmf, n, [u0, u1]));
        }
        lights.iter().map(|&(light, count)| self.learned.irradiance_of(light, count)).sum()
    }

    /// Samples of non-contributing lights, of which as many survive as their expected contribution times `scale` says.
    /// `singles` are those of the lights with one photon. Returns how many.
    fn draw_unseen(&self, n: u32, (scale, singles): (f32, &[u32]), records: &mut Vec<Candidate>) -> u32 {
        if self.seen.lights.len() == self.lights.lit.len() {
            return 0;
        }
        let mut drawn = 0;
        for i in 0..n {
            let [u_choice, u_survival, u0, u1] = self.point.stream.split(domain::NONCONTRIBUTING, n, i).draw::<4>();
            let Some(unseen) = self.learned.sample_unseen(&self.ctx, (&self.seen, singles), u_choice) else { continue };
            let SampledLight { light, pmf, .. } = unseen.choice;
            // Contributing lights have their own samples
            if self.seen.place(light).is_some() || !(unseen.importance > 0.0) {
                continue;
            }
            let survival = (unseen.importance * unseen.visibility.sqrt() / pmf * scale).min(1.0);
            if u_survival < survival {
                drawn += 1;
                records.extend(self.sample(light, pmf * survival, n, [u0, u1]));
            }
        }
        drawn
    }
}
