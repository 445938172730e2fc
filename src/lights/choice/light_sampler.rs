//! Light samplers: the choice of one light.
//!
//! | kind | probability |
//! |---|---|
//! | uniform | the same for all lights |
//! | power | 95 % proportional to power, 5 % uniform, so that no light starves |
//! | tree | by a [`TreeChoice`]; each infinite light has a probability beside it, or a fixed total |
//! | photons | mostly one of the lights in the visibility cache, if any; see [`VisibilityCacheSampler`] |
//!
//! Lights without power are never chosen. Emitting media have no power, but can be included in the tree on request.

use super::set::LightSet;
use crate::lights::tree::sampled_light::UNIT;
use crate::lights::{
    Light, LightCtx, LightId, LightRun, LightTree, RunPositions, SampledLight, TreeChoice, VisibilityCache,
    VisibilityCacheSampler,
};
use lumiris_numbers::math::{AliasTable, cumulative};
use std::sync::Arc;
use strum::{EnumIter, EnumString, IntoStaticStr, VariantNames};

/// Uniform fraction of the power sampler.
const UNIFORM_FRACTION: f64 = 0.05;

/// The light sampler.
#[derive(Clone, Copy, Debug, PartialEq, Eq, EnumIter, EnumString, IntoStaticStr, VariantNames)]
#[strum(serialize_all = "kebab-case")]
pub enum LightSamplerKind {
    /// All lights alike.
    Uniform,
    /// By power.
    Power,
    /// By a bound of the contribution at the point.
    Tree,
    /// By the same bound, over the lights that the visibility cache finds.
    #[strum(serialize = "photons")]
    VisibilityCache,
}

/// How lights are chosen.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LightChoice {
    /// The light sampler.
    pub kind: LightSamplerKind,
    /// Total probability of the infinite lights beside the light tree (0 to 1, exclusive). `None`: each infinite light
    /// has the same probability as the whole tree.
    pub infinite_fraction: Option<f32>,
    /// True if the tree includes emitting parts of media.
    pub volumes: bool,
}

impl From<LightSamplerKind> for LightChoice {
    fn from(kind: LightSamplerKind) -> Self {
        LightChoice { kind, infinite_fraction: None, volumes: false }
    }
}

/// A fixed distribution over lights, for single choices and for sorted positions.
#[derive(Clone, Debug)]
pub struct FixedChoice {
    table: AliasTable,
    /// Cumulative probabilities; empty if nothing can be chosen.
    cumulative: Vec<f64>,
}

impl FixedChoice {
    fn new(weights: &[f32]) -> Self {
        let table = AliasTable::new(weights);
        let total: f64 = (0..table.len()).map(|i| f64::from(table.pmf(i))).sum();
        let mut sum = 0.0;
        let mut add = |i| {
            sum += f64::from(table.pmf(i));
            sum / total
        };
        let cumulative = if total > 0.0 { (0..table.len()).map(&mut add).collect() } else { Vec::new() };
        FixedChoice { table, cumulative }
    }

    /// The only light with a positive probability, if there is exactly one.
    pub(super) fn only(&self) -> Option<LightId> {
        let mut chosen = (0..self.table.len()).filter(|&i| self.table.pmf(i) > 0.0);
        match (chosen.next(), chosen.next()) {
            (Some(light), None) => Some(light as LightId),
            _ => None,
        }
    }

    fn runs(&self, positions: &[u32], out: &mut Vec<LightRun>) {
        let mut first = 0;
        while let Some(&position) = positions.get(first) {
            let x = f64::from(position) * UNIT;
            let light = cumulative::find(&self.cumulative, x);
            let Some(&end) = self.cumulative.get(light) else { return };
            let start = cumulative::sum_before(&self.cumulative, light);
            let count = positions[first..].partition_point(|&p| f64::from(p) * UNIT < end);
            let pmf = self.table.pmf(light);
            let range = [first as u32, (first + count) as u32];
            out.push(LightRun { light: light as LightId, pmf, range, interval: [start, end] });
            first += count;
        }
    }
}

/// Chooses lights of a fixed set.
#[derive(Clone, Debug)]
pub enum LightSampler {
    /// All lights with power equally.
    Uniform(FixedChoice),
    /// By power.
    Power(FixedChoice),
    /// By the tree; infinite lights beside it.
    Tree(TreeChoice),
    /// By the visibility cache, and by the tree.
    VisibilityCache(VisibilityCacheSampler),
}

impl LightSampler {
    /// A sampler of all lights of a set. The photon sampler has no visibility cache yet.
    pub fn new(choice: LightChoice, set: &LightSet) -> Self {
        Self::of(choice, set, &set.powers, || set.tree_choice(choice.infinite_fraction, choice.volumes))
    }

