//! ꟻLIP: the perceived difference between two images that are flipped in place [Andersson et al. 2020], computed by its
//! authors' library, and its variant for high dynamic range [Andersson et al. 2021].
//!
//! LDR-ꟻLIP compares both images as displayed: radiance times a gain, clipped to 0..1, sRGB-encoded, in 8 bits.
//! HDR-ꟻLIP is the maximum of LDR-ꟻLIP over exposures, tone-mapped by the ACES approximation
//! (a x² + b x) / (c x² + d x + e) with the constants of the paper. The first exposure maps the maximum luminance of
//! the reference to 0.85 of the display, the last one the median. The others lie between, at most one stop apart.

use super::pixels::{Pixel, is_finite};
use crate::imaging::color::linear_to_srgb;
use lumiris_numbers::estimators::stats::median;
use lumiris_numbers::math::Rgb;
use nv_flip::FlipImageRgb8;
use rayon::prelude::*;

/// Pixels per degree of a display with 3840 pixels on 0.7 m at a distance of 0.7 m.
pub const DEFAULT_PIXELS_PER_DEGREE: f32 = nv_flip::DEFAULT_PIXELS_PER_DEGREE;

/// Maximum number of pixels that the library supports.
pub const MAX_PIXELS: usize = (u32::MAX / 3) as usize;

/// Result of [`hdr_flip`].
#[derive(Clone, Debug, PartialEq)]
pub struct HdrFlip {
    /// Maximum over the exposures per pixel, 0..1; NaN if a pixel is not finite.
    pub map: Vec<f32>,
    /// Minimum exposure (stops).
    pub start: f64,
    /// Maximum exposure (stops).
    pub stop: f64,
    /// Number of exposures, equally spaced from minimum to maximum.
    pub count: usize,
}

/// LDR-ꟻLIP per pixel, 0..1, of radiance times `gain`; NaN if a pixel is not finite. `size` is columns and rows. Panics
/// if the lengths do not match the size, or exceed [`MAX_PIXELS`].
pub fn ldr_flip(image: &[Pixel], reference: &[Pixel], size: [usize; 2], gain: f32, pixels_per_degree: f32) -> Vec<f32> {
    let display = |v: f32| linear_to_srgb((v * gain).clamp(0.0, 1.0));
    let mut map = displayed(image, reference, size, &display, pixels_per_degree);
    mark_odd_pixels(&mut map, image, reference);
    map
}

/// HDR-ꟻLIP. Panics like [`ldr_flip`].
pub fn hdr_flip(image: &[Pixel], reference: &[Pixel], size: [usize; 2], pixels_per_degree: f32) -> HdrFlip {
    let [start, stop] = exposure_range(reference);
    // An empty range, such as for an image of one colour, becomes two equal exposures
    let count = (stop - start).ceil().max(2.0) as usize;
    let at = |i: usize| start + (stop - start) * i as f64 / (count - 1) as f64;
    let of_exposure = |i: usize| {
        let gain = at(i).exp2() as f32;
        let display = |v: f32| linear_to_srgb(aces(v * gain));
        displayed(image, reference, size, &display, pixels_per_degree)
    };
    let greater = |mut a: Vec<f32>, b: Vec<f32>| {
        a.iter_mut().zip(b).for_each(|(a, b)| *a = a.max(b));
        a
    };
    let mut map = (0..count).into_par_iter().map(of_exposure).reduce(|| vec![0.0; image.len()], greater);
    mark_odd_pixels(&mut map, image, reference);
    HdrFlip { map, start, stop, count }
}

/// Numerator and denominator of the tone curve, from x² down.
const ACES: [f64; 5] = [0.36 * 2.51, 0.6 * 0.03, 0.36 * 2.43, 0.6 * 0.59, 0.14];

/// The tone curve, clipped to 0..1.
fn aces(v: f32) -> f32 {
    let [a, b, c, d, e] = ACES.map(|k| k as f32);
    // Larger values would overflow when squared; the display is white there
    let v = v.clamp(0.0, 1e9);
    ((a * v + b) * v / ((c * v + d) * v + e)).clamp(0.0, 1.0)
}

