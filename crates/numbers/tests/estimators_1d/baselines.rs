//! Baseline estimators, used only for comparison, each with its bias.
//!
//! | function | estimate | bias |
//! |---|---|---|
//! | [`weighted`] | ∫g · Σ f/p / Σ g/p | O(1/M), consistent |
//! | [`defensive_pdf`] | a sampling density α p₀ + (1 − α) p₁ | none |
//! | [`bidirectional`] | unshadowed colour times mean visibility | does not vanish for colours |

use lumiris_numbers::math::ONE_MINUS_EPSILON;

/// Weighted importance sampling [Powell and Swann 1966; Bekaert et al. 2000]: ∫g · Σ c_j / Σ w_j of all M proposals,
/// with c_j = f/(M p), w_j = g/(M p) and `integral` = ∫g known; 0 if no proposal has weight.
///
/// Biased, by (I V(g/p)/∫g − Cov(f/p, g/p))/(M ∫g) to the first order in 1/M, where I = ∫f; consistent.
pub(crate) fn weighted(contributions: &[f32], weights: &[f32], integral: f32) -> f32 {
    let sum = |values: &[f32]| values.iter().map(|&x| f64::from(x)).sum::<f64>();
    let total = sum(weights);
    if total > 0.0 { (f64::from(integral) * sum(contributions) / total) as f32 } else { 0.0 }
}

/// Defensive mixture [Hesterberg 1995]: the density α p₀ + (1 − α) p₁ of sampling p₀ with probability `alpha` and p₁
/// otherwise. f/p is then at most f/(α p₀) where p₁ misses f. Unbiased.
#[inline]
pub(crate) fn defensive_pdf(alpha: f32, p0: f32, p1: f32) -> f32 {
    alpha * p0 + (1.0 - alpha) * p1
}

/// Choice of the defensive mixture: true for p₀, and the number `u`, remapped to be uniform again.
#[inline]
pub(crate) fn defensive_choice(alpha: f32, u: f32) -> (bool, f32) {
    if u < alpha { (true, u / alpha) } else { (false, ((u - alpha) / (1.0 - alpha)).min(ONE_MINUS_EPSILON)) }
}

/// Bidirectional importance sampling by resampling [Burke et al. 2005]: the unshadowed colour Σ_j c_j of all proposals
/// times the mean of the visibilities of the samples, which are drawn with replacement by the luminance q̂ of the
/// colour.
///
/// Biased in a channel by E[(1/S) Σ_j w_j v_j Σ_j c_j] − ∫f, where v is the visibility: zero if the channel is
/// proportional to q̂ (range of one dimension), else it tends to C E_q(v) − ∫f for M → ∞, C being the unshadowed
/// integral [Talbot 2005, Section 4.7].
pub(crate) fn bidirectional(unshadowed: [f32; 3], visibilities: &[f32]) -> [f32; 3] {
    let visible = visibilities.iter().map(|&v| f64::from(v)).sum::<f64>() / visibilities.len().max(1) as f64;
    unshadowed.map(|c| (f64::from(c) * visible) as f32)
}

#[test]
fn no_proposals_and_no_samples_are_zero() {
    assert_eq!(weighted(&[], &[], 2.0), 0.0);
    assert_eq!(weighted(&[1.0], &[0.0], 2.0), 0.0);
    assert_eq!(bidirectional([1.0, 2.0, 3.0], &[]), [0.0; 3]);
}

#[test]
fn weighted_is_exact_if_g_is_proportional_to_f() {
    assert!((weighted(&[0.2, 0.6, 4.0], &[0.1, 0.3, 2.0], 1.5) - 3.0).abs() < 1e-6);
}

#[test]
fn defensive_choice_keeps_numbers_uniform_for_any_alpha() {
    for alpha in [0.0, 0.3, 1.0] {
        for u in [0.0, 0.29, 0.31, ONE_MINUS_EPSILON] {
            let (safe, v) = defensive_choice(alpha, u);
            assert_eq!(safe, u < alpha);
            assert!((0.0..1.0).contains(&v), "{alpha} {u} {v}");
        }
    }
    assert_eq!(defensive_pdf(0.25, 2.0, 4.0), 3.5);
}
