//! Lights: their emission, the sampling of directions towards them, and the choice of one of many.
//!
//! Reading order: [`point`], [`spot`], [`image_light`], [`area`], [`environment`], [`portal`], [`glow`], [`emit`], [`lanes`], [`bounds`],
//! [`choice`], [`turns`], [`tree`], [`tree_choice`], [`tops`], [`visibility_cache`], [`learned_visibility`], [`visibility_cache_sampler`],
//! [`light_sampler`], [`layers`], [`set`], [`groups`], [`sampling`], [`many`], [`irradiance`].

pub mod area;
pub mod bounds;
pub mod choice;
pub mod emit;
pub mod environment;
pub mod glow;
pub mod groups;
pub mod image_light;
pub mod irradiance;
pub mod lanes;
pub mod layers;
pub mod learned_visibility;
pub mod light_sampler;
pub mod many;
pub mod point;
pub mod portal;
pub mod sampling;
pub mod set;
pub mod spot;
pub mod tops;
pub mod tree;
mod tree_build;
pub mod tree_choice;
mod tree_node;
pub mod turns;
pub mod visibility_cache;
pub mod visibility_cache_sampler;

#[cfg(test)]
mod emit_tests;
#[cfg(test)]
mod glossy_lobe_tests;
#[cfg(test)]
mod light_tests;

pub use area::{AreaLight, AreaShape, Cover, Emission, EmissionImage, EmissionMapping, area_lights_of};
pub use bounds::LightBounds;
pub use choice::{LightRun, SampledLight};
pub use emit::{EmissionSample, EmittingPoint};
pub use environment::{EnvironmentFilter, EnvironmentMap, EnvironmentMapping};
pub use glow::Glow;
pub use groups::LightGroups;
pub use image_light::{ImageLight, ImageMapping};
pub use irradiance::Irradiances;
pub use lanes::LightLanes;
pub use layers::LightLayers;
pub use learned_visibility::LearnedVisibility;
pub use light_sampler::{LightChoice, LightSampler, LightSamplerKind};
pub use portal::{Portal, PortalLight};
pub use sampling::LightSampling;
pub use set::{LightSet, LightSetBuilder};
pub use tops::Tops;
pub use tree::{CutNode, LightTree};
pub use tree_choice::TreeChoice;
pub use turns::Turns;
pub use visibility_cache::VisibilityCache;
pub use visibility_cache_sampler::VisibilityCacheSampler;

pub use lumiris_numbers::math::light_bound::GlossyLobe;

use lumiris_numbers::math::light_bound::Receiver;
use lumiris_numbers::math::{Affine3A, Bounds3, Mat3, Rgb, Vec2, Vec3};
use std::f32::consts::PI;
use std::sync::Arc;

/// Index into [`LightSet::lights`].
pub type LightId = u32;

/// The illuminated point.
#[derive(Clone, Copy, Debug)]
pub struct LightCtx {
    /// Position.
    pub p: Vec3,
    /// Geometric normal, unit, on the illuminated side; zero if there is none, or if both sides are illuminated.
    pub n: Vec3,
    /// Shading normal, unit; zero if there is none.
    pub ns: Vec3,
    /// Glossy lobe, which the choice of a light takes into account.
    pub lobe: GlossyLobe,
}

impl LightCtx {
    /// A point without a surface.
    #[inline]
    pub fn at(p: Vec3) -> Self {
        LightCtx { p, n: Vec3::ZERO, ns: Vec3::ZERO, lobe: GlossyLobe::NONE }
    }

    /// A point of a diffuse surface of this normal.
    #[inline]
    pub fn on(p: Vec3, n: Vec3) -> Self {
        LightCtx { p, n, ns: n, lobe: GlossyLobe::NONE }
    }

    /// Input of the light bounds for this point.
    #[inline]
    pub fn receiver(&self) -> Receiver<f32> {
        let lobe = Some(self.lobe).filter(|lobe| lobe.scale > 0.0);
        Receiver { p: self.p.to_array(), ns: self.ns.to_array(), lobe }
    }

    /// The point as if the surface were diffuse.
    #[inline]
    #[must_use]
    pub fn diffuse(&self) -> Self {
        LightCtx { lobe: GlossyLobe::NONE, ..*self }
    }
}

