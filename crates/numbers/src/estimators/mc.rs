//! Plain Monte Carlo: E[f/p] = ∫ f for any density p that is positive where f is not zero. Unbiased.

/// The factor 1/(n·p) of f for one of `n` samples of density `p`; 0 for densities that are impossible for a sample
/// (p ≤ 0, NaN).
#[inline]
pub fn factor(n: f32, p: f32) -> f32 {
    if p > 0.0 { 1.0 / (n * p) } else { 0.0 }
}

/// The mean of two estimates of the same integral, weighted by their numbers of samples `n`; 0 without samples.
#[inline]
pub fn pooled(n: [f32; 2], [a, b]: [[f32; 3]; 2]) -> [f32; 3] {
    let sum = n[0] + n[1];
    if sum > 0.0 { [0, 1, 2].map(|i| (n[0] * a[i] + n[1] * b[i]) / sum) } else { [0.0; 3] }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn factors_and_pools_have_known_values() {
        assert_eq!(
            (factor(4.0, 0.5), factor(4.0, 0.0), factor(4.0, -1.0), factor(4.0, f32::NAN)),
            (0.5, 0.0, 0.0, 0.0)
        );
        let [a, b] = [[1.0, 2.0, 3.0], [5.0, 10.0, -1.0]];
        assert_eq!(pooled([3.0, 1.0], [a, b]), [2.0, 4.0, 2.0]);
        assert_eq!((pooled([2.0, 0.0], [a, b]), pooled([0.0, 0.0], [a, b])), (a, [0.0; 3]));
    }
}
