//! Spectra to linear Rec.709 colour.
//!
//! The renderer works in RGB. A measured spectrum becomes the colour that a spectral renderer with the CIE 1931
//! observer would show:
//!
//! - reflectance ρ(λ): X = ∫ρ·x̄·D65 dλ / ∫ȳ·D65 dλ and so on, so that ρ = 1 is white;
//! - emission E(λ): the same without D65, scaled to Y = 1: as in pbrt-v4, the brightness of a light is given by its
//!   `scale` or `power`, and its spectrum determines only the colour;
//! - η(λ), k(λ) of a conductor: see [`conductor_rgb`].

use super::number::numbers_of_text;
use super::spectra_data as data;
use lumiris_numbers::math::Rgb;
use std::path::Path;
use std::sync::OnceLock;

/// First wavelength of the integrals (nm).
pub(super) const LAMBDA_MIN: u32 = 360;
/// Last wavelength of the integrals (nm).
pub(super) const LAMBDA_MAX: u32 = 785;

/// A spectrum by linear interpolation between samples, and 0 outside of them.
#[derive(Clone, Debug, PartialEq)]
pub struct Spectrum {
    lambda: Vec<f32>,
    value: Vec<f32>,
}

impl Spectrum {
    /// From wavelengths (nm) in increasing order, and values.
    fn from_slices(lambda: &[f32], value: &[f32]) -> Self {
        Spectrum { lambda: lambda.to_vec(), value: value.to_vec() }
    }

    /// A constant spectrum.
    pub fn constant(value: f32) -> Self {
        Spectrum { lambda: vec![1.0, 1e5], value: vec![value; 2] }
    }

    /// From the value at each nm of the integration range.
    pub(super) fn per_nm(value: impl Fn(u32) -> f32) -> Self {
        let range = LAMBDA_MIN..=LAMBDA_MAX;
        Spectrum { lambda: range.clone().map(|l| l as f32).collect(), value: range.map(value).collect() }
    }

    /// From pairs of wavelength (nm) and value.
    pub fn from_pairs(pairs: &[f32]) -> Result<Self, String> {
        if pairs.is_empty() || !pairs.len().is_multiple_of(2) {
            return Err("a spectrum is a list of pairs of wavelength and value".to_owned());
        }
        let lambda: Vec<f32> = pairs.iter().step_by(2).copied().collect();
        let value = pairs.iter().skip(1).step_by(2).copied().collect();
        if let Some(w) = lambda.windows(2).find(|w| w[0] >= w[1]) {
            return Err(format!("wavelengths of a spectrum must increase, but {} follows {}", w[1], w[0]));
        }
        Ok(Spectrum { lambda, value })
    }

    /// From the text of an `.spd` file: pairs, with comments after `#`.
    pub fn from_text(text: &str) -> Result<Self, String> {
        Spectrum::from_pairs(&numbers_of_text(text)?)
    }

    /// Reads an `.spd` file.
    pub fn read(path: &Path) -> Result<std::io::Result<Self>, String> {
        match std::fs::read(path) {
            Ok(bytes) => Spectrum::from_text(&String::from_utf8_lossy(&bytes)).map(Ok),
            Err(error) => Ok(Err(error)),
        }
    }

    /// The tabulated optical constant with a name such as `metal-Cu-eta`, or the index of a glass.
    pub fn named(name: &str) -> Option<Self> {
        let metal = |value: &[f32]| Spectrum::from_slices(data::METAL_LAMBDA, value);
        Some(match name {
            "metal-Ag-eta" => metal(data::AG_ETA),
            "metal-Ag-k" => metal(data::AG_K),
            "metal-Al-eta" => metal(data::AL_ETA),
            "metal-Al-k" => metal(data::AL_K),
            "metal-Au-eta" => metal(data::AU_ETA),
            "metal-Au-k" => metal(data::AU_K),
            "metal-Cu-eta" => metal(data::CU_ETA),
            "metal-Cu-k" => metal(data::CU_K),
            "metal-CuZn-eta" => Spectrum::from_slices(data::CUZN_LAMBDA, data::CUZN_ETA),
            "metal-CuZn-k" => Spectrum::from_slices(data::CUZN_LAMBDA, data::CUZN_K),
            "metal-MgO-eta" => Spectrum::from_slices(data::MGO_LAMBDA, data::MGO_ETA),
            "metal-MgO-k" => Spectrum::constant(0.0),
            "metal-TiO2-eta" => Spectrum::from_slices(data::TIO2_LAMBDA, data::TIO2_ETA),
            "metal-TiO2-k" => Spectrum::from_slices(data::TIO2_LAMBDA, data::TIO2_K),
            _ => {
                let (_, b, c) = data::GLASSES.iter().find(|g| g.0 == name)?;
                Spectrum::per_nm(|l| sellmeier(b, c, f64::from(l)) as f32)
            }
        })
    }

