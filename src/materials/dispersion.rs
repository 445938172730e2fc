//! Dispersion: an index of refraction that depends on the wavelength, in paths that carry RGB.
//!
//! A path carries all wavelengths until it reaches a dispersive surface. There one wavelength λ is sampled for the rest
//! of the path, and its throughput is multiplied by r(λ)/p(λ), where r are the responses of the channels to white
//! light, each with the integral 1. Results that do not depend on λ therefore keep their mean, and all light of one
//! path belongs to the same λ. The density p is the mean of the responses, which bounds the factor by 3.
//!
//! The responses are those of the CIE 1931 observer to D65 in Rec.709, without their negative parts. Monochromatic
//! colours are outside of Rec.709, and are therefore rendered less saturated. As everywhere, the spectra of lights and
//! reflectances within a channel are treated as constant.
//!
//! `integrators/vertex_search.rs` samples the wavelength of a path at its first dispersive surface.

use lumiris_formats::spectra::{Spectrum, WHITE_RANGE, white_responses};
use lumiris_numbers::math::{PiecewiseConstant1D, Rgb};
use std::sync::OnceLock;

/// Difference of indices below which a material does not disperse.
const LEAST_DIFFERENCE: f32 = 1e-5;

/// The index of refraction by wavelength.
#[derive(Clone, Debug)]
pub struct Dispersion {
    /// Index at each nm of the responses.
    eta: Vec<f32>,
}

/// The wavelengths of white light.
struct White {
    first: f32,
    density: PiecewiseConstant1D,
    /// r/p at each nm.
    weights: Vec<Rgb>,
}

fn white() -> &'static White {
    static WHITE: OnceLock<White> = OnceLock::new();
    WHITE.get_or_init(|| {
        let responses = white_responses();
        let means: Vec<f32> = responses.iter().map(|r| r.average()).collect();
        let weight = |(r, &mean): (&Rgb, &f32)| if mean > 0.0 { *r / mean } else { Rgb::BLACK };
        let weights = responses.iter().zip(&means).map(weight).collect();
        White { first: *WHITE_RANGE.start() as f32, density: PiecewiseConstant1D::new(&means), weights }
    })
}

/// A sampled wavelength.
#[derive(Clone, Copy, Debug)]
pub struct WavelengthSample {
    /// The wavelength (nm).
    pub lambda: f32,
    /// r/p.
    pub weight: Rgb,
}

/// Samples a wavelength with density p.
#[inline]
pub fn sample_wavelength(u: f32) -> WavelengthSample {
    let white = white();
    // White light has power, so there is always a sample
    white.density.sample(u).map_or(WavelengthSample { lambda: white.first, weight: Rgb::BLACK }, |s| {
        let bins = white.density.len() as f32;
        WavelengthSample { lambda: white.first + s.x * bins - 0.5, weight: white.weights[s.index] }
    })
}

/// Density of [`sample_wavelength`] per nm.
pub fn pdf_wavelength(lambda: f32) -> f32 {
    let white = white();
    let bins = white.density.len() as f32;
    let x = (lambda - white.first + 0.5) / bins;
    if (0.0..1.0).contains(&x) { white.density.pdf(x) / bins } else { 0.0 }
}

impl Dispersion {
    /// The dispersion of a spectrum of indices, which is extended by its end values; `None` if it is constant or not
    /// positive.
    pub fn new(eta: &Spectrum) -> Option<Self> {
        let eta: Vec<f32> = WHITE_RANGE.map(|l| eta.at_clamped(l as f32)).collect();
        let (min, max) = eta.iter().fold((f32::INFINITY, 0.0_f32), |(a, b), &e| (a.min(e), b.max(e)));
        (min > 0.0 && max.is_finite() && max - min > LEAST_DIFFERENCE).then_some(Dispersion { eta })
    }

    /// The index at a wavelength (nm).
    #[inline]
    pub fn eta(&self, lambda: f32) -> f32 {
        let last = self.eta.len() - 1;
        let x = (lambda - white().first).clamp(0.0, last as f32);
        let i = (x as usize).min(last - 1);
        self.eta[i] + (self.eta[i + 1] - self.eta[i]) * (x - i as f32)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use lumiris_test_support::assert_chi_squared;
    use lumiris_test_support::random::{RngExt, pcg32};

    #[test]
    fn the_mean_over_all_wavelengths_is_white() {
        const N: u32 = 1 << 16;
        let (mut sum, mut greatest) = ([0.0_f64; 3], 0.0_f32);
        for i in 0..N {
            let WavelengthSample { lambda, weight } = sample_wavelength((i as f32 + 0.5) / N as f32);
            (0..3).for_each(|c| sum[c] += f64::from(weight[c]) / f64::from(N));
            greatest = greatest.max(weight.max_component());
            assert!((359.0..787.0).contains(&lambda) && weight.r >= 0.0 && weight.g >= 0.0 && weight.b >= 0.0);
            assert!((weight.r + weight.g + weight.b - 3.0).abs() < 1e-4);
        }
        assert!(sum.iter().all(|s| (s - 1.0).abs() < 2e-3) && greatest <= 3.0, "{sum:?} {greatest}");
        // Long waves are red, short ones blue
        let share = |lambda: f32| white().weights[(lambda - 360.0) as usize];
        assert!(share(630.0).r > 2.5 && share(540.0).g > 2.0 && share(450.0).b > 2.5);
    }

    #[test]
    fn wavelengths_follow_their_density_by_chi_squared() {
        const CELLS: usize = 60;
        let mut stream = pcg32([7, 8, 9]);
        let (mut observed, count) = (vec![0.0; CELLS], 100_000);
        let cell = |lambda: f32| (((lambda - 359.5) / 426.0 * CELLS as f32) as usize).min(CELLS - 1);
        for _ in 0..count {
            observed[cell(sample_wavelength(stream.random::<f32>()).lambda)] += 1.0;
        }
        let mut expected = vec![0.0; CELLS];
        for i in 0..426 * 60 {
            let lambda = 359.5 + (i as f32 + 0.5) / 60.0;
            expected[cell(lambda)] += f64::from(pdf_wavelength(lambda)) / 60.0 * f64::from(count);
        }
        assert!((expected.iter().sum::<f64>() / f64::from(count) - 1.0).abs() < 1e-4);
        assert_chi_squared(&observed, &expected, 1e-6);
    }

    #[test]
    fn glass_bends_blue_more_than_red() {
        let glass = Dispersion::new(&Spectrum::named("glass-SF11").unwrap()).unwrap();
        assert!(glass.eta(450.0) > glass.eta(550.0) + 0.02 && glass.eta(550.0) > glass.eta(650.0) + 0.01);
        assert_eq!(glass.eta(100.0), glass.eta(360.0));
        assert!((glass.eta(587.6) - 1.784_72).abs() < 1e-4);
        assert!(Dispersion::new(&Spectrum::constant(1.5)).is_none());
        assert!(Dispersion::new(&Spectrum::from_pairs(&[400.0, -1.0, 700.0, 1.5]).unwrap()).is_none());
    }
}
