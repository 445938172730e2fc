//! Weights of proposals of two techniques [Talbot 2005, Section 4.6.1]: q̂ = Y(f·cos θ·L), r = w/(m p), and q̂·r.
//!
//! Technique i has m_i proposals of density p_i, and r_j = w_i(x_j)/(m_i p_i(x_j)). With one target q̂ and a single
//! drawing step, c_j = f r_j and w_j = q̂ r_j are the same as for a single technique. The thesis prints the weight as
//! w_i q̂/p_i without 1/m_i, for an estimate that divides by M afterwards. That is correct only if all m_i are equal to
//! M, and off by m_i/M otherwise.

use super::lane::{F, LANES, Vec3s, begin, load, or_zero, padded, store};
use super::wide::Wide;
use fearless_simd::{Level, Simd, dispatch, prelude::*};
use lumiris_numbers::estimators::heuristics::Heuristic;
use lumiris_numbers::estimators::ris::weight;
use lumiris_numbers::math::rgb::LUMINANCE;

/// Samples of one technique, with the density of another technique. All slices have the same length.
#[derive(Clone, Copy, Debug)]
pub struct Proposals<'a> {
    /// f·|cos θi| by channel.
    pub f_cos: [&'a [f32]; 3],
    /// Radiance by channel.
    pub li: [&'a [f32]; 3],
    /// Density of the samples' technique; not positive if there is no sample.
    pub p: &'a [f32],
    /// Density of the other technique.
    pub p_other: &'a [f32],
    /// Number of samples of the technique.
    pub m: f32,
    /// Number of samples of the other technique; 0 if it is not used.
    pub m_other: f32,
    /// MIS heuristic.
    pub heuristic: Heuristic,
}

/// Output of [`weigh`].
#[derive(Debug)]
pub struct Weights<'a> {
    /// q̂, the luminance of f·cos θ·li; 0 if p is not positive.
    pub q_hat: &'a mut [f32],
    /// r = w/(m·p), where w is the MIS weight; 0 if p is not positive.
    pub r: &'a mut [f32],
    /// q̂·r; 0 if not finite.
    pub w: &'a mut [f32],
}

/// Computes the weights of proposals; see [`Weights`].
pub fn weigh(level: Level, proposals: &Proposals<'_>, out: &mut Weights<'_>) {
    let n = proposals.p.len();
    if n >= LANES {
        return dispatch!(level, simd => weigh_lanes(simd, proposals, out));
    }
    let (f_cos, li) = (proposals.f_cos.map(padded), proposals.li.map(padded));
    let (p, p_other) = (padded(proposals.p), padded(proposals.p_other));
    let (f_cos, li) = (f_cos.each_ref().map(|v| &v[..]), li.each_ref().map(|v| &v[..]));
    let [mut q_hat, mut r, mut w] = [[0.0; LANES]; 3];
    let few = Proposals { f_cos, li, p: &p, p_other: &p_other, ..*proposals };
    weigh(level, &few, &mut Weights { q_hat: &mut q_hat, r: &mut r, w: &mut w });
    out.q_hat.copy_from_slice(&q_hat[..n]);
    out.r.copy_from_slice(&r[..n]);
    out.w.copy_from_slice(&w[..n]);
}

#[inline(always)]
fn weigh_lanes<S: Simd>(simd: S, proposals: &Proposals<'_>, out: &mut Weights<'_>) {
    let zero = F::splat(simd, 0.0);
    for i in (0..proposals.p.len()).step_by(LANES) {
        let i = begin(i, proposals.p.len());
        let f = Vec3s::load(simd, proposals.f_cos, i);
        let l = Vec3s::load(simd, proposals.li, i);
        let (x, y) = (load(simd, proposals.p, i) * proposals.m, load(simd, proposals.p_other, i) * proposals.m_other);

        let is_sample = x.simd_gt(zero);
        let weight_of_both = proposals.heuristic.weight_of_expected(Wide(x), Wide(y)).0;
        let luminance = f.x * l.x * LUMINANCE[0] + f.y * l.y * LUMINANCE[1] + f.z * l.z * LUMINANCE[2];
        let q_hat = or_zero(is_sample, luminance);
        let r = or_zero(is_sample, weight_of_both / x);
        store(q_hat, out.q_hat, i);
        store(r, out.r, i);
        store(weight(Wide(q_hat), Wide(r)).0, out.w, i);
    }
}
