//! Draws N of M proposals by weight; each draw is one [`Draw`] with the scale that keeps the estimate unbiased.
//!
//! | function | E[times that j is drawn] | scale | draws of a proposal | source |
//! |---|---|---|---|---|
//! | [`with_replacement`] | N w_j/S | S/(N w_j) | up to N times | thesis (4.1) |
//! | [`systematic`] | N w_j/S | S/(N w_j) | ⌊N w_j/S⌋ or ⌈N w_j/S⌉ times | [Kitagawa 1996] |
//! | [`stratified`] | w_j/S_k | S_k/w_j | once | thesis (4.5); paper (1) |
//!
//! S is the sum of all weights, S_k the sum of stratum k. Weights that are not positive and finite count as 0.
//! Proposals of weight 0 are never drawn; if all weights are 0, nothing is drawn. Uniform numbers outside 0..1 are
//! clamped.
//!
//! Weights are summed in f32 within blocks of eight and in f64 across blocks, always in the same order. Equal arguments
//! therefore give bit-identical results, and the error of a probability is about 1e-7 of its block's, which is the
//! spacing of a uniform f32.

use crate::math::ONE_MINUS_EPSILON;
use crate::math::number::Number;

/// A drawn proposal. The estimate is Σ scale·c_index, scale = 1/E[number of times that it is drawn].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Draw {
    /// Index of the proposal.
    pub index: u32,
    /// 1/E[number of times that the proposal is drawn]; positive and finite.
    pub scale: f32,
}

/// Size of a block of proposals; sums within a block do not depend on the block before.
const BLOCK: usize = 8;

/// Maximum number of cells that [`with_replacement`] searches; up to 512 proposals a cell is one block.
const CELLS: usize = 64;

/// Factor of the weights if their sum overflows in f32.
const DOWN: f32 = 1.0 / 1024.0;

type Block = [f32; BLOCK];

/// The weight q̂·r of a proposal, or of several; 0 if it is not finite.
#[inline(always)]
pub fn weight<N: Number>(q_hat: N, r: N) -> N {
    let w = q_hat * r;
    w.finite_or(w.constant(0.0))
}

/// The effective weight: 0 for NaN, infinite and negative weights.
#[inline(always)]
pub(super) fn clean(weight: f32) -> f32 {
    if weight > 0.0 && weight <= f32::MAX { weight } else { 0.0 }
}

/// The weights of a block, as two half vectors. Unless `LARGE`, infinity is not removed, which saves instructions; an
/// infinite sum then requires `LARGE`, where each weight is cleaned and multiplied by [`DOWN`].
#[inline(always)]
fn load<const LARGE: bool>(w: &Block) -> ([f32; 4], [f32; 4]) {
    let at = |i: usize| if LARGE { clean(w[i]) * DOWN } else { positive(w[i]) };
    ([at(0), at(1), at(2), at(3)], [at(4), at(5), at(6), at(7)])
}

#[inline(always)]
fn positive(weight: f32) -> f32 {
    if weight > 0.0 { weight } else { 0.0 }
}

#[inline(always)]
fn add(a: [f32; 4], b: [f32; 4]) -> [f32; 4] {
    [a[0] + b[0], a[1] + b[1], a[2] + b[2], a[3] + b[3]]
}

#[inline(always)]
fn block_sum<const LARGE: bool>(w: &Block) -> f64 {
    let (low, high) = load::<LARGE>(w);
    let sum = add(low, high);
    f64::from((sum[0] + sum[2]) + (sum[1] + sum[3]))
}

/// Index within the block of the proposal whose part of the cumulative weight contains `threshold`. The block must have
/// a positive weight.
#[inline(always)]
fn search_block<const LARGE: bool>(w: &Block, threshold: f32) -> usize {
    // Monotonic prefix sums: pairs, then fours, then eight.
    let prefix = |v: [f32; 4]| {
        let pairs = add(v, [0.0, v[0], 0.0, v[2]]);
        add(pairs, [0.0, 0.0, pairs[1], pairs[1]])
    };
    let (low, high) = load::<LARGE>(w);
    let low = prefix(low);
    let high = add(prefix(high), [low[3]; 4]);

    let below = |bounds: &[f32]| bounds.iter().map(|&b| u32::from(b <= threshold)).sum::<u32>();
    let i = (below(&low) + below(&high[..3])) as usize % BLOCK;
    // A finite sum contains no infinite weight.
    let has_weight = if LARGE { clean(w[i]) > 0.0 } else { w[i] > 0.0 };
    if has_weight { i } else { last(w).unwrap_or(i) }
}

