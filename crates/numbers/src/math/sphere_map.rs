//! Maps between the unit square and the sphere of directions: the equal-area octahedral map [Clarberg 2008] in the
//! orientation of pbrt-v4, and the latitude-longitude map. z is up in both.

use super::elementary::arctangent;
use super::number::Number;
use super::v3::V3;
use super::warp::azimuth;
use super::{Vec2, Vec3, safe_sqrt, sqr};
use std::f32::consts::{FRAC_2_PI, FRAC_PI_4, PI, TAU};

/// The direction of a point of [0, 1]² under the equal-area octahedral map: the centre is +z, the corners are −z.
#[inline]
pub fn equal_area_square_to_sphere(p: Vec2) -> Vec3 {
    let (u, v) = (2.0 * p.x - 1.0, 2.0 * p.y - 1.0);
    let (u_abs, v_abs) = (u.abs(), v.abs());
    // Distance to the diagonal of the equator, positive on the upper hemisphere.
    let signed_distance = 1.0 - (u_abs + v_abs);
    let r = 1.0 - signed_distance.abs();
    let phi = if r == 0.0 { FRAC_PI_4 } else { ((v_abs - u_abs) / r + 1.0) * FRAC_PI_4 };
    let (sin_phi, cos_phi) = phi.sin_cos();
    let sin_theta = r * safe_sqrt(2.0 - sqr(r));
    Vec3::new(
        cos_phi.copysign(u) * sin_theta,
        sin_phi.copysign(v) * sin_theta,
        (1.0 - sqr(r)).copysign(signed_distance),
    )
}

/// Density of [`equal_area_square_to_sphere`] for a uniform point, per steradian: 1/4π.
#[inline]
pub fn pdf_equal_area_square_to_sphere() -> f32 {
    0.5 / TAU
}

/// Inverse of [`equal_area_square_to_sphere`]; `w` is unit.
#[inline]
pub fn equal_area_sphere_to_square(w: Vec3) -> Vec2 {
    Vec2::from_array(equal_area_squares(V3 { x: w.x, y: w.y, z: w.z }))
}

/// [`equal_area_sphere_to_square`] of one direction or of many.
#[inline(always)]
pub fn equal_area_squares<N: Number>(w: V3<N>) -> [N; 2] {
    let (x, y, z) = (w.x.magnitude(), w.y.magnitude(), w.z.magnitude());
    let (zero, one) = (x.constant(0.0), x.constant(1.0));
    // r = sqrt(1 − z), without cancellation near the poles.
    let r = ((x * x + y * y) / (z + 1.0)).root().lesser(one);
    let is_steep = y.above(x);
    let phi = arctangent(x.lesser(y), x.greater(y)) * FRAC_2_PI;
    let phi = N::choose(is_steep, one - phi, phi);
    let (u, v) = (r - phi * r, phi * r);
    let is_below = zero.above(w.z);
    let (u, v) = (N::choose(is_below, one - v, u), N::choose(is_below, one - u, v));
    [(u.signed_as(w.x) + 1.0) * 0.5, (v.signed_as(w.y) + 1.0) * 0.5]
}

/// The point of [0, 1]² with the same direction as `p`, which may be outside by less than 1: each edge of the
/// octahedral square is identified with its own reflection about its middle.
#[inline]
pub fn wrap_equal_area_square(p: Vec2) -> Vec2 {
    let mut p = p;
    if p.x < 0.0 {
        p = Vec2::new(-p.x, 1.0 - p.y);
    } else if p.x > 1.0 {
        p = Vec2::new(2.0 - p.x, 1.0 - p.y);
    }
    if p.y < 0.0 {
        p = Vec2::new(1.0 - p.x, -p.y);
    } else if p.y > 1.0 {
        p = Vec2::new(1.0 - p.x, 2.0 - p.y);
    }
    p
}

/// [`wrap_equal_area_square`] for texels of an image of `size`² texels; indices may be out of range by at most `size`.
#[inline]
pub fn wrap_equal_area_texel([mut x, mut y]: [isize; 2], size: isize) -> [isize; 2] {
    if x < 0 {
        (x, y) = (-1 - x, size - 1 - y);
    } else if x >= size {
        (x, y) = (2 * size - 1 - x, size - 1 - y);
    }
    if y < 0 {
        (x, y) = (size - 1 - x, -1 - y);
    } else if y >= size {
        (x, y) = (size - 1 - x, 2 * size - 1 - y);
    }
    [x, y]
}

/// The direction of longitude 2π·p.x (from +x to +y) and colatitude π·p.y (from +z).
#[inline]
pub fn lat_long_to_sphere(p: Vec2) -> Vec3 {
    let (sin_theta, cos_theta) = (PI * p.y).sin_cos();
    let (sin_phi, cos_phi) = (TAU * p.x).sin_cos();
    Vec3::new(sin_theta * cos_phi, sin_theta * sin_phi, cos_theta)
}