    /// Names that [`Spectrum::named`] and [`illuminant_rgb`] accept.
    pub fn names() -> impl Iterator<Item = &'static str> {
        const METALS: [&str; 14] = [
            "metal-Ag-eta",
            "metal-Ag-k",
            "metal-Al-eta",
            "metal-Al-k",
            "metal-Au-eta",
            "metal-Au-k",
            "metal-Cu-eta",
            "metal-Cu-k",
            "metal-CuZn-eta",
            "metal-CuZn-k",
            "metal-MgO-eta",
            "metal-MgO-k",
            "metal-TiO2-eta",
            "metal-TiO2-k",
        ];
        METALS.into_iter().chain(data::GLASSES.iter().map(|g| g.0)).chain(data::ILLUMINANTS.iter().map(|i| i.0))
    }

    /// The value at a wavelength (nm).
    pub fn at(&self, lambda: f32) -> f32 {
        let i = self.lambda.partition_point(|&l| l <= lambda);
        match (i.checked_sub(1), self.lambda.get(i)) {
            (Some(before), Some(&next)) => {
                let t = (lambda - self.lambda[before]) / (next - self.lambda[before]);
                self.value[before] * (1.0 - t) + self.value[i] * t
            }
            // The last sample is part of the spectrum.
            (Some(last), None) if lambda == self.lambda[last] => self.value[last],
            _ => 0.0,
        }
    }

    /// The value at a wavelength (nm), extended by the end values: optical constants do not end at the table.
    pub fn at_clamped(&self, lambda: f32) -> f32 {
        match (self.lambda.first(), self.lambda.last()) {
            (Some(&first), Some(&last)) => self.at(lambda.clamp(first, last)),
            _ => 0.0,
        }
    }

    /// The value at the helium d line: the index of refraction of a dielectric without dispersion.
    pub fn at_d_line(&self) -> f32 {
        self.at(587.6)
    }
}

/// The index of a glass at a wavelength (nm).
fn sellmeier(b: &[f64; 3], c: &[f64; 3], lambda: f64) -> f64 {
    let squared = (lambda * 1e-3).powi(2);
    (1.0 + b.iter().zip(c).map(|(b, c)| b * squared / (squared - c)).sum::<f64>()).sqrt()
}

/// Wavelengths (nm) of [`white_responses`].
pub const WHITE_RANGE: std::ops::RangeInclusive<u32> = LAMBDA_MIN..=LAMBDA_MAX;

/// Responses of the Rec.709 channels to white light (D65) at each nm of [`WHITE_RANGE`], without negative parts; each
/// channel sums to 1.
pub fn white_responses() -> &'static [Rgb] {
    static RESPONSES: OnceLock<Vec<Rgb>> = OnceLock::new();
    RESPONSES.get_or_init(|| {
        let all: Vec<[f64; 3]> = d65_observer().map(|xyz| to_rgb(xyz).map(|c| c.max(0.0))).collect();
        let sum = all.iter().fold([0.0; 3], |sum, &c| add(sum, c));
        all.iter().map(|c| rgb([0, 1, 2].map(|i| c[i] / sum[i]))).collect()
    })
}

/// Colour matching functions and illuminant over the integration range.
struct Observer {
    /// x̄, ȳ, z̄ per nm of the range.
    bars: Vec<[f64; 3]>,
    /// D65 per nm of the range, scaled to ∫ȳ·D65 = 1.
    d65: Vec<f64>,
    rgb_from_xyz: [[f64; 3]; 3],
}

