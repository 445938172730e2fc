//! Differences in units of the just noticeable difference.
//!
//! E = √(mean ((L − L_true) / tvi(L_true))²) over the pixels [Fan et al. 2006, Eq. 12]. L is the luminance. tvi is the
//! threshold versus intensity of [Ferwerda et al. 1996, Sec. 3.1], piecewise in log₁₀ of the luminance (cd/m²):
//!
//! | | lowest | between | highest |
//! |---|---|---|---|
//! | cones, log t_p | −0.72 below −2.6 | (0.249 log L + 0.65)^2.7 − 0.72 | log L − 1.255 from 1.9 |
//! | rods, log t_s | −2.86 below −3.94 | (0.405 log L + 1.6)^2.18 − 2.86 | log L − 0.395 from −1.44 |
//!
//! The paper does not specify its function. Here tvi is the smaller of the two thresholds, i.e. the threshold of the
//! more sensitive system. The thresholds cross near 1 cd/m²; below, rods are more sensitive. Both use the photopic
//! luminance, since an RGB image does not contain the scotopic one.

use super::pixels::{Pixel, finite_pairs, is_finite};
use lumiris_numbers::math::Rgb;

/// Threshold of the cones (cd/m²) at the luminance 10^`log` cd/m².
fn cone_threshold(log: f64) -> f64 {
    10.0_f64.powf(if log <= -2.6 {
        -0.72
    } else if log >= 1.9 {
        log - 1.255
    } else {
        (0.249 * log + 0.65).powf(2.7) - 0.72
    })
}

/// Threshold of the rods (cd/m²) at the luminance 10^`log` cd/m².
fn rod_threshold(log: f64) -> f64 {
    10.0_f64.powf(if log <= -3.94 {
        -2.86
    } else if log >= -1.44 {
        log - 0.395
    } else {
        (0.405 * log + 1.6).powf(2.18) - 2.86
    })
}

/// The just noticeable difference of luminance (cd/m²) at `luminance` (cd/m²). Values that are not positive, and NaN,
/// have the absolute threshold.
pub fn tvi(luminance: f64) -> f64 {
    // The maximum of NaN and a number is the number
    let log = luminance.max(f64::MIN_POSITIVE).log10();
    cone_threshold(log).min(rod_threshold(log))
}

/// (L − L_true) / tvi(L_true) per pixel, where a luminance of 1 in the images is `candelas` cd/m²; NaN if a pixel is
/// not finite. Panics if the lengths differ.
pub fn perceptual_map(image: &[Pixel], reference: &[Pixel], candelas: f64) -> Vec<f32> {
    assert_eq!(image.len(), reference.len(), "images of one size");
    let thresholds = |(x, r): (&Pixel, &Pixel)| {
        if is_finite(x) && is_finite(r) { in_thresholds(luminance(x), luminance(r), candelas) as f32 } else { f32::NAN }
    };
    image.iter().zip(reference).map(thresholds).collect()
}

/// The error E of the module header, where a luminance of 1 in the images is 1 cd/m². 0 if no pixel is finite in both
/// images. Panics if the lengths differ.
pub fn perceptual_error(image: &[Pixel], reference: &[Pixel]) -> f64 {
    perceptual_error_at(image, reference, 1.0)
}

/// Like [`perceptual_error`], where a luminance of 1 in the images is `candelas` cd/m².
pub fn perceptual_error_at(image: &[Pixel], reference: &[Pixel], candelas: f64) -> f64 {
    let (mut sum, mut count) = (0.0, 0_usize);
    for (i, ..) in finite_pairs(image, reference) {
        sum += in_thresholds(luminance(&image[i]), luminance(&reference[i]), candelas).powi(2);
        count += 1;
    }
    (sum / count.max(1) as f64).sqrt()
}

fn luminance(pixel: &Pixel) -> f64 {
    f64::from(Rgb::from_array(*pixel).luminance())
}

