//! Tests of `lumiris_lanes::vertex`.

use super::support::assert_same_bits;
use lumiris_lanes::level;
use lumiris_lanes::vertex::*;
use lumiris_numbers::estimators::heuristics::{Heuristic, Technique};
use lumiris_numbers::math::Vec3;
use lumiris_numbers::math::ray::{SEGMENT_END, offset_origin};
use lumiris_numbers::math::warp::sample_uniform_sphere;
use lumiris_test_support::random::{Pcg32, RngExt, pcg32};

const N: usize = 64;

type Three = [Vec<f32>; 3];

fn numbers(stream: &mut Pcg32, scale: f32) -> Vec<f32> {
    (0..N).map(|_| (stream.random::<f32>() * 2.0 - 1.0) * scale).collect()
}

fn vectors(stream: &mut Pcg32, scale: f32) -> Three {
    [0, 1, 2].map(|_| numbers(stream, scale))
}

fn directions(stream: &mut Pcg32) -> Three {
    let w: Vec<Vec3> = (0..N).map(|_| sample_uniform_sphere(stream.random::<[f32; 2]>())).collect();
    [0, 1, 2].map(|c| w.iter().map(|w| w[c]).collect())
}

fn slices(v: &Three) -> Columns3<'_> {
    [&v[0], &v[1], &v[2]]
}

fn at(v: &Three, i: usize) -> Vec3 {
    Vec3::new(v[0][i], v[1][i], v[2][i])
}

#[test]
fn segments_are_the_same_at_all_levels() {
    let stream = &mut pcg32([8, 1, 1]);
    let corner = vectors(stream, 4.0);
    let (ns, wo, wi) = (directions(stream), directions(stream), directions(stream));
    let (p, p_error) = (vectors(stream, 9.0), vectors(stream, 1e-6).map(|v| v.iter().map(|x| x.abs()).collect()));
    let from = Ends { p: slices(&p), p_error: slices(&p_error), n: slices(&ns) };
    let to = Ends { p: slices(&corner), p_error: slices(&p_error), n: slices(&wo) };
    let is_far: Vec<f32> = (0..N).map(|i| if i % 3 == 0 { 1.0 } else { 0.0 }).collect();
    assert_same_bits::<7>(N, |level, [ox, oy, oz, dx, dy, dz, t_max]| {
        segments(level, &from, slices(&wi), &to, &is_far, &mut Rays { o: [ox, oy, oz], d: [dx, dy, dz], t_max });
    });
}

#[test]
fn segments_are_those_of_single_points() {
    let stream = &mut pcg32([8, 1, 2]);
    let (mut p, q, wi) = (vectors(stream, 9.0), vectors(stream, 9.0), directions(stream));
    let (n, n_light) = (directions(stream), directions(stream));
    let error: Three = vectors(stream, 1e-6).map(|v| v.iter().map(|x| x.abs()).collect());
    // On a plane through the origin
    p[1][..8].fill(0.0);
    p[2][8..16].fill(-0.0);
    let from = Ends { p: slices(&p), p_error: slices(&error), n: slices(&n) };
    let to = Ends { p: slices(&q), p_error: slices(&error), n: slices(&n_light) };
    let is_far: Vec<f32> = (0..N).map(|i| if i % 3 == 0 { 1.0 } else { 0.0 }).collect();
    let (mut o, mut d, mut t_max) = ([0, 1, 2].map(|_| vec![0.0; N]), [0, 1, 2].map(|_| vec![0.0; N]), vec![0.0; N]);
    let ([ox, oy, oz], [dx, dy, dz]) = (&mut o, &mut d);
    let mut rays = Rays { o: [ox, oy, oz], d: [dx, dy, dz], t_max: &mut t_max };
    segments(level(), &from, slices(&wi), &to, &is_far, &mut rays);
    for i in 0..N {
        let origin = offset_origin(at(&p, i), at(&error, i), at(&n, i), at(&wi, i));
        assert_eq!(at(&o, i), origin);
        if is_far[i] > 0.0 {
            assert_eq!((at(&d, i), t_max[i]), (at(&wi, i), f32::INFINITY));
        } else {
            let end = offset_origin(at(&q, i), at(&error, i), at(&n_light, i), origin - at(&q, i));
            assert_eq!((at(&d, i), t_max[i]), (end - origin, SEGMENT_END));
        }
    }
}

#[test]
fn contributions_are_weighted_as_single_samples() {
    // One sample has no density
    let stream = &mut pcg32([8, 1, 3]);
    let (f_cos, li) = (vectors(stream, 1.0), vectors(stream, 5.0));
    let [mut p, p_other] = [0, 1].map(|_| numbers(stream, 3.0).iter().map(|p| p.abs()).collect::<Vec<f32>>());
    p[5] = 0.0;
    for heuristic in [Heuristic::Balance, Heuristic::Power, Heuristic::Maximum] {
        let samples = Samples {
            f_cos: slices(&f_cos),
            li: slices(&li),
            p: &p,
            p_other: &p_other,
            n: 3.0,
            n_other: 1.0,
            heuristic,
        };
        let mut c: Three = [0, 1, 2].map(|_| vec![-1.0; N]);
        weigh(level(), &samples, &mut c.each_mut().map(|c| &mut c[..]));
        for i in 0..N {
            let factor = heuristic.factor(Technique { n: 3.0, p: p[i] }, Technique { n: 1.0, p: p_other[i] });
            let expected = at(&f_cos, i) * at(&li, i) * factor;
            assert!((at(&c, i) - expected).length() <= 1e-5 * expected.length(), "{i} {heuristic:?}");
        }
    }
}
