//! The lights of a render job: the lights of its scene, with the light sampler of its settings, groups, and the
//! visibility cache.

use super::light_sampler::{LightChoice, LightSampler};
use super::mixture_groups::MixtureGroups;
use super::set::LightSet;
use crate::lights::visibility::visibility_cache::ContributingLights;
use crate::lights::{
    LeAndPdf, LearnedVisibility, Light, LightCtx, LightHit, LightId, SampleOfLight, TreeChoice, VisibilityCache,
};
use crate::media::{EmissionLookup, MediumId};
use lumiris_numbers::math::{Rgb, Vec3};
use std::ops::Deref;
use std::sync::Arc;

/// The lights of a render job, with their light sampler.
#[derive(Clone, Debug)]
pub struct JobLights {
    set: Arc<LightSet>,
    /// Chooses one of them.
    pub sampler: LightSampler,
    /// Chooses among the delta lights in the same way; `None` if there are none.
    pub delta: Option<LightSampler>,
    /// The lights as components of a mixture.
    pub groups: MixtureGroups,
    choice: LightChoice,
    visibility_cache: Option<Arc<VisibilityCache>>,
    /// Visibility estimated from the photons of the cache.
    learned: Option<LearnedVisibility>,
}

impl Deref for JobLights {
    type Target = LightSet;

    fn deref(&self) -> &LightSet {
        &self.set
    }
}

impl JobLights {
    /// Lights chosen by `choice`, with at most `max` groups.
    pub fn new(set: Arc<LightSet>, choice: impl Into<LightChoice>, max: usize) -> Self {
        let choice = choice.into();
        let sampler = LightSampler::new(choice, &set);
        let (delta, groups) = (LightSampler::of_delta(choice, &set), MixtureGroups::new(&set, &sampler, max));
        JobLights { set, sampler, delta, groups, choice, visibility_cache: None, learned: None }
    }

    /// Changes the light sampler; the visibility cache stays.
    pub fn choose_by(&mut self, choice: LightChoice, max: usize) {
        self.sampler = LightSampler::new(choice, &self.set);
        self.choice = choice;
        self.sampler.set_visibility_cache(self.visibility_cache.clone());
        self.delta = LightSampler::of_delta(choice, &self.set);
        self.learn();
        self.set_groups(max);
    }

    /// Divides the lights into at most `max` groups.
    pub fn set_groups(&mut self, max: usize) {
        self.groups = MixtureGroups::new(&self.set, &self.sampler, max);
    }

    /// Sets the visibility cache. Estimates remain unbiased for any content. Lights without power and unknown ids are
    /// ignored.
    pub fn set_visibility_cache(&mut self, visibility_cache: Option<VisibilityCache>) {
        let is_lit = |light: LightId| self.set.lit.binary_search(&light).is_ok();
        self.visibility_cache = visibility_cache.map(|visibility_cache| Arc::new(visibility_cache.of_lights(is_lit)));
        self.sampler.set_visibility_cache(self.visibility_cache.clone());
        self.learn();
    }

    /// Estimates the visibility of lights from the cache. Lights that emit no photons are excluded.
    fn learn(&mut self) {
        let LightSet { lights, scene_radius, .. } = &*self.set;
        let cache = self.visibility_cache.as_ref().filter(|cache| !cache.is_empty());
        self.learned = cache.map(|cache| {
            let choice = if self.choice.volumes {
                self.set.tree_choice(self.choice.infinite_fraction, false)
            } else {
                self.tree_choice()
            };
            LearnedVisibility::new(choice, lights, *scene_radius, cache)
        });
    }

    /// The choice by the light tree, for any light sampler.
    pub fn tree_choice(&self) -> TreeChoice {
        let choice = self.sampler.tree().cloned();
        choice.unwrap_or_else(|| self.set.tree_choice(None, false))
    }

    /// The visibility estimated from photons; `None` without photons.
    #[inline]
    pub fn learned_visibility(&self) -> Option<&LearnedVisibility> {
        self.learned.as_ref()
    }

    /// V̂ of a light, where `contributing` holds the photon counts at the point; 1 without photons.
    #[inline]
    pub fn visibility(&self, ctx: &LightCtx, contributing: &ContributingLights<'_>, light: LightId) -> f32 {
        match &self.learned {
            Some(learned) if !contributing.lights.is_empty() => {
                learned.visibility(light, learned.importance(ctx, light), contributing.count(light))
            }
            Some(_) | None => 1.0,
        }
    }

