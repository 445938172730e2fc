//! Reflection by a metal, see [`kernels::conductor`].

use super::kernel::KernelBsdf;
use super::microfacet::TrowbridgeReitz;
use lumiris_lanes::kernels;
use lumiris_numbers::math::Rgb;

/// Metallic reflection, on both sides of the surface.
#[derive(Clone, Copy, Debug)]
pub struct Conductor {
    /// Microfacets.
    pub distribution: TrowbridgeReitz,
    /// Real part of the index of refraction relative to the outside.
    pub eta: Rgb,
    /// Imaginary part (extinction) relative to the outside.
    pub k: Rgb,
}

/// A complex index of refraction, relative to the outside.
#[derive(Clone, Copy, Debug)]
pub struct ComplexIor {
    /// Real part.
    pub eta: Rgb,
    /// Imaginary part (extinction).
    pub k: Rgb,
}

impl Conductor {
    /// η and k of a metal of the given reflectance at normal incidence: η = 1, k = 2√r/√(1 − r), as in pbrt-v4.
    pub fn eta_k_of_reflectance(reflectance: Rgb) -> ComplexIor {
        let k = reflectance.clamp(0.0, 0.9999).map(|r| 2.0 * r.sqrt() / (1.0 - r).sqrt());
        ComplexIor { eta: Rgb::WHITE, k }
    }
}

impl KernelBsdf for Conductor {
    type Formulas = kernels::Conductor;
    type Params = [f32; 8];

    fn params(&self) -> [f32; 8] {
        let (distribution, eta, k) = (&self.distribution, self.eta, self.k);
        [distribution.alpha_x, distribution.alpha_y, eta.r, eta.g, eta.b, k.r, k.g, k.b]
    }
}
