//! Visibility of lights estimated from photons: an estimate V̂, and the choice of a light that has no photons in the
//! visibility cache.
//!
//! If a light is visible around a point, μ = E·A·N/Φ of its photons are expected there. E is the unshadowed irradiance
//! (lm/m² by luminance, up to a factor common to all lights), A the area that a cache lookup covers, N the number of
//! photon paths from the light, and Φ its power. The number of photons is Poisson distributed with the mean V·μ. With a
//! gamma distribution of mean v₀ and shape a as the prior of V, the posterior mean is
//!
//! > V̂ = (c + a)/(μ + a/v₀)
//!
//! for c photons. V̂ is near 0 for a light with many expected photons and none present. V̂ is near v₀ for a light that
//! is too far away, or has too few photon paths, to expect any.
//!
//! The density of light samples with the least variance is proportional to E·√V̂, as the second moment of a sample is
//! E²·V̂/p. On a glossy surface E is weighted by the reflection to the viewer, but V̂ uses the unweighted E.
//! [`LearnedVisibility::sample_noncontributing`] chooses lights without photons in this way. For a node of the light
//! tree, Φ/(A·N) is the sum over its lights.
//!
//! A node may hold many visible lights with few expected photons each. By [Good 1953], the expected contribution of its
//! lights without photons equals the contribution of its lights with exactly one photon. Their number is therefore the
//! count c of a node. For example, if a distant room is visible through a door, single photons from a few of its lights
//! indicate that the others are visible too.

use super::visibility_cache::{ContributingLights, PhotonCount, VisibilityCache};
use crate::lights::tree::descents::{Draw, Drawn};
use crate::lights::tree::node::Node;
use crate::lights::{Light, LightCtx, LightId, SampledLight, TreeChoice};
use lumiris_lanes::level;
use lumiris_lanes::light_descent::{self, DESCENTS, Expected, Photons};
use lumiris_numbers::math::ONE_MINUS_EPSILON;
use lumiris_numbers::math::expected_visibility::expected_visibility;
use lumiris_numbers::math::light_bound::Receiver;
use std::f32::consts::PI;

/// Minimum number of photon paths per light, for lights that have none.
const MIN_PATHS: f32 = 0.5;

/// The visibility of lights estimated from photons.
#[derive(Clone, Debug)]
pub struct LearnedVisibility {
    tree_choice: TreeChoice,
    /// For each infinite light, the luminance of the irradiance on a surface facing it; 0 for others.
    irradiances: Vec<f32>,
    /// Φ/(A·N) of each light: the irradiance at which one photon is expected.
    of_one_photon: Vec<f32>,
    /// Sums of `of_one_photon` over the lights below each node of the tree.
    of_nodes: Vec<f32>,
}

/// A light without photons in the visibility cache at a point.
#[derive(Clone, Copy, Debug)]
pub struct NoncontributingLight {
    /// The light.
    pub sampled: SampledLight,
    /// Its expected contribution without photons.
    pub expected: ExpectedContribution,
}

/// The choice of a light without photons, to be made.
#[derive(Clone, Copy, Debug)]
pub struct NoncontributingDraw<'a> {
    /// The point.
    pub ctx: LightCtx,
    /// The lights with photons there.
    pub contributing: ContributingLights<'a>,
    /// Tree indices of those with one photon, by [`LearnedVisibility::find_singles`].
    pub singles: &'a [u32],
    /// A random number in [0, 1).
    pub u: f32,
}

/// The expected contribution of a light at a point.
#[derive(Clone, Copy, Debug)]
pub struct ExpectedContribution {
    /// E, weighted by the reflection, up to a factor common to all lights.
    pub importance: f32,
    /// V̂ of the light.
    pub visibility: f32,
}

/// True if the importance of lights includes a glossy lobe.
#[inline]
fn is_glossy(ctx: &LightCtx) -> bool {
    ctx.lobe.scale > 0.0
}

/// Luminance of the irradiance on a surface that faces an infinite light; 0 for others.
pub(super) fn facing_irradiance(light: &Light, scene_radius: f32) -> f32 {
    let disk = PI * scene_radius * scene_radius;
    match light {
        Light::Distant(_) => light.power_luminance(scene_radius) / disk,
        // π times the mean radiance
        Light::InfiniteConstant { .. } | Light::InfiniteImage { .. } => {
            light.power_luminance(scene_radius) / (4.0 * disk)
        }
        // The mean over the scene
        Light::Portal(_) => light.power_luminance(scene_radius) / disk,
        Light::Point(_) | Light::Spot(_) | Light::Image(_) | Light::Area(_) | Light::Volume(_) => 0.0,
    }
}

