//! A thin dielectric sheet without refraction: the sum of all reflections between its two parallel faces,
//! R' = R + T²R/(1 − R²), T' = 1 − R' [Pharr et al. 2023, §9.5.1].

use super::fresnel::fr_dielectric;
use super::{BsdfSample, Lobe};
use lumiris_numbers::math::{Rgb, Vec3, sqr};

/// Thin sheet: mirror and straight transmission.
#[derive(Clone, Copy, Debug)]
pub struct ThinDielectric {
    /// Index of refraction of the sheet relative to both sides.
    pub eta: f32,
}

impl ThinDielectric {
    /// Reflectance of the sheet for the cosine of incidence `cos`.
    #[inline]
    pub fn reflectance(&self, cos: f32) -> f32 {
        let r = fr_dielectric(cos.abs(), self.eta);
        if r < 1.0 { r + sqr(1.0 - r) * r / (1.0 - sqr(r)) } else { r }
    }

    /// Mirror reflection with the probability of the reflectance, else straight on.
    pub fn sample(&self, wo: Vec3, uc: f32) -> Option<BsdfSample> {
        if wo.z == 0.0 {
            return None;
        }
        let r = self.reflectance(wo.z);
        let (wi, p, lobe) = if uc < r {
            (Vec3::new(-wo.x, -wo.y, wo.z), r, Lobe::REFLECTION)
        } else {
            (-wo, 1.0 - r, Lobe::TRANSMISSION)
        };
        let f = Rgb::splat(p / wo.z.abs());
        (p > 0.0).then(|| BsdfSample { f, wi, pdf: p, lobe: Lobe::SPECULAR | lobe, eta: 1.0 })
    }
}
