//! The material of [`crate::bsdfs::principled`].

use super::{Textures, distribution_of};
use crate::bsdfs::Principled;
use crate::bsdfs::principled::{Interior, rough};
use crate::bsdfs::sheen::{LEAST_ALPHA, Sheen};
use crate::textures::{FloatTextureId, RgbTextureId};
use lumiris_numbers::math::sqr;

/// Textures of a principled BSDF; weights and colours are clamped to 0..1.
#[derive(Clone, Copy, Debug)]
pub struct PrincipledMaterial {
    /// Colour of metal, diffuse base and glass.
    pub base_color: RgbTextureId,
    /// Part that is metal.
    pub metalness: FloatTextureId,
    /// Square root of alpha.
    pub roughness: FloatTextureId,
    /// How far alpha along ∂p/∂u is on the way from alpha to 1, square root.
    pub anisotropy: f32,
    /// Index of refraction.
    pub ior: f32,
    /// Factor of the dielectric's reflectance.
    pub specular: FloatTextureId,
    /// Colour of the dielectric's reflectance at normal incidence.
    pub specular_color: RgbTextureId,
    /// Part of the dielectric that is glass.
    pub transmission: FloatTextureId,
    /// True if glass is a sheet; else a solid.
    pub is_thin: bool,
    /// Weight of the sheen.
    pub sheen: FloatTextureId,
    /// Colour of the sheen.
    pub sheen_color: RgbTextureId,
    /// Square root of the sheen's alpha.
    pub sheen_roughness: FloatTextureId,
    /// Weight of the coat.
    pub coat: FloatTextureId,
    /// Square root of the coat's alpha.
    pub coat_roughness: FloatTextureId,
}

impl PrincipledMaterial {
    /// The BSDF at a point.
    pub(super) fn bsdf(&self, t: &Textures<'_>) -> Principled {
        let unit = |id: FloatTextureId| t.float(id).clamp(0.0, 1.0);
        let specular = unit(self.specular);
        let f0 = sqr((self.ior - 1.0) / (self.ior + 1.0));
        let alpha = sqr(unit(self.roughness));
        let along = alpha + (1.0 - alpha) * sqr(self.anisotropy.clamp(0.0, 1.0));
        let coat_alpha = sqr(unit(self.coat_roughness));
        let refracts = !self.is_thin && (self.ior - 1.0).abs() > 1e-3;
        Principled {
            base_color: t.albedo(self.base_color),
            metalness: unit(self.metalness),
            f0: (t.rgb(self.specular_color) * f0).clamp(0.0, 1.0) * specular,
            f90: specular,
            distribution: rough(distribution_of(along, alpha, false)),
            transmission: unit(self.transmission),
            interior: if refracts { Interior::Solid(self.ior) } else { Interior::Thin },
            sheen: Sheen {
                color: t.rgb(self.sheen_color).clamp(0.0, 1.0) * unit(self.sheen),
                alpha: sqr(unit(self.sheen_roughness)).max(LEAST_ALPHA),
            },
            coat: unit(self.coat),
            coat_distribution: rough(distribution_of(coat_alpha, coat_alpha, false)),
        }
    }
}
