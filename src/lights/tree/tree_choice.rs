//! The choice of a light by a [`LightTree`] and, beside it, the infinite lights, which have no bounds.

use super::light_tree::{LightTree, RunPositions};
use super::sampled_light::{LightRun, SampledLight, UNIT};
use crate::lights::{LightCtx, LightId};
use lumiris_lanes::level;
use lumiris_lanes::light_descent::{DESCENTS, Descents};
use lumiris_lanes::light_tree::{Receivers, importances};
use lumiris_numbers::math::ONE_MINUS_EPSILON;
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
        let p_infinite = self.infinite_probability(ctx);
        if u < p_infinite {
            return Some(one_of(&self.infinite, u / p_infinite, p_infinite));
        }
        let u = ((u - p_infinite) / (1.0 - p_infinite)).min(ONE_MINUS_EPSILON);
        let choice = self.tree.sample(ctx, u)?;
        Some(SampledLight { pmf: choice.pmf * (1.0 - p_infinite), ..choice })
    }

    /// Chooses a light for each of the points `at` by their random numbers `u` in [0, 1), as [`Self::sample`]. All
    /// columns have the same length. `take` gets the lights in the order of the points.
    pub(in crate::lights) fn sample_many(
        &self,
        at: &Receivers<'_>,
        u: &[f32],
        mut take: impl FnMut(Option<SampledLight>),
    ) {
        let (mut p_infinite, mut rest, mut descents) = ([0.0; DESCENTS], [0.0; DESCENTS], Descents::default());
        for (block, u) in u.chunks(DESCENTS).enumerate() {
            // Infinite lights
            let rows = block * DESCENTS..block * DESCENTS + u.len();
            if !self.infinite.is_empty() {
                self.infinite_probabilities(&at.rows(rows.clone()), &mut p_infinite[..u.len()]);
            }
            for ((rest, &u), p) in rest.iter_mut().zip(u).zip(p_infinite) {
                *rest = ((u - p) / (1.0 - p)).min(ONE_MINUS_EPSILON);
            }

            // Lights in the tree
            let in_tree = self.tree.sample_rows(at, rows, &rest, &mut descents);
            for ((&u, p), in_tree) in u.iter().zip(p_infinite).zip(in_tree) {
                take(if u < p {
                    Some(one_of(&self.infinite, u / p, p))
                } else {
                    in_tree.map(|choice| SampledLight { pmf: choice.pmf * (1.0 - p), ..choice })
                });
            }
        }
    }

    /// [`Self::infinite_probability`] at each point.
    fn infinite_probabilities(&self, at: &Receivers<'_>, out: &mut [f32]) {
        let fraction = self.infinite_fraction();
        match self.tree.root() {
            Some(root) => importances(level(), root, at, out),
            None => out.fill(0.0),
        }
        out.iter_mut().for_each(|p| *p = if *p > 0.0 { fraction } else { 1.0 });
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
