//! A light of any kind: sampled directions towards it, its radiance and power, and its bounds.

use super::bounds::LightBounds;
use super::kinds::area::{AreaLight, AreaShape};
use super::kinds::distant::DistantLight;
use super::kinds::environment::{EnvironmentMap, infinite_sample, orthogonal};
use super::kinds::image_light::ImageLight;
use super::kinds::point::PointLight;
use super::kinds::portal::PortalLight;
use super::kinds::spot::SpotLight;
use super::kinds::volume_light::VolumeLight;
use super::light_sample::{LeAndPdf, LightCtx, LightHit, LightSample};
use lumiris_numbers::math::warp::{pdf_uniform_sphere, sample_uniform_sphere};
use lumiris_numbers::math::{Affine3A, Mat3, Rgb, Vec3};
use std::f32::consts::PI;
use std::sync::Arc;

/// A source of light.
#[derive(Clone, Debug)]
pub enum Light {
    /// Emits from a point, the same in all directions.
    Point(PointLight),
    /// Emits from a point into a cone.
    Spot(SpotLight),
    /// Emits from a point by an image: goniometric and projection lights.
    Image(Arc<ImageLight>),
    /// Parallel light from infinity.
    Distant(DistantLight),
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
    /// An emitting part of a medium; see [`VolumeLight`].
    Volume(Box<VolumeLight>),
}

