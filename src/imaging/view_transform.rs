//! View transforms: from linear light to the colours of an sRGB display.
//!
//! * `srgb`: clipped to 0..1, then the sRGB curve.
//! * `filmic`: the curve of [Hable 2010] per channel, white at 11.2, then the sRGB curve.
//! * `agx`: log₂ encoding from −12.47 to 4.03 stops about middle grey, and a sigmoid [Sobotka 2022], fitted by a
//!   polynomial [Wrensch 2023]. Its primaries are less saturated, so that bright colours approach white without changes
//!   of hue. The result is for a display with gamma 2.2.

use super::color::linear_to_srgb;
use lumiris_numbers::math::luminance;
use strum::{EnumString, IntoStaticStr, VariantNames};

/// A view transform.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, EnumString, IntoStaticStr, VariantNames)]
#[strum(serialize_all = "kebab-case")]
pub enum ViewTransform {
    /// Clipped.
    #[default]
    Srgb,
    /// A film curve per channel.
    Filmic,
    /// AgX.
    Agx,
}

impl ViewTransform {
    /// Converts linear Rec.709 light to display colours, 0..1.
    pub fn apply(self, rgb: [f32; 3]) -> [f32; 3] {
        match self {
            ViewTransform::Srgb => rgb.map(|v| linear_to_srgb(v.clamp(0.0, 1.0))),
            ViewTransform::Filmic => {
                rgb.map(|v| linear_to_srgb((hable(2.0 * v.max(0.0)) / hable(11.2)).clamp(0.0, 1.0)))
            }
            ViewTransform::Agx => agx(rgb),
        }
    }
}

/// The curve of [Hable 2010].
fn hable(x: f32) -> f32 {
    let [a, b, c, d, e, f] = [0.15, 0.5, 0.1, 0.2, 0.02, 0.3];
    // Avoids ∞/∞. The limit is reached long before
    let x = x.min(1e6);
    (x * (a * x + c * b) + d * e) / (x * (a * x + b) + d * f) - e / f
}

/// Rows of the matrix to the primaries of AgX, and of its inverse.
const INSET: [[f32; 3]; 3] = [
    [0.842_479_06, 0.078_433_6, 0.079_223_745],
    [0.042_328_24, 0.878_468_64, 0.079_166_13],
    [0.042_375_65, 0.078_433_6, 0.879_142_97],
];
const OUTSET: [[f32; 3]; 3] = [
    [1.196_879, -0.098_020_88, -0.099_029_74],
    [-0.052_896_85, 1.151_903_1, -0.098_961_18],
    [-0.052_971_63, -0.098_043_45, 1.151_073_7],
];
/// Range of the logarithmic encoding (log₂ of the value).
const STOPS: [f32; 2] = [-12.473_93, 4.026_069];

fn agx(rgb: [f32; 3]) -> [f32; 3] {
    let encoded = transform(&INSET, rgb).map(|v| {
        let stops = v.max(1e-10).log2().clamp(STOPS[0], STOPS[1]);
        sigmoid((stops - STOPS[0]) / (STOPS[1] - STOPS[0]))
    });
    transform(&OUTSET, encoded).map(|v| linear_to_srgb(v.clamp(0.0, 1.0).powf(2.2)))
}

/// The contrast curve of AgX on 0..1 [Wrensch 2023].
fn sigmoid(x: f32) -> f32 {
    const C: [f32; 7] = [15.5, -40.14, 31.96, -6.868, 0.4298, 0.1191, -0.002_32];
    C.into_iter().fold(0.0, |sum, c| sum * x + c)
}

fn transform(rows: &[[f32; 3]; 3], [x, y, z]: [f32; 3]) -> [f32; 3] {
    rows.map(|[a, b, c]| a * x + b * y + c * z)
}

