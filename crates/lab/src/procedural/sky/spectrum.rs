//! Spectra in wavelength bands, and their colours.
//!
//! The sun is a black body of 5772 K above the atmosphere. Colours are computed for the CIE 1931 observer, by the fit
//! of [Wyman et al. 2013, Eq. 4], and converted to linear Rec.709.

use lumiris_numbers::math::Rgb;

/// Number of bands.
pub const BANDS: usize = 12;
/// Width of a band (nm).
const WIDTH: f32 = 25.0;
/// Centre of the first band (nm).
const FIRST: f32 = 412.5;

/// A value for each band.
pub type Spectrum = [f32; BANDS];

/// Centre of a band (nm).
pub fn wavelength(band: usize) -> f32 {
    FIRST + WIDTH * band as f32
}

/// Linear interpolation of a table at increasing positions.
pub fn table(entries: &[(f32, f32)], x: f32) -> f32 {
    let i = entries.partition_point(|e| e.0 <= x).clamp(1, entries.len() - 1);
    let (a, b) = (entries[i - 1], entries[i]);
    let t = ((x - a.0) / (b.0 - a.0)).clamp(0.0, 1.0);
    a.1 + (b.1 - a.1) * t
}

/// Irradiance of the sun above the atmosphere, in an arbitrary unit [Planck 1901].
pub fn sun() -> Spectrum {
    std::array::from_fn(|band| {
        let lambda = wavelength(band) * 1e-3;
        // c₂ = 14387.8 µm K
        0.1 * lambda.powi(-5) / ((14_387.8 / (lambda * 5772.0)).exp() - 1.0)
    })
}

/// A Gaussian with different slopes `low` and `high` (1/nm) on both sides.
fn lobe(lambda: f32, center: f32, low: f32, high: f32) -> f32 {
    let t = (lambda - center) * if lambda < center { low } else { high };
    (-0.5 * t * t).exp()
}

/// The weights of each band in linear Rec.709.
pub fn color_weights() -> [Rgb; BANDS] {
    std::array::from_fn(|band| {
        let l = wavelength(band);
        let x = 1.056 * lobe(l, 599.8, 0.0264, 0.0323) + 0.362 * lobe(l, 442.0, 0.0624, 0.0374)
            - 0.065 * lobe(l, 501.1, 0.0490, 0.0382);
        let y = 0.821 * lobe(l, 568.8, 0.0213, 0.0247) + 0.286 * lobe(l, 530.9, 0.0613, 0.0322);
        let z = 1.217 * lobe(l, 437.0, 0.0845, 0.0278) + 0.681 * lobe(l, 459.0, 0.0385, 0.0725);
        Rgb::new(
            3.240_97 * x - 1.537_383 * y - 0.498_611 * z,
            -0.969_244 * x + 1.875_968 * y + 0.041_555 * z,
            0.055_63 * x - 0.203_977 * y + 1.056_972 * z,
        )
    })
}

/// The colour of a spectrum, clipped to Rec.709.
pub fn color(spectrum: &Spectrum, weights: &[Rgb; BANDS]) -> Rgb {
    let mut sum = [0.0_f32; 3];
    for (value, weight) in spectrum.iter().zip(weights) {
        for (s, w) in sum.iter_mut().zip(weight.to_array()) {
            *s += value * w;
        }
    }
    Rgb::from_array(sum.map(|s| s.max(0.0)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_sun_is_nearly_white_and_the_ends_of_the_spectrum_are_coloured() {
        let weights = color_weights();
        let sun = color(&sun(), &weights);
        assert!((0.8..1.45).contains(&(sun.r / sun.g)) && (0.8..1.05).contains(&(sun.b / sun.g)), "{sun:?}");
        let only = |band: usize| {
            let mut s = [0.0; BANDS];
            s[band] = 1.0;
            color(&s, &weights)
        };
        assert!(only(1).b > only(1).g && only(5).g > only(5).b && only(9).r > only(9).g);
    }

    #[test]
    fn tables_are_linear_between_entries_and_constant_outside() {
        let t = [(1.0, 2.0), (3.0, 6.0)];
        assert_eq!([table(&t, 0.0), table(&t, 2.0), table(&t, 9.0)], [2.0, 4.0, 6.0]);
    }
}