fn observer() -> &'static Observer {
    static OBSERVER: OnceLock<Observer> = OnceLock::new();
    OBSERVER.get_or_init(|| {
        let table = |values: &[f32], step: u32, lambda: u32| {
            let i = ((lambda - LAMBDA_MIN) / step) as usize;
            let t = f64::from((lambda - LAMBDA_MIN) % step) / f64::from(step);
            let next = values.get(i + 1).copied().unwrap_or(0.0);
            f64::from(values[i]) * (1.0 - t) + f64::from(next) * t
        };
        let bars: Vec<[f64; 3]> = (LAMBDA_MIN..=LAMBDA_MAX)
            .map(|l| [data::CIE_X, data::CIE_Y, data::CIE_Z].map(|bar| table(bar, data::CIE_STEP as u32, l)))
            .collect();
        let d65: Vec<f64> = (LAMBDA_MIN..=LAMBDA_MAX).map(|l| table(data::D65, 10, l)).collect();
        let y: f64 = bars.iter().zip(&d65).map(|(bar, d)| bar[1] * d).sum();
        let d65: Vec<f64> = d65.iter().map(|d| d / y).collect();
        let white = bars.iter().zip(&d65).fold([0.0; 3], |sum, (bar, d)| add(sum, bar.map(|b| b * d)));
        Observer { rgb_from_xyz: rec709_from_xyz(white), bars, d65 }
    })
}

fn add(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[0] + b[0], a[1] + b[1], a[2] + b[2]]
}

/// The matrix that maps the Rec.709 primaries to the unit vectors and `white` to (1, 1, 1) [ITU-R BT.709].
fn rec709_from_xyz(white: [f64; 3]) -> [[f64; 3]; 3] {
    let primaries = [[0.64, 0.33], [0.30, 0.60], [0.15, 0.06]].map(|[x, y]| [x, y, 1.0 - x - y]);
    let inverse = invert_columns(primaries);
    let scale = inverse.map(|row| row[0] * white[0] + row[1] * white[1] + row[2] * white[2]);
    [0, 1, 2].map(|i| inverse[i].map(|v| v / scale[i]))
}

/// Inverse of the matrix of three columns, by rows.
fn invert_columns([a, b, c]: [[f64; 3]; 3]) -> [[f64; 3]; 3] {
    let cross =
        |u: [f64; 3], v: [f64; 3]| [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]];
    let bc = cross(b, c);
    let determinant = a[0] * bc[0] + a[1] * bc[1] + a[2] * bc[2];
    [bc, cross(c, a), cross(a, b)].map(|row| row.map(|v| v / determinant))
}

/// The matrix from CIE XYZ to linear Rec.709, by rows.
pub(super) fn rec709_matrix() -> [[f64; 3]; 3] {
    observer().rgb_from_xyz
}

/// (x̄, ȳ, z̄)·D65 at each nm of the integration range, with ∫ȳ·D65 = 1.
pub(super) fn d65_observer() -> impl Iterator<Item = [f64; 3]> {
    let o = observer();
    o.bars.iter().zip(&o.d65).map(|(bar, d)| bar.map(|b| b * d))
}

pub(super) fn to_rgb(xyz: [f64; 3]) -> [f64; 3] {
    observer().rgb_from_xyz.map(|row| row[0] * xyz[0] + row[1] * xyz[1] + row[2] * xyz[2])
}

fn rgb(channels: [f64; 3]) -> Rgb {
    Rgb::from_array(channels.map(|c| c as f32))
}

/// Linear Rec.709 of CIE XYZ relative to Y = 1 for white.
pub fn xyz_to_rgb(xyz: [f32; 3]) -> Rgb {
    rgb(to_rgb(xyz.map(f64::from)))
}

/// ∫ f·(x̄, ȳ, z̄)·D65, with ∫ȳ·D65 = 1, in Rec.709.
fn under_d65(f: impl Fn(f32) -> f64) -> [f64; 3] {
    let o = observer();
    let xyz = (LAMBDA_MIN..=LAMBDA_MAX).zip(o.bars.iter().zip(&o.d65)).fold([0.0; 3], |sum, (l, (bar, d))| {
        let weight = d * f(l as f32);
        add(sum, bar.map(|b| b * weight))
    });
    to_rgb(xyz)
}

/// The colour of a reflectance under D65, clamped to 0..=1.
pub fn reflectance_rgb(spectrum: &Spectrum) -> Rgb {
    unbounded_rgb(spectrum).clamp(0.0, 1.0)
}

/// As [`reflectance_rgb`] for quantities that may exceed 1.
pub fn unbounded_rgb(spectrum: &Spectrum) -> Rgb {
    rgb(under_d65(|l| f64::from(spectrum.at(l)))).map(|c| c.max(0.0))
}

