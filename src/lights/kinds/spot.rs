//! Spot lights: point lights with a falloff between an inner and an outer cone, as in pbrt-v4.

use super::point::{bounds_at, sample_li_from};
use crate::lights::{EmissionSample, LightBounds, LightCtx, LightSample};
use lumiris_numbers::math::warp::direction;
use lumiris_numbers::math::{Frame, Rgb, Vec3};
use std::f32::consts::TAU;

/// Newton steps for f32 accuracy; the start is below the root by a fifth at most.
const NEWTON_STEPS: u32 = 6;

/// A light that emits from a point into a cone.
#[derive(Clone, Copy, Debug)]
pub struct SpotLight {
    /// Position.
    pub p: Vec3,
    /// Unit axis of the cone.
    pub axis: Vec3,
    /// Cosine of the half-angle beyond which it does not emit.
    pub cos_total: f32,
    /// Cosine of the half-angle up to which it has the full intensity.
    pub cos_falloff_start: f32,
    /// Radiant intensity on the axis.
    pub intensity: Rgb,
}

impl SpotLight {
    #[inline]
    pub(in crate::lights) fn sample_li(&self, ctx: &LightCtx) -> Option<LightSample> {
        sample_li_from(self.p, ctx, |w| self.intensity * self.falloff(w.dot(self.axis)))
    }

    /// Emission in proportion to the falloff, so that all samples have the same power.
    pub(in crate::lights) fn sample_le(&self, u: [f32; 2]) -> Option<EmissionSample> {
        let d = Frame::from_z(self.axis).to_world(direction(self.sample_cos(u[0]), TAU * u[1]));
        EmissionSample::in_space(self.p, d.normalize(), self.intensity * self.solid_angle())
    }

    pub(in crate::lights) fn power_luminance(&self) -> f32 {
        self.intensity.luminance() * self.solid_angle()
    }

    pub(in crate::lights) fn bounds(&self) -> LightBounds {
        // The falloff ends cos⁻¹(cos_total) − cos⁻¹(cos_falloff_start) beyond the inner cone.
        let theta_e = (self.cos_total.acos() - self.cos_falloff_start.acos()).max(0.0);
        let bounds = bounds_at(self.p, self.cos_falloff_start, self.intensity);
        LightBounds { axis: self.axis, cos_theta_e: theta_e.cos(), ..bounds }
    }

    /// Factor of the intensity at polar cosine `cos_theta` from the axis: 0 outside the outer cone, 1 inside the inner
    /// cone, x²(3 − 2x) between them, where x is the relative position of the cosine.
    #[inline]
    pub fn falloff(&self, cos_theta: f32) -> f32 {
        if self.cos_total >= self.cos_falloff_start {
            return if cos_theta < self.cos_falloff_start { 0.0 } else { 1.0 };
        }
        let x = ((cos_theta - self.cos_total) / (self.cos_falloff_start - self.cos_total)).clamp(0.0, 1.0);
        x * x * (3.0 - 2.0 * x)
    }

    /// Integral of [`Self::falloff`] over the sphere, in steradians; exact, as the smooth step has mean 1/2.
    pub fn solid_angle(&self) -> f32 {
        TAU * ((1.0 - self.cos_falloff_start) + (self.cos_falloff_start - self.cos_total).max(0.0) * 0.5)
    }

    /// A polar cosine with the density falloff/solid angle per steradian: uniform in the inner cone. Between the cones,
    /// P(x) = 2x³ − x⁴ of the relative position x is inverted by Newton's method. On a convex function it decreases
    /// monotonically to the root once it is above it.
    fn sample_cos(&self, u: f32) -> f32 {
        // The inner cone
        let inner = 1.0 - self.cos_falloff_start;
        let band = (self.cos_falloff_start - self.cos_total).max(0.0);
        let p_inner = inner / (inner + 0.5 * band);
        if u < p_inner || band == 0.0 {
            return 1.0 - inner * (u / p_inner).min(1.0);
        }

        // Between the cones
        let target = f64::from((u - p_inner) / (1.0 - p_inner));
        let mut x = (0.5 * target).cbrt().max(1e-9);
        for _ in 0..NEWTON_STEPS {
            x = (x - (x * x * x * (2.0 - x) - target) / (x * x * (6.0 - 4.0 * x))).min(1.0);
        }
        self.cos_total + band * x as f32
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lights::Light;

    fn spot(cos_total: f32, cos_falloff_start: f32) -> SpotLight {
        SpotLight { p: Vec3::ZERO, axis: Vec3::Z, cos_total, cos_falloff_start, intensity: Rgb::splat(4.0) }
    }

    #[test]
    fn solid_angle_is_the_integral_of_the_falloff() {
        let (total, start) = (0.6_f32, 0.85_f32);
        let (light, n) = (spot(total, start), 100_000_i32);
        let falloff = |i: i32| f64::from(light.falloff(2.0 * (i as f32 + 0.5) / n as f32 - 1.0));
        let mean = (0..n).map(falloff).sum::<f64>() / f64::from(n);
        let integral = mean * 4.0 * std::f64::consts::PI;
        assert!((integral - f64::from(spot(total, start).solid_angle())).abs() < 1e-4);
    }

    #[test]
    fn the_sampled_cosine_inverts_the_integral_of_the_falloff() {
        for (total, start) in [(0.6_f32, 0.85_f32), (-0.5, 0.2), (0.5, 1.0), (0.7, 0.70001)] {
            let solid_angle = f64::from(spot(total, start).solid_angle());
            for i in 0..=64 {
                let u = (i as f32 / 64.0).min(lumiris_numbers::math::ONE_MINUS_EPSILON);
                let cos = f64::from(spot(total, start).sample_cos(u));
                // The fraction of the flux between the axis, or the inner cone, and this cosine
                let (inner, band) = (1.0 - f64::from(start), f64::from(start - total));
                let x = (cos - f64::from(total)) / band;
                let is_inner = f64::from(u) * solid_angle < std::f64::consts::TAU * inner;
                let flux = if is_inner { 1.0 - cos } else { inner + 0.5 * band * x * x * x * (2.0 - x) };
                let share = flux * std::f64::consts::TAU / solid_angle;
                assert!((share - f64::from(u)).abs() < 1e-5, "{total} {start} {u}: {cos} {share}");
            }
        }
    }

    #[test]
    fn spot_light_lights_its_cone_only() {
        let light = Light::Spot(spot(0.5, 0.8));
        let li = |p: Vec3| light.sample_li(&LightCtx::at(p), [0.5; 2]).map(|s| s.li.r);
        assert_eq!(li(Vec3::new(0.0, 0.0, 2.0)), Some(1.0));
        assert_eq!(li(Vec3::new(0.0, 0.0, -2.0)), None);
        assert_eq!(li(Vec3::new(2.0, 0.0, 1.0)), None);
        let half = li(Vec3::new((1.0_f32 - 0.65 * 0.65).sqrt(), 0.0, 0.65)).unwrap();
        assert!((half - 2.0).abs() < 1e-4, "{half}");
    }
}