/// Density of [`lat_long_to_sphere`] for a uniform point, per steradian: 1/(2π² sin θ); infinite at the poles.
#[inline]
pub fn pdf_lat_long_to_sphere(w: Vec3) -> f32 {
    1.0 / (TAU * PI * (sqr(w.x) + sqr(w.y)).sqrt())
}

/// Inverse of [`lat_long_to_sphere`]; `w` is unit.
#[inline]
pub fn sphere_to_lat_long(w: Vec3) -> Vec2 {
    let theta = (sqr(w.x) + sqr(w.y)).sqrt().atan2(w.z);
    Vec2::new(azimuth(w) / TAU, theta / PI)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::warp::sample_uniform_sphere;
    use lumiris_test_support::assert_chi_squared;
    use lumiris_test_support::random::{RngExt, pcg32};

    #[test]
    fn both_maps_round_trip() {
        let mut stream = pcg32([3, 1, 4]);
        for i in 0..20_000 {
            let w = if i < 6 {
                [Vec3::X, -Vec3::X, Vec3::Y, -Vec3::Y, Vec3::Z, -Vec3::Z][i]
            } else {
                sample_uniform_sphere(stream.random::<[f32; 2]>())
            };
            let back = equal_area_square_to_sphere(equal_area_sphere_to_square(w));
            assert!((back - w).length() < 2e-6, "{w} {back}");
            assert!((back.length() - 1.0).abs() < 1e-6);
            assert!((lat_long_to_sphere(sphere_to_lat_long(w)) - w).length() < 2e-6);
        }
    }

    #[test]
    fn orientation_is_that_of_pbrt() {
        let at = |x, y| equal_area_square_to_sphere(Vec2::new(x, y));
        let near = |a: Vec3, b: Vec3| assert!((a - b).length() < 1e-6, "{a} {b}");
        near(at(0.5, 0.5), Vec3::Z);
        near(at(1.0, 0.5), Vec3::X);
        near(at(0.0, 0.5), -Vec3::X);
        near(at(0.5, 1.0), Vec3::Y);
        near(at(0.5, 0.0), -Vec3::Y);
        near(at(0.0, 0.0), -Vec3::Z);
        near(at(1.0, 1.0), -Vec3::Z);
        near(lat_long_to_sphere(Vec2::new(0.25, 0.5)), Vec3::Y);
        near(lat_long_to_sphere(Vec2::ZERO), Vec3::Z);
    }

    #[test]
    fn octahedral_map_keeps_area_by_chi_squared() {
        let mut stream = pcg32([9, 1, 4]);
        let count = 200_000;
        let mut observed = vec![0.0; 8 * 16];
        for _ in 0..count {
            let w = equal_area_square_to_sphere(Vec2::from_array(stream.random::<[f32; 2]>()));
            let row = ((w.z + 1.0) * 4.0).min(7.0) as usize;
            observed[row * 16 + ((azimuth(w) / TAU * 16.0) as usize).min(15)] += 1.0;
        }
        assert_chi_squared(&observed, &[f64::from(count) / 128.0; 128], 1e-4);
    }

    #[test]
    fn wrapping_across_an_edge_is_continuous_on_the_sphere() {
        let mut stream = pcg32([9, 2, 6]);
        for _ in 0..1000 {
            let [t, e] = stream.random::<[f32; 2]>();
            let e = e * 1e-3;
            for (inside, outside) in [
                (Vec2::new(e, t), Vec2::new(-e, t)),
                (Vec2::new(1.0 - e, t), Vec2::new(1.0 + e, t)),
                (Vec2::new(t, e), Vec2::new(t, -e)),
                (Vec2::new(t, 1.0 - e), Vec2::new(t, 1.0 + e)),
            ] {
                let a = equal_area_square_to_sphere(inside);
                let b = equal_area_square_to_sphere(wrap_equal_area_square(outside));
                assert!((a - b).length() < 0.02, "{inside} {outside} {a} {b}");
            }
        }
        // The centres of outer texels map to the centres of their wrapped texels.
        let size = 5;
        for k in 0..size {
            for (x, y) in [(-1, k), (size, k), (k, -1), (k, size)] {
                let center = |x: isize, y: isize| (Vec2::new(x as f32, y as f32) + 0.5) / size as f32;
                let [wx, wy] = wrap_equal_area_texel([x, y], size);
                assert!((wrap_equal_area_square(center(x, y)) - center(wx, wy)).length() < 1e-6);
            }
        }
    }
}
