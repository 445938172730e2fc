//! Tests of `lumiris_lanes::combine`.

use super::support::{LENGTHS, assert_same_bits, levels};
use lumiris_lanes::ris_weights::*;
use lumiris_numbers::estimators::heuristics::{Heuristic, Technique};
use lumiris_numbers::math::Rgb;
use lumiris_test_support::random::{Pcg32, RngExt, pcg32};

fn numbers(stream: &mut Pcg32, n: usize) -> Vec<f32> {
    let special = [0.0, f32::INFINITY, f32::NAN, -1.0, 1e-38, 3e38];
    (0..n)
        .map(|_| {
            let [a, b] = stream.random::<[f32; 2]>();
            if a < 0.2 { special[(b * 6.0) as usize] } else { b * 10.0 }
        })
        .collect()
}

#[test]
fn weights_are_those_of_single_samples_to_the_bit_at_all_levels() {
    // Numbers with all special cases, against the formulas for single samples
    let mut stream = pcg32([5, 6, 7]);
    for heuristic in [Heuristic::Balance, Heuristic::Power, Heuristic::Maximum] {
        for n in LENGTHS {
            let v: [Vec<f32>; 8] = std::array::from_fn(|_| numbers(&mut stream, n));
            let (f_cos, li) = ([&v[0][..], &v[1], &v[2]], [&v[3][..], &v[4], &v[5]]);
            let (m, m_other) = (8.0, 3.0);
            let proposals = Proposals { f_cos, li, p: &v[6], p_other: &v[7], m, m_other, heuristic };
            assert_same_bits::<3>(n, |level, [q_hat, r, w]| {
                weigh(level, &proposals, &mut Weights { q_hat, r, w });
                for i in 0..n {
                    let x = proposals.p[i] * m;
                    let product = Rgb::new(v[0][i] * v[3][i], v[1][i] * v[4][i], v[2][i] * v[5][i]);
                    let expected_q = if x > 0.0 { product.luminance() } else { 0.0 };
                    let techniques =
                        [(m, proposals.p[i]), (m_other, proposals.p_other[i])].map(|(n, p)| Technique { n, p });
                    let mis = heuristic.weight(techniques[0], techniques[1]);
                    let expected_r = if x > 0.0 { mis / x } else { 0.0 };
                    let same = |a: f32, b: f32| a.to_bits() == b.to_bits() || a.is_nan() && b.is_nan();
                    assert!(same(q_hat[i], expected_q) && same(r[i], expected_r), "{} {expected_r}", r[i]);
                    assert!(w[i].is_finite() && (w[i] == q_hat[i] * r[i] || w[i] == 0.0));
                }
            });
        }
    }
}

#[test]
fn weights_of_two_techniques_sum_to_one_at_the_edges_of_a_tie() {
    let edges = [0.999_f32, 1.0, 1.001, 1.001_001];
    let p: Vec<f32> = (1..200).map(|i| 0.01 * i as f32).collect();
    for edge in edges {
        for ulps in -20_i32..=20 {
            let q: Vec<f32> =
                p.iter().map(|p| f32::from_bits((p * edge).to_bits().wrapping_add_signed(ulps))).collect();
            let ones = vec![1.0; p.len()];
            // r·p of one technique; the luminance is irrelevant
            let weights = |level, p: &[f32], p_other: &[f32]| {
                let [mut q_hat, mut r, mut w] = [(); 3].map(|()| vec![0.0; p.len()]);
                let (f_cos, heuristic) = ([&ones[..]; 3], Heuristic::Maximum);
                let proposals = Proposals { f_cos, li: f_cos, p, p_other, m: 1.0, m_other: 1.0, heuristic };
                weigh(level, &proposals, &mut Weights { q_hat: &mut q_hat, r: &mut r, w: &mut w });
                r.iter().zip(p).map(|(r, p)| r * p).collect::<Vec<_>>()
            };
            for level in levels() {
                for (a, b) in weights(level, &p, &q).iter().zip(weights(level, &q, &p)) {
                    assert!((a + b - 1.0).abs() < 1e-6, "{edge} {ulps}: {a} {b}");
                }
            }
        }
    }
}
