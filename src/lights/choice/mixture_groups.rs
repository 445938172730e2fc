//! Groups of lights, each a component of the mixture density of light sampling in `ocv` and `optimal-mis`. The light
//! groups of a scene file are [`LightLayers`](crate::lights::LightLayers).
//!
//! All infinite lights form one group, since they overlap. Each other light forms a group if there are few lights; with
//! many lights, subtrees of a light tree form groups. A light is chosen with the probability given by [`LightSampler`].
//! Groups only split the choice into two steps, a group and a light of that group, so that the number of samples per
//! group can be fixed.

use super::light_sampler::LightSampler;
use super::set::LightSet;
use crate::lights::tree::tree_choice::one_of;
use crate::lights::{CutNode, LightCtx, LightId, SampledLight};
use lumiris_numbers::math::AliasTable;

/// Maximum number of groups.
pub const MAX_GROUPS: usize = 8;
/// Group of lights that are never chosen.
const NO_GROUP: u8 = u8::MAX;

/// The lights in groups, as components of a mixture.
#[derive(Clone, Debug, Default)]
pub struct MixtureGroups {
    /// The group of each light.
    group_of: Vec<u8>,
    /// True if group 0 holds the infinite lights.
    has_infinite: bool,
    choice: Choice,
}

#[derive(Clone, Debug)]
enum Choice {
    /// Groups of fixed probabilities.
    Fixed(Vec<FixedGroup>),
    /// Subtrees of the sampler's tree: their root nodes, ascending, and the nodes above them.
    Tree { cut: Vec<u32>, above: Vec<CutNode> },
}

impl Default for Choice {
    fn default() -> Self {
        Choice::Tree { cut: Vec::new(), above: Vec::new() }
    }
}

#[derive(Clone, Debug)]
struct FixedGroup {
    pmf: f32,
    lights: Vec<LightId>,
    table: AliasTable,
}

impl MixtureGroups {
    /// Divides the lights of `set`, which `sampler` chooses from, into at most `max` (1 to [`MAX_GROUPS`]) groups.
    pub fn new(set: &LightSet, sampler: &LightSampler, max: usize) -> Self {
        let max = max.clamp(1, MAX_GROUPS);
        let lights = &set.lights;
        let tree = sampler.tree().map_or_else(|| set.tree(false), |choice| &choice.tree);
        let ctx = LightCtx::at(lumiris_numbers::math::Vec3::ZERO);
        let is_infinite = |i: usize| lights[i].is_infinite() && sampler.pmf(&ctx, i as LightId) > 0.0;
        let infinite: Vec<LightId> = (0..lights.len()).filter(|&i| is_infinite(i)).map(|i| i as LightId).collect();
        let has_infinite = !infinite.is_empty();
        let cut = tree.cut(max - usize::from(has_infinite && max > 1));

        // Lights of each group; a single group holds everything
        let mut groups: Vec<Vec<LightId>> = Vec::new();
        groups.extend(has_infinite.then_some(infinite));
        for &root in &cut {
            let mut lights = Vec::new();
            tree.visit_lights(root, &mut |light| lights.push(light));
            groups.push(lights);
        }
        let mut group_of = vec![NO_GROUP; lights.len()];
        for (g, lights) in groups.iter().enumerate() {
            lights.iter().for_each(|&l| group_of[l as usize] = g as u8);
        }
        let choice = match sampler.tree() {
            Some(_) => Choice::Tree { above: tree.above(&cut), cut },
            None => {
                let fixed = |lights: Vec<LightId>| {
                    let weights: Vec<f32> = lights.iter().map(|&l| sampler.pmf(&ctx, l)).collect();
                    FixedGroup { pmf: weights.iter().sum(), table: AliasTable::new(&weights), lights }
                };
                Choice::Fixed(groups.into_iter().map(fixed).collect())
            }
        };
        MixtureGroups { group_of, has_infinite, choice }
    }

    /// Number of groups.
    pub fn len(&self) -> usize {
        match &self.choice {
            Choice::Fixed(groups) => groups.len(),
            Choice::Tree { cut, .. } => cut.len() + usize::from(self.has_infinite),
        }
    }