    /// The visibility cache.
    pub fn visibility_cache(&self) -> Option<&VisibilityCache> {
        self.visibility_cache.as_deref()
    }

    /// The contributing lights at a point; empty without a visibility cache.
    #[inline]
    pub fn contributing_lights(&self, ctx: &LightCtx) -> ContributingLights<'_> {
        self.visibility_cache
            .as_ref()
            .map_or_else(ContributingLights::default, |visibility_cache| visibility_cache.lookup(ctx.p, ctx.n))
    }

    /// Chooses a light by `u_choice` and samples a direction to it by `u`. `pdf` of the sample includes the probability
    /// of the choice: it is per steradian, or a probability for delta lights.
    #[inline]
    pub fn sample(&self, ctx: &LightCtx, u_choice: f32, u: [f32; 2]) -> Option<SampleOfLight> {
        self.set.sample_choice(ctx, self.sampler.sample(ctx, u_choice)?, u)
    }

    /// True if light sampling includes emitting media.
    pub fn samples_volumes(&self) -> bool {
        self.choice.volumes && self.set.has_volume_lights()
    }

    /// Density per steradian, at `ctx`, of sampling a point of emission in a medium by light sampling; `p` is the point
    /// in world space.
    pub fn pdf_volume(&self, ctx: &LightCtx, medium: MediumId, lookup: &EmissionLookup, p: Vec3) -> f32 {
        let Some(light) = self.set.volume_light_at(medium, lookup.unit) else { return 0.0 };
        let Light::Volume(volume) = &self.set.lights[light as usize] else { return 0.0 };
        let pmf = self.sampler.pmf(ctx, light);
        if pmf > 0.0 { pmf * volume.pdf(ctx, lookup.unit, p, lookup.rate) } else { 0.0 }
    }

    /// Samples a direction to a light of one group, whose probability is `group_pmf`; otherwise as
    /// [`sample`](Self::sample).
    #[inline]
    pub fn sample_group(
        &self,
        ctx: &LightCtx,
        group: usize,
        group_pmf: f32,
        u_choice: f32,
        u: [f32; 2],
    ) -> Option<SampleOfLight> {
        self.set.sample_choice(ctx, self.groups.sample(&self.sampler, ctx, group, group_pmf, u_choice)?, u)
    }

    /// Density per steradian with which [`sample`](Self::sample) chooses `light` and the direction `wi`, which hits it
    /// at `hit` ([`LightHit::INFINITE`] for infinite lights).
    #[inline]
    pub fn pdf(&self, ctx: &LightCtx, light: LightId, wi: Vec3, hit: &LightHit) -> f32 {
        let pdf = self.set.lights[light as usize].pdf_li(ctx, wi, hit);
        if pdf > 0.0 { pdf * self.sampler.pmf(ctx, light) } else { 0.0 }
    }

    /// Radiance that all infinite lights send from the direction `wi`, and the density per steradian of
    /// [`sample`](Self::sample) to choose any of them and that direction.
    #[inline]
    pub fn infinite_in_direction(&self, ctx: &LightCtx, wi: Vec3) -> LeAndPdf {
        self.infinite_in_direction_by(ctx, wi, |ctx, light| self.sampler.pmf(ctx, light))
    }

    /// [`infinite_in_direction`](Self::infinite_in_direction) with the probabilities `pmf` of the lights.
    #[inline]
    pub fn infinite_in_direction_by(
        &self,
        ctx: &LightCtx,
        wi: Vec3,
        pmf: impl Fn(&LightCtx, LightId) -> f32,
    ) -> LeAndPdf {
        self.set.infinite.iter().fold(LeAndPdf::ZERO, |sum, &i| {
            let LeAndPdf { le, pdf } = self.set.lights[i as usize].le_and_pdf(ctx.p, wi);
            let pdf = if pdf > 0.0 { pdf * pmf(ctx, i) } else { 0.0 };
            LeAndPdf { le: sum.le + le, pdf: sum.pdf + pdf }
        })
    }

    /// [`infinite_in_direction`](Self::infinite_in_direction) for `n` points and directions.
    pub fn infinite_in_directions(
        &self,
        n: usize,
        ctx: impl Fn(usize) -> LightCtx,
        wi: impl Fn(usize) -> Vec3,
        out: impl FnMut(usize, Rgb, f32),
    ) {
        self.infinite_in_directions_by(n, ctx, wi, |_, ctx, light| self.sampler.pmf(ctx, light), out);
    }

    /// [`infinite_in_directions`](Self::infinite_in_directions) with the probabilities `pmf` of the lights at each
    /// point.
    pub fn infinite_in_directions_by(
        &self,
        n: usize,
        ctx: impl Fn(usize) -> LightCtx,
        wi: impl Fn(usize) -> Vec3,
        pmf: impl Fn(usize, &LightCtx, LightId) -> f32,
        mut out: impl FnMut(usize, Rgb, f32),
    ) {
        // A single infinite light is evaluated for all directions at once
        if let [light] = self.set.infinite[..] {
            self.set.lights[light as usize].le_and_pdf_many(
                n,
                |i| ctx(i).p,
                &wi,
                |i, LeAndPdf { le, pdf }| {
                    let pdf = if pdf > 0.0 { pdf * pmf(i, &ctx(i), light) } else { 0.0 };
                    out(i, le, pdf);
                },
            );
        } else if self.set.infinite.is_empty() {
            (0..n).for_each(|i| out(i, Rgb::BLACK, 0.0));
        } else {
            for i in 0..n {
                let LeAndPdf { le, pdf } =
                    self.infinite_in_direction_by(&ctx(i), wi(i), |ctx, light| pmf(i, ctx, light));
                out(i, le, pdf);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::{Shape, TriangleMesh};
    use crate::lights::{DistantLight, LightSamplerKind, LightSetBuilder, PointLight, PrimaryPhoton, SurfacePoint};
    use crate::lights::{Emission, EnvironmentFilter, EnvironmentMap, EnvironmentMapping, Light};
    use crate::media::{Field, Heterogeneous, Medium, MediumSet, RgbGrid, Samples};
    use lumiris_numbers::math::{Affine3A, Bounds3, DAffine3};
    use lumiris_test_support::random::{RngExt, pcg32};
    use lumiris_test_support::{Moments, assert_chi_squared};
    use std::sync::Arc;

    const CHOICES: [LightChoice; 6] = [
        LightChoice { kind: LightSamplerKind::Uniform, infinite_fraction: None, volumes: false },
        LightChoice { kind: LightSamplerKind::Power, infinite_fraction: None, volumes: false },
        LightChoice { kind: LightSamplerKind::Tree, infinite_fraction: None, volumes: false },
        LightChoice { kind: LightSamplerKind::Tree, infinite_fraction: Some(0.125), volumes: false },
        LightChoice { kind: LightSamplerKind::VisibilityCache, infinite_fraction: None, volumes: false },
        LightChoice { kind: LightSamplerKind::VisibilityCache, infinite_fraction: Some(0.9), volumes: false },
    ];

    /// A set with photons of some lights around (0.4, 0.3, 0); lights with greater ids have more photons.
    fn with_cache(builder: LightSetBuilder, kind: LightChoice, seen: &[LightId]) -> JobLights {
        let mut set = sampling(builder, kind, &bounds());
        let at = Vec3::new(0.4, 0.3, 0.0);
        let at = SurfacePoint { p: at, n: Vec3::Z };
        let photon = |light| PrimaryPhoton { at, light };
        let photons: Vec<_> = seen.iter().flat_map(|&light| vec![photon(light); light as usize % 7 + 1]).collect();
        set.set_visibility_cache(Some(VisibilityCache::new(&photons, 0.5)));
        set
    }

    fn sampling(builder: LightSetBuilder, kind: impl Into<LightChoice>, bounds: &Bounds3) -> JobLights {
        JobLights::new(Arc::new(builder.build(bounds)), kind, 1)
    }

    fn quad(z: f32) -> Shape {
        let p = vec![Vec3::new(0.0, 0.0, z), Vec3::new(0.0, 1.0, z), Vec3::new(1.0, 1.0, z), Vec3::new(1.0, 0.0, z)];
        Shape::Mesh(TriangleMesh::new(p, vec![[0, 1, 2], [0, 2, 3]]).unwrap())
    }

    fn builder() -> LightSetBuilder {
        let mut b = LightSetBuilder::default();
        b.add(Light::Point(PointLight { p: Vec3::new(2.0, 2.0, 2.0), intensity: Rgb::splat(3.0) }));
        b.add_area(7, &quad(3.0), &Emission::constant(Rgb::splat(5.0)));
        b.add_area(3, &quad(2.0), &Emission::constant(Rgb::BLACK));
        b.add(Light::InfiniteConstant { l: Rgb::splat(0.1) });
        b.add(Light::Distant(DistantLight { wi: Vec3::Z, irradiance: Rgb::WHITE }));
        let texels = (0..16).map(|i| Rgb::splat(i as f32 * 0.01)).collect();
        let map = EnvironmentMap::new(texels, [4, 4], EnvironmentMapping::EqualArea, EnvironmentFilter::Bilinear);
        b.add(Light::infinite_image(Arc::new(map.unwrap()), &Affine3A::IDENTITY, 2.0));
        b
    }

    fn bounds() -> Bounds3 {
        Bounds3 { min: Vec3::ZERO, max: Vec3::splat(3.0) }
    }

    #[test]
    fn every_sampler_is_a_distribution_over_the_lights_that_shine() {
        for (kind, seen) in CHOICES.into_iter().flat_map(|k| [(k, &[0, 2, 4][..]), (k, &[5, 900]), (k, &[])]) {
            let set = with_cache(builder(), kind, seen);
            let mut s = pcg32([1, 2, 3]);
            for ns in [Vec3::ZERO, Vec3::Z] {
                let ctx = LightCtx::on(Vec3::new(0.4, 0.3, 0.0), ns);

                // The probabilities are a distribution, and 0 for the dark light only
                let pmf: Vec<f64> = (0..6).map(|i| f64::from(set.sampler.pmf(&ctx, i))).collect();
                assert!((pmf.iter().sum::<f64>() - 1.0).abs() < 1e-5, "{kind:?} {pmf:?}");
                assert_eq!(pmf.iter().map(|&p| p > 0.0).collect::<Vec<_>>(), [true, true, false, true, true, true]);

                // Samples follow it
                let count = 50_000;
                let mut observed = vec![0.0; 6];
                for _ in 0..count {
                    let choice = set.sampler.sample(&ctx, s.random::<f32>()).unwrap();
                    assert!((0.0..1.0).contains(&choice.u));
                    assert_eq!(choice.pmf, set.sampler.pmf(&ctx, choice.light));
                    observed[choice.light as usize] += 1.0;
                }
                let expected: Vec<f64> = pmf.iter().map(|p| p * f64::from(count)).collect();
                assert_chi_squared(&observed, &expected, 1e-5);
            }
        }
    }

    #[test]
    fn lights_at_infinity_have_their_fraction_where_others_can_contribute() {
        let mut builder = LightSetBuilder::default();
        builder.add_area(7, &quad(3.0), &Emission::constant(Rgb::splat(5.0)));
        builder.add(Light::InfiniteConstant { l: Rgb::splat(0.1) });
        builder.add(Light::Distant(DistantLight { wi: Vec3::Z, irradiance: Rgb::WHITE }));
        for (infinite_fraction, expected) in [(None, 2.0 / 3.0), (Some(0.25), 0.25), (Some(0.9375), 0.9375)] {
            let choice = LightChoice { infinite_fraction, ..LightSamplerKind::Tree.into() };
            let set = sampling(builder.clone(), choice, &bounds());
            let of = |z: f32| -> f32 {
                let ctx = LightCtx::at(Vec3::new(0.4, 0.3, z));
                [1, 2].iter().map(|&light| set.sampler.pmf(&ctx, light)).sum()
            };
            assert!((of(1.0) - expected).abs() < 1e-6, "{} {expected}", of(1.0));
            // The lamp faces away
            assert!((of(4.0) - 1.0).abs() < 1e-6, "{}", of(4.0));
        }
    }

    #[test]
    fn runs_choose_each_light_by_its_probability_and_leave_a_uniform_number() {
        let mut builder = builder();
        for i in 0..80 {
            let p = Vec3::new(i as f32 * 0.15 - 6.0, 1.5, 2.0 + (i % 3) as f32);
            builder.add(Light::Point(PointLight { p, intensity: Rgb::splat(0.1 + i as f32) }));
        }
        // Few lights are compared at the point, many by their photon counts
        let (few, many): (Vec<LightId>, Vec<LightId>) = ((0..80).step_by(7).collect(), (2..80).collect());
        for (kind, seen) in CHOICES.into_iter().flat_map(|k| [(k, &few), (k, &many)]) {
            let set = with_cache(builder.clone(), kind, seen);
            for ns in [Vec3::ZERO, Vec3::Z] {
                let ctx = LightCtx::on(Vec3::new(0.4, 0.3, 0.0), ns);
                // A regular list: counts are exact up to one at each end of a run
                let count = 1_u32 << 16;
                let positions: Vec<u32> = (0..count).map(|i| (i << 16) + 0x8000).collect();
                let mut runs = Vec::new();
                set.sampler.runs(&ctx, &positions, &mut runs);
                let (mut place, mut parts) = (0, std::collections::BTreeMap::new());
                for run in &runs {
                    assert_eq!(run.range[0], place, "{kind:?}: runs follow each other");
                    place = run.range[1];
                    let number = run.range[1] - run.range[0];
                    let pmf = set.sampler.pmf(&ctx, run.light);
                    assert!((run.pmf - pmf).abs() <= 1e-5 * pmf, "{kind:?} {run:?} {pmf}");
                    let part = run.interval[1] - run.interval[0];
                    let expected = part * f64::from(count);
                    assert!((f64::from(number) - expected).abs() <= 1.5, "{kind:?} {run:?} {expected}");
                    *parts.entry(run.light).or_insert(0.0) += part;

                    // The remapped positions cover [0, 1) uniformly
                    let of = |place: u32| f64::from(run.within(positions[place as usize])) / 4_294_967_296.0;
                    let step = 1.0 / expected;
                    for place in run.range[0]..run.range[1] {
                        let expected = (f64::from(place - run.range[0]) + 0.5) * step;
                        assert!((of(place) - expected).abs() <= 1.01 * step, "{kind:?} {run:?} {place}");
                    }
                }
                assert_eq!(place, count, "{kind:?}: every position chooses a light");
                for (&light, &part) in &parts {
                    let pmf = f64::from(set.sampler.pmf(&ctx, light));
                    // A light of the base may be too improbable to have a position
                    assert!((pmf - part).abs() <= 1.5e-5 + 1e-4 * pmf, "{kind:?} {light}: {pmf} {part}");
                }
                let total: f64 = parts.values().sum();
                assert!((total - 1.0).abs() < 1e-3, "{kind:?} {total}");
            }
        }
    }

    #[test]
    fn all_samplers_agree_on_the_irradiance_and_with_the_sum_over_lights() {
        let (p, n) = (Vec3::new(0.4, 0.3, 0.0), Vec3::Z);
        let ctx = LightCtx::on(p, n);
        let reference = sampling(builder(), LightSamplerKind::Uniform, &bounds());
        let mut s = pcg32([4, 2, 3]);
        let mut exact = 0.0;
        for light in &reference.lights {
            let n_samples = 200_000;
            for _ in 0..n_samples {
                exact += light
                    .sample_li(&ctx, s.random::<[f32; 2]>())
                    .map_or(0.0, |s| f64::from(s.li.g * s.wi.dot(n).max(0.0) / s.pdf) / f64::from(n_samples));
            }
        }
        for kind in CHOICES {
            // Photons of the wrong lights cause no bias
            let set = with_cache(builder(), kind, &[2, 4]);
            let mut moments = Moments::default();
            for _ in 0..200_000 {
                let sample = set.sample(&ctx, s.random::<f32>(), s.random::<[f32; 2]>());
                moments.add(sample.map_or(0.0, |SampleOfLight { light, sample: s }| {
                    if !s.is_delta {
                        let hit = LightHit { t: s.t, p: s.p, n: s.n, uv: lumiris_numbers::math::Vec2::ZERO };
                        let pdf = set.pdf(&ctx, light, s.wi, &hit);
                        assert!((pdf - s.pdf).abs() <= 1e-3 * s.pdf || set.lights[light as usize].is_infinite());
                    }
                    f64::from(s.li.g * s.wi.dot(n).max(0.0) / s.pdf)
                }));
            }
            moments.assert_mean(exact, 1e-5, 2e-3);
        }
    }

    #[test]
    fn hits_find_their_lights_and_rays_that_leave_find_the_environment() {
        let set = sampling(builder(), LightSamplerKind::Tree, &bounds());
        assert_eq!((set.light_of(7, 0), set.light_of(7, 1), set.light_of(3, 1)), (Some(1), Some(1), Some(2)));
        assert_eq!((set.light_of(7, 2), set.light_of(0, 0), set.light_of(9, 0)), (None, None, None));
        assert_eq!(set.infinite, [3, 5]);
        let w = Vec3::new(0.6, 0.0, 0.8);
        let (ctx, p) = (LightCtx::at(Vec3::ZERO), Vec3::ZERO);
        assert_eq!(set.le(p, w), set.lights[3].le(p, w) + set.lights[5].le(p, w));
        let each: f32 = [3, 5].iter().map(|&i| set.pdf(&ctx, i, w, &LightHit::INFINITE)).sum();
        assert!(each > 0.0);
        assert_eq!(set.infinite_in_direction(&ctx, w), LeAndPdf { le: set.le(p, w), pdf: each });
    }

    #[test]
    fn what_photons_tell_is_of_lights_that_send_out_some() {
        // An absorbing, emitting medium
        let grid = RgbGrid {
            sigma_a: Some(Samples::new([1; 3], vec![Rgb::WHITE]).unwrap()),
            sigma_s: None,
            scale: 1.0,
            le: Some(Samples::new([1; 3], vec![Rgb::WHITE]).unwrap()),
        };
        let corners = [bounds().min, bounds().max].map(|corner| corner.as_dvec3());
        let fire = Heterogeneous::new(Field::Rgb(grid), corners, &DAffine3::IDENTITY, 0.0);
        let media = MediumSet { media: vec![Medium::Heterogeneous(Arc::new(fire))], ..Default::default() };
        let mut builder = builder();
        builder.add_media(&media);

        // A set with a visibility cache
        let choice = |volumes| LightChoice { volumes, ..LightSamplerKind::Tree.into() };
        let mut set = with_cache(builder, choice(true), &[0, 2]);
        let is_volume = |light: &LightId| set.medium_of(*light).is_some();
        let volume = (0..set.lights.len() as LightId).find(is_volume).unwrap();
        let ctx = LightCtx::at(Vec3::new(0.4, 0.3, 0.0));

        // The cache has no say about the medium, whether or not it is sampled
        for volumes in [true, false, true] {
            set.choose_by(choice(volumes), 1);
            assert_eq!((set.samples_volumes(), set.sampler.pmf(&ctx, volume) > 0.0), (volumes, volumes));
            assert_eq!(set.learned_visibility().unwrap().importance(&ctx, volume), 0.0);
        }
    }

    #[test]
    fn the_light_tree_is_built_once() {
        let mut set = sampling(builder(), LightSamplerKind::Tree, &bounds());
        let tree = set.tree_choice().tree;
        for kind in CHOICES {
            set.choose_by(LightChoice { infinite_fraction: Some(0.3), ..kind }, 4);
            assert!(Arc::ptr_eq(&tree, &set.tree_choice().tree), "{kind:?}");
        }
    }

    #[test]
    fn scenes_without_light_or_without_extent_are_handled() {
        let ctx = LightCtx::at(Vec3::ZERO);
        for kind in CHOICES {
            let set = sampling(LightSetBuilder::default(), kind, &Bounds3::EMPTY);
            assert!(set.sample(&ctx, 0.5, [0.5; 2]).is_none() && set.le(ctx.p, Vec3::Z).is_black());
            let mut b = LightSetBuilder::default();
            b.add(Light::InfiniteConstant { l: Rgb::WHITE });
            assert!(sampling(b, kind, &Bounds3::EMPTY).sample(&ctx, 0.999, [0.5; 2]).is_some());
            let mut b = LightSetBuilder::default();
            b.add_area(0, &quad(1.0), &Emission::constant(Rgb::BLACK));
            let set = sampling(b, kind, &bounds());
            assert!(set.sample(&ctx, 0.5, [0.5; 2]).is_none());
            let mut runs = Vec::new();
            set.sampler.runs(&ctx, &[0, 1 << 31, u32::MAX], &mut runs);
            assert!(runs.is_empty(), "{kind:?} {runs:?}");
        }
    }
}
