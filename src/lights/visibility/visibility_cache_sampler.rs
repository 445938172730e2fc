//! A light sampler that prefers the lights in the visibility cache at a point [Keller and Wald 2000, §3], mixed with a
//! light tree.
//!
//! pmf(l) = (1 − δ)·w_l/Σ w + δ·pmf_base(l), where w_l = 0 for lights that are not in the cache. The base is the
//! [`LightTree`] with the infinite lights beside it. Every light that can contribute therefore has a positive
//! probability, and estimates are unbiased for any content of the cache. If the cache is empty at the point, δ = 1.
//!
//! w_l is the tree's bound of the light's contribution at the point, cos θ′·cos θi′·I/d², or the irradiance of an
//! infinite light (lm/m² by luminance); both up to a common factor. With more than [`MAX_WEIGHTED`] lights, w_l is the
//! photon count instead, so that sampling takes logarithmic time.
//!
//! [`LightTree`]: crate::lights::LightTree

use super::learned_visibility::facing_irradiance;
use super::visibility_cache::{ContributingLights, PhotonCount, VisibilityCache};
use crate::lights::tree::sampled_light::UNIT;
use crate::lights::{Light, LightCtx, LightId, LightRun, RunPositions, SampledLight, TreeChoice};
use lumiris_numbers::math::{ONE_MINUS_EPSILON, cumulative};
use std::sync::Arc;

/// δ: probability of sampling the base instead of the contributing lights.
pub const BASE_FRACTION: f32 = 0.1;
/// Maximum number of lights whose contributions are compared at the point.
pub const MAX_WEIGHTED: usize = 64;

/// Samples the contributing lights of the visibility cache, if there are any.
#[derive(Clone, Debug)]
pub struct VisibilityCacheSampler {
    pub(in crate::lights) base: TreeChoice,
    /// For each infinite light, the luminance of the irradiance on a surface facing it; 0 for others.
    irradiances: Vec<f32>,
    pub(in crate::lights) visibility_cache: Option<Arc<VisibilityCache>>,
}

/// The contributing lights at a point, with their weights.
struct ContributingChoice<'a> {
    lights: ContributingLights<'a>,
    /// Cumulative weights; unused if the weights are photon counts.
    sums: [f32; MAX_WEIGHTED],
    total: f32,
}

/// The index of a contributing light, and the remapped random number.
struct ChosenIndex {
    i: usize,
    u: f32,
}

impl ContributingChoice<'_> {
    /// Light number `i`.
    #[inline]
    fn light(&self, i: usize) -> LightId {
        self.lights.lights[i].light
    }

    /// True if the weights are photon counts.
    fn is_counted(&self) -> bool {
        self.lights.lights.len() > MAX_WEIGHTED
    }

    /// Sum of the weights of the lights before index `i`.
    #[inline]
    fn sum_before(&self, i: usize) -> f32 {
        if self.is_counted() {
            cumulative::sum_before(self.lights.sums, i)
        } else {
            cumulative::sum_before(&self.sums, i)
        }
    }

    /// Probability of index `i` among the contributing lights.
    #[inline]
    fn pmf_at(&self, i: usize) -> f32 {
        (self.sum_before(i + 1) - self.sum_before(i)) / self.total
    }

    #[inline]
    fn pmf(&self, light: LightId) -> f32 {
        self.lights.index_of(light).map_or(0.0, |i| self.pmf_at(i))
    }

    /// Chooses an index by `u` in [0, 1), and remaps `u` to be uniform again.
    #[inline]
    fn choose(&self, u: f32) -> ChosenIndex {
        let x = u * self.total;
        let count = self.lights.lights.len();
        let i = if self.is_counted() {
            cumulative::find(self.lights.sums, x)
        } else {
            cumulative::find(&self.sums[..count], x)
        };
        // Rounding may reach the total: then take the last light with a weight
        let i = if i < count { i } else { (0..count).rfind(|&i| self.pmf_at(i) > 0.0).unwrap_or(0) };
        let before = self.sum_before(i);
        let rest = (x - before) / (self.sum_before(i + 1) - before);
        ChosenIndex { i, u: rest.clamp(0.0, ONE_MINUS_EPSILON) }
    }
}

impl VisibilityCacheSampler {
    pub(in crate::lights) fn new(base: TreeChoice, lights: &[Light], scene_radius: f32) -> Self {
        let irradiances = lights.iter().map(|light| facing_irradiance(light, scene_radius)).collect();
        VisibilityCacheSampler { base, irradiances, visibility_cache: None }
    }

