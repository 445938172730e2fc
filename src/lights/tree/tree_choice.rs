//! The choice of a light by a [`LightTree`] and, beside it, the infinite lights, which have no bounds.

use super::branches::Branches;
use super::light_tree::{LightTree, RunPositions};
use super::sampled_light::{LightRun, SampledLight, UNIT};
use crate::lights::{LightCtx, LightId};
use lumiris_numbers::math::ONE_MINUS_EPSILON;
use std::ops::Deref;
use std::sync::Arc;

/// A light tree, with the infinite lights beside it.
#[derive(Clone, Debug)]
pub struct TreeChoice {
    /// The lights with bounds.
    pub tree: Arc<LightTree>,
    /// Infinite lights, ascending.
    pub infinite: Vec<LightId>,
    /// Ratio of the probability of each infinite light to the probability of the whole tree.
    odds: f32,
}

/// One of some lights by `u` in [0, 1), which have the probability `pmf` together.
#[inline]
pub(in crate::lights) fn one_of(lights: &[LightId], u: f32, pmf: f32) -> SampledLight {
    let x = u * lights.len() as f32;
    let i = (x as usize).min(lights.len() - 1);
    let u = (x - i as f32).clamp(0.0, ONE_MINUS_EPSILON);
    SampledLight { light: lights[i], pmf: pmf / lights.len() as f32, u }
}

impl TreeChoice {
    /// A choice among the lights of `tree` and the lights `infinite` beside it, ascending. `infinite_fraction` is the
    /// total probability of the infinite lights (0 to 1, exclusive); `None`: each has the same probability as the whole
    /// tree.
    pub(in crate::lights) fn new(tree: Arc<LightTree>, infinite: Vec<LightId>, infinite_fraction: Option<f32>) -> Self {
        let odds = infinite_fraction.map_or(1.0, |f| f / ((1.0 - f) * infinite.len().max(1) as f32));
        TreeChoice { tree, infinite, odds }
    }

    /// Total probability of the infinite lights; 1 if no light in the tree can contribute.
    #[inline]
    pub(in crate::lights) fn infinite_probability(&self, ctx: &LightCtx) -> f32 {
        self.probability_of_some(ctx, self.infinite.len())
    }

    /// Total probability of `count` infinite lights, if the other infinite lights cannot be chosen.
    #[inline]
    pub(in crate::lights) fn probability_of_some(&self, ctx: &LightCtx, count: usize) -> f32 {
        if count == 0 {
            return 0.0;
        }
        if self.tree.importance(ctx) > 0.0 { self.fraction_of(count) } else { 1.0 }
    }

    /// Total probability of the infinite lights if lights in the tree can contribute.
    pub fn infinite_fraction(&self) -> f32 {
        self.fraction_of(self.infinite.len())
    }

    #[inline]
    fn fraction_of(&self, count: usize) -> f32 {
        let odds = count as f32 * self.odds;
        odds / (odds + 1.0)
    }

    /// Chooses a light by `u` in [0, 1); `None` if there is none.
    #[inline]
    pub fn sample(&self, ctx: &LightCtx, u: f32) -> Option<SampledLight> {
        self.sample_with(&ctx, u, Branches::NONE)
    }

    /// [`Self::sample`] with precomputed branch probabilities at the point.
    #[inline]
    pub fn sample_with(
        &self,
        ctx: &impl Deref<Target = LightCtx>,
        u: f32,
        branches: Branches<'_>,
    ) -> Option<SampledLight> {
        let p_infinite = branches.infinite_probability(|| self.infinite_probability(ctx));
        if u < p_infinite {
            return Some(one_of(&self.infinite, u / p_infinite, p_infinite));
        }
        let u = ((u - p_infinite) / (1.0 - p_infinite)).min(ONE_MINUS_EPSILON);
        let choice = self.tree.sample(ctx, u, branches)?;
        Some(SampledLight { pmf: choice.pmf * (1.0 - p_infinite), ..choice })
    }

    /// Appends runs for the positions.
    pub(in crate::lights) fn runs(&self, ctx: &LightCtx, at: RunPositions<'_>, out: &mut Vec<LightRun>) {
        let TreeChoice { tree, infinite, .. } = self;
        let RunPositions { positions, mut first, start, fraction } = at;

        // Infinite lights first, in equal intervals
        let p_infinite = self.infinite_probability(ctx);
        let each = f64::from(p_infinite * fraction) / infinite.len() as f64;
        for (i, &light) in infinite.iter().enumerate().filter(|_| p_infinite > 0.0) {
            let interval = [start + each * i as f64, start + each * (i + 1) as f64];
            let is_in = |&p: &u32| f64::from(p) * UNIT < interval[1] || p_infinite == 1.0 && i + 1 == infinite.len();
            let count = positions[first..].partition_point(is_in);
            if count > 0 {
                let pmf = p_infinite * fraction / infinite.len() as f32;
                out.push(LightRun { light, pmf, range: [first as u32, (first + count) as u32], interval });
            }
            first += count;
        }

        // The tree covers the rest
        if !tree.is_empty() && p_infinite < 1.0 {
            let start = start + f64::from(p_infinite * fraction);
            let fraction = (1.0 - p_infinite) * fraction;
            tree.runs(ctx, RunPositions { positions, first, start, fraction }, out);
        }
    }

    #[inline]
    pub(in crate::lights) fn pmf(&self, ctx: &LightCtx, light: LightId) -> f32 {
        let p_infinite = self.infinite_probability(ctx);
        if self.tree.contains(light) {
            self.tree.pmf(ctx, light) * (1.0 - p_infinite)
        } else if self.infinite.binary_search(&light).is_ok() {
            p_infinite / self.infinite.len() as f32
        } else {
            0.0
        }
    }
}
