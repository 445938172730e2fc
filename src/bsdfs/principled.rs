//! Metal, glossy diffuse or glass under a coat, see [`lumiris_lanes::kernels::principled`].

use super::kernel::KernelBsdf;
use super::lobe::MicrofacetLobe;
use super::microfacet::{SMOOTH_ALPHA, TrowbridgeReitz};
use super::sheen::Sheen;
use lumiris_lanes::kernels;
use lumiris_lanes::kernels::principled::{Choice, PARAMS, Params};
use lumiris_numbers::math::{Rgb, Vec3};

/// The interior of the glass.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Interior {
    /// A sheet without thickness.
    Thin,
    /// A solid with this index of refraction, other than 1.
    Solid(f32),
}

/// Metal, glossy diffuse or glass, under a coat.
#[derive(Clone, Copy, Debug)]
pub struct Principled {
    /// Reflectance of the metal, albedo of the diffuse base, transmittance of the glass.
    pub base_color: Rgb,
    /// Fraction of metal.
    pub metalness: f32,
    /// Reflectance of the dielectric at normal incidence.
    pub f0: Rgb,
    /// Reflectance of the dielectric at grazing angles.
    pub f90: f32,
    /// Microfacets; not smooth.
    pub distribution: TrowbridgeReitz,
    /// Fraction of glass in the dielectric.
    pub transmission: f32,
    /// The interior of the glass.
    pub interior: Interior,
    /// Sheen of fibres on the base.
    pub sheen: Sheen,
    /// Weight of the coat.
    pub coat: f32,
    /// Microfacets of the coat; not smooth.
    pub coat_distribution: TrowbridgeReitz,
}

/// Raises the roughness of smooth microfacets to the minimum that is not smooth.
pub fn rough(distribution: TrowbridgeReitz) -> TrowbridgeReitz {
    TrowbridgeReitz { alpha_x: distribution.alpha_x.max(SMOOTH_ALPHA), alpha_y: distribution.alpha_y.max(SMOOTH_ALPHA) }
}

impl Principled {
    /// The index of refraction of a transmitting solid; `None` for others.
    pub(super) fn eta_mut(&mut self) -> Option<&mut f32> {
        match &mut self.interior {
            Interior::Solid(eta) if self.transmission > 0.0 && self.metalness < 1.0 => Some(eta),
            Interior::Solid(_) | Interior::Thin => None,
        }
    }

    /// Fraction of metal or glass.
    pub fn metal_or_glass(&self) -> f32 {
        self.metalness + (1.0 - self.metalness) * self.transmission
    }

    fn choice(&self, wo: Vec3) -> Choice<f32> {
        Params::new(&self.params()).choice(wo.into())
    }

    /// Probability of the microfacet lobes, see [`super::Bsdf::first_lobe`].
    pub(super) fn first_lobe(&self, wo: Vec3) -> f32 {
        self.choice(wo).facets
    }

    /// The strongest reflected lobe, see [`super::Bsdf::glossy_lobe`].
    pub(super) fn glossy_lobe(&self, wo: Vec3) -> Option<MicrofacetLobe> {
        let choice = self.choice(wo);
        if self.transmission > 0.0 {
            None
        } else if choice.coat > choice.facets {
            Some(MicrofacetLobe { distribution: self.coat_distribution, share: choice.coat })
        } else {
            Some(MicrofacetLobe { distribution: self.distribution, share: choice.facets })
        }
    }

    /// Probability of the cosine lobe, see [`super::Bsdf::wide_lobe`].
    pub(super) fn wide_lobe(&self, wo: Vec3) -> f32 {
        self.choice(wo).diffuse
    }

    /// Density of the microfacet lobes, including their probability, see [`super::Bsdf::pdf_first_lobe`].
    pub(super) fn pdf_first_lobe(&self, wo: Vec3, wi: Vec3) -> f32 {
        if wo.z * wi.z <= 0.0 {
            return 0.0;
        }
        self.choice(wo).facets * self.distribution.pdf_reflection(wo, wi)
    }
}

impl KernelBsdf for Principled {
    type Formulas = kernels::Principled;
    type Params = [f32; PARAMS];

    fn params(&self) -> [f32; PARAMS] {
        let (color, f0, sheen) = (self.base_color, self.f0, self.sheen.color);
        let eta = match self.interior {
            Interior::Thin => 0.0,
            Interior::Solid(eta) => eta,
        };
        let TrowbridgeReitz { alpha_x, alpha_y } = self.distribution;
        // In the order of `kernels::principled::Params::new`
        [
            color.r,
            color.g,
            color.b,
            self.metalness,
            f0.r,
            f0.g,
            f0.b,
            self.f90,
            alpha_x,
            alpha_y,
            self.transmission,
            eta,
            sheen.r,
            sheen.g,
            sheen.b,
            self.sheen.alpha,
            self.coat,
            self.coat_distribution.alpha_x,
        ]
    }
}