/// Weights of the samples of a reflectance at wavelengths (nm) in increasing order, for linear Rec.709 under D65. The
/// reflectance is linear between them and constant beyond them. The weights of each channel sum to 1.
pub fn hat_weights(lambda: &[f32]) -> Vec<[f64; 3]> {
    let hat = |i: usize, l: f32| {
        let rise = |from: f32, to: f32| f64::from((l - from) / (to - from)).clamp(0.0, 1.0);
        let before = i.checked_sub(1).map_or(1.0, |before| rise(lambda[before], lambda[i]));
        let after = lambda.get(i + 1).map_or(1.0, |&after| rise(after, lambda[i]));
        before.min(after)
    };
    (0..lambda.len()).map(|i| under_d65(|l| hat(i, l))).collect()
}

/// The colour of an emission scaled to Y = 1; black if it emits nothing visible.
pub fn emission_rgb(spectrum: &Spectrum) -> Rgb {
    emission_of(|l| f64::from(spectrum.at(l)))
}

fn emission_of(f: impl Fn(f32) -> f64) -> Rgb {
    let xyz = xyz_of(f);
    if xyz[1] > 0.0 { rgb(to_rgb(xyz.map(|c| c / xyz[1]))).map(|c| c.max(0.0)) } else { Rgb::BLACK }
}

/// ∫ f·(x̄, ȳ, z̄).
fn xyz_of(f: impl Fn(f32) -> f64) -> [f64; 3] {
    (LAMBDA_MIN..=LAMBDA_MAX).zip(&observer().bars).fold([0.0; 3], |sum, (l, bar)| {
        let value = f(l as f32);
        add(sum, bar.map(|b| b * value))
    })
}

/// XYZ of a black body of a positive temperature (K), up to a factor.
pub(super) fn blackbody_xyz(kelvin: f64) -> [f64; 3] {
    xyz_of(|l| planck(f64::from(l), kelvin))
}

/// ∫ȳ over wavelength (nm): the luminance of a spectrum of constant 1, if it is not normalised.
pub const Y_INTEGRAL: f32 = 106.856_895;

/// The colour of a black body at a temperature (K), scaled to Y = 1, by Planck's law; black for temperatures that are
/// not positive.
pub fn blackbody_rgb(kelvin: f32) -> Rgb {
    if kelvin.is_nan() || kelvin <= 0.0 {
        return Rgb::BLACK;
    }
    emission_of(|l| planck(f64::from(l), f64::from(kelvin)))
}

/// The colour of a black body whose spectral radiance has the maximum 1, so that hotter bodies appear brighter. Y is
/// [`Y_INTEGRAL`] for a spectrum of constant 1, as in pbrt-v4 for emission without luminance normalisation. Black for
/// temperatures that are not positive.
pub fn glow_rgb(kelvin: f32) -> Rgb {
    if kelvin.is_nan() || kelvin <= 0.0 {
        return Rgb::BLACK;
    }
    // Wien's displacement constant (nm·K)
    const WIEN: f64 = 2.897_771_955e6;
    let kelvin = f64::from(kelvin);
    let peak = planck(WIEN / kelvin, kelvin);
    let y: f64 = (LAMBDA_MIN..=LAMBDA_MAX)
        .zip(&observer().bars)
        .map(|(l, bar)| bar[1] * planck(f64::from(l), kelvin) / peak)
        .sum();
    if y.is_finite() { blackbody_rgb(kelvin as f32) * y as f32 } else { Rgb::BLACK }
}

/// Spectral radiance of a black body at the wavelength `l` (nm), relative to 555 nm in the exponent, so that cold
/// bodies do not underflow.
fn planck(l: f64, kelvin: f64) -> f64 {
    // Second radiation constant hc/k (m·K)
    const C2: f64 = 1.438_776_877e-2;
    let exponent = |l: f64| C2 / (l * 1e-9 * kelvin);
    (555.0 / l).powi(5) * (exponent(555.0) - exponent(l)).exp() / -(-exponent(l)).exp_m1()
}

/// The colour of a CIE standard illuminant scaled to Y = 1.
pub fn illuminant_rgb(name: &str) -> Option<Rgb> {
    if name == "stdillum-D65" {
        return Some(Rgb::WHITE);
    }
    let [x, y] = data::ILLUMINANTS.iter().find(|i| i.0 == name)?.1;
    Some(rgb(to_rgb([x / y, 1.0, (1.0 - x - y) / y])).map(|c| c.max(0.0)))
}

