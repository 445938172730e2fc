//! Significance of the difference of two images: tests whether it can be noise.
//!
//! Per value (pixel and channel) z = (x − r) / √(v_x + v_r) with the variances of the two means. If both images have
//! the same expectation, the means are normal, and the variances are correct, z is standard normal. Three summaries:
//! - the fraction of values with |z| > 3; 0.27 % are expected;
//! - the family-wise test: the smallest p-value p of n values rejects at the level α if it is below the Šidák level
//!   1 − (1 − α)^(1/n). It is reported as 1 − (1 − p)^n. Channels of a pixel are not independent, which makes the test
//!   conservative (Šidák's inequality);
//! - χ² = Σ z² per channel with one degree of freedom per pixel. Reported is the upper tail, the smallest of three
//!   channels, again by Šidák. It detects small deviations in many pixels.
//!
//! The assumptions are violated by:
//! - variances estimated from few samples: z has the tails of Student's t, and if bright samples are rare, the variance
//!   is low exactly where the mean is low;
//! - variances of stratified samples computed as if the samples were independent: they are too large, z is too small,
//!   and the tests miss differences;
//! - neighbouring pixels that share samples.

use super::pixels::{Pixel, finite_pairs};
use lumiris_numbers::estimators::stats::{chi_squared_tail, z_test};

/// Result of [`significance`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Significance {
    /// Number of tested values: finite, with a variance or a difference.
    pub values: usize,
    /// Fraction of the values with |z| > 3.
    pub beyond: f64,
    /// The largest |z|; infinite if values without variance differ.
    pub max_z: f64,
    /// Probability that the largest |z| of `values` values is at least `max_z`.
    pub family_p: f64,
    /// Mean of z² over the finite z; the expected value is 1.
    pub mean_square: f64,
    /// Probability of a χ² at least this large in one of the three channels.
    pub chi_squared_p: f64,
    /// Number of values that differ although neither has a variance. Their z is infinite. They count in all results
    /// except χ².
    pub certain: usize,
}

/// Relative rounding error of values computed and stored in f32.
pub const F32_ROUNDING: f64 = 1.0 / (1_u32 << 22) as f64;
/// Relative rounding error of values stored as 16-bit floats.
pub const HALF_ROUNDING: f64 = 1.0 / (1_u32 << 11) as f64;

/// z of a value; `None` if there is neither a variance nor a difference beyond rounding. `rounding` is the relative
/// rounding error of the coarser file.
fn z_of(x: f64, r: f64, variance: f64, rounding: f64) -> Option<f64> {
    let difference = x - r;
    let max = rounding * x.abs().max(r.abs());
    if variance > 0.0 {
        // The rounding error is uniform over ± `max`
        return Some(difference / (variance + max * max / 3.0).sqrt());
    }
    (difference.abs() > 2.0 * max).then_some(difference.signum() * f64::INFINITY)
}

/// 1 − (1 − p)^n: the probability that the smallest of `n` independent p-values is at most `p`; 1 if there are none.
fn p_of_minimum(p: f64, n: usize) -> f64 {
    if n == 0 {
        return 1.0;
    }
    -((-p).ln_1p() * n as f64).exp_m1()
}

/// Tests all values of an image. `variance` holds v_x + v_r per pixel; values without a finite variance are excluded.
/// `rounding` is [`F32_ROUNDING`] or [`HALF_ROUNDING`]. Panics if the lengths differ.
pub fn significance(image: &[Pixel], reference: &[Pixel], variance: &[Pixel], rounding: f64) -> Significance {
    // Accumulate z of all values
    assert_eq!(image.len(), variance.len(), "a variance per pixel");
    let (mut beyond, mut certain, mut max_z) = (0_usize, 0_usize, 0.0_f64);
    let (mut squares, mut dof) = ([0.0; 3], [0_usize; 3]);
    for (i, x, r) in finite_pairs(image, reference) {
        for c in 0..3 {
            let v = f64::from(variance[i][c]);
            let Some(z) = v.is_finite().then(|| z_of(x[c], r[c], v, rounding)).flatten() else { continue };
            beyond += usize::from(z.abs() > 3.0);
            max_z = max_z.max(z.abs());
            if z.is_finite() {
                squares[c] += z * z;
                dof[c] += 1;
            } else {
                certain += 1;
            }
        }
    }

    // p-values of the maximum and of χ²
    let finite: usize = dof.iter().sum();
    let values = finite + certain;
    let p_channels = (0..3).map(|c| chi_squared_tail(squares[c], dof[c]));
    Significance {
        values,
        beyond: beyond as f64 / values.max(1) as f64,
        max_z,
        family_p: p_of_minimum(z_test(max_z, 0.0, 1.0).p_value, values),
        mean_square: squares.iter().sum::<f64>() / finite.max(1) as f64,
        chi_squared_p: p_of_minimum(p_channels.fold(1.0, f64::min), 3),
        certain,
    }
}

/// The z of largest magnitude among the channels of each pixel; NaN for excluded pixels, 0 without variance and
/// difference. Panics if the lengths differ.
pub fn z_map(image: &[Pixel], reference: &[Pixel], variance: &[Pixel], rounding: f64) -> Vec<f32> {
    assert_eq!(image.len(), variance.len(), "a variance per pixel");
    let mut map = vec![f32::NAN; image.len()];
    for (i, x, r) in finite_pairs(image, reference) {
        let v = variance[i].map(f64::from);
        if v.iter().all(|v| v.is_finite()) {
            let zs = (0..3).map(|c| z_of(x[c], r[c], v[c], rounding).unwrap_or(0.0));
            map[i] = zs.fold(0.0_f64, |a, b| if b.abs() > a.abs() { b } else { a }) as f32;
        }
    }
    map
}