    /// A sampler of the same kind over the delta lights of a set; `None` if there are none.
    pub fn of_delta(choice: LightChoice, set: &LightSet) -> Option<Self> {
        let is_delta = |light: LightId| set.lights[light as usize].is_delta();
        if !set.lit.iter().any(|&light| is_delta(light)) {
            return None;
        }
        let powers: Vec<f32> =
            (0..).zip(&set.powers).map(|(light, &power)| if is_delta(light) { power } else { 0.0 }).collect();
        let tree = || {
            let infinite = set.lit_infinite().filter(|&light| is_delta(light)).collect();
            TreeChoice::new(Arc::new(LightTree::new(&set.lights, Light::is_delta)), infinite, choice.infinite_fraction)
        };
        Some(Self::of(choice, set, &powers, tree))
    }

    /// A sampler of the lights with `powers`.
    fn of(choice: LightChoice, set: &LightSet, powers: &[f32], tree: impl FnOnce() -> TreeChoice) -> Self {
        match choice.kind {
            LightSamplerKind::Uniform => {
                let weights: Vec<f32> = powers.iter().map(|&p| if p > 0.0 { 1.0 } else { 0.0 }).collect();
                LightSampler::Uniform(FixedChoice::new(&weights))
            }
            LightSamplerKind::Power => LightSampler::Power(FixedChoice::new(&power_weights(powers))),
            LightSamplerKind::Tree => LightSampler::Tree(tree()),
            LightSamplerKind::VisibilityCache => {
                LightSampler::VisibilityCache(VisibilityCacheSampler::new(tree(), &set.lights, set.scene_radius))
            }
        }
    }

    /// Sets the visibility cache, if the sampler uses one.
    pub(super) fn set_visibility_cache(&mut self, visibility_cache: Option<Arc<VisibilityCache>>) {
        match self {
            LightSampler::VisibilityCache(choice) => choice.visibility_cache = visibility_cache,
            LightSampler::Uniform(_) | LightSampler::Power(_) | LightSampler::Tree(_) => {}
        }
    }

    /// The light tree, if the sampler uses one.
    pub fn tree(&self) -> Option<&TreeChoice> {
        match self {
            LightSampler::Tree(choice) => Some(choice),
            LightSampler::VisibilityCache(choice) => Some(&choice.base),
            LightSampler::Uniform(_) | LightSampler::Power(_) => None,
        }
    }

    /// True if probabilities depend on [`LightCtx::lobe`].
    #[inline]
    pub fn needs_lobes(&self) -> bool {
        self.tree().is_some_and(|choice| choice.tree.has_choice())
    }

    /// Chooses a light by `u` in [0, 1); `None` if there is none.
    #[inline]
    pub fn sample(&self, ctx: &LightCtx, u: f32) -> Option<SampledLight> {
        match self {
            LightSampler::Uniform(choice) | LightSampler::Power(choice) => {
                let s = choice.table.sample(u)?;
                Some(SampledLight { light: s.index as LightId, pmf: s.pmf, u: s.u })
            }
            LightSampler::Tree(choice) => choice.sample(ctx, u),
            LightSampler::VisibilityCache(choice) => choice.sample(ctx, u),
        }
    }

    /// Chooses a light for each position of an ascending list in units of 2⁻³², by inversion: neighbours in the list
    /// choose the same light or neighbours. Each light has the probability [`pmf`](Self::pmf), which can be split over
    /// two runs. If no light can be chosen, there are no runs.
    pub fn runs(&self, ctx: &LightCtx, positions: &[u32], out: &mut Vec<LightRun>) {
        out.clear();
        match self {
            LightSampler::Uniform(choice) | LightSampler::Power(choice) => choice.runs(positions, out),
            LightSampler::Tree(choice) => choice.runs(ctx, RunPositions::all(positions), out),
            LightSampler::VisibilityCache(choice) => choice.runs(ctx, positions, out),
        }
    }

    /// Probability that [`sample`](Self::sample) chooses `light`.
    #[inline]
    pub fn pmf(&self, ctx: &LightCtx, light: LightId) -> f32 {
        match self {
            LightSampler::Uniform(choice) | LightSampler::Power(choice) => choice.table.pmf(light as usize),
            LightSampler::Tree(choice) => choice.pmf(ctx, light),
            LightSampler::VisibilityCache(choice) => choice.pmf(ctx, light),
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
        ((1.0 - UNIFORM_FRACTION) * f64::from(p) / total + UNIFORM_FRACTION / count as f64) as f32
    };
    powers.iter().map(|&p| weight(p)).collect()
}