impl Light {
    /// Name of the kind of light, for messages.
    pub fn kind_name(&self) -> &'static str {
        match self {
            Light::Point(_) => "point",
            Light::Spot(_) => "spot",
            Light::Image(light) => light.kind_name(),
            Light::Distant(_) => "distant",
            Light::Area(area) => match area.shape {
                AreaShape::Triangle(_) => "triangle",
                AreaShape::Rectangle(_) => "rectangle",
                AreaShape::Quadric(_) => "quadric",
                AreaShape::Patch(_) => "patch",
            },
            Light::InfiniteConstant { .. } => "infinite, constant",
            Light::InfiniteImage { .. } => "infinite, image",
            Light::Portal(_) => "infinite, portal",
            Light::Volume(_) => "volume",
        }
    }

    /// An environment light. Only the rotation of `world_from_light`, with a possible reflection, is used.
    pub fn infinite_image(map: Arc<EnvironmentMap>, world_from_light: &Affine3A, scale: f32) -> Self {
        Light::InfiniteImage { map, world_from_light: orthogonal(world_from_light), scale }
    }

    /// Samples a direction towards the light; `None` if the light does not illuminate the point.
    #[inline]
    pub fn sample_li(&self, ctx: &LightCtx, u: [f32; 2]) -> Option<LightSample> {
        match self {
            Light::Point(light) => light.sample_li(ctx),
            Light::Spot(light) => light.sample_li(ctx),
            Light::Image(light) => light.sample_li(ctx),
            Light::Distant(light) => light.sample_li(),
            Light::Area(area) => area.sample_li(ctx, u),
            Light::InfiniteConstant { l } => {
                let wi = sample_uniform_sphere(u);
                (!l.is_black()).then(|| infinite_sample(wi, *l, pdf_uniform_sphere()))
            }
            Light::InfiniteImage { map, world_from_light, scale } => {
                let s = map.sample(u)?;
                Some(infinite_sample(*world_from_light * s.w, s.le * *scale, s.pdf))
            }
            Light::Portal(light) => light.sample_li(ctx, u),
            Light::Volume(light) => light.sample_li(ctx, u),
        }
    }

    /// Density per steradian of [`sample_li`](Self::sample_li) in the direction `wi`, which hits this light at `hit`. 0
    /// for delta lights, and for media, since rays do not end at their points (see [`VolumeLight::pdf`]).
    #[inline]
    pub fn pdf_li(&self, ctx: &LightCtx, wi: Vec3, hit: &LightHit) -> f32 {
        match self {
            Light::Point(_) | Light::Spot(_) | Light::Image(_) | Light::Distant(_) | Light::Volume(_) => 0.0,
            Light::Area(area) => area.pdf_li(ctx, wi, hit),
            Light::InfiniteConstant { l } if l.is_black() => 0.0,
            Light::InfiniteConstant { .. } => pdf_uniform_sphere(),
            Light::InfiniteImage { map, world_from_light, .. } => map.pdf(world_from_light.transpose() * wi),
            Light::Portal(light) => light.le_and_pdf(ctx.p, wi).pdf,
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
            Light::Point(_)
            | Light::Spot(_)
            | Light::Image(_)
            | Light::Distant(_)
            | Light::Area(_)
            | Light::Volume(_) => Rgb::BLACK,
        }
    }

    /// [`le`](Self::le) of an infinite light and [`pdf_li`](Self::pdf_li) at `p` in the direction `w`.
    #[inline]
    pub fn le_and_pdf(&self, p: Vec3, w: Vec3) -> LeAndPdf {
        match self {
            Light::InfiniteImage { map, world_from_light, scale } => {
                let LeAndPdf { le, pdf } = map.le_and_pdf(world_from_light.transpose() * w);
                LeAndPdf { le: le * *scale, pdf }
            }
            Light::Portal(light) => light.le_and_pdf(p, w),
            Light::Point(_)
            | Light::Spot(_)
            | Light::Image(_)
            | Light::Distant(_)
            | Light::Area(_)
            | Light::Volume(_)
            | Light::InfiniteConstant { .. } => {
                LeAndPdf { le: self.le(p, w), pdf: self.pdf_li(&LightCtx::at(p), w, &LightHit::INFINITE) }
            }
        }
    }

    /// [`le_and_pdf`](Self::le_and_pdf) of `n` points and directions.
    pub fn le_and_pdf_many(
        &self,
        n: usize,
        p: impl Fn(usize) -> Vec3,
        w: impl Fn(usize) -> Vec3,
        mut out: impl FnMut(usize, LeAndPdf),
    ) {
        // Images have lookups that overlap their cache misses
        if let Light::InfiniteImage { map, world_from_light, scale } = self {
            let to_light = world_from_light.transpose();
            map.le_and_pdf_many(
                n,
                |i| to_light * w(i),
                |i, LeAndPdf { le, pdf }| out(i, LeAndPdf { le: le * *scale, pdf }),
            );
        } else {
            for i in 0..n {
                out(i, self.le_and_pdf(p(i), w(i)));
            }
        }
    }

    /// Luminance of the emitted power. For an infinite light: the power that reaches a disk of the scene's radius from
    /// all directions, or that passes through its portal. 0 for media, which emit no photons.
    pub fn power_luminance(&self, scene_radius: f32) -> f32 {
        let disk = PI * scene_radius * scene_radius;
        let power = match self {
            Light::Point(light) => light.power_luminance(),
            Light::Spot(light) => light.power_luminance(),
            Light::Image(light) => light.power_luminance(),
            Light::Distant(light) => light.irradiance.luminance() * disk,
            Light::Area(area) => area.power_luminance(),
            Light::InfiniteConstant { l } => 4.0 * PI * l.luminance() * disk,
            Light::InfiniteImage { map, scale, .. } => map.luminance_integral() * *scale * disk,
            Light::Portal(light) => light.power_luminance(),
            Light::Volume(_) => 0.0,
        };
        if power.is_finite() { power.max(0.0) } else { 0.0 }
    }

    /// True for infinite lights, which are not in the light tree.
    #[inline]
    pub fn is_infinite(&self) -> bool {
        matches!(
            self,
            Light::Distant(_) | Light::InfiniteConstant { .. } | Light::InfiniteImage { .. } | Light::Portal(_)
        )
    }

    /// True for delta lights, which no ray can hit: only light sampling includes them.
    #[inline]
    pub fn is_delta(&self) -> bool {
        matches!(self, Light::Point(_) | Light::Spot(_) | Light::Image(_) | Light::Distant(_))
    }

    /// Bounds for the light tree; `None` for infinite lights and for lights that emit nothing.
    pub fn bounds(&self) -> Option<LightBounds> {
        let bounds = match self {
            Light::Point(light) => light.bounds(),
            Light::Spot(light) => light.bounds(),
            Light::Image(light) => light.bounds(),
            Light::Area(area) => area.bounds(),
            Light::Volume(light) => light.bounds(),
            Light::Distant(_) | Light::InfiniteConstant { .. } | Light::InfiniteImage { .. } | Light::Portal(_) => {
                return None;
            }
        };
        (bounds.intensity > 0.0 && bounds.intensity.is_finite()).then_some(bounds)
    }
}
