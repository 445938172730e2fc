//! Tests of `lumiris_lanes::area`.

use super::support::assert_same_bits;
use fearless_simd::{Simd, dispatch, f64x8, prelude::*};
use lumiris_lanes::area::Rectangle;
use lumiris_lanes::area::many::{PointsOnLight, sample_rectangle, sample_sphere, sample_triangle};
use lumiris_lanes::area::spherical::{atan2, sin_cos_turns_f64};
use lumiris_numbers::math::elementary::SinCos;
use lumiris_numbers::math::subtended_cone::{SpherePoint, SubtendedCone};
use lumiris_numbers::math::v3::V3;
use lumiris_numbers::math::{Sphere, Vec2, Vec3};
use lumiris_test_support::random::{RngExt, pcg32};
use std::array::from_fn;
use std::f64::consts::TAU;

#[test]
fn many_points_are_the_same_at_all_levels() {
    let (ex, ey, n) = (Vec3::X, Vec3::Z, Vec3::NEG_Y);
    let rectangle = Rectangle { corner: Vec3::new(-1.0, 2.0, -1.0), ex, ey, size: Vec2::new(2.0, 3.0), n };
    let corners = [Vec3::new(0.0, 3.0, 1.0), Vec3::new(2.0, 3.0, 0.0), Vec3::new(1.0, 2.0, 2.0)];
    let mut stream = pcg32([4, 4, 5]);
    for len in [0, 8, 64] {
        // Near, far, edge-on, and on the rectangle
        let scale = |i: usize| [0.5, 3.0, 100.0][i % 3];
        let from: [Vec<f32>; 3] =
            [0, 1, 2].map(|_| (0..len).map(|i| (stream.random::<f32>() - 0.4) * scale(i)).collect());
        let from = [&from[0][..], &from[1], &from[2]];
        let u: [Vec<f32>; 2] = [0, 1].map(|_| (0..len).map(|_| stream.random::<f32>()).collect());
        let u = [&u[0][..], &u[1]];
        assert_same_bits::<10>(len, |level, [wx, wy, wz, x, y, z, ex, ey, ez, pdf]| {
            let mut out = PointsOnLight { wi: [wx, wy, wz], p: [x, y, z], p_error: [ex, ey, ez], pdf };
            sample_rectangle(level, &rectangle, 1e-6, from, u, &mut out);
            assert!(out.pdf.iter().all(|&p| p >= 0.0 && p.is_finite()));
        });
        assert_same_bits::<10>(len, |level, [wx, wy, wz, x, y, z, ex, ey, ez, pdf]| {
            let mut out = PointsOnLight { wi: [wx, wy, wz], p: [x, y, z], p_error: [ex, ey, ez], pdf };
            sample_triangle(level, (corners, Vec3::Y, 1.5), from, u, &mut out);
        });
        // From inside and outside, and the same as for single points
        let sphere = Sphere { center: Vec3::new(0.1, 0.2, 0.0), radius: 0.4 };
        let lanes = assert_same_bits::<13>(len, |level, [wx, wy, wz, x, y, z, ex, ey, ez, pdf, nx, ny, nz]| {
            let mut out = PointsOnLight { wi: [wx, wy, wz], p: [x, y, z], p_error: [ex, ey, ez], pdf };
            sample_sphere(level, &sphere, from, u, [nx, ny, nz], &mut out);
        });
        for i in 0..len {
            let p = V3 { x: from[0][i], y: from[1][i], z: from[2][i] };
            let cone = SubtendedCone::new(&sphere, p);
            if !cone.is_outside {
                assert_eq!(lanes[9][i], -1.0);
                continue;
            }
            let SpherePoint { p, p_error, outward, wi, t: _, pdf } = cone.sample(&sphere, p, [u[0][i], u[1][i]]);
            let [wi, p, p_error, n] = [wi, p, p_error, outward].map(|v| [v.x, v.y, v.z]);
            let single: Vec<f32> = [wi, p, p_error].concat().into_iter().chain([pdf]).chain(n).collect();
            assert_eq!(lanes.each_ref().map(|column| column[i]).to_vec(), single);
        }
    }
}

#[test]
fn arguments_of_complex_numbers_are_accurate() {
    #[inline(always)]
    fn run<S: Simd>(simd: S, y: &[f64; 8], x: &[f64; 8]) -> [f64; 8] {
        atan2(f64x8::load_array(simd, *y), f64x8::load_array(simd, *x)).to_array()
    }
    for i in 0..2000 {
        let angles: [f64; 8] = from_fn(|part| (f64::from(i) / 1000.0 - 1.0 + part as f64 / 8000.0) * 0.5 * TAU);
        let (y, x) = (angles.map(|a| 3.0 * a.sin()), angles.map(|a| 3.0 * a.cos()));
        for level in super::support::levels() {
            let found = dispatch!(level, simd => run(simd, &y, &x));
            for k in 0..8 {
                assert!((found[k] - y[k].atan2(x[k])).abs() < 4e-15, "{} {}", angles[k], found[k]);
            }
        }
    }
}

#[test]
fn sines_of_f64_are_accurate() {
    #[inline(always)]
    fn run<S: Simd>(simd: S, t: &[f64; 8]) -> [[f64; 8]; 2] {
        let SinCos { sin: s, cos: c } = sin_cos_turns_f64(f64x8::load_array(simd, *t));
        [s.to_array(), c.to_array()]
    }
    for i in -300..1000 {
        let t: [f64; 8] = from_fn(|k| k as f64 * 0.001 + f64::from(i) / 777.0);
        for level in super::support::levels() {
            let [s, c] = dispatch!(level, simd => run(simd, &t));
            for k in 0..8 {
                let (sin, cos) = (t[k] * TAU).sin_cos();
                assert!((s[k] - sin).abs() < 1e-13 && (c[k] - cos).abs() < 1e-13, "{}", t[k]);
            }
        }
    }
}