/// A direction sampled towards a light.
#[derive(Clone, Copy, Debug)]
pub struct LightSample {
    /// Unoccluded incident radiance. It may be black where parts of a light do not emit.
    /// For delta lights it is the weight of the delta, with `pdf` 1.
    pub li: Rgb,
    /// Unit direction to the light.
    pub wi: Vec3,
    /// Density per steradian; 1 for delta lights; positive and finite.
    pub pdf: f32,
    /// Distance along `wi` to the light; infinite for infinite lights.
    pub t: f32,
    /// The point on the light; unused for infinite lights.
    pub p: Vec3,
    /// Normal of the light at `p` on its emitting side; zero for lights without a surface.
    pub n: Vec3,
    /// Bound of the rounding error of `p` per axis; zero for infinite lights.
    pub p_error: Vec3,
    /// True if no other technique can sample this direction.
    pub is_delta: bool,
}

/// The intersection of a ray in direction wi with a light.
#[derive(Clone, Copy, Debug)]
pub struct LightHit {
    /// Distance.
    pub t: f32,
    /// The point on the light.
    pub p: Vec3,
    /// Geometric normal there, unit, as oriented by the shape.
    pub n: Vec3,
    /// Texture coordinates there.
    pub uv: Vec2,
}

impl LightHit {
    /// The "hit" of an infinite light.
    pub const INFINITE: LightHit = LightHit { t: f32::INFINITY, p: Vec3::ZERO, n: Vec3::ZERO, uv: Vec2::ZERO };
}

/// A source of light.
#[derive(Clone, Debug)]
pub enum Light {
    /// Emits from a point, the same in all directions.
    Point {
        /// Position.
        p: Vec3,
        /// Radiant intensity (radiance times area).
        intensity: Rgb,
    },
    /// Emits from a point into a cone; see [`spot::spot_falloff`].
    Spot {
        /// Position.
        p: Vec3,
        /// Unit axis of the cone.
        axis: Vec3,
        /// Cosine of the half-angle beyond which it does not emit.
        cos_total: f32,
        /// Cosine of the half-angle up to which it has the full intensity.
        cos_falloff_start: f32,
        /// Radiant intensity on the axis.
        intensity: Rgb,
    },
    /// Emits from a point by an image: goniometric and projection lights.
    Image(Arc<ImageLight>),
    /// Parallel light from infinity.
    Distant {
        /// Unit direction to the light.
        wi_world: Vec3,
        /// Irradiance on a surface that faces it.
        l: Rgb,
    },
    /// An emitting surface.
    Area(AreaLight),
    /// The same radiance from everywhere.
    InfiniteConstant {
        /// Radiance.
        l: Rgb,
    },
    /// Radiance from everywhere by an image.
    InfiniteImage {
        /// The image.
        map: Arc<EnvironmentMap>,
        /// Orthogonal map of directions; see [`Light::infinite_image`].
        world_from_light: Mat3,
        /// Factor of the image's radiance.
        scale: f32,
    },
    /// Radiance by an image, through a rectangle.
    Portal(Arc<PortalLight>),
    /// An emitting part of a medium; see [`glow`].
    Glow(Box<Glow>),
}

