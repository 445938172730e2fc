//! All lights of a scene with their light sampler, and the map from hits to lights.

use super::area::AreaShape;
use super::hints::Around;
use super::{
    Emission, Light, LightChoice, LightCtx, LightGroups, LightHints, LightHit, LightId, LightSample, LightSampler,
    LightSamplerKind, area_lights_of,
};
use crate::geometry::{GeometryId, Shape};
use lumiris_numbers::math::{Bounds3, Rgb, Vec3};
use std::sync::Arc;

/// Lights of the primitives of one geometry: one for all, or one for each.
#[derive(Clone, Debug)]
struct EmittingGeometry {
    geometry: GeometryId,
    first_light: LightId,
    light_of_primitive: Vec<u32>,
}

/// Collects the lights of a scene.
#[derive(Clone, Debug, Default)]
pub struct LightSetBuilder {
    lights: Vec<Light>,
    emitting: Vec<EmittingGeometry>,
}

impl LightSetBuilder {
    /// Adds a light that is not an area light.
    pub fn add(&mut self, light: Light) -> LightId {
        self.lights.push(light);
        (self.lights.len() - 1) as LightId
    }

    /// Adds the area lights of a geometry of the root group, whose `shape` is in world space.
    pub fn add_area(&mut self, geometry: GeometryId, shape: &Shape, emission: &Emission) {
        let area = area_lights_of(shape, emission);
        let first_light = self.lights.len() as LightId;
        self.lights.extend(area.lights.into_iter().map(Light::Area));
        self.emitting.push(EmittingGeometry { geometry, first_light, light_of_primitive: area.light_of_primitive });
    }

    /// The set, for a scene of the given bounds.
    pub fn build(mut self, kind: LightSamplerKind, scene_bounds: &Bounds3) -> LightSet {
        let (center, radius) = scene_bounds.bounding_sphere();
        let has_extent = radius > 0.0 && radius.is_finite();
        let scene_radius = if has_extent { radius } else { 1.0 };
        let sampler = LightSampler::new(kind, &self.lights, scene_radius);
        let has_le = |light: &Light| matches!(light, Light::InfiniteConstant { .. } | Light::InfiniteImage { .. });
        let infinite = (0..self.lights.len()).filter(|&i| has_le(&self.lights[i])).map(|i| i as LightId).collect();
        let is_lit = |&i: &usize| self.lights[i].phi(scene_radius) > 0.0;
        let lit = (0..self.lights.len()).filter(is_lit).map(|i| i as LightId).collect();
        self.emitting.sort_by_key(|e| e.geometry);
        LightSet {
            lights: self.lights,
            sampler,
            groups: LightGroups::default(),
            hints: None,
            infinite,
            lit,
            emitting: self.emitting,
            scene_centre: if center.is_finite() { center } else { Vec3::ZERO },
            scene_radius,
        }
    }
}

/// The lights of a scene.
#[derive(Clone, Debug)]
pub struct LightSet {
    /// The lights; a [`LightId`] is an index.
    pub lights: Vec<Light>,
    /// Chooses one of them.
    pub sampler: LightSampler,
    /// The lights as components of a mixture; none before [`set_groups`](Self::set_groups).
    pub groups: LightGroups,
    /// The visibility cache, if there is one; see [`set_hints`](Self::set_hints).
    hints: Option<Arc<LightHints>>,
    /// Infinite lights, seen by rays that leave the scene, ascending.
    pub infinite: Vec<LightId>,
    /// Lights with power, ascending.
    pub lit: Vec<LightId>,
    /// Sorted by geometry.
    emitting: Vec<EmittingGeometry>,
    /// Centre of the scene's bounding sphere; the origin for an empty scene.
    pub scene_centre: Vec3,
    /// Radius of the scene's bounding sphere; 1 for a scene without extent.
    pub scene_radius: f32,
}

impl LightSet {
    /// Changes the light sampler.
    pub fn set_kind(&mut self, kind: LightSamplerKind) {
        self.sampler = LightSampler::new(kind, &self.lights, self.scene_radius);
        self.sampler.set_hints(self.hints.clone());
        self.groups = LightGroups::default();
    }

    /// Sets the visibility cache, which is used wherever settings ask for it. Estimates remain unbiased whatever it
    /// contains. Lights without power and unknown ids are ignored.
    pub fn set_hints(&mut self, hints: Option<LightHints>) {
        let is_lit = |light: LightId| self.lit.binary_search(&light).is_ok();
        self.hints = hints.map(|hints| Arc::new(hints.of_lights(is_lit)));
        self.sampler.set_hints(self.hints.clone());
    }

    /// The visibility cache.
    pub fn hints(&self) -> Option<&LightHints> {
        self.hints.as_deref()
    }