/// The value that the tone curve maps to `t`: the greater root of (a − t c) x² + (b − t d) x − t e = 0.
fn aces_inverse(t: f64) -> f64 {
    let [a, b, c, d, e] = ACES;
    let (half, constant) = (-0.5 * (b - t * d) / (a - t * c), -t * e / (a - t * c));
    half + (half * half - constant).sqrt()
}

/// Exposures (stops) of the brightest and of the median pixel of a reference. If the median is black, it is taken over
/// the other pixels. A black reference has the exposure 0.
fn exposure_range(reference: &[Pixel]) -> [f64; 2] {
    let luminances = reference.iter().filter(|p| is_finite(p)).map(|p| f64::from(Rgb::from_array(*p).luminance()));
    let mut sorted: Vec<f64> = luminances.collect();
    sorted.sort_by(f64::total_cmp);
    let lit = &sorted[sorted.partition_point(|&l| l <= 0.0)..];
    let Some(&greatest) = lit.last() else { return [0.0; 2] };
    let of_all = median(sorted.iter().copied());
    let white = aces_inverse(0.85);
    [greatest, if of_all > 0.0 { of_all } else { median(lit.iter().copied()) }].map(|l| (white / l).log2())
}

/// LDR-ꟻLIP of the values converted by `display`. Pixels that are not finite are black in both images.
fn displayed(
    image: &[Pixel],
    reference: &[Pixel],
    size: [usize; 2],
    display: &dyn Fn(f32) -> f32,
    pixels_per_degree: f32,
) -> Vec<f32> {
    // Check the sizes
    let pixels = size[0] * size[1];
    assert!(image.len() == pixels && reference.len() == pixels && pixels <= MAX_PIXELS, "images of the size told");
    if pixels == 0 {
        return Vec::new();
    }

    // Convert to bytes
    let byte = |v: f32| (display(v) * 255.0 + 0.5) as u8;
    let shown = |this: &[Pixel], other: &[Pixel]| {
        let pairs = this.iter().zip(other);
        let bytes: Vec<u8> =
            pairs.flat_map(|(a, b)| if is_finite(a) && is_finite(b) { a.map(byte) } else { [0; 3] }).collect();
        FlipImageRgb8::with_data(size[0] as u32, size[1] as u32, &bytes)
    };

    // Compare
    let (test, truth) = (shown(image, reference), shown(reference, image));
    nv_flip::flip(truth, test, pixels_per_degree).to_vec()
}

