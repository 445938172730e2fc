//! Area lights: sampled directions and points, radiance, power and bounds.

use super::area_shape::AreaShape;
use super::emission::{Emission, luminance_of};
use super::plane::Plane;
use super::quadric::DirectionBounds;
use super::shape_sample::{ShapePoint, ShapeSample};
use crate::lights::{LightBounds, LightCtx, LightHit, LightSample};
use lumiris_numbers::math::{Rgb, Vec2, Vec3};
use std::f32::consts::PI;

/// An emitting surface.
#[derive(Clone, Debug)]
pub struct AreaLight {
    /// The surface.
    pub shape: AreaShape,
    /// Its plane, if it is flat.
    pub plane: Option<Plane>,
    /// Its emission.
    pub emission: Emission,
    /// Its first primitive in the geometry.
    pub primitive: u32,
}

impl AreaLight {
    /// Samples a direction to the surface. Returns `None` if the geometry is degenerate, if the point is in the plane
    /// of a flat light, or if it is behind a one-sided flat light. A sample on the non-emitting side of a curved light
    /// has black `li`.
    #[inline]
    pub fn sample_li(&self, ctx: &LightCtx, u: [f32; 2]) -> Option<LightSample> {
        if self.is_dark_from(ctx.p) {
            return None;
        }
        let s = match &self.shape {
            AreaShape::Triangle(triangle) => triangle.sample(ctx.p, u),
            AreaShape::Rectangle(rectangle) => rectangle.sample(ctx.p, u),
            AreaShape::Quadric(quadric) => quadric.sample(ctx.p, u),
            AreaShape::Patch(patch) => patch.sample(ctx.p, u),
        }?;
        let uv = if self.emission.image.is_some() { self.uv(s.p) } else { Vec2::ZERO };
        let li = self.covered(self.colored(self.emission.l(s.n, uv, -s.wi), s.p), s.p);
        let ShapeSample { p, n, p_error, wi, t, pdf } = s;
        Some(LightSample { li, wi, pdf, t, p, n, p_error, is_delta: false })
    }

    /// Samples a point of the surface, uniform or nearly uniform in area, independent of the receiver.
    pub(in crate::lights) fn sample_point(&self, u: [f32; 2]) -> ShapePoint {
        match &self.shape {
            AreaShape::Triangle(triangle) => triangle.sample_point(u),
            AreaShape::Rectangle(rectangle) => rectangle.sample_point(u),
            AreaShape::Quadric(quadric) => quadric.sample_point(u),
            AreaShape::Patch(patch) => patch.sample_point(u),
        }
    }

    /// Radiance that leaves the point `p` on an emitting side, including vertex colours and alpha.
    pub(in crate::lights) fn radiance(&self, p: Vec3) -> Rgb {
        let uv = if self.emission.image.is_some() { self.uv(p) } else { Vec2::ZERO };
        self.covered(self.colored(self.emission.radiance(uv), p), p)
    }

    /// Multiplies a radiance by alpha at the point `p`.
    #[inline]
    fn covered(&self, l: Rgb, p: Vec3) -> Rgb {
        match &self.emission.alpha {
            Some(mask) if !l.is_black() => {
                // A rectangle can be made of two triangles
                let count = if matches!(self.shape, AreaShape::Rectangle(_)) { 2 } else { 1 };
                l * mask.alpha(self.primitive, count, p, || self.uv(p))
            }
            _ => l,
        }
    }

    /// Multiplies a radiance by the vertex colour at the point `p`.
    #[inline]
    fn colored(&self, radiance: Rgb, p: Vec3) -> Rgb {
        match &self.shape {
            AreaShape::Triangle(triangle) if triangle.colors.is_some() => radiance * triangle.color(p),
            AreaShape::Triangle(_) | AreaShape::Rectangle(_) | AreaShape::Quadric(_) | AreaShape::Patch(_) => radiance,
        }
    }

    /// True if the radiance is constant over the surface.
    pub(in crate::lights) fn is_even(&self) -> bool {
        let has_colors = matches!(&self.shape, AreaShape::Triangle(triangle) if triangle.colors.is_some());
        !self.emission.is_textured() && !has_colors
    }

    /// The radiance, averaged over the image and the vertices.
    pub fn mean_radiance(&self) -> Rgb {
        match &self.shape {
            AreaShape::Triangle(triangle) if triangle.colors.is_some() => self.emission.mean() * triangle.mean_color(),
            AreaShape::Triangle(_) | AreaShape::Rectangle(_) | AreaShape::Quadric(_) | AreaShape::Patch(_) => {
                self.emission.mean()
            }
        }
    }

