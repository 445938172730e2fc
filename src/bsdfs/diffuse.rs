//! Lambertian reflection: f = ρ/π on the side of `wo`, on both sides of the surface.

use super::{BsdfSample, Lobe};
use lumiris_numbers::math::{Rgb, Vec3, warp};
use std::f32::consts::FRAC_1_PI;

/// Lambertian reflection.
#[derive(Clone, Copy, Debug)]
pub struct Diffuse {
    /// Hemispherical albedo ρ.
    pub reflectance: Rgb,
}

impl Diffuse {
    /// f = ρ/π (1/sr) if both directions are on one side.
    #[inline]
    pub fn f(&self, wo: Vec3, wi: Vec3) -> Rgb {
        if wo.z * wi.z > 0.0 { self.reflectance * FRAC_1_PI } else { Rgb::BLACK }
    }

    /// |cos θi|/π on the side of `wo`.
    #[inline]
    pub fn pdf(&self, wo: Vec3, wi: Vec3) -> f32 {
        if wo.z * wi.z > 0.0 { warp::pdf_cosine_hemisphere(wi.abs()) } else { 0.0 }
    }

    /// Cosine-weighted direction on the side of `wo`.
    #[inline]
    pub fn sample(&self, wo: Vec3, u: [f32; 2]) -> Option<BsdfSample> {
        let mut wi = warp::sample_cosine_hemisphere(u);
        wi.z = wi.z.copysign(wo.z);
        let pdf = self.pdf(wo, wi);
        let lobe = Lobe::DIFFUSE | Lobe::REFLECTION;
        (pdf > 0.0).then(|| BsdfSample { f: self.f(wo, wi), wi, pdf, lobe, eta: 1.0 })
    }
}
