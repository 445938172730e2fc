//! The weights of proposals: q̂ = Y(f·cos θ · L), r = w/(m p), w·q̂ of resampling.

use super::lane::{F, LANES, Vec3s, begin, load, or_zero, padded, store};
use fearless_simd::{Level, Simd, dispatch, prelude::*};

/// How the weights of two techniques are chosen; see the heuristics of the same names in `estimators::mis`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Weighting {
    /// x/(x + y).
    Balance,
    /// x²/(x² + y²).
    Power,
    /// 1 where x is larger, 0 where y is, 1/2 where they differ by less than one part in a thousand.
    Maximum,
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
    pub weighting: Weighting,
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
    let (zero, one) = (F::splat(simd, 0.0), F::splat(simd, 1.0));
    for i in (0..proposals.p.len()).step_by(LANES) {
        let i = begin(i, proposals.p.len());
        let f = Vec3s::load(simd, proposals.f_cos, i);
        let l = Vec3s::load(simd, proposals.li, i);
        let (x, y) = (load(simd, proposals.p, i) * proposals.m, load(simd, proposals.p_other, i) * proposals.m_other);

        // The ratio y/x, and not the products, so that neither squares overflow nor inf/inf appears.
        let (is_sample, has_other) = (x.simd_gt(zero), y.simd_gt(zero));
        let ratio = y / x;
        let both_infinite = x.is_infinite() & y.is_infinite();
        let weight = match proposals.weighting {
            Weighting::Balance => one / (ratio + one),
            Weighting::Power => one / (ratio * ratio + one),
            Weighting::Maximum => {
                let is_tie = (ratio - one).abs().simd_le(F::splat(simd, 1e-3));
                is_tie.select(F::splat(simd, 0.5), ratio.simd_lt(one).select(one, zero))
            }
        };
        let weight = both_infinite.select(F::splat(simd, 0.5), has_other.select(weight, one));

        let luminance = f.x * l.x * 0.212_671 + f.y * l.y * 0.715_160 + f.z * l.z * 0.072_169;
        let q_hat = or_zero(is_sample, luminance);
        let r = or_zero(is_sample, weight / x);
        let w = q_hat * r;
        store(q_hat, out.q_hat, i);
        store(r, out.r, i);
        store(or_zero(w.is_finite(), w), out.w, i);
    }
}