/// Reflectance of a conductor in air for unpolarised light [Born and Wolf, §14.2].
pub fn fresnel_conductor(cos: f64, eta: f64, k: f64) -> f64 {
    let (cos2, sin2) = (cos * cos, 1.0 - cos * cos);
    let t0 = eta * eta - k * k - sin2;
    let a2_b2 = (t0 * t0 + 4.0 * eta * eta * k * k).sqrt();
    let a = (0.5 * (a2_b2 + t0)).max(0.0).sqrt();
    let t1 = a2_b2 + cos2;
    let t2 = 2.0 * cos * a;
    let rs = (t1 - t2) / (t1 + t2);
    let t3 = cos2 * a2_b2 + sin2 * sin2;
    let t4 = t2 * sin2;
    0.5 * rs * (1.0 + (t3 - t4) / (t3 + t4))
}

/// Cosine of the second angle that [`conductor_rgb`] matches: 75°.
const COS_75: f64 = 0.258_819_045_102_520_76;
/// Cosines of 0°, 45°, 60°, 70°, 75° and 85°, where [`nearest_conductor`] compares.
const COSINES: [f64; 6] =
    [1.0, std::f64::consts::FRAC_1_SQRT_2, 0.5, 0.342_020_143_325_668_7, COS_75, 0.087_155_742_747_658_17];

/// Optical constants of a conductor.
#[derive(Clone, Copy, Debug)]
pub struct Conductor<T> {
    /// Index of refraction.
    pub eta: T,
    /// Absorption.
    pub k: T,
}

/// Optical constants per channel with which an RGB renderer reproduces the reflectance of the measured spectra.
///
/// The reflectance spectrum is integrated to RGB under D65 at 0° and at 75°. For each channel this pair is matched
/// exactly if a pair (η, k) exists. The red of copper decreases more steeply towards grazing angles than any (η, k)
/// allows: then the maximum relative difference between 0° and 85° is minimised. Saturated metals leave the gamut (the
/// red of gold is 1.02); values above 1 are clipped.
pub fn conductor_rgb(eta: &Spectrum, k: &Spectrum) -> Conductor<Rgb> {
    let reflectance = |cos: f64| {
        under_d65(|l| fresnel_conductor(cos, f64::from(eta.at_clamped(l)), f64::from(k.at_clamped(l)).max(0.0)))
    };
    let (reflectances, grazing) = (COSINES.map(reflectance), reflectance(COS_75));
    let typical = under_d65(|l| f64::from(eta.at_clamped(l)));
    let channels = [0, 1, 2].map(|c| {
        let channel = reflectances.map(|r| r[c].clamp(1e-5, 0.9999));
        fit_conductor(channel[0], grazing[c], typical[c]).unwrap_or_else(|| nearest_conductor(channel))
    });
    Conductor { eta: rgb(channels.map(|c| c.eta)), k: rgb(channels.map(|c| c.k)) }
}

/// The (η, k) whose reflectances at [`COSINES`] have the smallest maximum relative difference to the given ones.
fn nearest_conductor(reflectances: [f64; 6]) -> Conductor<f64> {
    const ETAS: i32 = 120;
    const NORMALS: i32 = 80;
    let (mut best, mut min) = (Conductor { eta: 1.0, k: 0.0 }, f64::INFINITY);
    for i in 0..=ETAS {
        // η from 0.02 to 20, and the reflectance at 0° within ±4 % of the given one.
        let eta = 0.02 * 1000f64.powf(f64::from(i) / f64::from(ETAS));
        for j in 0..=NORMALS {
            let normal = reflectances[0] * (1.0 + 0.04 * (2.0 * f64::from(j) / f64::from(NORMALS) - 1.0));
            let k = k_of(normal.min(0.9999), eta);
            let error = |(cos, r): (f64, f64)| (fresnel_conductor(cos, eta, k) / r - 1.0).abs();
            let largest = COSINES.into_iter().zip(reflectances).map(error).fold(0.0, f64::max);
            if largest < min {
                (best, min) = (Conductor { eta, k }, largest);
            }
        }
    }
    best
}

/// The k that gives the reflectance `normal` at 0° together with `eta`.
fn k_of(normal: f64, eta: f64) -> f64 {
    let (up, down) = (eta + 1.0, eta - 1.0);
    ((normal * up * up - down * down) / (1.0 - normal)).max(0.0).sqrt()
}