impl LearnedVisibility {
    /// The visibility of `lights` according to `cache`; `tree_choice` holds the tree over the lights.
    pub(in crate::lights) fn new(
        tree_choice: TreeChoice,
        lights: &[Light],
        scene_radius: f32,
        cache: &VisibilityCache,
    ) -> Self {
        let of_one_photon: Vec<f32> = (0..)
            .zip(lights)
            .map(|(id, light)| light.power_luminance(scene_radius) / (cache.area() * cache.paths(id).max(MIN_PATHS)))
            .map(|irradiance| irradiance.clamp(f32::MIN_POSITIVE, 1e30))
            .collect();
        let of_nodes = tree_choice.tree.sums(|light| of_one_photon[light as usize]);
        let irradiances = lights.iter().map(|light| facing_irradiance(light, scene_radius)).collect();
        LearnedVisibility { tree_choice, irradiances, of_one_photon, of_nodes }
    }

    /// E of a light or an upper bound of it, up to a factor common to all lights; 0 if it cannot contribute.
    #[inline]
    pub fn importance(&self, ctx: &LightCtx, light: LightId) -> f32 {
        if self.tree_choice.tree.contains(light) {
            self.tree_choice.tree.light_importance(&ctx.diffuse(), light)
        } else {
            self.irradiances[light as usize]
        }
    }

    /// The expected contribution of a light with `count` photons.
    #[inline]
    fn expect(&self, ctx: &LightCtx, light: LightId, count: u32) -> ExpectedContribution {
        let e = self.importance(ctx, light);
        let is_by_lobe = is_glossy(ctx) && self.tree_choice.tree.contains(light);
        let importance = if is_by_lobe { self.tree_choice.tree.light_importance(ctx, light) } else { e };
        ExpectedContribution { importance, visibility: self.visibility(light, e, count) }
    }

    /// Appends the expected contributions of lights with photons.
    pub fn expect_many(&self, ctx: &LightCtx, lights: &[PhotonCount], out: &mut Vec<ExpectedContribution>) {
        let TreeChoice { tree, .. } = &self.tree_choice;
        let Some(root) = tree.root() else {
            return out.extend(lights.iter().map(|&PhotonCount { light, count }| self.expect(ctx, light, count)));
        };
        let at = ctx.receiver();
        let (mut bounds, mut photons, mut expected) = ([root; DESCENTS], Photons::default(), Expected::default());
        for lights in lights.chunks(DESCENTS) {
            for (i, &PhotonCount { light, count }) in lights.iter().enumerate() {
                bounds[i] = tree.bound(light).unwrap_or(root);
                (photons.of_one[i], photons.count[i]) = (self.of_one_photon[light as usize], count as f32);
            }
            light_descent::expect(level(), &at, &bounds, &photons, lights.len(), &mut expected);
            out.extend(lights.iter().enumerate().map(|(i, &PhotonCount { light, count })| {
                if tree.contains(light) {
                    ExpectedContribution { importance: expected.importance[i], visibility: expected.visibility[i] }
                } else {
                    self.expect(ctx, light, count)
                }
            }));
        }
    }

    /// V̂ of a light for its E and its number of photons.
    #[inline]
    pub fn visibility(&self, light: LightId, importance: f32, count: u32) -> f32 {
        expected_visibility(importance, self.of_one_photon[light as usize], count as f32)
    }

    /// The irradiance that `count` photons of a light stand for.
    #[inline]
    pub fn irradiance_of(&self, light: LightId, count: u32) -> f32 {
        count as f32 * self.of_one_photon[light as usize]
    }

    /// Appends the tree indices, ascending, of the contributing lights with exactly one photon.
    pub fn find_singles(&self, contributing: &ContributingLights<'_>, singles: &mut Vec<u32>) {
        let first = singles.len();
        let once = contributing.lights.iter().filter(|entry| entry.count == 1);
        singles.extend(once.filter_map(|entry| self.tree_choice.tree.leaf(entry.light)));
        singles[first..].sort_unstable();
    }

