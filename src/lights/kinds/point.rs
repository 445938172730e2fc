//! Point lights.
//!
//! li = I(−wi)/t², with I the radiant intensity.

use crate::lights::{EmissionSample, LightBounds, LightCtx, LightSample};
use lumiris_numbers::math::warp::sample_uniform_sphere;
use lumiris_numbers::math::{Bounds3, Rgb, Vec3};
use std::f32::consts::PI;

/// A light that emits from a point, the same in all directions.
#[derive(Clone, Copy, Debug)]
pub struct PointLight {
    /// Position.
    pub p: Vec3,
    /// Radiant intensity (radiance times area).
    pub intensity: Rgb,
}

impl PointLight {
    #[inline]
    pub(in crate::lights) fn sample_li(&self, ctx: &LightCtx) -> Option<LightSample> {
        sample_li_from(self.p, ctx, |_| self.intensity)
    }

    /// Emission is uniform, so that all samples have the same power.
    pub(in crate::lights) fn sample_le(&self, u: [f32; 2]) -> Option<EmissionSample> {
        EmissionSample::in_space(self.p, sample_uniform_sphere(u), self.intensity * (4.0 * PI))
    }

    pub(in crate::lights) fn power_luminance(&self) -> f32 {
        4.0 * PI * self.intensity.luminance()
    }

    pub(in crate::lights) fn bounds(&self) -> LightBounds {
        bounds_at(self.p, -1.0, self.intensity)
    }
}

/// Bounds of a light at a point whose normals are in a cone about +z.
pub(super) fn bounds_at(p: Vec3, cos_theta_o: f32, intensity: Rgb) -> LightBounds {
    LightBounds {
        bounds: Bounds3 { min: p, max: p },
        axis: Vec3::Z,
        cos_theta_o,
        cos_theta_e: 0.0,
        two_sided: false,
        intensity: intensity.luminance(),
    }
}

/// The sample of a light at `p`; `intensity(w)` is its intensity in the unit direction `w`.
#[inline]
pub(super) fn sample_li_from(p: Vec3, ctx: &LightCtx, intensity: impl Fn(Vec3) -> Rgb) -> Option<LightSample> {
    let d = p - ctx.p;
    let t2 = d.length_squared();
    if t2 <= 0.0 || !t2.is_finite() {
        return None;
    }
    let t = t2.sqrt();
    let wi = d / t;
    let li = intensity(-wi) / t2;
    if li.is_black() || !li.is_finite() {
        return None;
    }
    Some(LightSample { li, wi, pdf: 1.0, t, p, n: Vec3::ZERO, p_error: Vec3::ZERO, is_delta: true })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lights::Light;

    #[test]
    fn point_light_falls_with_the_squared_distance() {
        let intensity = Rgb::new(9.0, 18.0, 0.0);
        let light = Light::Point(PointLight { p: Vec3::new(0.0, 3.0, 0.0), intensity });
        let s = light.sample_li(&LightCtx::at(Vec3::ZERO), [0.5; 2]).unwrap();
        assert_eq!((s.li, s.wi, s.t, s.pdf, s.is_delta), (Rgb::new(1.0, 2.0, 0.0), Vec3::Y, 3.0, 1.0, true));
        assert!((light.power_luminance(1.0) - 4.0 * PI * intensity.luminance()).abs() < 1e-3);
        assert!(light.sample_li(&LightCtx::at(Vec3::new(0.0, 3.0, 0.0)), [0.5; 2]).is_none());
    }
}
