//! Reflection by a metal, smooth or with GGX microfacets: f = D F G / (4 cos θo cos θi) [Cook and Torrance 1982;
//! Walter et al. 2007], one scattering event only.

use super::fresnel::{fr_conductor, reflect};
use super::{BsdfSample, Lobe, TrowbridgeReitz};
use lumiris_numbers::math::{Rgb, Vec3};

/// Metallic reflection, on both sides of the surface.
#[derive(Clone, Copy, Debug)]
pub struct Conductor {
    /// Microfacets.
    pub distribution: TrowbridgeReitz,
    /// Real part of the index of refraction relative to the outside.
    pub eta: Rgb,
    /// Imaginary part (extinction) relative to the outside.
    pub k: Rgb,
}

impl Conductor {
    /// η and k of a metal of the given reflectance at normal incidence: η = 1, k = 2√r/√(1 − r), as pbrt-v4.
    pub fn eta_k_of_reflectance(reflectance: Rgb) -> (Rgb, Rgb) {
        let k = reflectance.clamp(0.0, 0.9999).map(|r| 2.0 * r.sqrt() / (1.0 - r).sqrt());
        (Rgb::WHITE, k)
    }

    /// Value without cosine (1/sr); 0 if smooth.
    pub fn f(&self, wo: Vec3, wi: Vec3) -> Rgb {
        self.f_and_pdf(wo, wi).0
    }

    /// Density of [`Self::sample`] per steradian; 0 if smooth.
    pub fn pdf(&self, wo: Vec3, wi: Vec3) -> f32 {
        self.f_and_pdf(wo, wi).1
    }

    /// [`Self::f`] and [`Self::pdf`].
    #[inline]
    pub(super) fn f_and_pdf(&self, wo: Vec3, wi: Vec3) -> (Rgb, f32) {
        if wo.z * wi.z <= 0.0 || self.distribution.is_smooth() {
            return (Rgb::BLACK, 0.0);
        }
        (wo + wi).try_normalize().map_or((Rgb::BLACK, 0.0), |m| self.f_and_pdf_of_m(wo, wi, m))
    }

    #[inline]
    fn f_and_pdf_of_m(&self, wo: Vec3, wi: Vec3, m: Vec3) -> (Rgb, f32) {
        let (distribution, cos_m) = (&self.distribution, wo.dot(m).abs());
        let (d, lambda) = (distribution.d(m), distribution.lambda(wo));
        let d_g = d * TrowbridgeReitz::g_of(lambda, distribution.lambda(wi));
        let f = fr_conductor(cos_m, self.eta, self.k) * (d_g / (4.0 * wo.z * wi.z).abs());
        (f, TrowbridgeReitz::pdf_of(wo, lambda, d, cos_m) / (4.0 * cos_m))
    }

    /// The mirror direction, or a reflection by a visible microfacet.
    pub fn sample(&self, wo: Vec3, u: [f32; 2]) -> Option<BsdfSample> {
        if wo.z == 0.0 {
            return None;
        }
        if self.distribution.is_smooth() {
            let wi = Vec3::new(-wo.x, -wo.y, wo.z);
            let f = fr_conductor(wi.z.abs(), self.eta, self.k) / wi.z.abs();
            return Some(BsdfSample { f, wi, pdf: 1.0, lobe: Lobe::SPECULAR | Lobe::REFLECTION, eta: 1.0 });
        }
        let m = self.distribution.sample_m(wo, u);
        let wi = reflect(wo, m);
        if wo.z * wi.z <= 0.0 {
            return None;
        }
        let (f, pdf) = self.f_and_pdf_of_m(wo, wi, m);
        Some(BsdfSample { f, wi, pdf, lobe: Lobe::GLOSSY | Lobe::REFLECTION, eta: 1.0 })
    }
}
