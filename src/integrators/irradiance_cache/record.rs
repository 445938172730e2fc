//! Records, and extrapolation from them to nearby points.
//!
//! A record i can be used at the point x with normal n if its error [Ward et al. 1988]
//!
//! ε_i(x, n) = |x − x_i| / a_i + √(1 − n·n_i) / κ
//!
//! is below 1. a_i is κR_i, clamped to a range in pixels. The weight is 1 − ε_i, which falls to 0 at ε_i = 1, so that
//! the interpolation is continuous.

use super::gradients::Irradiance;
use crate::settings::IrradianceCacheSettings;
use lumiris_numbers::math::{Rgb, Vec3};

/// Maximum distance of a point behind the tangent plane of a record, relative to a_i. Points further behind may be
/// hidden from the light of the record [Ward et al. 1988].
const BEHIND: f32 = 0.05;

/// Irradiance of a point.
#[derive(Clone, Copy, Debug)]
pub struct Record {
    /// The point.
    pub p: Vec3,
    /// Shading normal on the side of the light, unit.
    pub n: Vec3,
    /// Irradiance.
    pub light: Irradiance,
    /// R: harmonic mean distance of visible surfaces, after clamping.
    pub radius: f32,
    /// Width of a pixel on the surface.
    pub pixel_width: f32,
    /// The pixel that requested it.
    pub pixel: [u32; 2],
}

impl Record {
    /// a: distance up to which the record is used.
    #[inline]
    pub fn reach(&self, settings: &IrradianceCacheSettings) -> f32 {
        let [min, max] = settings.radius;
        (settings.error * self.radius).clamp(min * self.pixel_width, max.max(min) * self.pixel_width)
    }

    /// First-order extrapolation of the irradiance to `x` with the normal `n`, clamped at 0.
    #[inline]
    pub fn extrapolate(&self, x: Vec3, n: Vec3) -> Rgb {
        let (moved, turned) = (x - self.p, self.n.cross(n));
        let e = |c: usize| self.light.e[c] + moved.dot(self.light.translation[c]) + turned.dot(self.light.rotation[c]);
        Rgb::new(e(0).max(0.0), e(1).max(0.0), e(2).max(0.0))
    }
}

/// Data that determine the range of use of a record.
#[derive(Clone, Copy, Debug)]
pub struct Range {
    /// Its point.
    pub p: Vec3,
    /// Its normal.
    pub n: Vec3,
    /// a.
    pub reach: f32,
}

impl Range {
    /// ε; infinite for points behind the record.
    #[inline]
    pub fn error(&self, kappa: f32, x: Vec3, n: Vec3) -> f32 {
        let moved = x - self.p;
        if moved.dot(n + self.n) < -2.0 * BEHIND * self.reach {
            return f32::INFINITY;
        }
        moved.length() / self.reach + (1.0 - n.dot(self.n)).max(0.0).sqrt() / kappa
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const RANGE: Range = Range { p: Vec3::ZERO, n: Vec3::Z, reach: 0.5 };

    #[test]
    fn the_error_is_that_of_position_and_of_normal() {
        assert_eq!(RANGE.error(0.2, Vec3::new(0.25, 0.0, 0.0), Vec3::Z), 0.5);
        let n = Vec3::new(0.1, 0.0, 0.995).normalize();
        assert!((RANGE.error(0.2, Vec3::ZERO, n) - (1.0 - n.z).sqrt() / 0.2).abs() < 1e-5);
        assert!(RANGE.error(0.2, Vec3::ZERO, -Vec3::Z) > 1.0, "the other side of a wall");
    }

    #[test]
    fn points_behind_a_record_are_not_served() {
        assert!(RANGE.error(0.2, Vec3::new(0.1, 0.0, -0.1), Vec3::Z).is_infinite());
        assert!(RANGE.error(0.2, Vec3::new(0.1, 0.0, 0.1), Vec3::Z) < 1.0);
    }

    #[test]
    fn extrapolation_is_linear_and_never_negative() {
        let light = Irradiance {
            e: Rgb::WHITE,
            translation: [Vec3::X, Vec3::ZERO, Vec3::X * -9.0],
            rotation: [Vec3::ZERO, Vec3::Y, Vec3::ZERO],
        };
        let r = Record { p: Vec3::X, n: Vec3::Z, light, radius: 1.0, pixel_width: 0.1, pixel: [0, 0] };
        let n = Vec3::new(0.3, 0.0, 1.0).normalize();
        // n_i × n points along y
        let e = r.extrapolate(Vec3::new(1.25, 3.0, 0.0), n);
        assert!((e.r - 1.25).abs() < 1e-6 && (e.g - (1.0 + n.x)).abs() < 1e-6 && e.b == 0.0, "{e:?}");
    }

    #[test]
    fn the_reach_is_kept_to_pixels() {
        let record = |radius| Record {
            p: Vec3::ZERO,
            n: Vec3::Z,
            light: Irradiance::default(),
            radius,
            pixel_width: 0.01,
            pixel: [0, 0],
        };
        let s = IrradianceCacheSettings { error: 0.5, radius: [2.0, 10.0], ..Default::default() };
        for (radius, reach) in [(0.001, 0.02), (0.1, 0.05), (9.0, 0.1)] {
            assert!((record(radius).reach(&s) - reach).abs() < 1e-6, "{radius}");
        }
    }
}