/// The exposure (stops) that maps the geometric mean of luminance to middle grey, 18 % [Reinhard et al. 2002]. Pixels
/// without light and the darkest and brightest 5 % of the rest are ignored; 0 if none is left.
pub fn auto_exposure(pixels: impl Iterator<Item = [f32; 3]>) -> f32 {
    let mut luminances: Vec<f32> =
        pixels.map(|rgb| luminance(rgb.map(f64::from)) as f32).filter(|&l| l > 0.0 && l.is_finite()).collect();
    luminances.sort_unstable_by(f32::total_cmp);
    let rest = luminances.len() / 20;
    let middle = &luminances[rest..luminances.len() - rest];
    if middle.is_empty() {
        return 0.0;
    }
    let sum: f64 = middle.iter().map(|&l| f64::from(l).log2()).sum();
    (0.18_f64.log2() - sum / middle.len() as f64) as f32
}

#[cfg(test)]
mod tests {
    use super::*;
    use strum::VariantNames;

    fn all() -> impl Iterator<Item = ViewTransform> {
        ViewTransform::VARIANTS.iter().map(|name| name.parse().unwrap())
    }

    #[test]
    fn grey_stays_grey_and_grows_from_black_to_white() {
        for view in all() {
            let mut last = -1.0;
            for stop in -120..=80 {
                let v = (stop as f32 * 0.1).exp2() * 0.18;
                let [r, g, b] = view.apply([v; 3]);
                assert!((r - g).abs() < 2e-3 && (g - b).abs() < 2e-3, "{view:?} {v}: {r} {g} {b}");
                assert!(g >= last - 1e-3 && (0.0..=1.0).contains(&g), "{view:?} {v}: {g} after {last}");
                last = g;
            }
            assert!(view.apply([0.0; 3]).iter().all(|&v| v < 0.01), "{view:?}");
            assert!(view.apply([1e4; 3]).iter().all(|&v| v > 0.98), "{view:?}");
            assert!(view.apply([f32::INFINITY, 1.0, -1.0]).iter().all(|v| (0.0..=1.0).contains(v)), "{view:?}");
        }
    }

    /// Published values: Hable's figures of his curve, and AgX's middle, which keeps middle grey.
    #[test]
    fn curves_have_their_published_values() {
        assert!(hable(0.0).abs() < 1e-6);
        assert!((hable(11.2) - 0.725_13).abs() < 1e-4, "{}", hable(11.2));
        let grey = ViewTransform::Agx.apply([0.18; 3])[1];
        let linear = crate::imaging::color::srgb_to_linear(grey);
        assert!((linear - 0.2).abs() < 0.03, "{linear}");
        for row in 0..3 {
            let unit: [f32; 3] = std::array::from_fn(|i| if i == row { 1.0 } else { 0.0 });
            let back = transform(&OUTSET, transform(&INSET, unit));
            assert!((0..3).all(|i| (back[i] - unit[i]).abs() < 1e-5), "{back:?}");
        }
    }

    #[test]
    fn bright_colours_run_to_white_where_srgb_clips_them() {
        let red = [50.0, 0.5, 0.5];
        let [clipped, agx] = [ViewTransform::Srgb, ViewTransform::Agx].map(|view| view.apply(red));
        assert!(clipped[0] > 0.999 && clipped[1] < 0.75, "{clipped:?}");
        assert!(agx[1] > 0.75 && agx[0] > agx[1], "{agx:?}");
    }

    #[test]
    fn automatic_exposure_makes_the_middle_grey_whatever_the_lamps_are() {
        let exposure = |pixels: &[f32]| auto_exposure(pixels.iter().map(|&v| [v; 3]));
        assert!((exposure(&[0.045; 10]) - 2.0).abs() < 1e-5);
        let mut pixels = vec![0.72; 100];
        pixels[..4].copy_from_slice(&[1e6, f32::INFINITY, f32::NAN, 0.0]);
        assert!((exposure(&pixels) + 2.0).abs() < 1e-5);
        assert_eq!(exposure(&[0.0, -1.0]), 0.0);
    }
}
