//! The weights of proposals of two techniques [Talbot 2005, Section 4.6.1]: q̂ = Y(f·cos θ·L), r = w/(m p), and q̂·r.
//!
//! With m_i proposals of density p_i of each technique, r_j = w_i(x_j)/(m_i p_i(x_j)), one target q̂ and one drawing, c_j = f r_j and
//! w_j = q̂ r_j are as for a single technique. The thesis prints the weight as w_i q̂/p_i without 1/m_i, for an estimate that divides
//! by M afterwards; that is right only if all m_i are equal to M, and off by m_i/M otherwise.

use crate::estimators::mis::Heuristic;
use crate::math::rgb::LUMINANCE;
use crate::simd::lane::{F, LANES, Number, Vec3s, begin, load, or_zero, padded, store};
use fearless_simd::{Level, Simd, dispatch, prelude::*};

/// q̂·r; 0 if that is not finite.
#[inline(always)]
pub fn weight<N: Number>(q_hat: N, r: N) -> N {
    (q_hat * r).or_zero_if_not_finite()
}

/// Samples of one technique, and the density of another one at them. All slices have the same length.
#[derive(Clone, Copy, Debug)]
pub struct Proposals<'a> {
    /// f·|cos θi| by channel.
    pub f_cos: [&'a [f32]; 3],
    /// Radiance by channel.
    pub li: [&'a [f32]; 3],
    /// Density of the technique of the samples; not positive where there is none.
    pub p: &'a [f32],
    /// Density of the other technique.
    pub p_other: &'a [f32],
    /// Number of samples of the technique.
    pub m: f32,
    /// Number of samples of the other technique; 0 if it is not used.
    pub m_other: f32,
    /// How both are weighted.
    pub heuristic: Heuristic,
}

/// What [`combine`] computes.
#[derive(Debug)]
pub struct Weights<'a> {
    /// q̂, the luminance of f·cos θ·li; 0 where p is not positive.
    pub q_hat: &'a mut [f32],
    /// r = w/(m·p), w the weight of multiple importance sampling; 0 where p is not positive.
    pub r: &'a mut [f32],
    /// q̂·r; 0 where that is not finite.
    pub w: &'a mut [f32],
}

/// Computes the weights of proposals; see [`Weights`].
pub fn combine(level: Level, proposals: &Proposals<'_>, out: &mut Weights<'_>) {
    let n = proposals.p.len();
    if n >= LANES {
        return dispatch!(level, simd => combine_lanes(simd, proposals, out));
    }
    let (f_cos, li) = (proposals.f_cos.map(padded), proposals.li.map(padded));
    let (p, p_other) = (padded(proposals.p), padded(proposals.p_other));
    let (f_cos, li) = (f_cos.each_ref().map(|v| &v[..]), li.each_ref().map(|v| &v[..]));
    let [mut q_hat, mut r, mut w] = [[0.0; LANES]; 3];
    let few = Proposals { f_cos, li, p: &p, p_other: &p_other, ..*proposals };
    combine(level, &few, &mut Weights { q_hat: &mut q_hat, r: &mut r, w: &mut w });
    out.q_hat.copy_from_slice(&q_hat[..n]);
    out.r.copy_from_slice(&r[..n]);
    out.w.copy_from_slice(&w[..n]);
}

#[inline(always)]
fn combine_lanes<S: Simd>(simd: S, proposals: &Proposals<'_>, out: &mut Weights<'_>) {
    let zero = F::splat(simd, 0.0);
    for i in (0..proposals.p.len()).step_by(LANES) {
        let i = begin(i, proposals.p.len());
        let f = Vec3s::load(simd, proposals.f_cos, i);
        let l = Vec3s::load(simd, proposals.li, i);
        let (x, y) = (load(simd, proposals.p, i) * proposals.m, load(simd, proposals.p_other, i) * proposals.m_other);

        let is_sample = x.simd_gt(zero);
        let weight_of_both = proposals.heuristic.weight_of_expected(x, y);
        let luminance = f.x * l.x * LUMINANCE[0] + f.y * l.y * LUMINANCE[1] + f.z * l.z * LUMINANCE[2];
        let q_hat = or_zero(is_sample, luminance);
        let r = or_zero(is_sample, weight_of_both / x);
        store(q_hat, out.q_hat, i);
        store(r, out.r, i);
        store(weight(q_hat, r), out.w, i);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::estimators::mis::Technique;
    use crate::math::Rgb;
    use crate::math::hash::HashStream;
    use crate::simd::test_support::{LENGTHS, assert_same_bits, levels};

    fn numbers(stream: &mut HashStream, n: usize) -> Vec<f32> {
        let special = [0.0, f32::INFINITY, f32::NAN, -1.0, 1e-38, 3e38];
        (0..n)
            .map(|_| {
                let [a, b] = stream.next_2d();
                if a < 0.2 { special[(b * 6.0) as usize] } else { b * 10.0 }
            })
            .collect()
    }

    #[test]
    fn weights_are_those_of_single_samples_to_the_bit_at_all_levels() {
        let mut stream = HashStream::new([5, 6, 7]);
        for heuristic in [Heuristic::Balance, Heuristic::Power, Heuristic::Maximum] {
            for n in LENGTHS {
                let v: [Vec<f32>; 8] = std::array::from_fn(|_| numbers(&mut stream, n));
                let (f_cos, li) = ([&v[0][..], &v[1], &v[2]], [&v[3][..], &v[4], &v[5]]);
                let (m, m_other) = (8.0, 3.0);
                let proposals = Proposals { f_cos, li, p: &v[6], p_other: &v[7], m, m_other, heuristic };
                assert_same_bits::<3>(n, |level, [q_hat, r, w]| {
                    combine(level, &proposals, &mut Weights { q_hat, r, w });
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
                // r·p of one technique, whose luminance does not matter
                let weights = |level, p: &[f32], p_other: &[f32]| {
                    let [mut q_hat, mut r, mut w] = [(); 3].map(|()| vec![0.0; p.len()]);
                    let (f_cos, heuristic) = ([&ones[..]; 3], Heuristic::Maximum);
                    let proposals = Proposals { f_cos, li: f_cos, p, p_other, m: 1.0, m_other: 1.0, heuristic };
                    combine(level, &proposals, &mut Weights { q_hat: &mut q_hat, r: &mut r, w: &mut w });
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
}
