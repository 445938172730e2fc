//! Bias: overall difference in brightness.
//!
//! The bias is the mean of x − r over pixels and channels. Its standard error is computed in one of two ways:
//! - from the variances of the pixels, if available: σ_c² = Σ variance / n² per channel c, for independent pixels. The
//!   correlation between the channels of a pixel is unknown. The standard error of their mean is at most
//!   (σ_R + σ_G + σ_B) / 3, which is used;
//! - from the standard deviation of x − r over the pixels, s / √n. This works for any image, but counts errors that
//!   vary over the image as noise, and is too small if the errors of neighbouring pixels are correlated.

use super::pixels::{Pixel, finite_pairs};
use lumiris_numbers::estimators::stats::Welford;
use strum::IntoStaticStr;

/// Two-sided 95 % point of the normal distribution.
pub const Z_95: f64 = 1.959_963_984_540_054;

/// Source of a standard error.
#[derive(Clone, Copy, Debug, PartialEq, Eq, IntoStaticStr)]
#[strum(serialize_all = "lowercase")]
pub enum ErrorSource {
    /// Variances of the pixels.
    Variances,
    /// Spread of the differences over the pixels.
    Spread,
}

/// Mean difference of two images.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bias {
    /// Mean of x − r over pixels and channels.
    pub mean: f64,
    /// Its standard error.
    pub standard_error: f64,
    /// Mean of x − r per channel.
    pub channels: [f64; 3],
    /// Standard errors of `channels`.
    pub channel_errors: [f64; 3],
    /// Source of the standard errors.
    pub source: ErrorSource,
}

impl Bias {
    /// Half the width of the 95 % confidence interval about `mean`.
    pub fn half_width(&self) -> f64 {
        Z_95 * self.standard_error
    }

    /// `mean` in standard errors; 0 if there is no difference.
    pub fn z(&self) -> f64 {
        if self.mean == 0.0 { 0.0 } else { self.mean / self.standard_error }
    }
}

/// The bias of `image`. `variance` holds the variances of the differences x − r per pixel. Pixels without a finite
/// variance are excluded. Panics if the lengths differ.
pub fn bias(image: &[Pixel], reference: &[Pixel], variance: Option<&[Pixel]>) -> Bias {
    // Accumulate differences and variances
    let mut channels = [Welford::new(); 3];
    let mut together = Welford::new();
    let mut variances = [0.0; 3];
    for (i, x, r) in finite_pairs(image, reference) {
        let v = variance.map_or([0.0; 3], |v| v[i].map(f64::from));
        if v.iter().any(|v| !v.is_finite()) {
            continue;
        }
        let d: [f64; 3] = std::array::from_fn(|c| x[c] - r[c]);
        together.add((d[0] + d[1] + d[2]) / 3.0);
        for c in 0..3 {
            channels[c].add(d[c]);
            variances[c] += v[c];
        }
    }

    // Standard errors from variances, or from the spread
    let n = together.count().max(1) as f64;
    let (source, channel_errors, standard_error) = if variance.is_some() {
        let errors = variances.map(|v| v.sqrt() / n);
        (ErrorSource::Variances, errors, errors.iter().sum::<f64>() / 3.0)
    } else {
        (ErrorSource::Spread, channels.map(|c| c.standard_error()), together.standard_error())
    };
    Bias { mean: together.mean(), standard_error, channels: channels.map(|c| c.mean()), channel_errors, source }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn means_and_errors_are_those_by_hand() {
        let reference = [[1.0; 3]; 4];
        let image = [[1.5, 1.0, 1.0], [2.5, 1.0, 1.0], [0.5, 1.0, 1.0], [1.5, 1.0, 1.0]];
        let spread = bias(&image, &reference, None);
        assert_eq!((spread.channels, spread.source), ([0.5, 0.0, 0.0], ErrorSource::Spread));
        assert!((spread.mean - 0.5 / 3.0).abs() < 1e-15);
        // Deviations 0 1 −1 0: variance ⅔, variance of the mean ⅙
        assert!((spread.channel_errors[0] - (1.0_f64 / 6.0).sqrt()).abs() < 1e-15);
        assert!((spread.standard_error - (1.0_f64 / 6.0).sqrt() / 3.0).abs() < 1e-15);
        assert!((spread.half_width() - 1.96 * spread.standard_error).abs() < 1e-4);

        let variance = [[1.0, 4.0, 0.0], [1.0, 4.0, 0.0], [1.0, 4.0, 0.0], [1.0, 4.0, 0.0]];
        let told = bias(&image, &reference, Some(&variance));
        assert_eq!((told.channel_errors, told.standard_error), ([0.5, 1.0, 0.0], 0.5));
        assert_eq!((told.mean, told.source, told.z()), (spread.mean, ErrorSource::Variances, spread.mean / 0.5));
    }

    #[test]
    fn the_interval_covers_zero_as_often_as_it_says() {
        // Uniform noise of variance 1/12 per pixel, equal in all channels: the worst case, for which the bound is exact
        let mut state = 7_u64;
        let mut uniform = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 40) as f32 / (1 << 24) as f32 - 0.5
        };
        let (reference, variance) = ([[0.25; 3]; 64], [[1.0 / 12.0; 3]; 64]);
        let mut covered = [0; 2];
        for _ in 0..2000 {
            let image: Vec<Pixel> = (0..64).map(|_| [0.25 + uniform(); 3]).collect();
            for (i, variance) in [Some(&variance[..]), None].into_iter().enumerate() {
                let b = bias(&image, &reference, variance);
                covered[i] += usize::from(b.mean.abs() <= b.half_width());
            }
        }
        // 95 % of 2000 ± 4 standard deviations (9.7)
        assert!(covered.iter().all(|c| (1861..=1939).contains(c)), "{covered:?}");
    }

    #[test]
    fn odd_pixels_take_no_part_and_nothing_is_no_bias() {
        let image = [[f32::NAN; 3], [2.0; 3], [9.0; 3]];
        let b = bias(&image, &[[1.0; 3]; 3], Some(&[[0.0; 3], [0.25; 3], [f32::INFINITY; 3]]));
        assert_eq!((b.mean, b.standard_error, b.z()), (1.0, 0.5, 2.0));
        let none = bias(&image[..1], &[[1.0; 3]], None);
        assert_eq!((none.mean, none.standard_error, none.z()), (0.0, 0.0, 0.0));
    }
}
