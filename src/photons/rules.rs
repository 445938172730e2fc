//! Which photons are stored [Keller and Wald 2000, §2.3].
//!
//! More photon paths are traced than the global map needs, so that the caustic map is finer: caustic photons are stored
//! with probability p(x), those of the global map with q·p(x), and their powers are divided by it.

use strum::EnumIter;

/// How the global map is thinned by the ratio q. All rules give the same maps on average.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, EnumIter)]
pub enum CausticRule {
    /// One random number: ξ < q·p(x).
    OneRule,
    /// Two random numbers: ξ₁ < q, and only then ξ₂ < p(x), which is expensive.
    TwoTests,
    /// The first ⌊qN⌋ of N photon paths fill both maps, the others only the caustic map.
    #[default]
    FirstPaths,
}

impl CausticRule {
    /// Whether a photon of the global map is stored, and the factor of its power. `fills_global` is about its
    /// photon path; `p` is only called where the cheap tests pass.
    #[inline]
    pub fn global(self, q: f32, fills_global: bool, xi: [f32; 2], p: impl FnOnce() -> f32) -> Option<f32> {
        match self {
            CausticRule::OneRule => {
                // p ≤ 1
                if xi[0] >= q {
                    return None;
                }
                let qp = q * p();
                (xi[0] < qp).then(|| 1.0 / qp)
            }
            CausticRule::TwoTests => {
                if xi[0] >= q {
                    return None;
                }
                caustic(xi[1], p()).map(|factor| factor / q)
            }
            CausticRule::FirstPaths => {
                if fills_global {
                    caustic(xi[0], p())
                } else {
                    None
                }
            }
        }
    }
}

/// Whether a photon of the caustic map is stored, and the factor of its power.
#[inline]
pub fn caustic(xi: f32, p: f32) -> Option<f32> {
    (xi < p).then(|| 1.0 / p)
}

#[cfg(test)]
mod tests {
    use super::*;
    use lumiris_numbers::estimators::stats::{Welford, t_test};
    use lumiris_test_support::random::{RngExt, pcg32};
    use strum::IntoEnumIterator;

    #[test]
    fn all_rules_keep_the_power_on_average_and_ask_for_p_no_more_than_they_must() {
        let (q, p, count) = (0.25_f32, 0.4_f32, 100_000);
        for rule in CausticRule::iter() {
            let mut stream = pcg32([4, 4, rule as u32]);
            let (mut power, mut asked) = (Welford::default(), 0);
            for i in 0..count {
                let xi = stream.random::<[f32; 2]>();
                let is_first = (i as f32) < q * count as f32;
                let factor = rule.global(q, is_first, xi, || {
                    asked += 1;
                    p
                });
                // The first ⌊qN⌋ photon paths are divided by their number, not by N
                let share = if rule == CausticRule::FirstPaths { 1.0 / q } else { 1.0 };
                power.add(f64::from(factor.unwrap_or(0.0) * share));
            }
            assert!(t_test(&power, 1.0).p_value > 1e-4, "{rule:?} {}", power.mean());
            assert!((f64::from(asked) / f64::from(count) - f64::from(q)).abs() < 0.01, "{rule:?} {asked}");
        }
    }

    #[test]
    fn certain_photons_are_always_stored_and_impossible_ones_never() {
        assert_eq!(caustic(lumiris_numbers::math::ONE_MINUS_EPSILON, 1.0), Some(1.0));
        assert_eq!(caustic(0.0, 0.0), None);
        for rule in CausticRule::iter() {
            assert_eq!(rule.global(1.0, true, [0.0; 2], || 0.0), None);
            assert_eq!(rule.global(1.0, true, [lumiris_numbers::math::ONE_MINUS_EPSILON; 2], || 1.0), Some(1.0));
        }
    }
}