#[cfg(test)]
mod tests {
    use super::*;
    use lumiris_numbers::estimators::stats::sidak;

    #[test]
    fn values_are_those_by_hand() {
        let image = [[1.0, 4.0, 1.0], [1.5, 1.0, 1.0]];
        let reference = [[1.0; 3], [1.0; 3]];
        let variance = [[1.0, 0.25, 1.0], [0.25, 4.0, 0.0]];
        // z: 0 6 0 | 1 0 –
        let s = significance(&image, &reference, &variance, F32_ROUNDING);
        assert_eq!((s.values, s.beyond, s.certain), (5, 0.2, 0));
        // The rounding of f32 adds almost nothing to the variance
        assert!((s.max_z - 6.0).abs() < 1e-9);
        assert!((s.mean_square - 37.0 / 5.0).abs() < 1e-9);
        // Two-sided p of 6σ: 1.9732e-9, the smallest of five
        assert!((s.family_p / (5.0 * 1.973_175e-9) - 1.0).abs() < 1e-5, "{s:?}");
        // χ² = 36 with 2 degrees of freedom: e^-18, the smallest of three
        assert!((s.chi_squared_p / (3.0 * (-18.0_f64).exp()) - 1.0).abs() < 1e-6, "{s:?}");
        assert_eq!(z_map(&image, &reference, &variance, F32_ROUNDING), [6.0, 1.0]);
    }

    #[test]
    fn differences_without_variance_are_certain_and_rounding_is_none() {
        let s = significance(&[[2.0, 1.0, 1.0 + 1e-7]], &[[1.0; 3]], &[[0.0; 3]], F32_ROUNDING);
        assert_eq!((s.values, s.certain, s.beyond, s.family_p), (1, 1, 1.0, 0.0));
        assert!(s.max_z.is_infinite());
        let same = significance(&[[1.0; 3]], &[[1.0; 3]], &[[0.0; 3]], F32_ROUNDING);
        assert_eq!((same.values, same.beyond, same.max_z, same.family_p, same.chi_squared_p), (0, 0.0, 0.0, 1.0, 1.0));
    }

    #[test]
    fn rounding_to_half_floats_is_no_difference() {
        let (image, reference) = ([[17.0; 3]], [[17.0 * (1.0 + 9e-4); 3]]);
        let test = |variance: f32, rounding| significance(&image, &reference, &[[variance; 3]], rounding);
        assert_eq!(test(0.0, HALF_ROUNDING).values, 0);
        assert_eq!(test(0.0, F32_ROUNDING).certain, 3);
        // The variance of the rounding is (17 / 2048)² / 3 = (4.79e-3)²
        assert!((test(1e-9, HALF_ROUNDING).max_z - 0.0153 / 4.79e-3).abs() < 0.01);
        assert!(test(1e-9, F32_ROUNDING).max_z > 400.0);
    }

    #[test]
    fn values_that_are_not_finite_take_no_part() {
        let image = [[f32::NAN, 9.0, 9.0], [1.0, 1.0, 2.0]];
        let variance = [[1.0; 3], [1.0, f32::NAN, 1.0]];
        let s = significance(&image, &[[1.0; 3]; 2], &variance, F32_ROUNDING);
        assert!(s.values == 2 && (s.max_z - 1.0).abs() < 1e-9, "{s:?}");
        let map = z_map(&image, &[[1.0; 3]; 2], &variance, F32_ROUNDING);
        assert!(map[0].is_nan() && map[1].is_nan());
    }

    /// Sums of twelve uniform numbers: nearly normal, variance 1.
    fn noise(state: &mut u64) -> f32 {
        let mut uniform = || {
            *state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (*state >> 40) as f32 / (1 << 24) as f32 - 0.5
        };
        (0..12).map(|_| uniform()).sum()
    }

    #[test]
    fn noise_passes_and_a_small_bias_everywhere_or_a_large_one_somewhere_does_not() {
        let mut state = 3;
        let reference = vec![[1.0; 3]; 4096];
        let variance = vec![[0.01; 3]; 4096];
        let image: Vec<Pixel> = reference.iter().map(|r| r.map(|v| v + 0.1 * noise(&mut state))).collect();
        let s = significance(&image, &reference, &variance, F32_ROUNDING);
        assert!(s.family_p > 0.01 && s.chi_squared_p > 0.01 && s.beyond < 0.006, "{s:?}");
        assert!((s.mean_square - 1.0).abs() < 0.05, "{s:?}");

        let shifted: Vec<Pixel> = image.iter().map(|p| p.map(|v| v + 0.03)).collect();
        assert!(significance(&shifted, &reference, &variance, F32_ROUNDING).chi_squared_p < 1e-4);
        let mut spot = image;
        spot[77][1] += 0.8;
        let s = significance(&spot, &reference, &variance, F32_ROUNDING);
        assert!(s.family_p < 0.01 && z_test(s.max_z, 0.0, 1.0).p_value < sidak(0.01, s.values), "{s:?}");
        assert!(s.chi_squared_p > 0.001, "{s:?}");
    }
}