impl Light {
    /// Name of the kind of light, for messages.
    pub fn kind_name(&self) -> &'static str {
        match self {
            Light::Point { .. } => "point",
            Light::Spot { .. } => "spot",
            Light::Image(light) => light.kind_name(),
            Light::Distant { .. } => "distant",
            Light::Area(area) => match area.shape {
                AreaShape::Triangle(_) => "triangle",
                AreaShape::Rectangle(_) => "rectangle",
                AreaShape::Quadric(_) => "quadric",
                AreaShape::Patch(_) => "patch",
            },
            Light::InfiniteConstant { .. } => "infinite, constant",
            Light::InfiniteImage { .. } => "infinite, image",
            Light::Portal(_) => "infinite, portal",
            Light::Glow(_) => "glow",
        }
    }

    /// An environment light. Only the rotation of `world_from_light`, with a possible reflection, is used.
    pub fn infinite_image(map: Arc<EnvironmentMap>, world_from_light: &Affine3A, scale: f32) -> Self {
        Light::InfiniteImage { map, world_from_light: environment::orthogonal(world_from_light), scale }
    }

    /// Samples a direction towards the light; `None` if the light does not illuminate the point.
    #[inline]
    pub fn sample_li(&self, ctx: &LightCtx, u: [f32; 2]) -> Option<LightSample> {
        match self {
            Light::Point { p, intensity } => point::sample_li_from(*p, ctx, |_| *intensity),
            Light::Spot { p, axis, cos_total, cos_falloff_start, intensity } => point::sample_li_from(*p, ctx, |w| {
                *intensity * spot::spot_falloff(w.dot(*axis), *cos_total, *cos_falloff_start)
            }),
            Light::Image(light) => light.sample_li(ctx),
            Light::Distant { wi_world, l } => {
                let s = environment::infinite_sample(*wi_world, *l, 1.0);
                (!l.is_black()).then_some(LightSample { is_delta: true, ..s })
            }
            Light::Area(area) => area.sample_li(ctx, u),
            Light::InfiniteConstant { l } => {
                let wi = lumiris_numbers::math::warp::sample_uniform_sphere(u);
                (!l.is_black())
                    .then(|| environment::infinite_sample(wi, *l, lumiris_numbers::math::warp::pdf_uniform_sphere()))
            }
            Light::InfiniteImage { map, world_from_light, scale } => {
                let s = map.sample(u)?;
                Some(environment::infinite_sample(*world_from_light * s.w, s.le * *scale, s.pdf))
            }
            Light::Portal(light) => light.sample_li(ctx, u),
            Light::Glow(glow) => glow.sample_li(ctx, u),
        }
    }

    /// Density per steradian of [`sample_li`](Self::sample_li) in the direction `wi`, which hits this light at `hit`. 0
    /// for delta lights, and for media, since rays do not end at their points (see [`Glow::pdf`]).
    #[inline]
    pub fn pdf_li(&self, ctx: &LightCtx, wi: Vec3, hit: &LightHit) -> f32 {
        match self {
            Light::Point { .. } | Light::Spot { .. } | Light::Image(_) | Light::Distant { .. } | Light::Glow(_) => 0.0,
            Light::Area(area) => area.pdf_li(ctx, wi, hit),
            Light::InfiniteConstant { l } if l.is_black() => 0.0,
            Light::InfiniteConstant { .. } => lumiris_numbers::math::warp::pdf_uniform_sphere(),
            Light::InfiniteImage { map, world_from_light, .. } => map.pdf(world_from_light.transpose() * wi),
            Light::Portal(light) => light.le_and_pdf(ctx.p, wi).1,
        }
    }

    /// True if none of its emission is visible from `p`: `p` is in the plane of an area light, or behind it. No
    /// technique samples such a light.
    #[inline]
    pub fn is_dark_from(&self, p: Vec3) -> bool {
        matches!(self, Light::Area(area) if area.is_dark_from(p))
    }

    /// Radiance that leaves the surface of an area light at `hit` in direction `w`; black for all others.
    #[inline]
    pub fn l(&self, hit: &LightHit, w: Vec3) -> Rgb {
        if let Light::Area(area) = self { area.l(hit, w) } else { Rgb::BLACK }
    }

    /// Radiance of an infinite light along a ray that leaves the scene from `p` in unit direction `w`; black for all
    /// other lights.
    #[inline]
    pub fn le(&self, p: Vec3, w: Vec3) -> Rgb {
        match self {
            Light::InfiniteConstant { l } => *l,
            Light::InfiniteImage { map, world_from_light, scale } => map.le(world_from_light.transpose() * w) * *scale,
            Light::Portal(light) => light.le(p, w),
            Light::Point { .. }
            | Light::Spot { .. }
            | Light::Image(_)
            | Light::Distant { .. }
            | Light::Area(_)
            | Light::Glow(_) => Rgb::BLACK,
        }
    }

    /// [`le`](Self::le) of an infinite light and [`pdf_li`](Self::pdf_li) at `p` in the direction `w`.
    #[inline]
    pub fn le_and_pdf(&self, p: Vec3, w: Vec3) -> (Rgb, f32) {
        match self {
            Light::InfiniteImage { map, world_from_light, scale } => {
                let (le, pdf) = map.le_and_pdf(world_from_light.transpose() * w);
                (le * *scale, pdf)
            }
            Light::Portal(light) => light.le_and_pdf(p, w),
            Light::Point { .. }
            | Light::Spot { .. }
            | Light::Image(_)
            | Light::Distant { .. }
            | Light::Area(_)
            | Light::Glow(_)
            | Light::InfiniteConstant { .. } => (self.le(p, w), self.pdf_li(&LightCtx::at(p), w, &LightHit::INFINITE)),
        }
    }

    /// [`le_and_pdf`](Self::le_and_pdf) of `n` points and directions.
    pub fn le_and_pdf_many(
        &self,
        n: usize,
        p: impl Fn(usize) -> Vec3,
        w: impl Fn(usize) -> Vec3,
        mut out: impl FnMut(usize, Rgb, f32),
    ) {
        if let Light::InfiniteImage { map, world_from_light, scale } = self {
            let to_light = world_from_light.transpose();
            map.le_and_pdf_many(n, |i| to_light * w(i), |i, le, pdf| out(i, le * *scale, pdf));
        } else {
            for i in 0..n {
                let (le, pdf) = self.le_and_pdf(p(i), w(i));
                out(i, le, pdf);
            }
        }
    }

    /// Luminance of the emitted power. For an infinite light: the power that reaches a disk of the scene's radius from
    /// all directions, or that passes through its portal. 0 for media, which emit no photons.
    pub fn phi(&self, scene_radius: f32) -> f32 {
        let disk = PI * scene_radius * scene_radius;
        let phi = match self {
            Light::Point { intensity, .. } => 4.0 * PI * intensity.luminance(),
            Light::Spot { cos_total, cos_falloff_start, intensity, .. } => {
                intensity.luminance() * spot::spot_solid_angle(*cos_total, *cos_falloff_start)
            }
            Light::Image(light) => light.phi(),
            Light::Distant { l, .. } => l.luminance() * disk,
            Light::Area(area) => area.phi(),
            Light::InfiniteConstant { l } => 4.0 * PI * l.luminance() * disk,
            Light::InfiniteImage { map, scale, .. } => map.luminance_integral() * *scale * disk,
            Light::Portal(light) => light.phi(),
            Light::Glow(_) => 0.0,
        };
        if phi.is_finite() { phi.max(0.0) } else { 0.0 }
    }

    /// True for infinite lights, which are not in the light tree.
    #[inline]
    pub fn is_infinite(&self) -> bool {
        matches!(
            self,
            Light::Distant { .. } | Light::InfiniteConstant { .. } | Light::InfiniteImage { .. } | Light::Portal(_)
        )
    }

    /// True for delta lights, which no ray can hit: only light sampling includes them.
    #[inline]
    pub fn is_delta(&self) -> bool {
        matches!(self, Light::Point { .. } | Light::Spot { .. } | Light::Image(_) | Light::Distant { .. })
    }

    /// Bounds for the light tree; `None` for infinite lights and for lights that emit nothing.
    pub fn bounds(&self) -> Option<LightBounds> {
        let at = |p: Vec3, axis, cos_theta_o, cos_theta_e, intensity: Rgb| LightBounds {
            bounds: Bounds3 { min: p, max: p },
            axis,
            cos_theta_o,
            cos_theta_e,
            two_sided: false,
            intensity: intensity.luminance(),
        };
        let bounds = match self {
            Light::Point { p, intensity } => at(*p, Vec3::Z, -1.0, 0.0, *intensity),
            Light::Spot { p, axis, cos_total, cos_falloff_start, intensity } => {
                // The falloff ends cos⁻¹(cos_total) − cos⁻¹(cos_falloff_start) beyond the inner cone.
                let theta_e = (cos_total.acos() - cos_falloff_start.acos()).max(0.0);
                at(*p, *axis, *cos_falloff_start, theta_e.cos(), *intensity)
            }
            Light::Image(light) => light.bounds(),
            Light::Area(area) => area.bounds(),
            Light::Glow(glow) => glow.bounds(),
            Light::Distant { .. } | Light::InfiniteConstant { .. } | Light::InfiniteImage { .. } | Light::Portal(_) => {
                return None;
            }
        };
        (bounds.intensity > 0.0 && bounds.intensity.is_finite()).then_some(bounds)
    }
}