/// Index of the last proposal with a positive weight, for a threshold that was rounded to the end.
#[cold]
fn last(weights: &[f32]) -> Option<usize> {
    weights.iter().rposition(|&w| clean(w) > 0.0)
}

/// Weights in whole blocks, and the zero-padded rest.
struct Blocks<'a> {
    whole: &'a [Block],
    rest: Option<Block>,
}

impl<'a> Blocks<'a> {
    #[inline(always)]
    fn new(weights: &'a [f32]) -> Self {
        let (whole, rest) = weights.as_chunks::<BLOCK>();
        let mut last = [0.0; BLOCK];
        last[..rest.len()].copy_from_slice(rest);
        Blocks { whole, rest: if rest.is_empty() { None } else { Some(last) } }
    }

    #[inline(always)]
    fn sum<const LARGE: bool>(&self) -> f64 {
        let whole = self.whole.iter().fold(0.0, |sum, block| sum + block_sum::<LARGE>(block));
        whole + self.rest.as_ref().map_or(0.0, block_sum::<LARGE>)
    }
}

/// A uniform number as f64, clamped to [0, 1); NaN becomes 0.
#[inline(always)]
fn unit(u: f32) -> f64 {
    if u > 0.0 { f64::from(u.min(ONE_MINUS_EPSILON)) } else { 0.0 }
}

/// A sum in units of the weights.
#[inline(always)]
fn unscaled<const LARGE: bool>(sum: f64) -> f64 {
    if LARGE { sum / f64::from(DOWN) } else { sum }
}

/// The draw of proposal `index` with the weight `weight`; `sum_per_draw` is S/N. The scale is clamped to finite values;
/// its factors are of the order of the weight.
#[inline(always)]
fn draw(index: usize, weight: f32, sum_per_draw: f64) -> Draw {
    Draw { index: index as u32, scale: (sum_per_draw / f64::from(weight)).min(f64::from(f32::MAX)) as f32 }
}

/// `u.len()` = N draws with replacement by inversion in the order of the proposals; scale = S/(N w_j)
/// [Talbot 2005, Eq. 4.1]. O(M + N (6 + M/512)).
///
/// Its variance over proposals and draws is V(f(X)/p)/M + (1 − 1/M) V(f(Y)/q)/N [Talbot 2005, Eq. 4.2].
pub fn with_replacement(weights: &[f32], u: &[f32], out: &mut Vec<Draw>) {
    out.clear();
    let blocks = Blocks::new(weights);
    let sum = blocks.sum::<false>();
    if sum.is_finite() {
        invert::<false>(weights, &blocks, sum, u, out);
    } else {
        invert::<true>(weights, &blocks, blocks.sum::<true>(), u, out);
    }
}

fn invert<const LARGE: bool>(weights: &[f32], blocks: &Blocks<'_>, sum: f64, u: &[f32], out: &mut Vec<Draw>) {
    if u.is_empty() || !(sum > 0.0) {
        return;
    }
    let whole = blocks.whole;

    // Store the cumulative weight at the ends of cells of whole blocks.
    let per_cell = whole.len().div_ceil(CELLS).max(1);
    let (mut ends, mut cells, mut end) = ([0.0; CELLS], 0, 0.0);
    for cell in whole.chunks(per_cell) {
        end = cell.iter().fold(end, |end, block| end + block_sum::<LARGE>(block));
        ends[cells] = end;
        cells += 1;
    }

    // Invert by cell, block, and proposal.
    let sum_per_draw = unscaled::<LARGE>(sum) / u.len() as f64;
    out.reserve(u.len());
    for &u in u {
        let threshold = unit(u) * sum;
        let cell = ends[..cells].partition_point(|&end| end <= threshold);
        let mut below = if cell > 0 { ends[cell - 1] } else { 0.0 };
        let mut k = cell * per_cell;
        if per_cell > 1 {
            while let Some(block) = whole.get(k) {
                let end = below + block_sum::<LARGE>(block);
                if threshold < end {
                    break;
                }
                (k, below) = (k + 1, end);
            }
        }
        let k = k.min(whole.len());
        let index = match whole.get(k).or(blocks.rest.as_ref()) {
            Some(block) => k * BLOCK + search_block::<LARGE>(block, (threshold - below) as f32),
            None => weights.len(),
        };
        let index = if weights.get(index).is_some_and(|&w| clean(w) > 0.0) { Some(index) } else { last(weights) };
        out.extend(index.map(|i| draw(i, weights[i], sum_per_draw)));
    }
}

