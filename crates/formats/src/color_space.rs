//! RGB colour spaces of scene files, and their conversion to linear Rec.709.

use glam::{DMat3, DVec3};
use lumiris_numbers::math::Rgb;

/// A colour space that `ColorSpace` names.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum ColorSpace {
    /// sRGB and Rec.709 primaries, D65.
    #[default]
    Srgb,
    /// DCI-P3 primaries, D65.
    DciP3,
    /// Rec.2020 primaries, D65.
    Rec2020,
    /// ACES 2065-1, D60.
    Aces2065,
}

/// Chromaticities (x, y) of red, green, blue and white.
const REC709: [[f64; 2]; 4] = [[0.64, 0.33], [0.30, 0.60], [0.15, 0.06], [0.3127, 0.3290]];

impl ColorSpace {
    /// The names of the format.
    pub const NAMES: [&str; 4] = ["srgb", "dci-p3", "rec2020", "aces2065-1"];

    /// The space of a name.
    pub fn from_name(name: &str) -> Option<Self> {
        let all = [ColorSpace::Srgb, ColorSpace::DciP3, ColorSpace::Rec2020, ColorSpace::Aces2065];
        Self::NAMES.iter().position(|n| *n == name).map(|i| all[i])
    }

    fn chromaticities(self) -> [[f64; 2]; 4] {
        match self {
            ColorSpace::Srgb => REC709,
            ColorSpace::DciP3 => [[0.680, 0.320], [0.265, 0.690], [0.150, 0.060], [0.3127, 0.3290]],
            ColorSpace::Rec2020 => [[0.708, 0.292], [0.170, 0.797], [0.131, 0.046], [0.3127, 0.3290]],
            ColorSpace::Aces2065 => [[0.7347, 0.2653], [0.0, 1.0], [0.0001, -0.077], [0.32168, 0.33767]],
        }
    }

    /// A colour of this space in linear Rec.709, through XYZ and without adapting the white: the white of a space is
    /// the light of that chromaticity.
    pub fn to_rec709(self, rgb: [f32; 3]) -> Rgb {
        if self == ColorSpace::Srgb {
            return Rgb::from_array(rgb);
        }
        let xyz = xyz_from_rgb(self.chromaticities()) * DVec3::from_array(rgb.map(f64::from));
        let out = xyz_from_rgb(REC709).inverse() * xyz;
        Rgb::new(out.x as f32, out.y as f32, out.z as f32)
    }
}

/// The matrix whose columns are the primaries, scaled so that (1, 1, 1) is the white of Y = 1.
fn xyz_from_rgb(chromaticities: [[f64; 2]; 4]) -> DMat3 {
    let [r, g, b, white] = chromaticities.map(|[x, y]| DVec3::new(x / y, 1.0, (1.0 - x - y) / y));
    // A primary with y = 0 is no light; none of the spaces has one.
    let primaries = DMat3::from_cols(r, g, b);
    primaries * DMat3::from_diagonal(primaries.inverse() * white)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn d65_spaces_share_their_white_and_rec709_is_itself() {
        for space in [ColorSpace::Srgb, ColorSpace::DciP3, ColorSpace::Rec2020] {
            let white = space.to_rec709([1.0; 3]);
            assert!((white - Rgb::WHITE).map(f32::abs).max_component() < 1e-5, "{space:?} {white:?}");
        }
        // The green of Rec.2020 lies outside of Rec.709.
        let green = ColorSpace::Rec2020.to_rec709([0.0, 1.0, 0.0]);
        assert!((green.r + 0.5876).abs() < 1e-3 && (green.g - 1.1329).abs() < 1e-3 && green.b < 0.0, "{green:?}");
    }

    #[test]
    fn the_white_of_aces_is_warmer_than_d65() {
        let white = ColorSpace::Aces2065.to_rec709([1.0; 3]);
        assert!(white.r > white.b && (white.luminance() - 1.0).abs() < 1e-3, "{white:?}");
    }

    #[test]
    fn every_name_is_known() {
        assert!(ColorSpace::NAMES.iter().all(|n| ColorSpace::from_name(n).is_some()));
        assert_eq!(ColorSpace::from_name("cmyk"), None);
    }
}
