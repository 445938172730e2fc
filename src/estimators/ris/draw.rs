//! Draws N of M proposals by weight; each draw is one [`Draw`] with the scale that keeps the estimate unbiased.
//!
//! | function | E[times that j is drawn] | scale | a proposal can come | source |
//! |---|---|---|---|---|
//! | [`with_replacement`] | N w_j/S | S/(N w_j) | up to N times | thesis (4.1) |
//! | [`systematic`] | N w_j/S | S/(N w_j) | ⌊N w_j/S⌋ or ⌈N w_j/S⌉ times | [Kitagawa 1996] |
//! | [`stratified`] | w_j/S_k | S_k/w_j | once | thesis (4.5) |
//! | [`independent_sets`] | w_j/S_k | S_k/w_j | once | paper (1) |
//!
//! S is the sum of all weights, S_k that of stratum k. Sums are in f64 and in a fixed order, so weights of any finite size
//! keep their probabilities and equal arguments give equal bits. A weight that is not positive and finite counts as 0; such
//! a proposal is never drawn, and nothing is drawn if there is no other.

use crate::math::ONE_MINUS_EPSILON;

/// A drawn proposal. The estimate is Σ scale·c_index, scale = 1/E[number of times that it is drawn].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Draw {
    /// Index of the proposal.
    pub index: u32,
    /// 1/E[number of times that the proposal is drawn]; positive and finite.
    pub scale: f32,
}

/// Proposals whose prefix sums are formed together: sums within a block do not wait for the block before.
const BLOCK: usize = 8;

/// Most coarse bounds that [`with_replacement`] searches.
const COARSE: usize = 64;

/// The weight that counts: 0 for NaN, infinite and negative weights.
#[inline(always)]
pub(super) fn clean(weight: f32) -> f64 {
    if weight > 0.0 && weight <= f32::MAX { f64::from(weight) } else { 0.0 }
}

/// Prefix sums of up to [`BLOCK`] weights; what is missing counts as 0.
#[inline(always)]
fn prefix_sums(block: &[f32]) -> [f64; BLOCK] {
    let mut w = [0.0; BLOCK];
    for (w, &weight) in w.iter_mut().zip(block) {
        *w = clean(weight);
    }
    // In pairs, then fours, then eight: three additions deep instead of seven.
    for i in [1, 3, 5, 7] {
        w[i] += w[i - 1];
    }
    for i in [2, 6] {
        w[i] += w[i - 1];
        w[i + 1] += w[i - 1];
    }
    let half = w[3];
    for x in &mut w[4..] {
        *x += half;
    }
    w
}

/// Sum of the weights, in exactly the order in which the bounds below are summed, so that the last bound is the sum.
#[inline]
fn sum(weights: &[f32]) -> f64 {
    let blocks = weights.chunks_exact(BLOCK);
    let rest = prefix_sums(blocks.remainder())[BLOCK - 1];
    blocks.fold(0.0, |sum, block| sum + prefix_sums(block)[BLOCK - 1]) + rest
}

/// A uniform number as f64 in [0, 1); what is outside is clamped, NaN is 0.
#[inline(always)]
fn unit(u: f32) -> f64 {
    if u > 0.0 { f64::from(u.min(ONE_MINUS_EPSILON)) } else { 0.0 }
}

/// Index of the first proposal whose cumulative weight, counted from `below`, exceeds `threshold`. A proposal of weight 0
/// raises no bound and so is never the first. `None` only if rounding put the threshold at the end.
#[inline]
fn search(weights: &[f32], mut below: f64, threshold: f64) -> Option<usize> {
    for (i, block) in weights.chunks(BLOCK).enumerate() {
        let bounds = prefix_sums(block).map(|prefix| below + prefix);
        if threshold < bounds[BLOCK - 1] {
            return Some(i * BLOCK + count_at_most(&bounds, threshold));
        }
        below = bounds[BLOCK - 1];
    }
    weights.iter().rposition(|&w| clean(w) > 0.0)
}

/// Number of bounds that do not exceed `threshold`.
#[inline(always)]
fn count_at_most(bounds: &[f64; BLOCK], threshold: f64) -> usize {
    bounds.iter().map(|&bound| usize::from(bound <= threshold)).sum()
}

/// Appends proposal `index` with scale sum/(n·w). The scale is kept finite; what it multiplies is of the order of w.
#[inline(always)]
fn push(weights: &[f32], index: usize, sum_per_draw: f64, out: &mut Vec<Draw>) {
    let scale = (sum_per_draw / f64::from(weights[index])).min(f64::from(f32::MAX)) as f32;
    out.push(Draw { index: index as u32, scale });
}