/// N draws by one uniform number: the proposals whose parts of the cumulative weight contain the thresholds (k+u)S/N, k
/// < N, in ascending order; scale = S/(N w_j) [Kitagawa 1996]. A proposal can be drawn several times if w_j > S/N.
/// O(M + N).
///
/// The N draws are evenly distributed over the ordered proposals. If neighbours are similar, the variance is lower than
/// with [`with_replacement`]. There is no formula and no guarantee for it, since the draws are not independent.
pub fn systematic(weights: &[f32], n: u32, u: f32, out: &mut Vec<Draw>) {
    out.clear();
    draw_evenly(weights, 0, n, u, out);
}

/// One draw per stratum of consecutive proposals; scale = S_k/w_j, exactly 1 for a stratum of one proposal [Talbot
/// 2005, Eq. 4.5]. `ends[k]` is the end (exclusive) of stratum k, and `u[k]` its uniform number. A stratum of weight 0
/// draws nothing. O(M).
///
/// With M strata the estimate is plain Monte Carlo, bit-identical if summed in the same order. Proposals after the last
/// end are in no stratum, and would be missing from the integral. With strata of equal numbers of independent
/// proposals, this is one draw from each of n independent sets [Talbot et al. 2005, Eq. 1].
pub fn stratified(weights: &[f32], ends: &[u32], u: &[f32], out: &mut Vec<Draw>) {
    out.clear();
    let mut begin = 0;
    for (&end, &u) in ends.iter().zip(u) {
        let end = (end as usize).clamp(begin, weights.len());
        draw_evenly(&weights[begin..end], begin, 1, u, out);
        begin = end;
    }
}

/// Appends the draws for the thresholds (k+u)S/n; `offset` is the index of the first of `weights`.
#[inline]
fn draw_evenly(weights: &[f32], offset: usize, n: u32, u: f32, out: &mut Vec<Draw>) {
    if n == 1 && weights.len() < BLOCK {
        out.extend(draw_of_few(weights, offset, u));
        return;
    }
    let blocks = Blocks::new(weights);
    let sum = blocks.sum::<false>();
    if sum.is_finite() {
        step_through::<false>(&blocks, sum, [n, offset as u32], u, out);
    } else {
        step_through::<true>(&blocks, blocks.sum::<true>(), [n, offset as u32], u, out);
    }
}

/// One draw from fewer proposals than a block, in f64. The sum of a single weight equals the weight, so its scale is 1.
#[inline]
fn draw_of_few(weights: &[f32], offset: usize, u: f32) -> Option<Draw> {
    let sum: f64 = weights.iter().map(|&w| f64::from(clean(w))).sum();
    let threshold = unit(u) * sum;
    let (mut chosen, mut end) = (None, 0.0);
    for (i, &w) in weights.iter().enumerate() {
        // The last proposal with a positive weight that begins at or below the threshold.
        chosen = if clean(w) > 0.0 && end <= threshold { Some(i) } else { chosen };
        end += f64::from(clean(w));
    }
    chosen.map(|i| draw(offset + i, weights[i], sum))
}

