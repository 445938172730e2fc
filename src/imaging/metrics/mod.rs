//! Metrics of the difference between an image and its reference: numbers for the image, maps for the pixels.
//!
//! Images are linear Rec.709 radiance, row-major from the top left. **Pixels that are not finite in either image are
//! excluded from all means.** [`Differences`] counts them, maps are NaN there, and ꟻLIP treats them as black in both
//! images.
//!
//! Reading order: [`difference`] (MSE, relative MSE, PSNR), [`mod@bias`], [`mod@significance`] (z-tests),
//! [`perceptual`] (visual thresholds), [`flip`].

pub mod bias;
pub mod difference;
pub mod flip;
pub mod perceptual;
pub mod significance;

pub use bias::{Bias, ErrorSource, bias};
pub use difference::{Differences, differences};
pub use flip::{DEFAULT_PIXELS_PER_DEGREE, HdrFlip, hdr_flip, ldr_flip};
pub use perceptual::{perceptual_error, perceptual_map, tvi};
pub use significance::{Significance, significance, z_map};

/// Linear red, green and blue.
pub type Pixel = [f32; 3];

/// True if all components are finite.
#[inline]
fn is_finite(pixel: &Pixel) -> bool {
    pixel.iter().all(|v| v.is_finite())
}

/// Pixels that are finite in both images, in f64, with their index. Panics if the lengths differ.
fn finite_pairs<'a>(
    image: &'a [Pixel],
    reference: &'a [Pixel],
) -> impl Iterator<Item = (usize, [f64; 3], [f64; 3])> + 'a {
    assert_eq!(image.len(), reference.len(), "images of one size");
    let finite = image.iter().zip(reference).enumerate().filter(|(_, (x, r))| is_finite(x) && is_finite(r));
    finite.map(|(i, (x, r))| (i, x.map(f64::from), r.map(f64::from)))
}

/// Mean of the finite values of a map; 0 if there are none.
pub fn mean_of_map(map: &[f32]) -> f64 {
    let (sum, count) =
        map.iter().filter(|v| v.is_finite()).fold((0.0, 0_usize), |(s, n), &v| (s + f64::from(v), n + 1));
    if count == 0 { 0.0 } else { sum / count as f64 }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn means_leave_out_what_is_not_finite() {
        assert_eq!(mean_of_map(&[1.0, f32::NAN, 3.0, f32::INFINITY]), 2.0);
        assert_eq!(mean_of_map(&[f32::NAN]), 0.0);
        let image = [[1.0, f32::NAN, 0.0], [1.0, 2.0, 3.0], [0.0; 3]];
        let reference = [[0.0; 3], [0.5; 3], [f32::INFINITY, 0.0, 0.0]];
        let pairs: Vec<_> = finite_pairs(&image, &reference).collect();
        assert_eq!(pairs, [(1, [1.0, 2.0, 3.0], [0.5; 3])]);
    }

    #[test]
    #[should_panic(expected = "one size")]
    fn lengths_must_agree() {
        let _ = finite_pairs(&[[0.0; 3]], &[]).count();
    }
}
