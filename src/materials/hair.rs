//! The material `hair`: textures at a hit → a fibre.

use super::parameters::{Textures, valid_eta};
use crate::bsdfs::Hair;
use crate::bsdfs::hair::HairLobes;
use crate::textures::{FloatTextureId, RgbTextureId};
use lumiris_numbers::math::Rgb;

/// The colour parameters of a fibre.
#[derive(Clone, Copy, Debug)]
pub enum HairColor {
    /// Absorption per radius of the fibre.
    SigmaA(RgbTextureId),
    /// Colour of a bulk of fibres.
    Reflectance(RgbTextureId),
    /// Concentrations of melanin.
    Melanin {
        /// Brown melanin.
        eumelanin: FloatTextureId,
        /// Red melanin.
        pheomelanin: FloatTextureId,
    },
}

/// Parameters of `hair`. The texture coordinate v is the offset of a path across the fibre.
#[derive(Clone, Copy, Debug)]
pub struct HairMaterial {
    /// Colour parameters.
    pub color: HairColor,
    /// Index of refraction.
    pub eta: FloatTextureId,
    /// Longitudinal roughness.
    pub beta_m: FloatTextureId,
    /// Azimuthal roughness.
    pub beta_n: FloatTextureId,
    /// Tilt of the scales (degrees).
    pub alpha: FloatTextureId,
}

impl HairMaterial {
    /// The fibre at a hit.
    pub(super) fn bsdf(&self, t: &Textures<'_>) -> Hair {
        let lobes =
            HairLobes { beta_m: t.float(self.beta_m), beta_n: t.float(self.beta_n), alpha: t.float(self.alpha) };
        let sigma_a = match self.color {
            HairColor::SigmaA(id) => t.rgb(id),
            HairColor::Reflectance(id) => Hair::sigma_a_of_reflectance(t.albedo(id), lobes.beta_n),
            HairColor::Melanin { eumelanin, pheomelanin } => {
                let [e, p] = [eumelanin, pheomelanin].map(|id| t.float(id).max(0.0));
                Hair::sigma_a_of_melanin(e, p)
            }
        };
        let sigma_a = if sigma_a.is_finite() { sigma_a } else { Rgb::BLACK };
        Hair::new(2.0 * t.ctx.uv.y - 1.0, valid_eta(t.float(self.eta)), sigma_a, lobes)
    }
}
