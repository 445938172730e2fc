//! A material of any kind, with its maps.

use super::dispersion::Dispersion;
use super::evaluated::EvaluatedMaterial;
use super::hair::HairMaterial;
use super::parameters::{Coat, ConductorSpectrum, Roughness};
use super::principled::PrincipledMaterial;
use crate::textures::{FloatTextureId, ImageId, ImageTexture, Mapping2d, RgbTextureId};
use std::sync::Arc;
use strum::IntoStaticStr;

/// Index into a [`MaterialSet`](super::MaterialSet).
pub type MaterialId = u32;

/// A surface material.
#[derive(Clone, Copy, Debug, IntoStaticStr)]
#[strum(serialize_all = "lowercase")]
pub enum Material {
    /// Lambertian.
    Diffuse {
        /// Albedo, clamped to 0..1.
        reflectance: RgbTextureId,
    },
    /// Metal.
    Conductor {
        /// Optical constants.
        spectrum: ConductorSpectrum,
        /// Roughness.
        roughness: Roughness,
    },
    /// Glass.
    Dielectric {
        /// Index of refraction of the side behind the normal.
        eta: f32,
        /// Roughness.
        roughness: Roughness,
    },
    /// A sheet of glass.
    ThinDielectric {
        /// Index of refraction.
        eta: f32,
    },
    /// Lambertian on both sides.
    DiffuseTransmission {
        /// Reflectance before scale.
        reflectance: RgbTextureId,
        /// Transmittance before scale.
        transmittance: RgbTextureId,
        /// Factor of both; the products are clamped to 0..1.
        scale: f32,
    },
    /// Lambertian under a dielectric coat.
    CoatedDiffuse {
        /// Albedo of the base, clamped to 0..1.
        reflectance: RgbTextureId,
        /// The coat.
        coat: Coat,
    },
    /// Metal under a dielectric coat.
    CoatedConductor {
        /// Optical constants of the metal, relative to vacuum.
        conductor: ConductorSpectrum,
        /// Roughness of the metal.
        roughness: Roughness,
        /// The coat.
        coat: Coat,
    },
    /// Metal, glossy diffuse or glass under a coat.
    Principled(PrincipledMaterial),
    /// Fibres.
    Hair(HairMaterial),
    /// Measured reflection.
    Measured {
        /// Index into the tables of the [`MaterialSet`](super::MaterialSet).
        tables: u32,
    },
    /// Reflection that can only be evaluated.
    Evaluated(EvaluatedMaterial),
    /// One of two materials at each point, the second with probability `amount`.
    Mix {
        /// The materials.
        materials: [MaterialId; 2],
        /// Probability of the second.
        amount: FloatTextureId,
    },
    /// No surface: rays pass through.
    Interface,
}

impl Material {
    /// Name of the kind of material, for messages.
    pub fn kind_name(&self) -> &'static str {
        self.into()
    }
}

/// A tangent-space normal map.
#[derive(Clone, Copy, Debug)]
pub struct NormalMap {
    /// The image, stored linear.
    pub image: ImageTexture,
    /// Factor of the tangential components.
    pub strength: f32,
    /// True if the second axis of tangent space is on the side of the bitangent, as in glTF; else it is to the left of
    /// the first axis, as in pbrt-v4.
    pub is_along_v: bool,
}

impl NormalMap {
    /// The map with the conventions of pbrt-v4.
    pub fn unscaled(image: ImageId) -> Self {
        let image = ImageTexture { image, mapping: Mapping2d::default(), udim: None, scale: 1.0, invert: false };
        NormalMap { image, strength: 1.0, is_along_v: false }
    }
}

/// A material with its name and its maps.
#[derive(Clone, Debug)]
pub struct MaterialEntry {
    /// Name, for messages.
    pub name: String,
    /// The material.
    pub material: Material,
    /// Tangent-space normal map, stored linear; it takes precedence over displacement.
    pub normal_map: Option<NormalMap>,
    /// Displacement along the normal, which affects only the shading normal (scene units).
    pub displacement: Option<FloatTextureId>,
    /// The index of refraction by wavelength, which replaces the index of the material.
    pub dispersion: Option<Arc<Dispersion>>,
}
