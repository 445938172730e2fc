//! Strata of the proposals for [`stratified`](super::stratified): consecutive proposals, as ends (exclusive).
//!
//! Any strata are unbiased, also strata that depend on the weights. Two of one stratum instead of the stratum never raise
//! the variance for f ≥ 0, so both functions make as many strata as they may. Consecutive proposals are neighbours
//! if they were made from stratified numbers, and strata of neighbours have little variance of f/q̂
//! [Talbot 2005, Section 4.5.2, heuristic 2].

use super::draw::clean;

/// min(n, m) strata of equal numbers of the `m` proposals; numbers differ by at most one [Talbot 2005, Section 4.5.2.1].
///
/// For f/q that varies less than f/p, the variance is at most that of plain Monte Carlo with n samples.
pub fn equal_proposals(m: usize, n: usize, ends: &mut Vec<u32>) {
    ends.clear();
    let n = n.min(m);
    ends.extend((1..=n).map(|k| (k * m / n) as u32));
}

/// At most `n` strata of nearly equal weight; `u[k]` decides about end k, so `u.len()` ≥ n − 1 [Talbot 2005, Section 4.5.2.2].
///
/// Proposals join the open stratum in order as long as its weight stays within the target w_max. The one that crosses the
/// target joins it with probability (w_max − w_total)/w(x) and otherwise opens the next; the expected weight
/// w_total + w(x)·(w_max − w_total)/w(x) of the stratum is then w_max. The thesis prints the complement of this
/// probability, (w_total + w(x) − w_max)/w(x), which is 1 or more once a stratum is past its target and would never end it.
///
/// The target is the weight that is left over the strata that are left, not the fixed Σw/n of the thesis: after one heavy
/// proposal the others still fill n − 1 strata. If no more proposals of positive weight are left than strata, each
/// gets its own, so that there are exactly min(n, proposals of positive weight) strata (one if there are none).
pub fn equal_weights(weights: &[f32], n: usize, u: &[f32], ends: &mut Vec<u32>) {
    ends.clear();
    if weights.is_empty() || n == 0 {
        return;
    }
    let mut weight_left: f64 = weights.iter().map(|&w| f64::from(clean(w))).sum();
    let mut proposals_left = weights.iter().filter(|&&w| clean(w) > 0.0).count();
    let mut strata_left = n;
    let (mut weight, mut target) = (0.0, weight_left / n as f64);

    for (j, &w) in weights.iter().enumerate() {
        let w = f64::from(clean(w));
        if w == 0.0 {
            continue;
        }
        if weight > 0.0 && strata_left > 1 {
            let u = u.get(ends.len()).map_or(0.5, |&u| f64::from(u));
            let joins = weight + w <= target || u * w < target - weight;
            if !joins || proposals_left < strata_left {
                ends.push(j as u32);
                weight_left -= weight;
                strata_left -= 1;
                (weight, target) = (0.0, weight_left / strata_left as f64);
            }
        }
        weight += w;
        proposals_left -= 1;
    }
    ends.push(weights.len() as u32);
}