    /// True if no light can be chosen.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The group of a light; `None` if it is never chosen.
    #[inline]
    pub fn group_of(&self, light: LightId) -> Option<usize> {
        let group = *self.group_of.get(light as usize)?;
        (group != NO_GROUP).then_some(usize::from(group))
    }

    /// Probabilities of the groups at a point. They sum to one unless no light can be chosen.
    pub fn pmfs(&self, sampler: &LightSampler, ctx: &LightCtx) -> [f32; MAX_GROUPS] {
        let mut pmfs = [0.0; MAX_GROUPS];
        match &self.choice {
            Choice::Tree { cut, above } => {
                let Some(choice) = sampler.tree() else { return pmfs };

                // Group 0 has the infinite lights
                let p_infinite = choice.infinite_probability(ctx);
                let of_tree = &mut pmfs[usize::from(self.has_infinite)..];
                if !cut.is_empty() {
                    choice.tree.cut_pmfs(ctx, above, of_tree);
                }
                of_tree.iter_mut().for_each(|p| *p *= 1.0 - p_infinite);
                if self.has_infinite {
                    pmfs[0] = p_infinite;
                }
            }
            Choice::Fixed(groups) => groups.iter().zip(&mut pmfs).for_each(|(group, p)| *p = group.pmf),
        }

        // Mixture with the visibility cache
        if let LightSampler::VisibilityCache(choice) = sampler {
            choice.group_pmfs(ctx, |light| self.group_of(light), &mut pmfs);
        }
        pmfs
    }

    /// Chooses a light of a group by `u` in [0, 1). The returned probability includes `group_pmf`, the probability of
    /// the group.
    pub fn sample(
        &self,
        sampler: &LightSampler,
        ctx: &LightCtx,
        group: usize,
        group_pmf: f32,
        u: f32,
    ) -> Option<SampledLight> {
        let of_base = |u| self.sample_base(sampler, ctx, group, group_pmf, u);
        match sampler {
            LightSampler::VisibilityCache(choice) => {
                choice.sample_group(ctx, |light| self.group_of(light) == Some(group), group_pmf, u, of_base)
            }
            LightSampler::Uniform(_) | LightSampler::Power(_) | LightSampler::Tree(_) => of_base(u),
        }
    }