/// `u.len()` = N draws with replacement by inversion in the order of the proposals; scale = S/(N w_j)
/// [Talbot 2005, Eq. 4.1]. O(M + N (6 + M/64)).
///
/// Its variance over proposals and draws is V(f(X)/p)/M + (1 − 1/M) V(f(Y)/q)/N [Talbot 2005, Eq. 4.2].
pub fn with_replacement(weights: &[f32], u: &[f32], out: &mut Vec<Draw>) {
    out.clear();

    // Sum in cells of whole blocks and keep the bounds of the cells.
    let cell = weights.len().div_ceil(COARSE * BLOCK) * BLOCK;
    let (mut bounds, mut cells, mut sum) = ([0.0; COARSE], 0, 0.0);
    for proposals in weights.chunks(cell.max(1)) {
        sum = proposals.chunks(BLOCK).fold(sum, |sum, block| sum + prefix_sums(block)[BLOCK - 1]);
        bounds[cells] = sum;
        cells += 1;
    }
    if !(sum > 0.0) {
        return;
    }

    // Invert: find the cell, then the proposal.
    let sum_per_draw = sum / u.len() as f64;
    for &u in u {
        let threshold = unit(u) * sum;
        let k = bounds[..cells].partition_point(|&bound| bound <= threshold).min(cells - 1);
        let below = if k > 0 { bounds[k - 1] } else { 0.0 };
        if let Some(i) = search(&weights[k * cell..], below, threshold) {
            push(weights, k * cell + i, sum_per_draw, out);
        }
    }
}

/// N draws by one uniform number: the proposals in which the thresholds (k+u)S/N of the cumulative weight fall, k < N, in
/// rising order; scale = S/(N w_j) [Kitagawa 1996]. A proposal can come several times, if w_j > S/N. O(M + N).
///
/// A proposal comes ⌊N w_j/S⌋ or ⌈N w_j/S⌉ times, so that M = N equal weights draw each proposal once. As proposals of
/// which neighbours are alike are drawn from evenly, the variance is mostly below that of [`with_replacement`].
pub fn systematic(weights: &[f32], n: u32, u: f32, out: &mut Vec<Draw>) {
    out.clear();
    let sum = sum(weights);
    if n == 0 || !(sum > 0.0) {
        return;
    }
    let (sum_per_draw, u) = (sum / f64::from(n), unit(u));
    let threshold_of = |k: u32| (f64::from(k) + u) * sum_per_draw;
    out.reserve(n as usize);

    let (mut k, mut threshold, mut below) = (0, threshold_of(0), 0.0);
    for (i, block) in weights.chunks(BLOCK).enumerate() {
        let bounds = prefix_sums(block).map(|prefix| below + prefix);
        while threshold < bounds[BLOCK - 1] && k < n {
            push(weights, i * BLOCK + count_at_most(&bounds, threshold), sum_per_draw, out);
            k += 1;
            threshold = threshold_of(k);
        }
        below = bounds[BLOCK - 1];
    }

    // With more draws than f64 tells thresholds apart, the last can round up to the sum.
    if k < n
        && let Some(last) = weights.iter().rposition(|&w| clean(w) > 0.0)
    {
        (k..n).for_each(|_| push(weights, last, sum_per_draw, out));
    }
}

/// One draw per stratum of consecutive proposals; scale = S_k/w_j, exactly 1 for a stratum of one proposal
/// [Talbot 2005, Eq. 4.5]. `ends[k]` is the end (exclusive) of stratum k, and `u[k]` its uniform number; a stratum without
/// weight draws nothing. O(M).
///
/// With M strata the estimate is that of plain Monte Carlo, bit for bit if the sum is formed in the same order. Proposals
/// after the last end are in no stratum, and their part of the integral would be missing.
pub fn stratified(weights: &[f32], ends: &[u32], u: &[f32], out: &mut Vec<Draw>) {
    out.clear();
    let mut begin = 0;
    for (&end, &u) in ends.iter().zip(u) {
        let end = (end as usize).clamp(begin, weights.len());
        draw_one(weights, begin, end, u, out);
        begin = end;
    }
}

/// One draw from each of `n` sets of M consecutive proposals, as equal in size as `weights.len()` = nM allows; scale =
/// S_k/w_j [Talbot et al. 2005, Eq. 1]. `u.len()` = n. O(nM).
///
/// With r_j = 1/(nM p(x_j)), Σ scale·c_j is (1/n) Σ_k (f(y_k)/q̂(y_k)) (1/M) Σ_j q̂(x_kj)/p(x_kj). This is [`stratified`] with
/// strata of equal counts; the variance is [Talbot et al. 2005, Eq. 2] if the proposals are independent.
pub fn independent_sets(weights: &[f32], n: u32, u: &[f32], out: &mut Vec<Draw>) {
    out.clear();
    let (m, n) = (weights.len(), n as usize);
    for (k, &u) in (0..n).zip(u) {
        draw_one(weights, k * m / n, (k + 1) * m / n, u, out);
    }
}

/// Draws one of the proposals `begin..end`, whose sum is S_k, with scale S_k/w_j.
#[inline]
fn draw_one(weights: &[f32], begin: usize, end: usize, u: f32, out: &mut Vec<Draw>) {
    let stratum = &weights[begin..end];
    let sum = if let &[w] = stratum { clean(w) } else { sum(stratum) };
    if !(sum > 0.0) {
        return;
    }
    let index = if stratum.len() == 1 { Some(0) } else { search(stratum, 0.0, unit(u) * sum) };
    if let Some(i) = index {
        push(weights, begin + i, sum, out);
    }
}
