//! Lit, penumbra and shadowed pixels, by the fraction of unoccluded light.
//!
//! The fraction is v = L/L₀, where L is the image and L₀ the same image without occlusion. For delta lights it is 0 or
//! 1, for all others the mean visibility of the light, weighted by its contribution. Pixels without a surface belong to
//! no class.

use super::super::measure::{Stage, View, radiance};
use super::super::method::Method;
use super::super::{Observer, ReproduceError};
use lumiris_numbers::math::luminance;

/// Minimum fraction in lit pixels.
pub(super) const LIT: f64 = 0.9;
/// Maximum fraction in shadowed pixels.
pub(super) const SHADOWED: f64 = 0.25;

/// Names of the classes, in their order.
pub(super) const NAMES: [&str; 3] = ["lit", "penumbra", "shadow"];

/// The class of every pixel.
pub(super) struct Classes {
    /// Fraction of unoccluded light; NaN without a surface, or without light.
    pub visibility: Vec<f64>,
    /// Masks of lit, penumbra and shadowed pixels.
    pub masks: [Vec<bool>; 3],
}

impl Classes {
    /// Renders the image without shadows and compares it with `reference`.
    pub(super) fn new(
        stage: &mut Stage,
        reference: &[[f64; 3]],
        observer: Observer<'_>,
    ) -> Result<Self, ReproduceError> {
        let method = Method::mis(8).stratified();
        let rendering = stage.render(&method, View::Unshadowed, 32, 0, observer)?;
        let pixels = rendering.film.pixels();
        let surface = |i: usize| pixels[i].hits > 0;
        let unshadowed = radiance(&rendering.film);
        let visibility: Vec<f64> = (0..reference.len())
            .map(|i| if surface(i) { luminance(reference[i]) / luminance(unshadowed[i]) } else { f64::NAN })
            .map(|v| if v.is_finite() { v } else { f64::NAN })
            .collect();
        Ok(Classes { masks: masks(&visibility), visibility })
    }

    /// Number of pixels of each class.
    pub(super) fn counts(&self) -> [usize; 3] {
        std::array::from_fn(|k| self.masks[k].iter().filter(|&&m| m).count())
    }
}

fn masks(visibility: &[f64]) -> [Vec<bool>; 3] {
    let of = |is: fn(f64) -> bool| visibility.iter().map(|&v| is(v)).collect();
    [of(|v| v >= LIT), of(|v| v > SHADOWED && v < LIT), of(|v| v <= SHADOWED)]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_pixel_with_a_surface_has_one_class_and_others_none() {
        let [lit, half, dark] = masks(&[1.02, 0.9, 0.5, 0.25, 0.0, f64::NAN]);
        assert_eq!(lit, [true, true, false, false, false, false]);
        assert_eq!(half, [false, false, true, false, false, false]);
        assert_eq!(dark, [false, false, false, true, true, false]);
    }
}