    /// Chooses a light for each draw by its `u`, nearly in proportion to E·√V̂ for lights without photons. Every light
    /// that can contribute and has no photons has a positive probability. `contributing` lights may be chosen too, but
    /// those with a single photon only if no other light below their node can contribute. The result is `None` if there
    /// is no light.
    pub fn sample_noncontributing(&self, draws: &[NoncontributingDraw<'_>]) -> Vec<Option<NoncontributingLight>> {
        let mut chosen = vec![None; draws.len()];

        // Infinite lights
        let TreeChoice { tree, infinite, .. } = &self.tree_choice;
        let (mut in_tree, mut indices) = (Vec::with_capacity(draws.len()), Vec::with_capacity(draws.len()));
        for (i, draw) in draws.iter().enumerate() {
            let &NoncontributingDraw { ctx, contributing, singles, u } = draw;
            let others = || infinite.iter().filter(|&&light| contributing.index_of(light).is_none());
            let count = others().count();
            let p_infinite = self.tree_choice.probability_of_some(&ctx, count);
            if u < p_infinite {
                let x = u / p_infinite * count as f32;
                let k = (x as usize).min(count - 1);
                let u = (x - k as f32).clamp(0.0, ONE_MINUS_EPSILON);
                let of_one = |&light| self.evaluated(&ctx, SampledLight { light, pmf: p_infinite / count as f32, u });
                chosen[i] = others().nth(k).map(of_one);
            } else {
                let u = ((u - p_infinite) / (1.0 - p_infinite)).min(ONE_MINUS_EPSILON);
                in_tree.push(Draw { at: ctx.receiver(), u, leaves: singles });
                indices.push((i, p_infinite));
            }
        }

        // Lights in the tree
        tree.sample_by_photons(&in_tree, &self.of_nodes, |i, drawn| {
            let (i, p_infinite) = indices[i];
            chosen[i] = drawn.map(|Drawn { light: sampled, importance, diffuse_importance }| NoncontributingLight {
                sampled: SampledLight { pmf: sampled.pmf * (1.0 - p_infinite), ..sampled },
                expected: ExpectedContribution {
                    importance,
                    visibility: self.visibility(sampled.light, diffuse_importance, 0),
                },
            });
        });
        chosen
    }

    /// Evaluates a light without photons, with the probability that [`Self::sample_noncontributing`] chooses it.
    #[inline]
    pub fn noncontributing_light(
        &self,
        ctx: &LightCtx,
        contributing: &ContributingLights<'_>,
        singles: &[u32],
        light: LightId,
    ) -> NoncontributingLight {
        let TreeChoice { tree, infinite, .. } = &self.tree_choice;
        let count = infinite.iter().filter(|&&light| contributing.index_of(light).is_none()).count();
        let p_infinite = self.tree_choice.probability_of_some(ctx, count);
        let pmf = if tree.contains(light) {
            tree.pmf_by(light, singles, self.by_visibility(ctx)) * (1.0 - p_infinite)
        } else if infinite.binary_search(&light).is_ok() {
            p_infinite / count as f32
        } else {
            0.0
        };
        self.evaluated(ctx, SampledLight { light, pmf, u: 0.0 })
    }

    /// E·√V̂ of nodes at a point, as a function of the index, the node, and the number of lights below it with a single
    /// photon.
    #[inline]
    fn by_visibility(&self, ctx: &LightCtx) -> impl Fn(usize, &Node, usize) -> f32 {
        let receiver = ctx.receiver();
        let diffuse = Receiver { lobe: None, ..receiver };
        move |index, node, singles| {
            let e = node.bound.importance(&diffuse);
            let reflected = if receiver.lobe.is_some() { node.bound.importance(&receiver) } else { e };
            reflected * expected_visibility(e, self.of_nodes[index], singles as f32).sqrt()
        }
    }

    #[inline]
    fn evaluated(&self, ctx: &LightCtx, sampled: SampledLight) -> NoncontributingLight {
        NoncontributingLight { sampled, expected: self.expect(ctx, sampled.light, 0) }
    }
}

#[cfg(test)]
mod tests {
    use super::super::visibility_cache::{PathCount, PrimaryPhoton};
    use super::*;
    use crate::lights::{DistantLight, GlossyLobe, LightTree, PointLight, SurfacePoint};
    use lumiris_numbers::math::expected_visibility::{MIN_VISIBILITY, PRIOR_MEAN, PRIOR_SHAPE};
    use lumiris_numbers::math::{Rgb, Vec3};
    use lumiris_test_support::random::{RngExt, pcg32};
    use std::sync::Arc;

