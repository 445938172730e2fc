//! Multiple importance sampling [Veach and Guibas 1995].
//!
//! With n_i samples x_ij of density p_i for each technique i, the estimate is
//! Σ_i (1/n_i) Σ_j w_i(x_ij) f(x_ij)/p_i(x_ij), and it is unbiased if Σ_i w_i = 1 wherever f ≠ 0 and w_i = 0 where
//! p_i = 0. The deterministic mixture is the balance heuristic.

/// How the weights of techniques are chosen.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
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
    /// The name on the command line and in metadata.
    pub fn name(self) -> &'static str {
        match self {
            Heuristic::Balance => "balance",
            Heuristic::Power => "power",
            Heuristic::Maximum => "maximum",
        }
    }

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
