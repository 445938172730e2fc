//! Lambertian reflection and transmission: f = ρ/π on the side of `wo`, τ/π on the other.

use super::{BsdfSample, Lobe};
use lumiris_numbers::math::{Rgb, Vec3, warp};
use std::f32::consts::FRAC_1_PI;

/// Lambertian reflection and transmission.
#[derive(Clone, Copy, Debug)]
pub struct DiffuseTransmission {
    /// Hemispherical reflectance ρ.
    pub reflectance: Rgb,
    /// Hemispherical transmittance τ.
    pub transmittance: Rgb,
}

impl DiffuseTransmission {
    /// Probability of sampling reflection; `None` if the surface is black.
    #[inline]
    pub(super) fn p_reflect(&self) -> Option<f32> {
        let (r, t) = (self.reflectance.max_component(), self.transmittance.max_component());
        (r + t > 0.0).then(|| r / (r + t))
    }

    /// Probability of sampling reflection, see [`super::Bsdf::first_lobe`].
    pub(super) fn first_lobe(&self) -> f32 {
        self.p_reflect().unwrap_or(1.0)
    }

    /// ρ/π or τ/π (1/sr).
    #[inline]
    pub fn f(&self, wo: Vec3, wi: Vec3) -> Rgb {
        let side = wo.z * wi.z;
        if side > 0.0 {
            self.reflectance * FRAC_1_PI
        } else if side < 0.0 {
            self.transmittance * FRAC_1_PI
        } else {
            Rgb::BLACK
        }
    }

    /// Cosine density of the side of `wi`, times the probability of that side.
    #[inline]
    pub fn pdf(&self, wo: Vec3, wi: Vec3) -> f32 {
        let Some(p) = self.p_reflect() else { return 0.0 };
        let p_side = if wo.z * wi.z > 0.0 { p } else { 1.0 - p };
        p_side * warp::pdf_cosine_hemisphere(wi.abs())
    }

    /// Reflection or transmission in proportion to their largest channels, then the cosine.
    #[inline]
    pub fn sample(&self, wo: Vec3, uc: f32, u: [f32; 2]) -> Option<BsdfSample> {
        let reflects = uc < self.p_reflect()?;
        let mut wi = warp::sample_cosine_hemisphere(u);
        wi.z = wi.z.copysign(if reflects { wo.z } else { -wo.z });
        let pdf = self.pdf(wo, wi);
        let lobe = Lobe::DIFFUSE | if reflects { Lobe::REFLECTION } else { Lobe::TRANSMISSION };
        (pdf > 0.0).then(|| BsdfSample { f: self.f(wo, wi), wi, pdf, lobe, eta: 1.0 })
    }
}
