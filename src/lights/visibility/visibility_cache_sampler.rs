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
use super::visibility_cache::{ContributingLights, VisibilityCache};
use crate::lights::tree::sampled_light::UNIT;
use crate::lights::{Light, LightCtx, LightId, LightRun, SampledLight, TreeChoice};
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
struct Known<'a> {
    contributing: ContributingLights<'a>,
    /// Cumulative weights; unused if the weights are photon counts.
    sums: [f32; MAX_WEIGHTED],
    total: f32,
}

impl Known<'_> {
    fn is_counted(&self) -> bool {
        self.contributing.lights.len() > MAX_WEIGHTED
    }

    /// Sum of the weights of the lights before index `i`.
    #[inline]
    fn sum_before(&self, i: usize) -> f32 {
        if self.is_counted() {
            cumulative::sum_before(self.contributing.sums, i)
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
        self.contributing.place(light).map_or(0.0, |i| self.pmf_at(i))
    }

    /// Chooses an index by `u` in [0, 1), and remaps `u` to be uniform again.
    #[inline]
    fn choose(&self, u: f32) -> (usize, f32) {
        let x = u * self.total;
        let count = self.contributing.lights.len();
        let place = if self.is_counted() {
            cumulative::find(self.contributing.sums, x)
        } else {
            cumulative::find(&self.sums[..count], x)
        };
        // Rounding may reach the total: then take the last light with a weight
        let place = if place < count { place } else { (0..count).rfind(|&i| self.pmf_at(i) > 0.0).unwrap_or(0) };
        let before = self.sum_before(place);
        let rest = (x - before) / (self.sum_before(place + 1) - before);
        (place, rest.clamp(0.0, ONE_MINUS_EPSILON))
    }
}

impl VisibilityCacheSampler {
    pub(in crate::lights) fn new(base: TreeChoice, lights: &[Light], scene_radius: f32) -> Self {
        let irradiances = lights.iter().map(|light| facing_irradiance(light, scene_radius)).collect();
        VisibilityCacheSampler { base, irradiances, visibility_cache: None }
    }

    /// The contributing lights; `None` if none of them has a weight.
    #[inline]
    fn known(&self, ctx: &LightCtx) -> Option<Known<'_>> {
        let contributing = self.visibility_cache.as_ref()?.lookup_with_sums(ctx.p, ctx.n);
        let mut known = Known { contributing, sums: [0.0; MAX_WEIGHTED], total: 0.0 };
        if known.is_counted() {
            known.total = contributing.sums.last().map_or(0.0, |&sum| sum as f32);
        } else {
            for (sum, &(light, _)) in known.sums.iter_mut().zip(contributing.lights) {
                known.total += self.weight(ctx, light);
                *sum = known.total;
            }
        }
        (known.total > 0.0 && known.total.is_finite()).then_some(known)
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
        let Some(known) = self.known(ctx) else { return self.base.sample(ctx, u) };
        if u < BASE_FRACTION {
            let choice = self.base.sample(ctx, (u / BASE_FRACTION).min(ONE_MINUS_EPSILON))?;
            let pmf = mixed(known.pmf(choice.light), choice.pmf);
            return Some(SampledLight { pmf, ..choice });
        }
        let (place, u) = known.choose((u - BASE_FRACTION) / (1.0 - BASE_FRACTION));
        let light = known.contributing.lights[place].0;
        Some(SampledLight { light, pmf: mixed(known.pmf_at(place), self.base.pmf(ctx, light)), u })
    }

    #[inline]
    pub(in crate::lights) fn pmf(&self, ctx: &LightCtx, light: LightId) -> f32 {
        let base = self.base.pmf(ctx, light);
        self.known(ctx).map_or(base, |known| mixed(known.pmf(light), base))
    }

    /// Runs of the contributing lights, then of the base; a light may have a run in each.
    pub(in crate::lights) fn runs(&self, ctx: &LightCtx, positions: &[u32], out: &mut Vec<LightRun>) {
        let Some(known) = self.known(ctx) else {
            self.base.runs(ctx, positions, 0, (0.0, 1.0), out);
            return;
        };

        // Runs of the contributing lights
        let fraction = f64::from(1.0 - BASE_FRACTION);
        let end_of = |i: usize| fraction * f64::from(known.sum_before(i + 1)) / f64::from(known.total);
        let count = known.contributing.lights.len();
        let mut first = 0;
        while first < positions.len() && f64::from(positions[first]) * UNIT < fraction {
            let x = f64::from(positions[first]) * UNIT;
            let place = cumulative::find_computed(count, end_of, x);
            if place == count {
                break;
            }
            let interval = [if place > 0 { end_of(place - 1) } else { 0.0 }, end_of(place)];
            let last = first + positions[first..].partition_point(|&p| f64::from(p) * UNIT < interval[1]);
            let light = known.contributing.lights[place].0;
            let pmf = mixed(known.pmf_at(place), self.base.pmf(ctx, light));
            out.push(LightRun { light, pmf, places: [first as u32, last as u32], interval });
            first = last;
        }

        // Runs of the base, with the probabilities of both
        let of_base = out.len();
        self.base.runs(ctx, positions, first, (fraction, BASE_FRACTION), out);
        for run in &mut out[of_base..] {
            run.pmf += (1.0 - BASE_FRACTION) * known.pmf(run.light);
        }
    }

    /// Mixes the probabilities of the contributing lights into the group probabilities of the base.
    pub(in crate::lights) fn group_pmfs(
        &self,
        ctx: &LightCtx,
        group_of: impl Fn(LightId) -> Option<usize>,
        pmfs: &mut [f32],
    ) {
        let Some(known) = self.known(ctx) else { return };
        pmfs.iter_mut().for_each(|p| *p *= BASE_FRACTION);
        for (i, &(light, _)) in known.contributing.lights.iter().enumerate() {
            if let Some(group) = group_of(light) {
                pmfs[group] += (1.0 - BASE_FRACTION) * known.pmf_at(i);
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
        let Some(known) = self.known(ctx) else { return base(u) };
        let places = || (0..known.contributing.lights.len()).filter(|&i| is_in(known.contributing.lights[i].0));
        let p_known = places().map(|i| known.pmf_at(i)).sum::<f32>();
        let fraction = ((1.0 - BASE_FRACTION) * p_known / group_pmf).min(1.0);

        // Choose by the base
        if u >= fraction {
            let choice = base(((u - fraction) / (1.0 - fraction)).min(ONE_MINUS_EPSILON))?;
            return Some(SampledLight { pmf: self.pmf(ctx, choice.light), ..choice });
        }

        // Choose among the contributing lights of the group
        let mut x = u / fraction * p_known;
        let mut chosen = None;
        for i in places().filter(|&i| known.pmf_at(i) > 0.0) {
            let p = known.pmf_at(i);
            chosen = Some((i, (x / p).clamp(0.0, ONE_MINUS_EPSILON)));
            if x < p {
                break;
            }
            x -= p;
        }
        let (place, u) = chosen?;
        let light = known.contributing.lights[place].0;
        Some(SampledLight { light, pmf: mixed(known.pmf_at(place), self.base.pmf(ctx, light)), u })
    }
}

/// The probability of a choice that has the probability `known` among the contributing lights and `base` in the base.
#[inline]
fn mixed(known: f32, base: f32) -> f32 {
    (1.0 - BASE_FRACTION) * known + BASE_FRACTION * base
}
