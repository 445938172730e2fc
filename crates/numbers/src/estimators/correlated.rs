//! Combined correlated and importance sampling [Szécsi, Sbert and Szirmay-Kalos 2004]: a linear combination of two
//! estimates from the same N samples of one density p.
//!
//! With y = f/p, a function g of known integral G and the control c = g/p − G, whose expectation is 0, the two
//! estimates are importance sampling ȳ and correlated sampling ȳ − c̄. Their combination (1 − λ) ȳ + λ (ȳ − c̄) = ȳ − λ
//! c̄ has the variance (V(y) − 2λ Cov(c, y) + λ² V(c))/N. Its minimum V(y)(1 − ρ²)/N is at λ = Cov(c, y)/V(c), where ρ
//! is their correlation. λ is estimated per channel: from the same samples (bias O(1/N)), or from the other half of
//! them (unbiased).

use super::mc;

/// Number of sums: n, and Σ c, Σ c², Σ c y, Σ y of three channels.
pub const SUMS: usize = 13;

/// Fraction of Σ c² below which the variance of the control is rounding, and λ = 0.
const CONSTANT: f64 = 1e-6;

/// Adds a sample of control g/p − G and value f/p. A non-finite sample counts as value and control 0.
#[inline]
pub fn add(sums: &mut [f32; SUMS], control: [f32; 3], y: [f32; 3]) {
    sums[0] += 1.0;
    if !control.iter().chain(&y).all(|v| v.is_finite()) {
        return;
    }
    for (sums, (c, y)) in sums[1..].chunks_exact_mut(4).zip(control.into_iter().zip(y)) {
        sums[0] += c;
        sums[1] += c * c;
        sums[2] += c * y;
        sums[3] += y;
    }
}

/// λ of each channel; 0 if the control is constant or anything is not finite.
pub fn weight(sums: &[f32; SUMS]) -> [f32; 3] {
    let n = f64::from(sums[0]);
    std::array::from_fn(|i| {
        let [c, cc, cy, y] = [1, 2, 3, 4].map(|k| f64::from(sums[4 * i + k]));
        let (covariance, variance) = (cy - c * y / n, cc - c * c / n);
        let lambda = (covariance / variance) as f32;
        if variance > CONSTANT * cc && lambda.is_finite() { lambda } else { 0.0 }
    })
}

/// ȳ − λ c̄; 0 without samples.
pub fn estimate(sums: &[f32; SUMS], lambda: [f32; 3]) -> [f32; 3] {
    let n = sums[0];
    if !(n > 0.0) {
        return [0.0; 3];
    }
    std::array::from_fn(|i| (sums[4 * i + 4] - lambda[i] * sums[4 * i + 1]) / n)
}

/// The estimate with λ from the same samples; bias O(1/N).
pub fn combined(sums: &[f32; SUMS]) -> [f32; 3] {
    estimate(sums, weight(sums))
}

/// The mean, weighted by numbers of samples, of two independent halves, each with λ from the other half. Unbiased.
pub fn crossfit(halves: [&[f32; SUMS]; 2]) -> [f32; 3] {
    mc::pooled(halves.map(|sums| sums[0]), [0, 1].map(|k| estimate(halves[k], weight(halves[1 - k]))))
}

#[cfg(test)]
mod tests {
    use super::*;
    use lumiris_test_support::random::{RngExt, pcg32};

    fn filled(n: usize, channel: impl Fn(f32) -> [f32; 3]) -> [f32; SUMS] {
        let (mut sums, mut stream) = ([0.0; SUMS], pcg32([3, 2, 1]));
        for _ in 0..n {
            let c = stream.random::<f32>() - 0.5;
            add(&mut sums, [c, 2.0 * c, 0.0], channel(c));
        }
        sums
    }

    #[test]
    fn what_the_control_explains_is_integrated_exactly() {
        let a = filled(9, |c| [1.0 + 3.0 * c, 2.0 - c, 5.0]);
        let b = filled(7, |c| [1.0 + 3.0 * c, 2.0 - c, 5.0]);
        for estimate in [combined(&a), crossfit([&a, &b])] {
            for (e, expected) in estimate.into_iter().zip([1.0, 2.0, 5.0]) {
                assert!((e - expected).abs() < 1e-5, "{estimate:?}");
            }
        }
        let lambda = weight(&a);
        assert!((lambda[0] - 3.0).abs() < 1e-4 && (lambda[1] + 0.5).abs() < 1e-4 && lambda[2] == 0.0);
    }

    #[test]
    fn nothing_one_sample_and_what_is_not_finite_have_no_weight() {
        assert_eq!(combined(&[0.0; SUMS]), [0.0; 3]);
        assert_eq!(crossfit([&[0.0; SUMS], &[0.0; SUMS]]), [0.0; 3]);
        let mut one = filled(1, |c| [c; 3]);
        assert_eq!(weight(&one), [0.0; 3]);
        add(&mut one, [f32::NAN, 1.0, 1.0], [1.0; 3]);
        assert!(combined(&one).iter().all(|e| e.is_finite()));
        let huge = filled(9, |c| [c * 1e38, c, c]);
        assert!(combined(&huge).iter().all(|e| e.is_finite()), "{:?}", combined(&huge));
    }
}
