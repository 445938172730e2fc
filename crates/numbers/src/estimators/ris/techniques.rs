//! RIS with several techniques [Talbot 2005, Section 4.6].
//!
//! **On proposals** (4.6.1), if all techniques sample one domain and their densities can be evaluated at every proposal:
//! m_i proposals of density p_i each, r_j = w_i(x_j)/(m_i p_i(x_j)), one target q̂, one drawing. Then c_j = f r_j and
//! w_j = q̂ r_j as ever. The thesis prints the weight as w_i q̂/p_i without 1/m_i, for an estimate that divides by M
//! afterwards; that is right only if all m_i are equal to M, and off by m_i/M otherwise.
//!
//! **On samples** (4.6.2), if the targets differ: for each technique a set of its own with m_i proposals of p_i, weights
//! q̂_i/(m_i p_i) and n_i draws; each drawn c_j = f/(m_i p_i) is multiplied by w_i(x) of n_i and the targets q̂_i(x), not the
//! densities p_i.

use crate::estimators::mis::{Heuristic, Technique};

/// The factor r = w_i/(m_i p_i) of a proposal that technique `i` drew; techniques hold m_k and p_k at the proposal.
/// 1/Σ m_k p_k for the balance heuristic. 0 for a density that is 0 or infinite (a delta takes no part).
#[inline]
pub fn proposal_factor(heuristic: Heuristic, i: usize, techniques: &[Technique]) -> f32 {
    let expected = techniques[i].n * techniques[i].p;
    if expected > 0.0 && expected.is_finite() { heuristic.weight_of(i, techniques) / expected } else { 0.0 }
}

/// The weight w_i of a draw of set `i`; techniques hold the numbers of draws n_k and the targets q̂_k at the sample (as
/// [`Technique::p`], need not integrate to 1).
///
/// Unbiased for any targets that are functions of the sample alone and of which Σ n_k q̂_k > 0 where f ≠ 0. Targets
/// normalised by the sums of the drawn proposals would not be: the weights of one point must be the same in every set.
#[inline]
pub fn sample_weight(heuristic: Heuristic, i: usize, targets: &[Technique]) -> f32 {
    heuristic.weight_of(i, targets)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn factor_of_the_balance_heuristic_is_one_over_the_mixture_and_deltas_take_no_part() {
        let t = [Technique { n: 3.0, p: 0.5 }, Technique { n: 2.0, p: 2.0 }, Technique { n: 7.0, p: 0.0 }];
        for i in 0..2 {
            assert!((proposal_factor(Heuristic::Balance, i, &t) - 1.0 / 5.5).abs() < 1e-7);
        }
        for h in [Heuristic::Balance, Heuristic::Power, Heuristic::Maximum] {
            assert_eq!(proposal_factor(h, 2, &t), 0.0);
            assert_eq!(proposal_factor(h, 0, &[Technique { n: 1.0, p: f32::INFINITY }]), 0.0);
            assert_eq!(proposal_factor(h, 0, &[Technique { n: 1.0, p: f32::NAN }]), 0.0);
        }
        assert!((sample_weight(Heuristic::Power, 0, &t) - Heuristic::Power.weight(t[0], t[1])).abs() < 1e-7);
    }
}
