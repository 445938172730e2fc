//! Multiple importance sampling [Veach and Guibas 1995].
//!
//! With n_i samples x_ij of density p_i for each technique i, the estimate is
//! Σ_i (1/n_i) Σ_j w_i(x_ij) f(x_ij)/p_i(x_ij), and it is unbiased if Σ_i w_i = 1 wherever f ≠ 0 and w_i = 0 where
//! p_i = 0. The deterministic mixture is the balance heuristic.

use strum::{EnumString, IntoStaticStr, VariantNames};

/// How the weights of techniques are chosen.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, EnumString, IntoStaticStr, VariantNames)]
#[strum(serialize_all = "kebab-case")]
pub enum Heuristic {
    /// w_i = n_i p_i / Σ n_k p_k.
    Balance,
    /// w_i = (n_i p_i)² / Σ (n_k p_k)².
    #[default]
    Power,
    /// w_i = 1 where n_i p_i is largest, else 0; ties, which rounding must not decide, share.
    Maximum,
}

/// A technique at a sample: how many samples it has, and its density there.
#[derive(Clone, Copy, Debug)]
pub struct Technique {
    /// Number of samples n_i; may be the expected number of a random choice.
    pub n: f32,
    /// Density p_i of the technique at the sample. May be infinite (a delta).
    pub p: f32,
}

/// Relative difference of densities within which the maximum heuristic takes them for equal: the same density, computed on
/// the way of one technique and of the other, differs by rounding.
const TIE: f32 = 1e-3;

impl Heuristic {
    /// Weight of technique `a` against `b` at a sample that `a` drew. In 0..=1; finite for any densities.
    #[inline]
    pub fn weight(self, a: Technique, b: Technique) -> f32 {
        let (x, y) = (a.n * a.p, b.n * b.p);
        // The ratio y/x, and not the products, so that neither squares overflow nor inf/inf appears.
        if !(x > 0.0) {
            return 0.0;
        }
        if !(y > 0.0) || x.is_infinite() {
            return if x.is_infinite() && y.is_infinite() { 0.5 } else { 1.0 };
        }
        let ratio = y / x;
        match self {
            Heuristic::Balance => 1.0 / (1.0 + ratio),
            Heuristic::Power => 1.0 / (1.0 + ratio * ratio),
            Heuristic::Maximum if (ratio - 1.0).abs() <= TIE => 0.5,
            Heuristic::Maximum => f32::from(u8::from(ratio < 1.0)),
        }
    }

    /// Weight of technique `i` among any number of `techniques` at a sample that it drew. In 0..=1; finite for any
    /// densities. Infinite densities share.
    pub fn weight_of(self, i: usize, techniques: &[Technique]) -> f32 {
        let expected = |t: &Technique| if t.n * t.p > 0.0 { t.n * t.p } else { 0.0 };
        let x = expected(&techniques[i]);
        let most = techniques.iter().map(expected).fold(0.0, f32::max);
        if x == 0.0 {
            return 0.0;
        }
        if most.is_infinite() {
            let infinite = techniques.iter().filter(|t| expected(t).is_infinite()).count();
            return if x.is_infinite() { 1.0 / infinite as f32 } else { 0.0 };
        }

        // Relative to the largest, so that neither squares overflow nor inf/inf appears.
        let relative = |y: f32| match self {
            Heuristic::Balance => y / most,
            Heuristic::Power => (y / most) * (y / most),
            Heuristic::Maximum => f32::from(u8::from(y / most >= 1.0 - TIE)),
        };
        relative(x) / techniques.iter().map(|t| relative(expected(t))).sum::<f32>()
    }
}

/// Numbers of samples n_j of a deterministic mixture of weights `alpha`: Σ n_j = `n`, and each is as near to n α_j as whole
/// numbers can be, but at least 1 where α_j > 0, if `n` suffices for that; else those of the largest α_j have one each.
///
/// The mixture is that of the weights n_j/n, which are α_j only if all n α_j are whole: densities must be weighted by what is
/// returned here, or the estimate is biased. Equal claims are settled in favour of the earlier component.
pub fn allot(alpha: &[f32], n: u32, counts: &mut [u32]) {
    let counts = &mut counts[..alpha.len()];
    counts.fill(0);
    let total: f64 = alpha.iter().filter(|a| **a > 0.0).map(|a| f64::from(*a)).sum();
    for _ in 0..n {
        // Who has none comes first, by weight; then who is farthest below its share.
        let claim = |j: usize, count: u32| match (alpha[j] > 0.0, count) {
            (false, _) => f64::NEG_INFINITY,
            (true, 0) => f64::from(n) + f64::from(alpha[j]) / total,
            (true, count) => f64::from(n) * f64::from(alpha[j]) / total - f64::from(count),
        };
        let best = (0..alpha.len()).reduce(|b, j| if claim(j, counts[j]) > claim(b, counts[b]) { j } else { b });
        match best {
            Some(best) if alpha[best] > 0.0 => counts[best] += 1,
            _ => return,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn counts_of_a_mixture_are_its_shares_and_nobody_with_a_share_has_none() {
        let counts = |alpha: &[f32], n| {
            let mut counts = vec![9; alpha.len()];
            allot(alpha, n, &mut counts);
            counts
        };
        assert_eq!(counts(&[0.5, 0.25, 0.25], 8), [4, 2, 2]);
        assert_eq!(counts(&[0.5, 0.25, 0.25], 64), [32, 16, 16]);
        assert_eq!(counts(&[0.5, 0.25, 0.25], 3), [1, 1, 1]);
        assert_eq!(counts(&[0.25, 0.5, 0.25], 2), [1, 1, 0]);
        assert_eq!(counts(&[0.9, 0.05, 0.05], 10), [8, 1, 1]);
        assert_eq!(counts(&[1.0, 0.0], 5), [5, 0]);
        assert_eq!(counts(&[0.3, 0.2, 0.25, 0.25], 64), [19, 13, 16, 16]);
        assert_eq!((counts(&[0.0], 4), counts(&[], 4)), (vec![0], vec![]));
    }

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
    fn weight_of_two_techniques_is_the_weight_and_any_number_sum_to_one() {
        let values = [0.0, 1e-30, 0.3, 0.7, 5.0, 1e30, f32::INFINITY];
        for h in ALL {
            for p in values {
                for q in values {
                    let two = [Technique { n: 1.0, p }, Technique { n: 2.0, p: q }];
                    assert!((h.weight_of(0, &two) - h.weight(two[0], two[1])).abs() < 1e-6, "{h:?} {p} {q}");
                    let three = [two[0], two[1], Technique { n: 3.0, p: 0.2 }];
                    let sum: f32 = (0..3).map(|i| h.weight_of(i, &three)).sum();
                    assert!((sum - 1.0).abs() < 1e-6, "{h:?} {p} {q}: {sum}");
                }
            }
        }
        let none = [Technique { n: 1.0, p: f32::NAN }, Technique { n: 0.0, p: f32::INFINITY }];
        assert!(ALL.iter().all(|h| h.weight_of(0, &none) == 0.0 && h.weight_of(1, &none) == 0.0));
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