    /// The contributing lights of a point; none without a visibility cache.
    #[inline]
    pub fn around(&self, ctx: &LightCtx) -> Around<'_> {
        self.hints.as_ref().map_or_else(Around::default, |hints| hints.around_with_sums(ctx.p, ctx.n))
    }

    /// Divides the lights into at most `most` groups.
    pub fn set_groups(&mut self, most: usize) {
        self.groups = LightGroups::new(self, most);
    }

    /// False if no emitter can occlude another light, or itself, from any point: as for lamps in one ceiling. True in
    /// case of doubt.
    pub fn may_hide_each_other(&self) -> bool {
        if self.emitting.is_empty() {
            return false;
        }
        if !self.infinite.is_empty() {
            return true;
        }
        let area = || self.lights.iter().filter_map(|l| if let Light::Area(area) = l { Some(area) } else { None });
        let all = area().fold(Bounds3::EMPTY, |b, light| b.union(light.bounds().bounds));
        let tolerance = 1e-5 * all.diagonal().length();
        area().any(|light| {
            let (p, n) = match &light.shape {
                AreaShape::Triangle(t) => (t.p[0], t.n),
                AreaShape::Rectangle(r) => (r.corner, r.n),
                AreaShape::Quadric(_) | AreaShape::Patch(_) => return true,
            };
            // The corner of the bounds that lies farthest along the normal
            let corner = Vec3::select(n.cmpgt(Vec3::ZERO), all.max, all.min);
            light.emission.two_sided || n.dot(corner - p) > tolerance
        })
    }

    /// A sampler of the same kind over the delta lights; `None` if there are none.
    pub fn delta_sampler(&self, kind: LightSamplerKind) -> Option<LightSampler> {
        let is_lit = |light: &&Light| light.is_delta() && light.phi(self.scene_radius) > 0.0;
        self.lights.iter().find(is_lit)?;
        let black = Light::Point { p: Vec3::ZERO, intensity: Rgb::BLACK };
        let delta: Vec<Light> =
            self.lights.iter().map(|l| if l.is_delta() { l.clone() } else { black.clone() }).collect();
        Some(LightSampler::new(kind, &delta, self.scene_radius))
    }

    /// The area lights, with the geometries that they are.
    pub fn emitters(&self) -> impl Iterator<Item = (GeometryId, LightId)> {
        let lights = |e: &'_ EmittingGeometry| {
            let (geometry, first_light) = (e.geometry, e.first_light);
            e.light_of_primitive.iter().map(move |&i| (geometry, first_light + i)).collect::<Vec<_>>()
        };
        self.emitting.iter().flat_map(lights)
    }

    /// True if any primitive of the geometry emits.
    pub fn emits(&self, geometry: GeometryId) -> bool {
        self.emitting.binary_search_by_key(&geometry, |e| e.geometry).is_ok()
    }

    /// The light that a primitive of a geometry belongs to, if it emits.
    #[inline]
    pub fn light_of(&self, geometry: GeometryId, primitive: u32) -> Option<LightId> {
        let place = self.emitting.binary_search_by_key(&geometry, |e| e.geometry).ok()?;
        let e = &self.emitting[place];
        e.light_of_primitive.get(primitive as usize).map(|&i| e.first_light + i)
    }

    /// Chooses a light by `u_choice` and samples a direction to it by `u`. `pdf` of the sample includes the probability
    /// of the choice: it is per steradian, or a probability for delta lights.
    #[inline]
    pub fn sample(&self, ctx: &LightCtx, u_choice: f32, u: [f32; 2]) -> Option<(LightId, LightSample)> {
        self.sample_choice(ctx, self.sampler.sample(ctx, u_choice)?, u)
    }

    /// Samples a direction to a light of one group, whose probability is `group_pmf`; otherwise as
    /// [`sample`](Self::sample).
    #[inline]
    pub fn sample_group(
        &self,
        ctx: &LightCtx,
        group: (usize, f32),
        u_choice: f32,
        u: [f32; 2],
    ) -> Option<(LightId, LightSample)> {
        self.sample_choice(ctx, self.groups.sample(self, ctx, group, u_choice)?, u)
    }

    /// Samples a direction to a light that was chosen; otherwise as [`sample`](Self::sample).
    #[inline]
    pub fn sample_choice(&self, ctx: &LightCtx, choice: LightChoice, u: [f32; 2]) -> Option<(LightId, LightSample)> {
        let sample = self.lights[choice.light as usize].sample_li(ctx, u)?;
        let pdf = sample.pdf * choice.pmf;
        (pdf > 0.0 && pdf.is_finite()).then_some((choice.light, LightSample { pdf, ..sample }))
    }

    /// Density per steradian of [`sample`](Self::sample) to choose `light` and the direction `wi`, which hits it at
    /// `hit` ([`LightHit::INFINITE`] for infinite lights).
    #[inline]
    pub fn pdf(&self, ctx: &LightCtx, light: LightId, wi: Vec3, hit: &LightHit) -> f32 {
        let pdf = self.lights[light as usize].pdf_li(ctx, wi, hit);
        if pdf > 0.0 { pdf * self.sampler.pmf(ctx, light) } else { 0.0 }
    }

    /// Radiance that all infinite lights send along a ray that leaves the scene in direction `w`.
    #[inline]
    pub fn le(&self, w: Vec3) -> Rgb {
        self.infinite.iter().map(|&i| self.lights[i as usize].le(w)).sum()
    }

    /// Density per steradian of [`sample`](Self::sample) to choose any infinite light and the direction `wi`.
    #[inline]
    pub fn pdf_infinite(&self, ctx: &LightCtx, wi: Vec3) -> f32 {
        self.infinite.iter().map(|&i| self.pdf(ctx, i, wi, &LightHit::INFINITE)).sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::TriangleMesh;
    use crate::lights::{EnvironmentFilter, EnvironmentMap, EnvironmentMapping};
    use lumiris_numbers::math::Affine3A;
    use lumiris_numbers::math::hash::HashStream;
    use lumiris_test_support::{Moments, assert_chi_squared};
    use std::sync::Arc;

    const KINDS: [LightSamplerKind; 4] =
        [LightSamplerKind::Uniform, LightSamplerKind::Power, LightSamplerKind::Tree, LightSamplerKind::Photons];

    /// The set, with photons of some lights around (0.4, 0.3, 0): more of those with a greater id.
    fn hinted(builder: LightSetBuilder, kind: LightSamplerKind, seen: &[LightId]) -> LightSet {
        let mut set = builder.build(kind, &bounds());
        let at = Vec3::new(0.4, 0.3, 0.0);
        let photons = seen.iter().flat_map(|&id| (0..=id % 7).map(move |_| (at, Vec3::Z, id)));
        set.set_hints(Some(LightHints::new(photons, 0.5)));
        set
    }

    fn quad(z: f32) -> Shape {
        let p = vec![Vec3::new(0.0, 0.0, z), Vec3::new(0.0, 1.0, z), Vec3::new(1.0, 1.0, z), Vec3::new(1.0, 0.0, z)];
        Shape::Mesh(TriangleMesh::new(p, vec![[0, 1, 2], [0, 2, 3]]).unwrap())
    }

    fn builder() -> LightSetBuilder {
        let mut b = LightSetBuilder::default();
        b.add(Light::Point { p: Vec3::new(2.0, 2.0, 2.0), intensity: Rgb::splat(3.0) });
        b.add_area(7, &quad(3.0), &Emission::constant(Rgb::splat(5.0)));
        b.add_area(3, &quad(2.0), &Emission::constant(Rgb::BLACK));
        b.add(Light::InfiniteConstant { l: Rgb::splat(0.1) });
        b.add(Light::Distant { wi_world: Vec3::Z, l: Rgb::WHITE });
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
        for (kind, seen) in KINDS.into_iter().flat_map(|k| [(k, &[0, 2, 4][..]), (k, &[5, 900]), (k, &[])]) {
            let set = hinted(builder(), kind, seen);
            let mut s = HashStream::new([1, 2, 3]);
            for ns in [Vec3::ZERO, Vec3::Z] {
                let ctx = LightCtx { p: Vec3::new(0.4, 0.3, 0.0), n: ns, ns };
                let pmf: Vec<f64> = (0..6).map(|i| f64::from(set.sampler.pmf(&ctx, i))).collect();
                assert!((pmf.iter().sum::<f64>() - 1.0).abs() < 1e-5, "{kind:?} {pmf:?}");
                assert_eq!(pmf.iter().map(|&p| p > 0.0).collect::<Vec<_>>(), [true, true, false, true, true, true]);
                let count = 50_000;
                let mut observed = vec![0.0; 6];
                for _ in 0..count {
                    let choice = set.sampler.sample(&ctx, s.next_f32()).unwrap();
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
    fn runs_choose_each_light_by_its_probability_and_leave_a_uniform_number() {
        let mut builder = builder();
        for i in 0..80 {
            let p = Vec3::new(i as f32 * 0.15 - 6.0, 1.5, 2.0 + (i % 3) as f32);
            builder.add(Light::Point { p, intensity: Rgb::splat(0.1 + i as f32) });
        }
        // Few lights are compared at the point, many by the number of their photons
        let (few, many): (Vec<LightId>, Vec<LightId>) = ((0..80).step_by(7).collect(), (2..80).collect());
        for (kind, seen) in KINDS.into_iter().flat_map(|k| [(k, &few), (k, &many)]) {
            let set = hinted(builder.clone(), kind, seen);
            for ns in [Vec3::ZERO, Vec3::Z] {
                let ctx = LightCtx { p: Vec3::new(0.4, 0.3, 0.0), n: ns, ns };
                // A regular list: counts are exact up to one at each end of a run
                let count = 1_u32 << 16;
                let positions: Vec<u32> = (0..count).map(|i| (i << 16) + 0x8000).collect();
                let mut runs = Vec::new();
                set.sampler.runs(&ctx, &positions, &mut runs);
                let (mut place, mut parts) = (0, std::collections::BTreeMap::new());
                for run in &runs {
                    assert_eq!(run.places[0], place, "{kind:?}: runs follow each other");
                    place = run.places[1];
                    let number = run.places[1] - run.places[0];
                    let pmf = set.sampler.pmf(&ctx, run.light);
                    assert!((run.pmf - pmf).abs() <= 1e-5 * pmf, "{kind:?} {run:?} {pmf}");
                    let part = run.interval[1] - run.interval[0];
                    let expected = part * f64::from(count);
                    assert!((f64::from(number) - expected).abs() <= 1.5, "{kind:?} {run:?} {expected}");
                    *parts.entry(run.light).or_insert(0.0) += part;

                    // What remains of the positions fills [0, 1) evenly
                    let of = |place: u32| f64::from(run.within(positions[place as usize])) / 4_294_967_296.0;
                    let step = 1.0 / expected;
                    for place in run.places[0]..run.places[1] {
                        let expected = (f64::from(place - run.places[0]) + 0.5) * step;
                        assert!((of(place) - expected).abs() <= 1.01 * step, "{kind:?} {run:?} {place}");
                    }
                }
                assert_eq!(place, count, "{kind:?}: every position chooses a light");
                for (&light, &part) in &parts {
                    let pmf = f64::from(set.sampler.pmf(&ctx, light));
                    // A light of the base may be so improbable that it has no position
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
        let ctx = LightCtx { p, n, ns: n };
        let reference = builder().build(LightSamplerKind::Uniform, &bounds());
        let mut s = HashStream::new([4, 2, 3]);
        let mut exact = 0.0;
        for light in &reference.lights {
            let n_samples = 200_000;
            for _ in 0..n_samples {
                exact += light
                    .sample_li(&ctx, s.next_2d())
                    .map_or(0.0, |s| f64::from(s.li.g * s.wi.dot(n).max(0.0) / s.pdf) / f64::from(n_samples));
            }
        }
        for kind in KINDS {
            // Photons of the wrong lights change nothing
            let set = hinted(builder(), kind, &[2, 4]);
            let mut moments = Moments::default();
            for _ in 0..200_000 {
                let sample = set.sample(&ctx, s.next_f32(), s.next_2d());
                moments.add(sample.map_or(0.0, |(light, s)| {
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
        let set = builder().build(LightSamplerKind::Tree, &bounds());
        assert_eq!((set.light_of(7, 0), set.light_of(7, 1), set.light_of(3, 1)), (Some(1), Some(1), Some(2)));
        assert_eq!((set.light_of(7, 2), set.light_of(0, 0), set.light_of(9, 0)), (None, None, None));
        assert_eq!(set.infinite, [3, 5]);
        let w = Vec3::new(0.6, 0.0, 0.8);
        assert_eq!(set.le(w), set.lights[3].le(w) + set.lights[5].le(w));
        let ctx = LightCtx::at(Vec3::ZERO);
        let each: f32 = [3, 5].iter().map(|&i| set.pdf(&ctx, i, w, &LightHit::INFINITE)).sum();
        assert!(each > 0.0 && set.pdf_infinite(&ctx, w) == each);
    }

    #[test]
    fn scenes_without_light_or_without_extent_are_handled() {
        let ctx = LightCtx::at(Vec3::ZERO);
        for kind in KINDS {
            let set = LightSetBuilder::default().build(kind, &Bounds3::EMPTY);
            assert!(set.sample(&ctx, 0.5, [0.5; 2]).is_none() && set.le(Vec3::Z).is_black());
            let mut b = LightSetBuilder::default();
            b.add(Light::InfiniteConstant { l: Rgb::WHITE });
            assert!(b.build(kind, &Bounds3::EMPTY).sample(&ctx, 0.999, [0.5; 2]).is_some());
            let mut b = LightSetBuilder::default();
            b.add_area(0, &quad(1.0), &Emission::constant(Rgb::BLACK));
            let set = b.build(kind, &bounds());
            assert!(set.sample(&ctx, 0.5, [0.5; 2]).is_none());
            let mut runs = Vec::new();
            set.sampler.runs(&ctx, &[0, 1 << 31, u32::MAX], &mut runs);
            assert!(runs.is_empty(), "{kind:?} {runs:?}");
        }
    }
}
