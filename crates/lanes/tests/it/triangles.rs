//! Tests of `lumiris_lanes::triangles`.

use super::support::{LENGTHS, assert_same_bits};
use lumiris_lanes::level;
use lumiris_lanes::triangles::{FirstHits, first_hits};
use lumiris_numbers::math::Vec3;
use lumiris_test_support::random::{RngExt, pcg32};

type Rays = ([Vec<f32>; 3], [Vec<f32>; 3]);

fn columns(rays: &[(Vec3, Vec3)]) -> Rays {
    let column = |f: &dyn Fn(&(Vec3, Vec3)) -> Vec3, c: usize| rays.iter().map(|r| f(r)[c]).collect();
    ([0, 1, 2].map(|c| column(&|r| r.0, c)), [0, 1, 2].map(|c| column(&|r| r.1, c)))
}

fn run(triangles: &[[Vec3; 3]], (o, d): &Rays) -> [Vec<f32>; 4] {
    let mut out: [Vec<f32>; 4] = std::array::from_fn(|_| vec![-1.0; o[0].len()]);
    let [t, b1, b2, triangle] = &mut out;
    let (o, d) = (o.each_ref().map(|o| &o[..]), d.each_ref().map(|d| &d[..]));
    first_hits(level(), triangles, o, d, &mut FirstHits { t, b: [b1, b2], triangle });
    out
}

#[test]
fn first_hits_are_those_of_f64() {
    let mut stream = pcg32([3, 7, 7]);
    let mut point = || Vec3::new(stream.random::<f32>(), stream.random::<f32>(), stream.random::<f32>()) * 2.0 - 1.0;
    let (mut hits, mut close) = (0, 0);
    for _ in 0..2000 {
        let triangles: Vec<[Vec3; 3]> = (0..7).map(|_| [point(), point(), point()]).collect();
        let rays: Vec<(Vec3, Vec3)> = (0..21).map(|_| (point() * 2.0, point())).collect();
        let [t, b1, b2, index] = run(&triangles, &columns(&rays));
        for (i, (o, d)) in rays.iter().map(|(o, d)| (o.as_dvec3(), d.as_dvec3())).enumerate() {
            // Cramer's rule; rays within 1e-5 of an edge may hit or miss
            let mut expected = (f64::INFINITY, 0);
            let mut is_close = false;
            for (k, p) in triangles.iter().enumerate() {
                let [p0, p1, p2] = p.map(|p| p.as_dvec3());
                let (e1, e2, s) = (p1 - p0, p2 - p0, o - p0);
                let det = e1.dot(d.cross(e2));
                let (u, v) = (s.dot(d.cross(e2)) / det, d.dot(s.cross(e1)) / det);
                let t = e2.dot(s.cross(e1)) / det;
                is_close |= [u, v, 1.0 - u - v, t].iter().any(|x| x.abs() < 1e-5);
                if u > 0.0 && v > 0.0 && u + v < 1.0 && t > 0.0 && t < expected.0 {
                    expected = (t, k);
                }
            }
            if is_close {
                close += 1;
                continue;
            }
            assert_eq!(t[i].is_finite(), expected.0.is_finite(), "{o} {d}");
            if t[i].is_finite() {
                hits += 1;
                assert_eq!(index[i] as usize, expected.1);
                assert!((f64::from(t[i]) - expected.0).abs() < 1e-3 * expected.0);
                let p = triangles[expected.1];
                let q = p[0] + (p[1] - p[0]) * b1[i] + (p[2] - p[0]) * b2[i];
                assert!((q - (rays[i].0 + rays[i].1 * t[i])).length() < 1e-3);
            }
        }
    }
    assert!(hits > 1000 && close < 200, "{hits} {close}");
}

#[test]
fn rays_at_a_common_edge_hit_one_of_its_triangles() {
    let square = [Vec3::ZERO, Vec3::new(1.0, 0.1, 0.0), Vec3::new(1.2, 1.1, 0.3), Vec3::new(0.1, 0.9, 0.2)];
    let triangles = [[square[0], square[1], square[2]], [square[0], square[2], square[3]]];
    let mut stream = pcg32([3, 7, 8]);
    let rays: Vec<(Vec3, Vec3)> = (0..10_000)
        .map(|_| {
            let o = Vec3::new(stream.random::<f32>(), stream.random::<f32>(), 1.0 + stream.random::<f32>());
            (o, square[0].lerp(square[2], 0.05 + 0.9 * stream.random::<f32>()) - o)
        })
        .collect();
    let [t, _, _, index] = run(&triangles, &columns(&rays));
    assert!(t.iter().all(|t| (t - 1.0).abs() < 1e-4));
    assert!(index.contains(&0.0) && index.contains(&1.0));
}

#[test]
fn all_levels_and_lengths_give_the_same_bits() {
    let mut stream = pcg32([3, 7, 9]);
    let mut point = || Vec3::new(stream.random::<f32>(), stream.random::<f32>(), stream.random::<f32>()) * 2.0 - 1.0;
    let triangles: Vec<[Vec3; 3]> = (0..5).map(|_| [point(), point(), point()]).collect();
    let rays: Vec<(Vec3, Vec3)> = (0..128).map(|_| (point(), point())).collect();
    let all = run(&triangles, &columns(&rays));
    for n in LENGTHS {
        let (o, d) = columns(&rays[..n]);
        assert_same_bits::<4>(n, |level, [t, b1, b2, triangle]| {
            let (o, d) = (o.each_ref().map(|o| &o[..]), d.each_ref().map(|d| &d[..]));
            first_hits(level, &triangles, o, d, &mut FirstHits { t, b: [b1, b2], triangle });
            assert_eq!(t[..], all[0][..n]);
        });
    }
}