#[inline(always)]
fn step_through<const LARGE: bool>(blocks: &Blocks<'_>, sum: f64, [n, offset]: [u32; 2], u: f32, out: &mut Vec<Draw>) {
    if n == 0 || !(sum > 0.0) {
        return;
    }
    let (step, u) = (sum / f64::from(n), unit(u));
    let sum_per_draw = unscaled::<LARGE>(step);
    out.reserve(n as usize);

    // Traverse the blocks, and those that contain thresholds in detail.
    let (mut k, mut threshold, mut below) = (0, u * step, 0.0);
    for i in 0..=blocks.whole.len() {
        let Some(block) = blocks.whole.get(i).or(blocks.rest.as_ref()) else { break };
        let end = below + block_sum::<LARGE>(block);
        while threshold < end && k < n {
            let j = search_block::<LARGE>(block, (threshold - below) as f32);
            out.push(draw(offset as usize + i * BLOCK + j, block[j], sum_per_draw));
            k += 1;
            threshold = (f64::from(k) + u) * step;
        }
        below = end;
    }

    // With very many draws, the last threshold can round up to the sum.
    let of = blocks.whole.as_flattened();
    let rest = blocks.rest.as_slice().as_flattened();
    if k < n
        && let Some(i) = last(rest).map(|i| of.len() + i).or_else(|| last(of))
    {
        let weight = if i < of.len() { of[i] } else { rest[i - of.len()] };
        out.extend((k..n).map(|_| draw(offset as usize + i, weight, sum_per_draw)));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const EDGES: [f32; 4] = [0.0, 0.5, ONE_MINUS_EPSILON, f32::NAN];

    /// The draws of every function, with the same number u everywhere and n samples (or strata).
    fn all_ways(weights: &[f32], n: usize, u: f32) -> [Vec<Draw>; 3] {
        let mut draws = [Vec::new(), Vec::new(), Vec::new()];
        let us = vec![u; n];
        let ends: Vec<u32> = (1..=n).map(|k| (k * weights.len() / n.max(1)) as u32).collect();
        with_replacement(weights, &us, &mut draws[0]);
        systematic(weights, n as u32, u, &mut draws[1]);
        stratified(weights, &ends, &us, &mut draws[2]);
        draws
    }

    fn assert_valid(weights: &[f32], draws: &[Draw]) {
        for d in draws {
            let w = weights[d.index as usize];
            assert!(w > 0.0 && w.is_finite(), "drew weight {w} of {weights:?}");
            assert!(d.scale > 0.0 && d.scale.is_finite(), "{d:?}");
        }
    }

    #[test]
    fn nothing_is_drawn_where_there_is_no_weight_and_old_draws_are_gone() {
        let none: [&[f32]; 4] =
            [&[], &[0.0], &[0.0, -1.0, f32::NAN, f32::INFINITY, f32::NEG_INFINITY, -0.0], &[0.0; 700]];
        for weights in none {
            for u in EDGES {
                for n in [0, 1, 5] {
                    assert!(all_ways(weights, n, u).iter().all(Vec::is_empty), "{weights:?}");
                }
            }
        }
        let mut draws = vec![Draw { index: 7, scale: 1.0 }];
        systematic(&[], 1, 0.5, &mut draws);
        assert!(draws.is_empty());
    }

    #[test]
    fn one_proposal_of_weight_among_any_number_is_always_drawn() {
        for m in [1, 2, 7, 8, 9, 16, 511, 512, 513, 5000] {
            for at in [0, m / 2, m - 1] {
                for u in EDGES {
                    let mut weights = vec![0.0; m];
                    weights[at] = 3e-7;
                    let [a, b, ..] = all_ways(&weights, 3, u);
                    let draw = Draw { index: at as u32, scale: (1.0_f64 / 3.0) as f32 };
                    assert_eq!((a, b), (vec![draw; 3], vec![draw; 3]), "{m} {at} {u}");
                    let mut one = Vec::new();
                    stratified(&weights, &[m as u32], &[u], &mut one);
                    assert_eq!(one, [Draw { index: at as u32, scale: 1.0 }]);
                }
            }
        }
    }

    #[test]
    fn more_samples_than_proposals_repeat_them_evenly() {
        let mut draws = Vec::new();
        systematic(&[1.0, 2.0, 0.0, 1.0], 8, 0.5, &mut draws);
        let indices: Vec<u32> = draws.iter().map(|d| d.index).collect();
        assert_eq!(indices, [0, 0, 1, 1, 1, 1, 3, 3]);
        assert_eq!((draws[0].scale, draws[2].scale), (0.5, 0.25));
    }

    #[test]
    fn weights_of_any_size_keep_finite_scales_and_large_ones_win() {
        let weights =
            [1e-30, 1e30, f32::MAX, f32::MAX, 1e-30, f32::from_bits(1), f32::MAX, 1e30, f32::MAX, f32::MAX, 1.0];
        for n in [1, 2, 3, 11, 40] {
            for u in EDGES {
                all_ways(&weights, n, u).iter().for_each(|draws| assert_valid(&weights, draws));
            }
        }
        let mut draws = Vec::new();
        systematic(&weights, 5, 0.5, &mut draws);
        let indices: Vec<u32> = draws.iter().map(|d| d.index).collect();
        assert_eq!(indices, [2, 3, 6, 8, 9]);
        assert!(draws.iter().all(|d| (d.scale - 1.0).abs() < 1e-6), "{draws:?}");
        // A number of 0 selects the first proposal, however small: its scale is clamped to finite values.
        with_replacement(&[1e-30, 1e30], &[0.0], &mut draws);
        assert_eq!(draws, [Draw { index: 0, scale: f32::MAX }]);
    }

    #[test]
    fn strata_that_end_out_of_order_or_outside_draw_what_is_left() {
        let mut draws = Vec::new();
        stratified(&[1.0; 4], &[3, 2, 99], &[0.9; 3], &mut draws);
        assert_eq!(draws, [Draw { index: 2, scale: 3.0 }, Draw { index: 3, scale: 1.0 }]);
    }

    fn weights() -> impl Strategy<Value = Vec<f32>> {
        let weight = prop_oneof![3 => 0.0_f32..1.0, 1 => Just(0.0), 1 => 0.0_f32..30.0, 1 => (-30.0_f32..3.0).prop_map(f32::exp)];
        prop::collection::vec(weight, 1..60)
    }

    proptest! {
        /// Over a grid of u, each proposal is drawn N w/S times on average and ⌊⌋ or ⌈⌉ of that each time, and the
        /// scale is the inverse.
        #[test]
        fn systematic_draws_each_proposal_as_often_as_its_weight_says(weights in weights(), n in 1_u32..20) {
            const GRID: u32 = 2048;
            let sum: f64 = weights.iter().map(|&w| f64::from(w)).sum();
            prop_assume!(sum > 0.0);
            let (mut counts, mut draws) = (vec![0.0; weights.len()], Vec::new());
            for k in 0..GRID {
                systematic(&weights, n, (k as f32 + 0.5) / GRID as f32, &mut draws);
                prop_assert_eq!(draws.len(), n as usize);
                prop_assert!(draws.is_sorted_by_key(|d| d.index));
                let mut of_this = vec![0.0_f64; weights.len()];
                for d in &draws {
                    of_this[d.index as usize] += 1.0;
                    let expected = f64::from(n) * f64::from(weights[d.index as usize]) / sum;
                    prop_assert!((f64::from(d.scale) * expected - 1.0).abs() < 1e-5);
                }
                for (j, count) in of_this.iter().enumerate() {
                    let expected = f64::from(n) * f64::from(weights[j]) / sum;
                    prop_assert!((count - expected).abs() < 1.0 + 1e-5 * f64::from(n), "{} {}", count, expected);
                    counts[j] += count / f64::from(GRID);
                }
            }
            for (j, count) in counts.iter().enumerate() {
                let expected = f64::from(n) * f64::from(weights[j]) / sum;
                prop_assert!((count - expected).abs() < 2.5 / f64::from(GRID) + 1e-5 * f64::from(n), "{} {}", count, expected);
            }
        }

        /// Inversion: a grid of u draws each proposal in proportion to its weight, also with more than one block per
        /// cell.
        #[test]
        fn inversion_draws_each_proposal_in_proportion(weights in weights(), repeat in 1_usize..30) {
            const GRID: usize = 8192;
            let weights = weights.repeat(repeat);
            let sum: f64 = weights.iter().map(|&w| f64::from(w)).sum();
            prop_assume!(sum > 0.0);
            let u: Vec<f32> = (0..GRID).map(|k| (k as f32 + 0.5) / GRID as f32).collect();
            let (mut counts, mut draws) = (vec![0.0; weights.len()], Vec::new());
            with_replacement(&weights, &u, &mut draws);
            prop_assert_eq!(draws.len(), GRID);
            for d in &draws {
                counts[d.index as usize] += 1.0 / GRID as f64;
            }
            for (count, &w) in counts.iter().zip(&weights) {
                prop_assert!((count - f64::from(w) / sum).abs() < 1.5 / GRID as f64 + 1e-5, "{} {}", count, w);
            }
        }

        /// For any weights, only valid proposals are drawn, and all strata of positive weight draw.
        #[test]
        fn invalid_weights_are_never_drawn(
            bits in prop::collection::vec(any::<u32>(), 0..80), n in 0_usize..20, u in 0.0_f32..1.0,
        ) {
            let weights: Vec<f32> = bits.into_iter().map(f32::from_bits).collect();
            let valid = weights.iter().any(|&w| w > 0.0 && w.is_finite());
            for u in [u, 0.0, ONE_MINUS_EPSILON] {
                let draws = all_ways(&weights, n, u);
                draws.iter().for_each(|draws| assert_valid(&weights, draws));
                let expected = if valid { n } else { 0 };
                prop_assert_eq!((draws[0].len(), draws[1].len()), (expected, expected));
            }
        }

        /// With one set and one draw, all functions draw the same proposal.
        #[test]
        fn one_draw_is_the_same_in_all_ways(weights in weights(), u in 0.0_f32..1.0) {
            let [a, b, c] = all_ways(&weights, 1, u);
            let same = |x: &[Draw], y: &[Draw]| x.len() == y.len() && x.iter().zip(y).all(|(x, y)| x.index.abs_diff(y.index) <= 1);
            prop_assert!(same(&a, &b) && b == c);
        }
    }
}