    const RADIUS: f32 = 20.0;
    const AT: Vec3 = Vec3::new(0.5, 0.5, 0.0);

    /// Lamps in a row above the floor, and two infinite lights.
    fn lamps() -> Vec<Light> {
        let lamp = |i: i32| {
            Light::Point(PointLight { p: Vec3::new(i as f32, 0.3, 2.0), intensity: Rgb::splat(1.0 + i as f32) })
        };
        let mut lights: Vec<Light> = (0..12).map(lamp).collect();
        lights.push(Light::InfiniteConstant { l: Rgb::splat(0.1) });
        lights.push(Light::Distant(DistantLight { wi: Vec3::Z, irradiance: Rgb::splat(0.2) }));
        lights
    }

    /// The choice of a single draw.
    fn sample(
        learned: &LearnedVisibility,
        contributing: ContributingLights<'_>,
        singles: &[u32],
        u: f32,
    ) -> NoncontributingLight {
        let draw = NoncontributingDraw { ctx: LightCtx::on(AT, Vec3::Z), contributing, singles, u };
        learned.sample_noncontributing(&[draw])[0].unwrap()
    }

    /// A cache with `count` photons of each light of `contributing` at the point, and `paths` photon paths of every
    /// light.
    fn cache(seen: &[LightId], count: usize, paths: f32) -> VisibilityCache {
        let at = SurfacePoint { p: AT, n: Vec3::Z };
        let photons: Vec<_> = seen.iter().flat_map(|&light| vec![PrimaryPhoton { at, light }; count]).collect();
        VisibilityCache::new(&photons, 0.2).with_paths((0..14).map(|light| PathCount { light, paths }))
    }

    fn learned(cache: &VisibilityCache) -> LearnedVisibility {
        let lights = lamps();
        LearnedVisibility::new(choice(&lights), &lights, RADIUS, cache)
    }

    fn choice(lights: &[Light]) -> TreeChoice {
        let infinite = (0..).zip(lights).filter(|(_, light)| light.is_infinite()).map(|(id, _)| id).collect();
        TreeChoice::new(Arc::new(LightTree::new(lights, |_| true)), infinite, None)
    }

    #[test]
    fn visibility_is_the_ratio_of_photons_to_those_expected_and_the_prior_without_any() {
        // A lamp above a floor: the irradiance I/h² corresponds to N·A/(4π h²) photons.
        let lights = [Light::Point(PointLight { p: AT + Vec3::Z * 3.0, intensity: Rgb::splat(7.0) })];
        let ctx = LightCtx::on(AT, Vec3::Z);
        let of = |paths: f32| {
            let photon = PrimaryPhoton { at: SurfacePoint { p: AT, n: Vec3::Z }, light: 0 };
            let cache = VisibilityCache::new(&[photon], 0.1);
            let cache = cache.with_paths(std::iter::once(PathCount { light: 0, paths }));
            let learned = LearnedVisibility::new(choice(&lights), &lights, RADIUS, &cache);
            let importance = learned.importance(&ctx, 0);
            move |count| learned.visibility(0, importance, count)
        };
        let many = 4.0 * PI * 9.0 / (16.0 * 0.01) * 1000.0;
        for (count, expected) in [(0, 0.001), (250, 0.25), (1000, 1.0), (2000, 1.0)] {
            let v = of(many)(count);
            assert!((v - expected).abs() < 2e-3, "{count} photons: {v}");
        }
        assert!((of(1e-3 * many)(0) - PRIOR_SHAPE / (1.0 + PRIOR_SHAPE / PRIOR_MEAN)).abs() < 1e-3);
        assert!((of(1e-9 * many)(0) - PRIOR_MEAN).abs() < 0.01 && of(0.0)(0) > 0.4);
        assert_eq!(of(1e12 * many)(0), MIN_VISIBILITY);
    }

