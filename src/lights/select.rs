//! The choice of one light.
//!
//! | kind | probability |
//! |---|---|
//! | uniform | the same for all |
//! | power | 95 % in proportion to the power, 5 % the same for all, so that no light starves |
//! | tree | every infinite light, and all others together by the [`LightTree`], the same share |
//!
//! Lights without power are never chosen.

use super::{Light, LightCtx, LightId, LightTree};
use crate::math::{AliasTable, ONE_MINUS_EPSILON};

/// Share of the power sampler that does not follow the power.
const UNIFORM_SHARE: f64 = 0.05;

/// How a light is chosen.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LightSamplerKind {
    /// All lights alike.
    Uniform,
    /// By power.
    Power,
    /// By a bound of the contribution at the point.
    Tree,
}

impl LightSamplerKind {
    /// The name on the command line and in metadata.
    pub fn name(self) -> &'static str {
        match self {
            LightSamplerKind::Uniform => "uniform",
            LightSamplerKind::Power => "power",
            LightSamplerKind::Tree => "tree",
        }
    }
}

/// A chosen light.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LightChoice {
    /// The light.
    pub light: LightId,
    /// Probability of the choice.
    pub pmf: f32,
    /// The random number, made uniform in [0, 1) again.
    pub u: f32,
}

/// Chooses lights of a fixed set.
#[derive(Clone, Debug)]
pub enum LightSampler {
    /// All lights with power alike.
    Uniform(AliasTable),
    /// By power.
    Power(AliasTable),
    /// By the tree; infinite lights beside it.
    Tree {
        /// Lights with a place.
        tree: LightTree,
        /// Lights at infinity, ascending.
        infinite: Vec<LightId>,
    },
}

impl LightSampler {
    /// A sampler of `lights`, indexed as they are; `scene_radius` weighs infinite lights against others.
    pub fn new(kind: LightSamplerKind, lights: &[Light], scene_radius: f32) -> Self {
        let powers: Vec<f32> = lights.iter().map(|light| light.phi(scene_radius)).collect();
        match kind {
            LightSamplerKind::Uniform => {
                let weights: Vec<f32> = powers.iter().map(|&p| if p > 0.0 { 1.0 } else { 0.0 }).collect();
                LightSampler::Uniform(AliasTable::new(&weights))
            }
            LightSamplerKind::Power => LightSampler::Power(AliasTable::new(&power_weights(&powers))),
            LightSamplerKind::Tree => {
                let bounds: Vec<_> = lights.iter().map(Light::bounds).collect();
                let is_chosen = |&i: &usize| lights[i].is_infinite() && powers[i] > 0.0;
                let infinite = (0..lights.len()).filter(is_chosen).map(|i| i as LightId).collect();
                LightSampler::Tree { tree: LightTree::new(&bounds), infinite }
            }
        }
    }

    /// Chooses a light by `u` in [0, 1); `None` if there is none.
    #[inline]
    pub fn sample(&self, ctx: &LightCtx, u: f32) -> Option<LightChoice> {
        match self {
            LightSampler::Uniform(table) | LightSampler::Power(table) => {
                let s = table.sample(u)?;
                Some(LightChoice { light: s.index as LightId, pmf: s.pmf, u: s.u })
            }
            LightSampler::Tree { tree, infinite } => {
                let p_infinite = infinite_probability(tree, infinite, ctx);
                if u < p_infinite {
                    let x = u / p_infinite * infinite.len() as f32;
                    let i = (x as usize).min(infinite.len() - 1);
                    let u = (x - i as f32).clamp(0.0, ONE_MINUS_EPSILON);
                    return Some(LightChoice { light: infinite[i], pmf: p_infinite / infinite.len() as f32, u });
                }
                let u = ((u - p_infinite) / (1.0 - p_infinite)).min(ONE_MINUS_EPSILON);
                let (light, pmf, u) = tree.sample(ctx, u)?;
                Some(LightChoice { light, pmf: pmf * (1.0 - p_infinite), u })
            }
        }
    }

    /// Probability that [`sample`](Self::sample) chooses `light`.
    #[inline]
    pub fn pmf(&self, ctx: &LightCtx, light: LightId) -> f32 {
        match self {
            LightSampler::Uniform(table) | LightSampler::Power(table) => table.pmf(light as usize),
            LightSampler::Tree { tree, infinite } => {
                let p_infinite = infinite_probability(tree, infinite, ctx);
                if tree.contains(light) {
                    tree.pmf(ctx, light) * (1.0 - p_infinite)
                } else if infinite.binary_search(&light).is_ok() {
                    p_infinite / infinite.len() as f32
                } else {
                    0.0
                }
            }
        }
    }
}

/// The weights of the power sampler.
fn power_weights(powers: &[f32]) -> Vec<f32> {
    let total: f64 = powers.iter().map(|&p| f64::from(p)).sum();
    let count = powers.iter().filter(|&&p| p > 0.0).count();
    let weight = |p: f32| {
        if p <= 0.0 {
            return 0.0;
        }
        ((1.0 - UNIFORM_SHARE) * f64::from(p) / total + UNIFORM_SHARE / count as f64) as f32
    };
    powers.iter().map(|&p| weight(p)).collect()
}

/// Probability of the infinite lights together: each has the share of the whole tree. All, where nothing of the tree
/// can contribute.
#[inline]
fn infinite_probability(tree: &LightTree, infinite: &[LightId], ctx: &LightCtx) -> f32 {
    if infinite.is_empty() {
        return 0.0;
    }
    if tree.importance(ctx) > 0.0 { infinite.len() as f32 / (infinite.len() + 1) as f32 } else { 1.0 }
}