    /// The contributing lights; `None` if none of them has a weight.
    #[inline]
    fn contributing(&self, ctx: &LightCtx) -> Option<ContributingChoice<'_>> {
        let lights = self.visibility_cache.as_ref()?.lookup(ctx.p, ctx.n);
        let mut choice = ContributingChoice { lights, sums: [0.0; MAX_WEIGHTED], total: 0.0 };
        if choice.is_counted() {
            choice.total = lights.sums.last().map_or(0.0, |&sum| sum as f32);
        } else {
            for (sum, &PhotonCount { light, .. }) in choice.sums.iter_mut().zip(lights.lights) {
                choice.total += self.weight(ctx, light);
                *sum = choice.total;
            }
        }
        (choice.total > 0.0 && choice.total.is_finite()).then_some(choice)
    }

    #[inline]
    fn weight(&self, ctx: &LightCtx, light: LightId) -> f32 {
        if self.base.tree.contains(light) {
            self.base.tree.light_importance(ctx, light)
        } else {
            self.irradiances[light as usize]
        }
    }

    #[inline]
    pub(in crate::lights) fn sample(&self, ctx: &LightCtx, u: f32) -> Option<SampledLight> {
        let Some(contributing) = self.contributing(ctx) else { return self.base.sample(ctx, u) };
        if u < BASE_FRACTION {
            let choice = self.base.sample(ctx, (u / BASE_FRACTION).min(ONE_MINUS_EPSILON))?;
            let pmf = mixed(contributing.pmf(choice.light), choice.pmf);
            return Some(SampledLight { pmf, ..choice });
        }
        let ChosenIndex { i, u } = contributing.choose((u - BASE_FRACTION) / (1.0 - BASE_FRACTION));
        let light = contributing.light(i);
        Some(SampledLight { light, pmf: mixed(contributing.pmf_at(i), self.base.pmf(ctx, light)), u })
    }

    #[inline]
    pub(in crate::lights) fn pmf(&self, ctx: &LightCtx, light: LightId) -> f32 {
        let base = self.base.pmf(ctx, light);
        self.contributing(ctx).map_or(base, |contributing| mixed(contributing.pmf(light), base))
    }

    /// Runs of the contributing lights, then of the base; a light may have a run in each.
    pub(in crate::lights) fn runs(&self, ctx: &LightCtx, positions: &[u32], out: &mut Vec<LightRun>) {
        let Some(contributing) = self.contributing(ctx) else {
            self.base.runs(ctx, RunPositions::all(positions), out);
            return;
        };

        // Runs of the contributing lights
        let fraction = f64::from(1.0 - BASE_FRACTION);
        let end_of = |i: usize| fraction * f64::from(contributing.sum_before(i + 1)) / f64::from(contributing.total);
        let count = contributing.lights.lights.len();
        let mut first = 0;
        while first < positions.len() && f64::from(positions[first]) * UNIT < fraction {
            let x = f64::from(positions[first]) * UNIT;
            let i = cumulative::find_computed(count, end_of, x);
            if i == count {
                break;
            }
            let interval = [if i > 0 { end_of(i - 1) } else { 0.0 }, end_of(i)];
            let last = first + positions[first..].partition_point(|&p| f64::from(p) * UNIT < interval[1]);
            let light = contributing.light(i);
            let pmf = mixed(contributing.pmf_at(i), self.base.pmf(ctx, light));
            out.push(LightRun { light, pmf, range: [first as u32, last as u32], interval });
            first = last;
        }

        // Runs of the base, with the probabilities of both
        let of_base = out.len();
        let at = RunPositions { positions, first, start: fraction, fraction: BASE_FRACTION };
        self.base.runs(ctx, at, out);
        for run in &mut out[of_base..] {
            run.pmf += (1.0 - BASE_FRACTION) * contributing.pmf(run.light);
        }
    }

    /// Mixes the probabilities of the contributing lights into the group probabilities of the base.
    pub(in crate::lights) fn group_pmfs(
        &self,
        ctx: &LightCtx,
        group_of: impl Fn(LightId) -> Option<usize>,
        pmfs: &mut [f32],
    ) {
        let Some(contributing) = self.contributing(ctx) else { return };
        pmfs.iter_mut().for_each(|p| *p *= BASE_FRACTION);
        for (i, &PhotonCount { light, .. }) in contributing.lights.lights.iter().enumerate() {
            if let Some(group) = group_of(light) {
                pmfs[group] += (1.0 - BASE_FRACTION) * contributing.pmf_at(i);
            }
        }
    }

    /// Chooses a light of a group by `u` in [0, 1). `base` does the same for the base alone. The returned probability
    /// includes `group_pmf`, the probability of the group.
    pub(in crate::lights) fn sample_group(
        &self,
        ctx: &LightCtx,
        is_in: impl Fn(LightId) -> bool,
        group_pmf: f32,
        u: f32,
        base: impl Fn(f32) -> Option<SampledLight>,
    ) -> Option<SampledLight> {
        let Some(contributing) = self.contributing(ctx) else { return base(u) };
        let indices = || (0..contributing.lights.lights.len()).filter(|&i| is_in(contributing.light(i)));
        let p_contributing = indices().map(|i| contributing.pmf_at(i)).sum::<f32>();
        let fraction = ((1.0 - BASE_FRACTION) * p_contributing / group_pmf).min(1.0);

        // Choose by the base
        if u >= fraction {
            let choice = base(((u - fraction) / (1.0 - fraction)).min(ONE_MINUS_EPSILON))?;
            return Some(SampledLight { pmf: self.pmf(ctx, choice.light), ..choice });
        }

        // Choose among the contributing lights of the group
        let mut x = u / fraction * p_contributing;
        let mut chosen = None;
        for i in indices().filter(|&i| contributing.pmf_at(i) > 0.0) {
            let p = contributing.pmf_at(i);
            chosen = Some(ChosenIndex { i, u: (x / p).clamp(0.0, ONE_MINUS_EPSILON) });
            if x < p {
                break;
            }
            x -= p;
        }
        let ChosenIndex { i, u } = chosen?;
        let light = contributing.light(i);
        Some(SampledLight { light, pmf: mixed(contributing.pmf_at(i), self.base.pmf(ctx, light)), u })
    }
}

/// The probability of a choice that has the probability `contributing` among the contributing lights and `base` in the
/// base.
#[inline]
fn mixed(contributing: f32, base: f32) -> f32 {
    (1.0 - BASE_FRACTION) * contributing + BASE_FRACTION * base
}