    #[test]
    fn every_light_that_is_not_seen_is_chosen_with_the_probability_given() {
        for (seen, count, paths) in
            [(&[0, 3, 12][..], 5, 1e4), (&[12, 13], 1, 100.0), (&[1], 3, 0.0), (&[2, 5], 9, 1e12), (&[4, 5, 7], 1, 1e4)]
        {
            let cache = cache(seen, count, paths);
            let learned = learned(&cache);
            let ctx = LightCtx::on(AT, Vec3::Z);
            let contributing = cache.lookup(AT, Vec3::Z);
            assert_eq!(contributing.lights.len(), seen.len());
            let mut singles = Vec::new();
            learned.find_singles(&contributing, &mut singles);

            // The mean of 1/pmf over the samples of a light is 1
            let draws = 200_000;
            let mut s = pcg32([3, 1, 4]);
            let (mut means, mut squares) = ([0.0_f64; 14], [0.0_f64; 14]);
            for _ in 0..draws {
                let sampled = sample(&learned, contributing, &singles, s.random::<f32>());
                let SampledLight { light, pmf, u } = sampled.sampled;
                assert!((0.0..1.0).contains(&u) && pmf > 0.0);
                assert_eq!(sampled.expected.importance, learned.importance(&ctx, light));
                if !seen.contains(&light) {
                    assert_eq!(learned.noncontributing_light(&ctx, &contributing, &singles, light).sampled.pmf, pmf);
                }
                means[light as usize] += f64::from(1.0 / pmf) / f64::from(draws);
                squares[light as usize] += f64::from(1.0 / pmf).powi(2) / f64::from(draws);
            }
            for light in (0..14).filter(|light| !seen.contains(light)) {
                let (mean, square) = (means[light as usize], squares[light as usize]);
                let sigma = ((square - mean * mean) / f64::from(draws)).sqrt();
                assert!((mean - 1.0).abs() < 4.5 * sigma + 1e-4, "{seen:?}, light {light}: {mean} ± {sigma}");
            }
        }
    }

    #[test]
    fn expectations_of_many_lights_are_those_of_each() {
        // Few and many lights, a diffuse and a glossy surface, infinite lights among them
        let learned = learned(&cache(&[0, 3, 12], 5, 1e3));
        let diffuse = LightCtx::on(AT, Vec3::Z);
        let lobe = GlossyLobe::new(Vec3::new(0.6, 0.0, 0.8), Vec3::Z, 0.3, 0.7);
        for ctx in [diffuse, LightCtx { lobe, ..diffuse }] {
            for n in [0, 1, 5, 14, 100] {
                let lights: Vec<_> = (0..n).map(|i| PhotonCount { light: i % 14, count: i % 5 }).collect();
                let mut found = Vec::new();
                learned.expect_many(&ctx, &lights, &mut found);
                let each = lights.iter().map(|&PhotonCount { light, count }| learned.expect(&ctx, light, count));
                let values = |e: &ExpectedContribution| (e.importance, e.visibility);
                assert!(found.iter().map(values).eq(each.map(|e| values(&e))));
            }
        }
    }

    #[test]
    fn lights_whose_photons_were_expected_and_did_not_come_are_chosen_less() {
        let share_of_near = |paths: f32| {
            let cache = cache(&[5], 1, paths);
            let learned = learned(&cache);
            let contributing = cache.lookup(AT, Vec3::Z);
            let near = |i: u32| sample(&learned, contributing, &[], (i as f32 + 0.5) / 4096.0);
            (0..4096).filter(|&i| near(i).sampled.light < 3).count()
        };
        let [few, many] = [1.0, 1e6].map(share_of_near);
        assert!(few > many + 100, "{few} {many}");
    }

    #[test]
    fn lights_beside_those_of_single_photons_are_chosen_more() {
        let share_of_far = |seen: &[LightId], count: usize| {
            let cache = cache(seen, count, 1e5);
            let learned = learned(&cache);
            let contributing = cache.lookup(AT, Vec3::Z);
            let mut singles = Vec::new();
            learned.find_singles(&contributing, &mut singles);
            assert_eq!(singles.len(), if count == 1 { seen.len() } else { 0 });
            let chosen = |i: u32| sample(&learned, contributing, &singles, (i as f32 + 0.5) / 4096.0);
            (0..4096).filter(|&i| (8..12).contains(&chosen(i).sampled.light)).count()
        };
        let [none, many, single] = [share_of_far(&[], 0), share_of_far(&[9, 11], 50), share_of_far(&[9, 11], 1)];
        assert_eq!(none, many, "lights with photons enough tell nothing of others");
        assert!(single as f64 > 1.2 * none as f64, "{single} {none}");
    }
}
