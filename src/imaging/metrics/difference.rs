//! Squared differences.
//!
//! With x the image, r the reference and means over pixels and channels:
//! - MSE = mean (x − r)², RMSE = √MSE;
//! - relMSE = mean (x − r)² / (r² + ε), ε = 0.01 by default [Rousselle et al. 2011, Sec. 4];
//! - nMSE = MSE / mean r²: no ε, and dark pixels have no extra weight;
//! - PSNR = 10 log₁₀ (peak² / MSE) decibels.

use super::pixels::{Pixel, finite_pairs, is_finite};

/// The usual ε of relMSE.
pub const DEFAULT_EPSILON: f64 = 0.01;

/// Mean squared differences, means and counts.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Differences {
    /// Mean of (x − r)².
    pub mse: f64,
    /// Mean of (x − r)² / (r² + ε).
    pub relmse: f64,
    /// Mean of (x − r)² over the mean of r²; infinite if the reference is black and the image is not.
    pub nmse: f64,
    /// Mean of each channel of the image.
    pub mean: [f64; 3],
    /// Mean of each channel of the reference.
    pub reference_mean: [f64; 3],
    /// Pixels that are finite in both images.
    pub pixels: usize,
    /// Pixels of the image that are not finite.
    pub nonfinite: usize,
    /// Pixels of the reference that are not finite.
    pub reference_nonfinite: usize,
}

impl Differences {
    /// Root of the MSE.
    pub fn rmse(&self) -> f64 {
        self.mse.sqrt()
    }

    /// Peak signal-to-noise ratio (dB) for the largest value `peak`; infinite for equal images.
    pub fn psnr(&self, peak: f64) -> f64 {
        10.0 * (peak * peak / self.mse).log10()
    }
}

/// Compares two images. All means are 0 if no pixel is finite in both. Panics if the lengths differ.
pub fn differences(image: &[Pixel], reference: &[Pixel], epsilon: f64) -> Differences {
    let (mut squares, mut relative, mut power) = (0.0, 0.0, 0.0);
    let (mut sum, mut reference_sum) = ([0.0; 3], [0.0; 3]);
    let mut pixels = 0;
    for (_, x, r) in finite_pairs(image, reference) {
        pixels += 1;
        for c in 0..3 {
            let square = (x[c] - r[c]).powi(2);
            squares += square;
            // 0/0 is no difference
            relative += if square == 0.0 { 0.0 } else { square / (r[c] * r[c] + epsilon) };
            power += r[c] * r[c];
            sum[c] += x[c];
            reference_sum[c] += r[c];
        }
    }
    let count = (3 * pixels).max(1) as f64;
    let per_channel = |sums: [f64; 3]| sums.map(|s| s / pixels.max(1) as f64);
    Differences {
        mse: squares / count,
        relmse: relative / count,
        nmse: if squares == 0.0 { 0.0 } else { squares / power },
        mean: per_channel(sum),
        reference_mean: per_channel(reference_sum),
        pixels,
        nonfinite: image.iter().filter(|p| !is_finite(p)).count(),
        reference_nonfinite: reference.iter().filter(|p| !is_finite(p)).count(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const IMAGE: [Pixel; 2] = [[1.0, 2.0, 0.0], [0.5, 0.5, 0.5]];
    const REFERENCE: [Pixel; 2] = [[1.0, 1.0, 0.0], [0.0, 0.5, 1.0]];

    #[test]
    fn values_are_those_by_hand() {
        let d = differences(&IMAGE, &REFERENCE, 0.25);
        // Squares 0 1 0 ¼ 0 ¼; divided by r² + ε: 1/1.25, ¼/¼, ¼/1.25
        assert!((d.mse - 1.5 / 6.0).abs() < 1e-15);
        assert!((d.relmse - (0.8 + 1.0 + 0.2) / 6.0).abs() < 1e-15);
        assert!((d.nmse - 1.5 / 3.25).abs() < 1e-15);
        assert!((d.rmse() - 0.5).abs() < 1e-15);
        assert!((d.psnr(1.0) - 6.020_599_913).abs() < 1e-9 && (d.psnr(10.0) - 26.020_599_913).abs() < 1e-9);
        assert_eq!((d.mean, d.reference_mean), ([0.75, 1.25, 0.25], [0.5, 0.75, 0.5]));
        assert_eq!((d.pixels, d.nonfinite, d.reference_nonfinite), (2, 0, 0));
    }

    #[test]
    fn equal_images_have_no_difference_even_without_epsilon() {
        let d = differences(&REFERENCE, &REFERENCE, 0.0);
        assert_eq!((d.mse, d.relmse, d.nmse, d.psnr(1.0)), (0.0, 0.0, 0.0, f64::INFINITY));
        let black = differences(&IMAGE, &[[0.0; 3]; 2], DEFAULT_EPSILON);
        assert!(black.nmse.is_infinite() && black.relmse.is_finite());
    }

    #[test]
    fn brighter_images_scale_as_the_formulas_say() {
        let by = |s: f32| {
            let scale = |p: &[Pixel]| p.iter().map(|p| p.map(|v| v * s)).collect::<Vec<_>>();
            differences(&scale(&IMAGE), &scale(&REFERENCE), 0.01 * f64::from(s * s))
        };
        let (one, eight) = (by(1.0), by(8.0));
        assert!((eight.mse / one.mse - 64.0).abs() < 1e-12 && (eight.rmse() / one.rmse() - 8.0).abs() < 1e-12);
        // With ε scaled as well, relative errors stay the same
        assert!((eight.relmse / one.relmse - 1.0).abs() < 1e-6 && (eight.nmse / one.nmse - 1.0).abs() < 1e-12);
        assert!((one.psnr(1.0) - eight.psnr(8.0)).abs() < 1e-9);
    }

    #[test]
    fn pixels_that_are_not_finite_are_counted_and_left_out() {
        let image = [IMAGE[0], IMAGE[1], [f32::NAN, 0.0, 0.0], [9.0; 3], [f32::INFINITY; 3]];
        let reference = [REFERENCE[0], REFERENCE[1], [0.0; 3], [0.0, f32::NEG_INFINITY, 0.0], [f32::INFINITY; 3]];
        let d = differences(&image, &reference, 0.01);
        let clean = differences(&IMAGE, &REFERENCE, 0.01);
        assert_eq!((d.mse, d.relmse, d.nmse, d.mean), (clean.mse, clean.relmse, clean.nmse, clean.mean));
        assert_eq!((d.pixels, d.nonfinite, d.reference_nonfinite), (2, 2, 2));
        let nothing = differences(&image[2..], &reference[2..], 0.01);
        assert_eq!((nothing.mse, nothing.relmse, nothing.nmse, nothing.pixels), (0.0, 0.0, 0.0, 0));
    }
}