    /// [`sample`](Self::sample) without the visibility cache.
    fn sample_base(
        &self,
        sampler: &LightSampler,
        ctx: &LightCtx,
        group: usize,
        group_pmf: f32,
        u: f32,
    ) -> Option<SampledLight> {
        match &self.choice {
            Choice::Tree { .. } if self.has_infinite && group == 0 => {
                Some(one_of(&sampler.tree()?.infinite, u, group_pmf))
            }
            Choice::Tree { cut, .. } => {
                // A group of the tree is a subtree of the cut
                let root = *cut.get(group - usize::from(self.has_infinite))?;
                let choice = sampler.tree()?.tree.sample_below(ctx, root, u)?;
                Some(SampledLight { pmf: choice.pmf * group_pmf, ..choice })
            }
            Choice::Fixed(groups) => {
                let group = groups.get(group)?;
                let s = group.table.sample(u)?;
                Some(SampledLight { light: group.lights[s.index], pmf: s.pmf * group_pmf, u: s.u })
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lights::{
        JobLights, Light, LightSamplerKind, LightSetBuilder, PointLight, PrimaryPhoton, SurfacePoint, VisibilityCache,
    };
    use lumiris_numbers::math::{Bounds3, Rgb, Vec3};
    use lumiris_test_support::assert_chi_squared;
    use lumiris_test_support::random::{RngExt, pcg32};
    use std::sync::Arc;

    const KINDS: [LightSamplerKind; 4] =
        [LightSamplerKind::Uniform, LightSamplerKind::Power, LightSamplerKind::Tree, LightSamplerKind::VisibilityCache];

    fn set(kind: LightSamplerKind, points: u32, infinite: u32) -> JobLights {
        let mut b = LightSetBuilder::default();
        for _ in 0..infinite {
            b.add(Light::InfiniteConstant { l: Rgb::splat(0.3) });
        }
        for i in 0..points {
            let p = Vec3::new(i as f32 * 0.7 - 2.0, (i % 3) as f32, 2.0 + (i % 4) as f32);
            b.add(Light::Point(PointLight { p, intensity: Rgb::splat(if i == 2 { 0.0 } else { 0.5 + i as f32 }) }));
        }
        let set = b.build(&Bounds3 { min: Vec3::ZERO, max: Vec3::splat(3.0) });
        let mut set = JobLights::new(Arc::new(set), kind, 1);
        // A third of the lights is visible, or all of them if there are many
        let step = if points > 90 { 1 } else { 3 };
        let at = SurfacePoint { p: Vec3::new(0.4, 0.3, 0.0), n: Vec3::Z };
        let photons = |light| vec![PrimaryPhoton { at, light }; light as usize % 5 + 1];
        let photons: Vec<_> = (0..points + infinite).step_by(step).flat_map(photons).collect();
        set.set_visibility_cache(Some(VisibilityCache::new(&photons, 0.5)));
        set
    }

    #[test]
    fn choosing_a_group_and_then_a_light_is_choosing_a_light() {
        for kind in KINDS {
            for (points, infinite) in [(4, 0), (4, 1), (30, 2), (100, 1), (0, 2), (1, 0)] {
                for max in [1, 2, 5, 8] {
                    let set = set(kind, points, infinite);
                    let groups = MixtureGroups::new(&set, &set.sampler, max);
                    let ctx = LightCtx::on(Vec3::new(0.4, 0.3, 0.0), Vec3::Z);
                    let pmfs = groups.pmfs(&set.sampler, &ctx);
                    assert!((pmfs.iter().sum::<f32>() - 1.0).abs() < 1e-5, "{kind:?} {pmfs:?}");
                    assert!(groups.len() <= max.max(usize::from(infinite > 0) + usize::from(points > 0)));

                    // Choose a group, then a light
                    let mut s = pcg32([points, infinite, max as u32]);
                    let mut observed = vec![0.0; set.lights.len()];
                    let n = 20_000;
                    for _ in 0..n {
                        let mut u = s.random::<f32>() * pmfs.iter().sum::<f32>();
                        let pick = |p: &f32| {
                            u -= p;
                            u < 0.0
                        };
                        let group = pmfs.iter().position(pick).unwrap_or(0);
                        let choice = groups.sample(&set.sampler, &ctx, group, pmfs[group], s.random::<f32>()).unwrap();
                        assert_eq!(groups.group_of(choice.light), Some(group));
                        let pmf = set.sampler.pmf(&ctx, choice.light);
                        assert!((choice.pmf / pmf - 1.0).abs() < 1e-4, "{kind:?} {} {pmf}", choice.pmf);
                        assert!((0.0..1.0).contains(&choice.u));
                        observed[choice.light as usize] += 1.0;
                    }

                    // Compare the frequencies of the lights
                    let pmf = |i: usize| f64::from(set.sampler.pmf(&ctx, i as LightId)) * f64::from(n);
                    let expected: Vec<f64> = (0..set.lights.len()).map(pmf).collect();
                    assert_chi_squared(&observed, &expected, 1e-6);
                }
            }
        }
    }

    #[test]
    fn few_lights_have_a_group_each_and_dark_ones_none() {
        for kind in KINDS {
            let set = set(kind, 5, 1);
            let groups = MixtureGroups::new(&set, &set.sampler, 7);
            assert_eq!(groups.len(), 5, "{kind:?}");
            let mut seen: Vec<_> = (0..6).map(|l| groups.group_of(l)).collect();
            assert_eq!(seen.remove(3), None);
            seen.sort_unstable();
            assert_eq!(seen, (0..5).map(Some).collect::<Vec<_>>());
        }
        let empty = set(LightSamplerKind::Tree, 0, 0);
        assert!(MixtureGroups::new(&empty, &empty.sampler, 4).is_empty());
    }
}