fn mark_odd_pixels(map: &mut [f32], image: &[Pixel], reference: &[Pixel]) {
    for ((value, x), r) in map.iter_mut().zip(image).zip(reference) {
        if !(is_finite(x) && is_finite(r)) {
            *value = f32::NAN;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::imaging::metrics::mean_of_map;

    const PPD: f32 = DEFAULT_PIXELS_PER_DEGREE;

    /// A gradient with an edge.
    fn scene(size: [usize; 2], gain: f32) -> Vec<Pixel> {
        let pixel = |i: usize| {
            let (x, y) = (i % size[0], i / size[0]);
            let v = if x > size[0] / 2 { 0.7 } else { 0.1 + 0.3 * y as f32 / size[1] as f32 };
            [v, 0.8 * v, 0.5 * v].map(|v| v * gain)
        };
        (0..size[0] * size[1]).map(pixel).collect()
    }

    #[test]
    fn equal_images_do_not_differ_whatever_their_size() {
        for size in [[0, 0], [1, 1], [1, 7], [2, 1], [40, 30]] {
            let a = scene(size, 1.0);
            assert!(ldr_flip(&a, &a, size, 1.0, PPD).iter().all(|&v| v == 0.0), "{size:?}");
            assert!(hdr_flip(&a, &a, size, PPD).map.iter().all(|&v| v == 0.0), "{size:?}");
        }
    }

    #[test]
    fn black_and_white_differ_wholly() {
        let size = [24, 16];
        let (black, white) = (vec![[0.0; 3]; 384], vec![[1.0; 3]; 384]);
        let map = ldr_flip(&white, &black, size, 1.0, PPD);
        assert!(map.iter().all(|v| (0.9..=1.0).contains(v)), "{map:?}");
        assert!((mean_of_map(&map) - 0.97).abs() < 0.01, "{}", mean_of_map(&map));
    }

    #[test]
    fn the_library_gives_the_published_difference_of_two_flat_colours() {
        // Flat fields have no edges: ΔE is the HyAB distance to the power 0.7, compressed above 0.4 of its maximum
        let size = [16, 16];
        let grey = |byte: f32| vec![[crate::imaging::color::srgb_to_linear(byte / 255.0); 3]; 256];
        let map = ldr_flip(&grey(120.0), &grey(100.0), size, 1.0, PPD);
        // L* is 50.43 and 42.37. Green and blue have the largest distance: 55.4 in L*, and with the Hunt effect (−75.6,
        // 72.9) and (25.6, −34.8) in a* and b*
        let farthest = 55.4 + 101.2_f64.hypot(107.7);
        let expected = (50.43_f64 - 42.37).powf(0.7) * 0.95 / (0.4 * farthest.powf(0.7));
        assert!((mean_of_map(&map) - expected).abs() < 0.002, "{} {expected}", mean_of_map(&map));
    }

    #[test]
    fn hdr_flip_sees_what_one_exposure_clips_and_is_the_same_for_scaled_images() {
        let size = [48, 32];
        let reference: Vec<Pixel> =
            scene(size, 1.0).iter().map(|p| p.map(|v| if v > 0.5 { v * 100.0 } else { v })).collect();
        let image: Vec<Pixel> = reference.iter().map(|p| p.map(|v| if v > 1.0 { v * 0.5 } else { v })).collect();
        assert!(mean_of_map(&ldr_flip(&image, &reference, size, 1.0, PPD)) < 1e-3);
        let one = hdr_flip(&image, &reference, size, PPD);
        assert!(mean_of_map(&one.map) > 0.05 && one.count >= 6, "{} {}", mean_of_map(&one.map), one.count);
        let scaled = |p: &[Pixel]| p.iter().map(|p| p.map(|v| v * 64.0)).collect::<Vec<_>>();
        let other = hdr_flip(&scaled(&image), &scaled(&reference), size, PPD);
        assert_eq!((one.map, one.count), (other.map, other.count));
        assert!((one.start - other.start - 6.0).abs() < 1e-5);
    }

    #[test]
    fn exposures_map_the_brightest_and_the_median_to_their_place() {
        for t in [0.2, 0.85, 0.95] {
            assert!((f64::from(aces(aces_inverse(t) as f32)) - t).abs() < 1e-6);
        }
        let [start, stop] = exposure_range(&[[0.0; 3], [1.0; 3], [1.0; 3], [16.0; 3], [f32::NAN; 3]]);
        assert!((stop - start - 4.0).abs() < 1e-4 && (stop - aces_inverse(0.85).log2()).abs() < 1e-4);
        assert_eq!(exposure_range(&[[0.0; 3]; 4]), [0.0; 2]);
        let mostly_black = exposure_range(&[[0.0; 3], [0.0; 3], [0.0; 3], [2.0; 3]]);
        assert_eq!(mostly_black[0], mostly_black[1]);
    }

    #[test]
    fn pixels_that_are_not_finite_hurt_only_themselves() {
        let size = [20, 20];
        let reference = scene(size, 1.0);
        let mut image = reference.clone();
        image[210] = [f32::NAN, 0.0, f32::INFINITY];
        for map in [ldr_flip(&image, &reference, size, 1.0, PPD), hdr_flip(&image, &reference, size, PPD).map] {
            assert!(map[210].is_nan());
            assert!(map.iter().enumerate().all(|(i, &v)| i == 210 || v == 0.0));
        }
    }
}