    /// Luminance of [`mean_radiance`](Self::mean_radiance).
    fn mean_luminance(&self) -> f32 {
        luminance_of(self.mean_radiance())
    }

    /// Density per steradian of [`sample_li`](Self::sample_li) at the point `hit`. If a ray can cross the surface more
    /// than once, this is the density of this intersection only.
    #[inline]
    pub fn pdf_li(&self, ctx: &LightCtx, _wi: Vec3, hit: &LightHit) -> f32 {
        if self.is_dark_from(ctx.p) {
            return 0.0;
        }
        match &self.shape {
            AreaShape::Triangle(triangle) => triangle.pdf(ctx.p, hit.p),
            AreaShape::Rectangle(rectangle) => rectangle.pdf(ctx.p, hit.p),
            AreaShape::Quadric(quadric) => quadric.pdf(ctx.p, hit.p),
            AreaShape::Patch(patch) => patch.pdf(ctx.p, hit.p),
        }
    }

    /// Radiance that leaves the point `hit` in direction `w`, where `hit` is a ray intersection. The emitting side of a
    /// flat light is read from the light itself, so that light and BSDF sampling agree. Curved lights use the normal of
    /// the hit.
    #[inline]
    pub fn l(&self, hit: &LightHit, w: Vec3) -> Rgb {
        let n = match &self.shape {
            AreaShape::Triangle(triangle) => triangle.n,
            AreaShape::Rectangle(rectangle) => rectangle.n,
            AreaShape::Quadric(_) | AreaShape::Patch(_) => hit.n,
        };
        let has_own_uv = self.emission.image.as_ref().is_some_and(|image| image.mapping().is_some());
        let uv = if has_own_uv { self.uv(hit.p) } else { hit.uv };
        self.colored(self.emission.l(n, uv, w), hit.p)
    }

    /// Luminance of the emitted power, π·A·L, doubled for a two-sided light.
    pub fn power_luminance(&self) -> f32 {
        let sides = if self.emission.two_sided { 2.0 } else { 1.0 };
        PI * self.area() * self.mean_luminance() * sides
    }

    /// Area of the surface.
    pub fn area(&self) -> f32 {
        match &self.shape {
            AreaShape::Triangle(triangle) => triangle.area,
            AreaShape::Rectangle(rectangle) => rectangle.area(),
            AreaShape::Quadric(quadric) => quadric.area,
            AreaShape::Patch(patch) => patch.area,
        }
    }

    /// Bounds for the light tree.
    pub fn bounds(&self) -> LightBounds {
        // Bounds for a radiance of 1
        let of = |bounds, axis, cos_theta_o, intensity| LightBounds {
            bounds,
            axis,
            cos_theta_o,
            cos_theta_e: 0.0,
            two_sided: self.emission.two_sided,
            intensity,
        };
        let unit = match &self.shape {
            AreaShape::Triangle(t) => of(t.bounds(), t.n, 1.0, t.area),
            AreaShape::Rectangle(r) => of(r.bounds(), r.n, 1.0, r.area()),
            AreaShape::Quadric(q) => {
                let DirectionBounds { axis, cos, max_projected_area } = q.direction_bounds();
                of(q.bounds(), axis, cos, max_projected_area)
            }
            AreaShape::Patch(p) => of(p.bounds(), p.cone_axis, p.cos_cone, p.area),
        };
        LightBounds { intensity: unit.intensity * self.mean_luminance(), ..unit }
    }

    /// True if no emitting side is visible from `p`: `p` is in the plane of a flat light, or behind a one-sided light.
    #[inline]
    pub(in crate::lights) fn is_dark_from(&self, p: Vec3) -> bool {
        let two_sided = self.emission.two_sided;
        match (&self.plane, &self.shape) {
            (Some(plane), _) => {
                let height = plane.height(p);
                height == 0.0 || !two_sided && height < 0.0
            }
            (None, AreaShape::Quadric(quadric)) => !two_sided && quadric.is_behind(p),
            (None, AreaShape::Triangle(_) | AreaShape::Rectangle(_) | AreaShape::Patch(_)) => false,
        }
    }

    /// Texture coordinates of the point `p` of the surface.
    fn uv(&self, p: Vec3) -> Vec2 {
        match &self.shape {
            AreaShape::Triangle(triangle) => triangle.uv(p),
            AreaShape::Rectangle(rectangle) => rectangle.uv(p),
            AreaShape::Quadric(quadric) => quadric.uv(p),
            AreaShape::Patch(patch) => patch.uv(p),
        }
    }
}
