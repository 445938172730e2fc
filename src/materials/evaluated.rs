//! Materials whose BSDF can only be evaluated, see [`crate::bsdfs::models`].

use super::parameters::Textures;
use crate::bsdfs::Model;
use crate::bsdfs::models::{AshikhminShirley, CookTorrance, CosineLobe, LobeAxis, OrenNayar};
use crate::textures::{FloatTextureId, RgbTextureId};

/// A reflectance model with textures for its parameters. Albedos are clamped to 0..1.
#[derive(Clone, Copy, Debug)]
pub enum EvaluatedMaterial {
    /// Lambertian.
    Diffuse {
        /// Albedo.
        reflectance: RgbTextureId,
    },
    /// Rough diffuse.
    OrenNayar {
        /// Albedo.
        reflectance: RgbTextureId,
        /// Standard deviation of the facets' slope angle (degrees).
        sigma: FloatTextureId,
    },
    /// Microfacets over a Lambertian.
    CookTorrance {
        /// Albedo of the base.
        reflectance: RgbTextureId,
        /// Reflectance of the facets at normal incidence.
        specular: RgbTextureId,
        /// Root mean square slope of the facets.
        slope: FloatTextureId,
        /// The facets' fraction of the surface.
        amount: FloatTextureId,
    },
    /// Power of a cosine over a Lambertian.
    CosineLobe {
        /// Albedo of the base.
        reflectance: RgbTextureId,
        /// Albedo of the lobe along the normal.
        specular: RgbTextureId,
        /// Exponent.
        exponent: FloatTextureId,
        /// Axis of the lobe.
        axis: LobeAxis,
    },
    /// Anisotropic power of a cosine over a diffuse base.
    AshikhminShirley {
        /// Albedo of the base.
        reflectance: RgbTextureId,
        /// Reflectance of the lobe at normal incidence.
        specular: RgbTextureId,
        /// Exponents along ∂p/∂u and across it.
        exponents: [FloatTextureId; 2],
    },
}

impl EvaluatedMaterial {
    /// The model at a point.
    pub(super) fn model(&self, t: &Textures<'_>) -> Model {
        match *self {
            EvaluatedMaterial::Diffuse { reflectance } => Model::Diffuse(t.albedo(reflectance)),
            EvaluatedMaterial::OrenNayar { reflectance, sigma } => {
                Model::OrenNayar(OrenNayar::new(t.albedo(reflectance), t.float(sigma).to_radians()))
            }
            EvaluatedMaterial::CookTorrance { reflectance, specular, slope, amount } => {
                let (base, facets) = (t.albedo(reflectance), t.albedo(specular));
                Model::CookTorrance(CookTorrance::new(base, facets, t.float(slope), t.float(amount)))
            }
            EvaluatedMaterial::CosineLobe { reflectance, specular, exponent, axis } => {
                let (base, lobe) = (t.albedo(reflectance), t.albedo(specular));
                Model::CosineLobe(CosineLobe::new(base, lobe, t.float(exponent), axis))
            }
            EvaluatedMaterial::AshikhminShirley { reflectance, specular, exponents } => {
                let (base, lobe) = (t.albedo(reflectance), t.albedo(specular));
                Model::AshikhminShirley(AshikhminShirley::new(base, lobe, exponents.map(|id| t.float(id))))
            }
        }
    }
}
