//! Parameters that materials have in common, and their values at a point.

use crate::bsdfs::{Base, ComplexIor, Conductor, Dielectric, Layered, TrowbridgeReitz};
use crate::textures::{FloatTextureId, RgbTextureId, TextureContext, TextureSet};
use lumiris_numbers::math::Rgb;

/// Roughness of a microfacet surface.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Roughness {
    /// Along ∂p/∂u.
    pub u: FloatTextureId,
    /// Across it.
    pub v: FloatTextureId,
    /// True for alpha = √roughness, false for alpha = roughness.
    pub remap: bool,
}

/// Optical constants of a metal.
#[derive(Clone, Copy, Debug)]
pub enum ConductorSpectrum {
    /// Index of refraction and extinction.
    EtaK {
        /// Real part of the index.
        eta: RgbTextureId,
        /// Imaginary part.
        k: RgbTextureId,
    },
    /// Reflectance at normal incidence: η = 1, k = 2√r/√(1 − r).
    Reflectance(RgbTextureId),
}

/// A dielectric coat.
#[derive(Clone, Copy, Debug)]
pub struct Coat {
    /// Roughness of the interface.
    pub roughness: Roughness,
    /// Thickness in mean free paths.
    pub thickness: FloatTextureId,
    /// Index of refraction.
    pub eta: f32,
    /// Asymmetry of the medium.
    pub g: FloatTextureId,
    /// Single-scattering albedo of the medium, clamped to 0..1.
    pub albedo: RgbTextureId,
    /// Greatest number of events in the coat.
    pub max_depth: u32,
    /// Walks per evaluation, where walks are needed.
    pub samples: u32,
}

/// The textures at a point.
pub(super) struct Textures<'a> {
    pub(super) set: &'a TextureSet,
    pub(super) ctx: &'a TextureContext,
}

impl Textures<'_> {
    pub(super) fn float(&self, id: FloatTextureId) -> f32 {
        self.set.float(id, self.ctx)
    }

    pub(super) fn rgb(&self, id: RgbTextureId) -> Rgb {
        self.set.rgb(id, self.ctx)
    }

    pub(super) fn albedo(&self, id: RgbTextureId) -> Rgb {
        self.rgb(id).clamp(0.0, 1.0)
    }

    pub(super) fn distribution(&self, roughness: Roughness) -> TrowbridgeReitz {
        distribution_of(self.float(roughness.u), self.float(roughness.v), roughness.remap)
    }

    /// A base under a coat.
    pub(super) fn layered(&self, base: Base, coat: &Coat) -> Layered {
        Layered {
            top: Dielectric { eta: valid_eta(coat.eta), distribution: self.distribution(coat.roughness) },
            base,
            thickness: self.float(coat.thickness).max(f32::MIN_POSITIVE),
            albedo: self.albedo(coat.albedo),
            // At ±1 the phase function is a delta, which walks cannot connect.
            g: self.float(coat.g).clamp(-0.99, 0.99),
            max_depth: coat.max_depth,
            samples: coat.samples.max(1),
        }
    }

    /// The metal under a medium with index of refraction `outside`.
    pub(super) fn conductor(&self, spectrum: ConductorSpectrum, roughness: Roughness, outside: f32) -> Conductor {
        let ComplexIor { eta, k } = match spectrum {
            ConductorSpectrum::EtaK { eta, k } => ComplexIor { eta: self.rgb(eta), k: self.rgb(k) },
            ConductorSpectrum::Reflectance(r) => Conductor::eta_k_of_reflectance(self.rgb(r)),
        };
        Conductor { distribution: self.distribution(roughness), eta: eta / outside, k: k / outside }
    }
}

/// Treats an index of 0 as no interface, as pbrt-v4 does, and also a negative one or NaN.
pub(super) fn valid_eta(eta: f32) -> f32 {
    if eta > 0.0 { eta } else { 1.0 }
}

/// Microfacets of two roughness values.
pub(super) fn distribution_of(u: f32, v: f32, remap: bool) -> TrowbridgeReitz {
    let alpha = |r| if remap { TrowbridgeReitz::roughness_to_alpha(r) } else { r };
    TrowbridgeReitz::new(alpha(u), alpha(v))
}
