//! The spot light's falloff between its inner and outer cone, as in pbrt-v4.

/// Factor of the intensity at polar cosine `cos_theta` from the axis: 0 outside the outer cone (`cos_total`), 1 inside
/// the inner cone (`cos_falloff_start`), x²(3 − 2x) between them, where x is the relative position of the cosine.
#[inline]
pub fn spot_falloff(cos_theta: f32, cos_total: f32, cos_falloff_start: f32) -> f32 {
    if cos_total >= cos_falloff_start {
        return if cos_theta < cos_falloff_start { 0.0 } else { 1.0 };
    }
    let x = ((cos_theta - cos_total) / (cos_falloff_start - cos_total)).clamp(0.0, 1.0);
    x * x * (3.0 - 2.0 * x)
}

/// Integral of [`spot_falloff`] over the sphere, in steradians; exact, as the smooth step has mean 1/2.
pub fn spot_solid_angle(cos_total: f32, cos_falloff_start: f32) -> f32 {
    std::f32::consts::TAU * ((1.0 - cos_falloff_start) + (cos_falloff_start - cos_total).max(0.0) * 0.5)
}

/// A polar cosine with the density [`spot_falloff`]/[`spot_solid_angle`] per steradian: uniform in the inner cone.
/// Between the cones, P(x) = 2x³ − x⁴ of the relative position x is inverted by Newton's method. On a convex function
/// it decreases monotonically to the root once it is above it.
pub fn sample_spot_cos(u: f32, cos_total: f32, cos_falloff_start: f32) -> f32 {
    let inner = 1.0 - cos_falloff_start;
    let band = (cos_falloff_start - cos_total).max(0.0);
    let p_inner = inner / (inner + 0.5 * band);
    if u < p_inner || band == 0.0 {
        return 1.0 - inner * (u / p_inner).min(1.0);
    }
    let target = f64::from((u - p_inner) / (1.0 - p_inner));
    let mut x = (0.5 * target).cbrt().max(1e-9);
    for _ in 0..SPOT_STEPS {
        x = (x - (x * x * x * (2.0 - x) - target) / (x * x * (6.0 - 4.0 * x))).min(1.0);
    }
    cos_total + band * x as f32
}

/// Newton steps for f32 accuracy; the start is below the root by a fifth at most.
const SPOT_STEPS: u32 = 6;

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lights::{Light, LightCtx};
    use lumiris_numbers::math::{Rgb, Vec3};

    #[test]
    fn solid_angle_is_the_integral_of_the_falloff() {
        let (total, start) = (0.6_f32, 0.85_f32);
        let n = 100_000;
        let mean: f64 =
            (0..n).map(|i| f64::from(spot_falloff(2.0 * (i as f32 + 0.5) / n as f32 - 1.0, total, start))).sum::<f64>()
                / f64::from(n);
        let integral = mean * 4.0 * std::f64::consts::PI;
        assert!((integral - f64::from(spot_solid_angle(total, start))).abs() < 1e-4);
    }

    #[test]
    fn the_sampled_cosine_inverts_the_integral_of_the_falloff() {
        for (total, start) in [(0.6_f32, 0.85_f32), (-0.5, 0.2), (0.5, 1.0), (0.7, 0.70001)] {
            let solid_angle = f64::from(spot_solid_angle(total, start));
            for i in 0..=64 {
                let u = (i as f32 / 64.0).min(lumiris_numbers::math::ONE_MINUS_EPSILON);
                let cos = f64::from(sample_spot_cos(u, total, start));
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
        let light = Light::Spot {
            p: Vec3::ZERO,
            axis: Vec3::Z,
            cos_total: 0.5,
            cos_falloff_start: 0.8,
            intensity: Rgb::splat(4.0),
        };
        let li = |p: Vec3| light.sample_li(&LightCtx::at(p), [0.5; 2]).map(|s| s.li.r);
        assert_eq!(li(Vec3::new(0.0, 0.0, 2.0)), Some(1.0));
        assert_eq!(li(Vec3::new(0.0, 0.0, -2.0)), None);
        assert_eq!(li(Vec3::new(2.0, 0.0, 1.0)), None);
        let half = li(Vec3::new((1.0_f32 - 0.65 * 0.65).sqrt(), 0.0, 0.65)).unwrap();
        assert!((half - 2.0).abs() < 1e-4, "{half}");
    }
}