fn in_thresholds(luminance: f64, truth: f64, candelas: f64) -> f64 {
    (luminance - truth) * candelas / tvi(truth * candelas)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn thresholds_are_those_of_the_published_curves() {
        // Absolute threshold of the rods; Weber's law of the cones with the fraction 10^-1.255 = 5.56 %
        assert!((tvi(0.0) - 1.380_384e-3).abs() < 1e-9 && (tvi(1e-5) - tvi(0.0)).abs() < 1e-15);
        assert!((tvi(1000.0) / 1000.0 - 0.055_590).abs() < 1e-6 && (tvi(100.0) - 5.559_04).abs() < 1e-5);
        // 1 cd/m²: cones 10^(0.65^2.7 − 0.72), rods 10^-0.395
        assert!((cone_threshold(0.0) - 0.391_302).abs() < 1e-5 && (rod_threshold(0.0) - 0.402_72).abs() < 1e-5);
        // 0.01 cd/m²: rods 10^(0.79^2.18 − 2.86), cones 10^(0.152^2.7 − 0.72)
        assert!((tvi(0.01) - 0.005_472_3).abs() < 1e-6, "{}", tvi(0.01));
        assert!((cone_threshold(-2.0) - 0.193_277).abs() < 1e-5);
        assert!((tvi(10.0) - cone_threshold(1.0)).abs() < 1e-15 && (tvi(0.1) - rod_threshold(-1.0)).abs() < 1e-15);
    }

    #[test]
    fn the_curves_join_and_rise() {
        for (curve, ends) in [(cone_threshold as fn(f64) -> f64, [-2.6, 1.9]), (rod_threshold, [-3.94, -1.44])] {
            for end in ends {
                // With the published three digits, the rods jump by 2.8 % at −1.44
                assert!((curve(end - 1e-9) / curve(end + 1e-9) - 1.0).abs() < 0.03, "{end}");
            }
        }
        let steps: Vec<f64> = (-60..60).map(|i| tvi(10.0_f64.powf(f64::from(i) * 0.1))).collect();
        assert!(steps.windows(2).all(|w| w[1] >= 0.995 * w[0]), "{steps:?}");
        for odd in [-5.0, f64::NEG_INFINITY, f64::NAN] {
            assert_eq!(tvi(odd), tvi(0.0));
        }
        assert!(tvi(f64::INFINITY).is_infinite());
    }

    #[test]
    fn the_error_is_the_root_mean_square_in_thresholds() {
        let reference = [[1000.0; 3], [1.0; 3], [f32::NAN; 3]];
        let image = [[1000.0 + 3.0 * 55.590_43; 3], [1.0 - 4.0 * 0.391_302; 3], [1.0; 3]];
        let e = perceptual_error(&image, &reference);
        assert!((e - 12.5_f64.sqrt()).abs() < 1e-4, "{e}");
        let map = perceptual_map(&image, &reference, 1.0);
        assert!((map[0] - 3.0).abs() < 1e-4 && (map[1] + 4.0).abs() < 1e-4 && map[2].is_nan());
        assert_eq!(perceptual_error(&reference, &reference), 0.0);
        assert_eq!(perceptual_error(&image[2..], &reference[2..]), 0.0);
    }

    #[test]
    fn above_all_thresholds_only_the_ratio_counts_and_units_are_a_factor() {
        let reference = [[2.0, 3.0, 1.0], [8.0, 1.0, 4.0]];
        let image = reference.map(|p: Pixel| p.map(|v| v * 1.1));
        let bright = perceptual_error_at(&image, &reference, 1e4);
        assert!((bright - 0.1 / 0.055_590_4).abs() < 1e-4, "{bright}");
        assert!((perceptual_error_at(&image, &reference, 1e6) - bright).abs() < 1e-9);
        let scaled = |p: &[Pixel; 2]| p.map(|p| p.map(|v| v * 0.25));
        let direct = perceptual_error(&scaled(&image), &scaled(&reference));
        assert!((direct - perceptual_error_at(&image, &reference, 0.25)).abs() < 1e-9);
    }
}
