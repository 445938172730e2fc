//! RGB colour spaces of scene files, their conversion to linear Rec.709, and white balance.

use crate::spectra::{blackbody_xyz, rec709_matrix};
use glam::{DMat3, DVec3};
use lumiris_numbers::math::{Mat3, Rgb, Vec3};

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
pub type Chromaticities = [[f64; 2]; 4];

const REC709: Chromaticities = [[0.64, 0.33], [0.30, 0.60], [0.15, 0.06], [0.3127, 0.3290]];

impl ColorSpace {
    /// The names of the format.
    pub const NAMES: [&str; 4] = ["srgb", "dci-p3", "rec2020", "aces2065-1"];

    /// The space with a name.
    pub fn from_name(name: &str) -> Option<Self> {
        let all = [ColorSpace::Srgb, ColorSpace::DciP3, ColorSpace::Rec2020, ColorSpace::Aces2065];
        Self::NAMES.iter().position(|n| *n == name).map(|i| all[i])
    }

    fn chromaticities(self) -> Chromaticities {
        match self {
            ColorSpace::Srgb => REC709,
            ColorSpace::DciP3 => [[0.680, 0.320], [0.265, 0.690], [0.150, 0.060], [0.3127, 0.3290]],
            ColorSpace::Rec2020 => [[0.708, 0.292], [0.170, 0.797], [0.131, 0.046], [0.3127, 0.3290]],
            ColorSpace::Aces2065 => [[0.7347, 0.2653], [0.0, 1.0], [0.0001, -0.077], [0.32168, 0.33767]],
        }
    }

    /// Converts a colour of this space to linear Rec.709.
    pub fn to_rec709(self, rgb: [f32; 3], of: Colored) -> Rgb {
        // All spaces have a conversion
        match rec709_from(&self.chromaticities(), of).filter(|_| self != ColorSpace::Srgb) {
            Some(matrix) => Rgb::from_array((matrix * Vec3::from_array(rgb)).to_array()),
            None => Rgb::from_array(rgb),
        }
    }
}

/// The quantity of a colour.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Colored {
    /// Light: the white of a space has the chromaticity of its white point.
    Light,
    /// A factor of light, such as a reflectance: equal components are grey in any space.
    Factor,
}

/// Conversion from linear colours with these primaries to linear Rec.709, through XYZ. For factors, the white point is
/// adapted by Bradford. `None` if the chromaticities are degenerate.
pub fn rec709_from(chromaticities: &Chromaticities, of: Colored) -> Option<Mat3> {
    let xyz_from_rgb = xyz_from_rgb(*chromaticities);
    let xyz_from_rec709 = self::xyz_from_rgb(REC709);
    let white = |xyz_from_rgb: DMat3| xyz_from_rgb * DVec3::ONE;
    let adapted = match of {
        Colored::Light => DMat3::IDENTITY,
        Colored::Factor => adaptation(white(xyz_from_rgb), white(xyz_from_rec709)),
    };
    let matrix = (xyz_from_rec709.inverse() * adapted * xyz_from_rgb).as_mat3();
    (matrix.is_finite() && matrix.determinant() != 0.0).then_some(matrix)
}

/// True if these chromaticities are those of Rec.709, to the precision of files.
pub fn is_rec709(chromaticities: &Chromaticities) -> bool {
    const ROUNDING: f64 = 1e-3;
    chromaticities.as_flattened().iter().zip(REC709.as_flattened()).all(|(a, b)| (a - b).abs() < ROUNDING)
}

/// Cone responses of XYZ by rows [Lam 1985], called Bradford.
const BRADFORD: [[f64; 3]; 3] = [[0.8951, 0.2664, -0.1614], [-0.7502, 1.7135, 0.0367], [0.0389, -0.0685, 1.0296]];
/// White balance temperatures (K) of cameras.
const TEMPERATURES: std::ops::RangeInclusive<f32> = 1000.0..=25_000.0;

/// The map of linear Rec.709 that makes daylight of a correlated colour temperature (K) white, by scaling Bradford's
/// cone responses; below 4000 K, a black body. `None` below 1000 K and above 25,000 K. As in pbrt-v4.
pub fn white_balance(kelvin: f32) -> Option<Mat3> {
    if !TEMPERATURES.contains(&kelvin) {
        return None;
    }
    let rgb_from_xyz = DMat3::from_cols_array_2d(&rec709_matrix()).transpose();
    let xyz_from_rgb = rgb_from_xyz.inverse();
    let source = daylight_xyz(kelvin).unwrap_or_else(|| DVec3::from_array(blackbody_xyz(kelvin.into())));
    let adapted = adaptation(source / source.y, xyz_from_rgb * DVec3::ONE);
    Some((rgb_from_xyz * adapted * xyz_from_rgb).as_mat3())
}

/// The map of XYZ that adapts one white to another by scaling Bradford's cone responses.
fn adaptation(from: DVec3, to: DVec3) -> DMat3 {
    let bradford = DMat3::from_cols_array_2d(&BRADFORD).transpose();
    bradford.inverse() * DMat3::from_diagonal((bradford * to) / (bradford * from)) * bradford
}

