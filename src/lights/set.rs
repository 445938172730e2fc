//! All lights of a scene with the way one is chosen, and the map from hits to lights.

use super::{
    Emission, Light, LightCtx, LightHit, LightId, LightSample, LightSampler, LightSamplerKind, area_lights_of,
};
use crate::geometry::{GeometryId, Shape};
use crate::math::{Bounds3, Rgb, Vec3};

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
    /// Adds a light that is no surface.
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
        let (_, radius) = scene_bounds.bounding_sphere();
        let scene_radius = if radius > 0.0 && radius.is_finite() { radius } else { 1.0 };
        let sampler = LightSampler::new(kind, &self.lights, scene_radius);
        let has_le = |light: &Light| matches!(light, Light::InfiniteConstant { .. } | Light::InfiniteImage { .. });
        let infinite = (0..self.lights.len()).filter(|&i| has_le(&self.lights[i])).map(|i| i as LightId).collect();
        self.emitting.sort_by_key(|e| e.geometry);
        LightSet { lights: self.lights, sampler, infinite, emitting: self.emitting, scene_radius }
    }
}

/// The lights of a scene.
#[derive(Clone, Debug)]
pub struct LightSet {
    /// The lights; a [`LightId`] is an index.
    pub lights: Vec<Light>,
    /// Chooses one of them.
    pub sampler: LightSampler,
    /// Lights that rays which leave the scene see, ascending.
    pub infinite: Vec<LightId>,
    /// Sorted by geometry.
    emitting: Vec<EmittingGeometry>,
    /// Radius of the scene's bounding sphere; 1 for a scene without extent.
    pub scene_radius: f32,
}

impl LightSet {
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
        let choice = self.sampler.sample(ctx, u_choice)?;
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
