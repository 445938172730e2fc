//! Tests of `lumiris_lanes::combine`.

use super::support::{LENGTHS, assert_same_bits};
use lumiris_lanes::combine::*;
use lumiris_numbers::math::Rgb;
use lumiris_numbers::math::hash::HashStream;

fn numbers(stream: &mut HashStream, n: usize) -> Vec<f32> {
    let special = [0.0, f32::INFINITY, f32::NAN, -1.0, 1e-38, 3e38];
    (0..n)
        .map(|_| {
            let [a, b] = stream.next_2d();
            if a < 0.2 { special[(b * 6.0) as usize] } else { b * 10.0 }
        })
        .collect()
}

/// As `estimators::mis` has it.
fn weight(weighting: Weighting, x: f32, y: f32) -> f32 {
    if !(x > 0.0) {
        return 0.0;
    }
    if !(y > 0.0) || x.is_infinite() {
        return if x.is_infinite() && y.is_infinite() { 0.5 } else { 1.0 };
    }
    let ratio = y / x;
    match weighting {
        Weighting::Balance => 1.0 / (1.0 + ratio),
        Weighting::Power => 1.0 / (1.0 + ratio * ratio),
        Weighting::Maximum if (ratio - 1.0).abs() <= 1e-3 => 0.5,
        Weighting::Maximum => f32::from(u8::from(ratio < 1.0)),
    }
}

#[test]
fn weights_are_those_of_single_samples_to_the_bit_at_all_levels() {
    let mut stream = HashStream::new([5, 6, 7]);
    for weighting in [Weighting::Balance, Weighting::Power, Weighting::Maximum] {
        for n in LENGTHS {
            let v: [Vec<f32>; 8] = std::array::from_fn(|_| numbers(&mut stream, n));
            let (f_cos, li) = ([&v[0][..], &v[1], &v[2]], [&v[3][..], &v[4], &v[5]]);
            let (m, m_other) = (8.0, 3.0);
            let proposals = Proposals { f_cos, li, p: &v[6], p_other: &v[7], m, m_other, weighting };
            assert_same_bits::<3>(n, |level, [q_hat, r, w]| {
                combine(level, &proposals, &mut Weights { q_hat, r, w });
                for i in 0..n {
                    let x = proposals.p[i] * m;
                    let product = Rgb::new(v[0][i] * v[3][i], v[1][i] * v[4][i], v[2][i] * v[5][i]);
                    let expected_q = if x > 0.0 { product.luminance() } else { 0.0 };
                    let mis = weight(weighting, x, proposals.p_other[i] * m_other);
                    let expected_r = if x > 0.0 { mis / x } else { 0.0 };
                    let same = |a: f32, b: f32| a.to_bits() == b.to_bits() || a.is_nan() && b.is_nan();
                    assert!(same(q_hat[i], expected_q) && same(r[i], expected_r), "{} {expected_r}", r[i]);
                    assert!(w[i].is_finite() && (w[i] == q_hat[i] * r[i] || w[i] == 0.0));
                }
            });
        }
    }
}
