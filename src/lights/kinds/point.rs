//! Point and spot lights.
//!
//! li = I(−wi)/t², with I the radiant intensity.

use crate::lights::{LightCtx, LightSample};
use lumiris_numbers::math::{Rgb, Vec3};

/// The sample of a light at `p`; `intensity(w)` is its intensity in the unit direction `w`.
pub(in crate::lights) fn sample_li_from(
    p: Vec3,
    ctx: &LightCtx,
    intensity: impl Fn(Vec3) -> Rgb,
) -> Option<LightSample> {
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
    use crate::lights::{Light, LightCtx};
    use lumiris_numbers::math::{Rgb, Vec3};
    use std::f32::consts::PI;

    #[test]
    fn point_light_falls_with_the_squared_distance() {
        let light = Light::Point { p: Vec3::new(0.0, 3.0, 0.0), intensity: Rgb::new(9.0, 18.0, 0.0) };
        let s = light.sample_li(&LightCtx::at(Vec3::ZERO), [0.5; 2]).unwrap();
        assert_eq!((s.li, s.wi, s.t, s.pdf, s.is_delta), (Rgb::new(1.0, 2.0, 0.0), Vec3::Y, 3.0, 1.0, true));
        assert!((light.phi(1.0) - 4.0 * PI * Rgb::new(9.0, 18.0, 0.0).luminance()).abs() < 1e-3);
        assert!(light.sample_li(&LightCtx::at(Vec3::new(0.0, 3.0, 0.0)), [0.5; 2]).is_none());
    }
}
