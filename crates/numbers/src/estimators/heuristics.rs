//! Multiple importance sampling [Veach and Guibas 1995].
//!
//! With n_i samples x_ij of density p_i for each technique i, the estimate is
//! Σ_i (1/n_i) Σ_j w_i(x_ij) f(x_ij)/p_i(x_ij), and it is unbiased if Σ_i w_i = 1 wherever f ≠ 0 and w_i = 0 where
//! p_i = 0. The deterministic mixture is the balance heuristic.
//!
//! The renderer applies these weights in `src/direct/candidates.rs`, `src/direct/columns` and
//! `src/integrators/path_state.rs`; see `src/direct/estimators/mis.rs`.

use super::mc;
use crate::math::number::Number;
use strum::{EnumString, IntoStaticStr, VariantNames};

/// Heuristics for the weights of techniques.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, EnumString, IntoStaticStr, VariantNames)]
#[strum(serialize_all = "kebab-case")]
pub enum Heuristic {
    /// w_i = n_i p_i / Σ n_k p_k.
    Balance,
    /// w_i = (n_i p_i)² / Σ (n_k p_k)².
    #[default]
    Power,
    /// w_i = 1 if n_i p_i is maximal, else 0; ties share, since rounding must not decide them.
    Maximum,
}

/// A technique at a sample: its number of samples, and its density.
#[derive(Clone, Copy, Debug)]
pub struct Technique {
    /// Number of samples n_i; may be the expected number of a random choice.
    pub n: f32,
    /// Density p_i of the technique at the sample. May be infinite (a delta).
    pub p: f32,
}

/// Ratio of two densities above which the maximum heuristic treats them as equal: the same density, computed by
/// different techniques, differs by rounding. The decision depends only on the two values, not on their order, so that
/// both techniques agree about ties.
const TIE: f32 = 0.999;

impl Heuristic {
    /// Weight of technique `a` against `b` at a sample drawn by `a`. In 0..=1; finite for any densities.
    #[inline]
    pub fn weight(self, a: Technique, b: Technique) -> f32 {
        let (x, y) = (a.n * a.p, b.n * b.p);
        if x > 0.0 { self.weight_of_expected(x, y) } else { 0.0 }
    }

    /// [`weight`](Self::weight) for expected numbers of samples x = n_a p_a > 0 and y = n_b p_b, for one sample or for
    /// lanes.
    #[inline(always)]
    pub fn weight_of_expected<N: Number>(self, x: N, y: N) -> N {
        let (zero, half, one, max) = (x.constant(0.0), x.constant(0.5), x.constant(1.0), x.constant(f32::MAX));
        // The ratio y/x instead of the products, so that neither squares overflow nor inf/inf occurs
        let ratio = y / x;
        let weight = match self {
            Heuristic::Balance => one / (one + ratio),
            Heuristic::Power => one / (one + ratio * ratio),
            Heuristic::Maximum => {
                let larger = x.if_above(y, one, zero);
                x.lesser(y).if_at_least(x.greater(y) * x.constant(TIE), half, larger)
            }
        };
        let weight = y.if_above(zero, weight, one);
        // Infinite densities share
        x.if_above(max, y.if_above(max, half, weight), weight)
    }

    /// The factor w/(n·p) of f in the estimate over the samples of both techniques, for a sample drawn by `a`; 0 if `a`
    /// cannot have drawn it.
    #[inline]
    pub fn factor(self, a: Technique, b: Technique) -> f32 {
        self.weight(a, b) * mc::factor(a.n, a.p)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const ALL: [Heuristic; 3] = [Heuristic::Balance, Heuristic::Power, Heuristic::Maximum];

    #[test]
    fn weights_of_two_techniques_sum_to_one() {
        let values = [1e-30, 0.3, 0.7, 5.0, 1e30];
        for h in ALL {
            for p in values {
                for q in values {
                    let (a, b) = (Technique { n: 1.0, p }, Technique { n: 1.0, p: q });
                    assert!((h.weight(a, b) + h.weight(b, a) - 1.0).abs() < 1e-6, "{h:?} {p} {q}");
                }
            }
        }
    }

    #[test]
    fn weights_of_two_techniques_sum_to_one_at_the_edges_of_a_tie() {
        // Weight 0.5 although y/x was 1.0010005: the reciprocal counted as a tie
        for x in [1e-40, 3e-7, 0.3, 1.0, 7.0, 3e38_f32] {
            for of_tie in [0.998_999, 0.999, 0.999_000_1, 1.0, 1.001, 1.001_000_5, 1.001_001] {
                for ulps in -40_i32..=40 {
                    let y = f32::from_bits((x * of_tie).to_bits().wrapping_add_signed(ulps));
                    let (a, b) = (Technique { n: 1.0, p: x }, Technique { n: 1.0, p: y });
                    let (w, v) = (Heuristic::Maximum.weight(a, b), Heuristic::Maximum.weight(b, a));
                    assert_eq!(w + v, 1.0, "{x} {y}: {w} {v}");
                }
            }
        }
        let weight = |y| Heuristic::Maximum.weight(Technique { n: 1.0, p: 1.0 }, Technique { n: 1.0, p: y });
        assert_eq!([0.998, 0.9995, 1.0005, 1.002].map(weight), [1.0, 0.5, 0.5, 0.0]);
    }

    #[test]
    fn weights_are_finite_for_zero_and_infinite_densities() {
        let values = [0.0, 1.0, f32::INFINITY, f32::NAN];
        for h in ALL {
            for p in values {
                for q in values {
                    let w = h.weight(Technique { n: 1.0, p }, Technique { n: 2.0, p: q });
                    assert!((0.0..=1.0).contains(&w), "{h:?} {p} {q}: {w}");
                }
            }
        }
    }
}
