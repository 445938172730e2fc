//! Lambertian reflection and transmission, see [`kernels::diffuse_transmission`].

use super::kernel::KernelBsdf;
use lumiris_lanes::kernels;
use lumiris_numbers::math::Rgb;

/// Lambertian reflection and transmission.
#[derive(Clone, Copy, Debug)]
pub struct DiffuseTransmission {
    /// Hemispherical reflectance ρ.
    pub reflectance: Rgb,
    /// Hemispherical transmittance τ.
    pub transmittance: Rgb,
}

impl DiffuseTransmission {
    /// Probability of sampling reflection, see [`super::Bsdf::first_lobe`].
    pub(super) fn first_lobe(&self) -> f32 {
        kernels::diffuse_transmission::p_reflect(&self.params())
    }
}

impl KernelBsdf for DiffuseTransmission {
    type Formulas = kernels::DiffuseTransmission;
    type Params = [f32; 6];

    fn params(&self) -> [f32; 6] {
        let (r, t) = (self.reflectance, self.transmittance);
        [r.r, r.g, r.b, t.r, t.g, t.b]
    }
}