/// The (η, k) nearest to the index `typical` with the reflectances `normal` at 0° and `grazing` at 75°; `None` if there
/// is none.
fn fit_conductor(normal: f64, grazing: f64, typical: f64) -> Option<Conductor<f64>> {
    const STEPS: i32 = 400;
    let root = normal.sqrt();
    // k is real in this interval.
    let (low, high) = ((1.0 - root) / (1.0 + root), (1.0 + root) / (1.0 - root));
    let eta_at = |i: i32| low * (high / low).powf(f64::from(i) / f64::from(STEPS));
    let error = |eta: f64| fresnel_conductor(COS_75, eta, k_of(normal, eta)) - grazing;
    let distance = |eta: f64| (eta / typical.max(1e-3)).ln().abs();
    // If several indices match, take the one nearest to the measured index.
    let mut best: Option<f64> = None;
    for i in 0..STEPS {
        let (mut a, mut b) = (eta_at(i), eta_at(i + 1));
        if (error(a) < 0.0) == (error(b) < 0.0) {
            continue;
        }
        let rising = error(a) < 0.0;
        for _ in 0..60 {
            let middle = 0.5 * (a + b);
            if (error(middle) < 0.0) == rising { a = middle } else { b = middle }
        }
        if best.is_none_or(|eta| distance(a) < distance(eta)) {
            best = Some(a);
        }
    }
    best.map(|eta| Conductor { eta, k: k_of(normal, eta) })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn near(a: Rgb, b: [f32; 3], tolerance: f32) {
        let worst = (0..3).map(|c| (a[c] - b[c]).abs()).fold(0.0, f32::max);
        assert!(worst <= tolerance, "{a:?} is not {b:?}");
    }

    #[test]
    fn conductors_whose_tables_end_inside_the_visible_range_stay_finite() {
        for metal in ["MgO", "TiO2", "CuZn", "Ag"] {
            let curve = |what: &str| Spectrum::named(&format!("metal-{metal}-{what}")).unwrap();
            let Conductor { eta, k } = conductor_rgb(&curve("eta"), &curve("k"));
            assert!(eta.is_finite() && k.is_finite() && eta.r > 0.0, "{metal}: {eta:?} {k:?}");
        }
        // Magnesium oxide is a clear crystal of index 1.74, for any form of its table.
        let Conductor { eta, k } =
            conductor_rgb(&Spectrum::named("metal-MgO-eta").unwrap(), &Spectrum::named("metal-MgO-k").unwrap());
        let f0 = fresnel_conductor(1.0, f64::from(eta.g), f64::from(k.g));
        assert!((f0 - (0.74_f64 / 2.74).powi(2)).abs() < 0.01, "{f0}");
    }

    #[test]
    fn tables_are_those_of_the_standard() {
        // Equal energy has the chromaticity (1/3, 1/3); the integral of y is 106.857.
        let sum = |t: &[f32]| t.iter().map(|&v| f64::from(v)).sum::<f64>() * 5.0;
        for bar in [data::CIE_X, data::CIE_Y, data::CIE_Z] {
            assert!((sum(bar) - 106.87).abs() < 0.06, "{}", sum(bar));
        }
        // D65 is at (0.31272, 0.32903).
        let o = observer();
        let white = o.bars.iter().zip(&o.d65).fold([0.0; 3], |s, (b, d)| add(s, b.map(|v| v * d)));
        let total: f64 = white.iter().sum();
        assert!((white[0] / total - 0.312_72).abs() < 2e-4 && (white[1] / total - 0.329_03).abs() < 2e-4, "{white:?}");
        // The well-known matrix of sRGB.
        near(xyz_to_rgb([0.950_47, 1.0, 1.088_83]), [1.0; 3], 2e-3);
        near(xyz_to_rgb([0.412_456, 0.212_673, 0.019_334]), [1.0, 0.0, 0.0], 2e-3);
    }

    #[test]
    fn white_is_white_and_black_bodies_have_their_colours() {
        near(reflectance_rgb(&Spectrum::constant(1.0)), [1.0; 3], 1e-5);
        near(reflectance_rgb(&Spectrum::constant(0.25)), [0.25; 3], 1e-5);
        near(illuminant_rgb("stdillum-D65").unwrap(), [1.0; 3], 0.0);
        for kelvin in [1000.0, 2856.0, 6504.0, 20_000.0] {
            assert!((blackbody_rgb(kelvin).luminance() - 1.0).abs() < 0.03, "{kelvin}");
        }
        // Illuminant A is a black body of 2856 K; 6504 K is near D65.
        let a = illuminant_rgb("stdillum-A").unwrap();
        near(blackbody_rgb(2856.0), a.to_array(), 0.01);
        near(blackbody_rgb(6504.0), [1.0; 3], 0.06);
        // The white of ACES is close to daylight of 6000 K, between D50 and D65.
        let [d50, d60] = ["stdillum-D50", "illum-acesD60"].map(|name| illuminant_rgb(name).unwrap());
        assert!((d60.luminance() - 1.0).abs() < 1e-3 && d60.r > d60.g && d60.g > d60.b && d60.b > d50.b, "{d60:?}");
        assert_eq!(blackbody_rgb(-1.0), Rgb::BLACK);
        assert!(blackbody_rgb(100.0).is_finite());
    }

    #[test]
    fn metals_show_their_colours_at_both_angles() {
        for metal in ["Ag", "Al", "Au", "Cu", "CuZn"] {
            let table = |q: &str| Spectrum::named(&format!("metal-{metal}-{q}")).unwrap();
            let (eta_table, k_table) = (table("eta"), table("k"));
            let Conductor { eta, k } = conductor_rgb(&eta_table, &k_table);
            let reflectance =
                |cos: f64| under_d65(|l| fresnel_conductor(cos, f64::from(eta_table.at(l)), f64::from(k_table.at(l))));
            let (normal, grazing) = (reflectance(1.0), reflectance(COS_75));
            for c in 0..3 {
                let exact = fit_conductor(normal[c].clamp(1e-5, 0.9999), grazing[c], 1.0).is_some();
                let error = |cos: f64| {
                    let shown = fresnel_conductor(cos, f64::from(eta[c]), f64::from(k[c]));
                    (shown - reflectance(cos)[c].min(1.0)).abs()
                };
                // All channels match exactly except the red of gold, which is brighter than white.
                assert_eq!(exact, !(metal == "Au" && c == 0), "{metal} {c}");
                let (at_normal, at_grazing) = (error(1.0), error(COS_75));
                let tolerance = if exact { 2e-4 } else { 0.006 };
                assert!(at_normal < tolerance && at_grazing < tolerance, "{metal} {c}: {at_normal} {at_grazing}");
            }
        }
        let Conductor { eta, k } =
            conductor_rgb(&Spectrum::named("metal-Au-eta").unwrap(), &Spectrum::named("metal-Au-k").unwrap());
        let gold = [0, 1, 2].map(|c| fresnel_conductor(1.0, f64::from(eta[c]), f64::from(k[c])) as f32);
        assert!(gold[0] > 0.95 && gold[1] > 0.65 && gold[2] < 0.45, "{gold:?}");
    }

    #[test]
    fn spectra_are_read_from_text_and_checked() {
        let s = Spectrum::from_text("# gold\n400 1.0\n500, 2.0 # here\n\n600\t0\n").unwrap();
        assert_eq!((s.at(450.0), s.at(600.0), s.at(399.0), s.at(601.0)), (1.5, 0.0, 0.0, 0.0));
        assert!(Spectrum::from_text("400 1 500").is_err());
        assert!(Spectrum::from_text("400 1 400 2").unwrap_err().contains("increase"));
        assert!(Spectrum::from_text("400 x").unwrap_err().contains("`x`"));
        assert!(Spectrum::from_text("").is_err());
        // Values of the catalogue
        for (glass, index) in [
            ("BK7", 1.51680),
            ("BAF10", 1.67003),
            ("FK51A", 1.48656),
            ("LASF9", 1.85025),
            ("F5", 1.67271),
            ("SF5", 1.67271),
            ("F10", 1.72828),
            ("SF10", 1.72828),
            ("SF11", 1.78472),
        ] {
            let found = Spectrum::named(&format!("glass-{glass}")).unwrap().at_d_line();
            assert!((found - index).abs() < 2e-5, "{glass} {found}");
        }
        assert!(Spectrum::named("metal-Xx-eta").is_none());
        for name in Spectrum::names() {
            assert!(Spectrum::named(name).is_some() || illuminant_rgb(name).is_some(), "{name}");
        }
    }
}