/// XYZ of daylight with Y = 1 [CIE 15:2004]; `None` below 4000 K.
fn daylight_xyz(kelvin: f32) -> Option<DVec3> {
    // The second radiation constant has been revised since: D65 has 6504 K
    let t = f64::from(kelvin) * 1.4388 / 1.4380;
    let x = match t {
        ..4000.0 => return None,
        ..7000.0 => -4.6070e9 / t.powi(3) + 2.9678e6 / t.powi(2) + 0.09911e3 / t + 0.244063,
        _ => -2.0064e9 / t.powi(3) + 1.9018e6 / t.powi(2) + 0.24748e3 / t + 0.23704,
    };
    let y = -3.0 * x * x + 2.870 * x - 0.275;
    Some(DVec3::new(x / y, 1.0, (1.0 - x - y) / y))
}

/// The matrix whose columns are the primaries, scaled so that (1, 1, 1) is white with Y = 1.
fn xyz_from_rgb(chromaticities: Chromaticities) -> DMat3 {
    let [r, g, b, white] = chromaticities.map(|[x, y]| DVec3::new(x / y, 1.0, (1.0 - x - y) / y));
    let primaries = DMat3::from_cols(r, g, b);
    primaries * DMat3::from_diagonal(primaries.inverse() * white)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn d65_spaces_share_their_white_and_rec709_is_itself() {
        for space in [ColorSpace::Srgb, ColorSpace::DciP3, ColorSpace::Rec2020] {
            let white = space.to_rec709([1.0; 3], Colored::Light);
            assert!((white - Rgb::WHITE).map(f32::abs).max_component() < 1e-5, "{space:?} {white:?}");
        }
        // The green of Rec.2020 lies outside of Rec.709.
        let green = ColorSpace::Rec2020.to_rec709([0.0, 1.0, 0.0], Colored::Light);
        assert!((green.r + 0.5876).abs() < 1e-3 && (green.g - 1.1329).abs() < 1e-3 && green.b < 0.0, "{green:?}");
    }

    #[test]
    fn the_white_of_aces_is_warmer_than_d65() {
        let white = ColorSpace::Aces2065.to_rec709([1.0; 3], Colored::Light);
        assert!(white.r > white.b && (white.luminance() - 1.0).abs() < 1e-3, "{white:?}");
        // A white surface is white under any illuminant
        let white = ColorSpace::Aces2065.to_rec709([0.5; 3], Colored::Factor);
        assert!((white - Rgb::splat(0.5)).map(f32::abs).max_component() < 1e-5, "{white:?}");
    }

    #[test]
    fn chromaticities_that_are_no_space_have_no_conversion() {
        let with = |place: usize, xy: [f64; 2]| {
            let mut all = REC709;
            all[place] = xy;
            all
        };
        for wrong in [with(0, [0.3, 0.6]), with(3, [0.3, 0.0]), with(1, [f64::NAN, 0.5]), [[0.0; 2]; 4]] {
            assert!(rec709_from(&wrong, Colored::Light).is_none() && !is_rec709(&wrong), "{wrong:?}");
        }
        assert!(is_rec709(&with(0, [0.6401, 0.33])) && !is_rec709(&with(0, [0.68, 0.32])));
    }

    #[test]
    fn white_balance_makes_its_light_white() {
        // The chromaticities of D50 and D55, and of a black body of 2856 K, illuminant A
        for (kelvin, [x, y]) in
            [(5000.0, [0.34567, 0.35850]), (5500.0, [0.33242, 0.34743]), (2856.0, [0.44757, 0.40745])]
        {
            let light = to_rec709_from_xyz(DVec3::new(x / y, 1.0, (1.0 - x - y) / y));
            let white = white_balance(kelvin).unwrap() * light.as_vec3();
            assert!((white - white.y).abs().max_element() < 4e-3, "{kelvin} {white}");
            assert!((white.y - 1.0).abs() < 4e-3, "{kelvin} {white}");
        }
        // D65 is unchanged, and so are all colours under it
        let same = white_balance(6500.0).unwrap();
        assert!((same - Mat3::IDENTITY).to_cols_array().iter().all(|x| x.abs() < 4e-3), "{same}");
        // The published adaptation of XYZ from D50 to D65 [Lindbloom 2017]
        let published = DMat3::from_cols_array_2d(&[
            [0.955_576_6, -0.023_039_3, 0.063_163_6],
            [-0.028_289_5, 1.009_941_6, 0.021_007_7],
            [0.012_298_2, -0.020_483_0, 1.329_909_8],
        ]);
        let xyz_from_rgb = xyz_from_rgb(REC709);
        let expected = xyz_from_rgb.inverse() * published.transpose() * xyz_from_rgb;
        let found = white_balance(5003.0).unwrap();
        assert!((found - expected.as_mat3()).to_cols_array().iter().all(|x| x.abs() < 3e-3), "{found} {expected}");
        assert!([0.0, 999.0, 1e9, f32::NAN, -5000.0].iter().all(|&k| white_balance(k).is_none()));
    }

    fn to_rec709_from_xyz(xyz: DVec3) -> DVec3 {
        xyz_from_rgb(REC709).inverse() * xyz
    }

    #[test]
    fn every_name_is_known() {
        assert!(ColorSpace::NAMES.iter().all(|n| ColorSpace::from_name(n).is_some()));
        assert_eq!(ColorSpace::from_name("cmyk"), None);
    }
}
