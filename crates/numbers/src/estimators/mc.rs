//! Plain Monte Carlo: E[f/p] = ∫ f for any density p that is positive where f is not zero. Unbiased.

/// The weight 1/(n·p) of one of `n` samples of density `p`; 0 if the sample cannot have been drawn (p ≤ 0, NaN).
#[inline]
pub fn weight(n: f32, p: f32) -> f32 {
    if p > 0.0 { 1.0 / (n * p) } else { 0.0 }
}
