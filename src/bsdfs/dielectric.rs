//! Reflection and refraction at a dielectric interface, smooth or with GGX microfacets [Walter et al. 2007].
//!
//! Reflection: f = D F G / (4 cos θo cos θi), half vector m = wo + wi. Transmission: m = wo + η'wi,
//! f = D (1 − F) G |wo·m wi·m| / (|cos θo cos θi| (wi·m + wo·m/η')²), times 1/η'² for radiance, where η' is the index
//! of the side of `wi` relative to the side of `wo`. One scattering event only, as pbrt-v4.

use super::fresnel::{fr_dielectric, reflect, refract};
use super::{BsdfSample, Lobe, TrowbridgeReitz};
use lumiris_numbers::math::{Rgb, Vec3, sqr};

/// What is transported along the path, which decides whether transmission scales by 1/η².
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Transport {
    /// Paths from the camera.
    Radiance,
    /// Paths from the lights.
    Importance,
}

/// Which lobes a sample or a density is of.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Select {
    /// Both.
    All,
    /// Reflection only.
    Reflection,
    /// Transmission only.
    Transmission,
}

/// Interface between the outside (+z) and a dielectric (−z).
#[derive(Clone, Copy, Debug)]
pub struct Dielectric {
    /// Index of refraction of the side of −z relative to that of +z.
    pub eta: f32,
    /// Microfacets.
    pub distribution: TrowbridgeReitz,
}

impl Dielectric {
    /// True if all scattering is by deltas.
    #[inline]
    pub fn is_specular(&self) -> bool {
        self.eta == 1.0 || self.distribution.is_smooth()
    }

    /// For many directions at once.
    pub(super) fn lanes(&self) -> lumiris_lanes::bsdf::Interface {
        let TrowbridgeReitz { alpha_x, alpha_y } = self.distribution;
        lumiris_lanes::bsdf::Interface { alpha: [alpha_x, alpha_y], eta: self.eta }
    }

    /// Probability of reflection among the selected lobes; `None` if they carry no light.
    #[inline]
    fn p_reflect(select: Select, fresnel: f32) -> Option<f32> {
        match select {
            Select::All => Some(fresnel),
            Select::Reflection => (fresnel > 0.0).then_some(1.0),
            Select::Transmission => (fresnel < 1.0).then_some(0.0),
        }
    }

    /// Microfacet normal that scatters `wo` to `wi`, in the upper hemisphere, with η' of the pair (1 for reflection);
    /// `None` if it is seen from behind.
    #[inline]
    fn half_vector(&self, wo: Vec3, wi: Vec3) -> Option<(Vec3, f32)> {
        if wo.z == 0.0 || wi.z == 0.0 {
            return None;
        }
        let eta_p = self.eta_prime(wo, wi);
        let m = (wo + wi * eta_p).try_normalize()?;
        let m = if m.z < 0.0 { -m } else { m };
        (m.dot(wi) * wi.z > 0.0 && m.dot(wo) * wo.z > 0.0).then_some((m, eta_p))
    }

    #[inline]
    fn eta_prime(&self, wo: Vec3, wi: Vec3) -> f32 {
        if wo.z * wi.z > 0.0 {
            1.0
        } else if wo.z > 0.0 {
            self.eta
        } else {
            1.0 / self.eta
        }
    }

    /// Value without cosine for radiance (1/sr); 0 if specular.
    #[inline]
    pub fn f(&self, wo: Vec3, wi: Vec3) -> Rgb {
        Rgb::splat(self.value(wo, wi, Transport::Radiance))
    }

    /// Value without cosine (1/sr); 0 if specular.
    pub fn value(&self, wo: Vec3, wi: Vec3, transport: Transport) -> f32 {
        if self.is_specular() {
            return 0.0;
        }
        let half_vector = self.half_vector(wo, wi);
        half_vector.map_or(0.0, |m| self.value_and_pdf_of_m((wo, wi), m, transport, Select::All).0)
    }

    /// [`Self::f`] and [`Self::pdf`].
    #[inline]
    pub(super) fn f_and_pdf(&self, wo: Vec3, wi: Vec3) -> (Rgb, f32) {
        let (value, pdf) = self.value_and_pdf(wo, wi, Select::All);
        (Rgb::splat(value), pdf)
    }

    /// [`Self::value`] for radiance and [`Self::pdf_select`].
    #[inline]
    pub(super) fn value_and_pdf(&self, wo: Vec3, wi: Vec3, select: Select) -> (f32, f32) {
        if self.is_specular() {
            return (0.0, 0.0);
        }
        let half_vector = self.half_vector(wo, wi);
        half_vector.map_or((0.0, 0.0), |m| self.value_and_pdf_of_m((wo, wi), m, Transport::Radiance, select))
    }

    /// Value and density, which have most in common.
    #[inline]
    fn value_and_pdf_of_m(
        &self,
        (wo, wi): (Vec3, Vec3),
        (m, eta_p): (Vec3, f32),
        transport: Transport,
        select: Select,
    ) -> (f32, f32) {
        let (o_m, distribution) = (wo.dot(m), &self.distribution);
        let fresnel = fr_dielectric(o_m, self.eta);
        let (d, lambda) = (distribution.d(m), distribution.lambda(wo));
        let d_g = d * TrowbridgeReitz::g_of(lambda, distribution.lambda(wi));
        let pdf_m = TrowbridgeReitz::pdf_of(wo, lambda, d, o_m);
        let p_reflect = Self::p_reflect(select, fresnel);
        if wo.z * wi.z > 0.0 {
            let value = d_g * fresnel / (4.0 * wo.z * wi.z).abs();
            return (value, p_reflect.map_or(0.0, |p| p * pdf_m / (4.0 * o_m.abs())));
        }
        let i_m = wi.dot(m);
        let denominator = sqr(i_m + o_m / eta_p);
        let jacobian = i_m * o_m / (wo.z * wi.z * denominator);
        let f = d_g * (1.0 - fresnel) * jacobian.abs();
        let value = match transport {
            Transport::Radiance => f / sqr(eta_p),
            Transport::Importance => f,
        };
        (value, p_reflect.map_or(0.0, |p| (1.0 - p) * pdf_m * i_m.abs() / denominator))
    }

    /// Density of [`Self::sample`] per steradian; 0 if specular.
    #[inline]
    pub fn pdf(&self, wo: Vec3, wi: Vec3) -> f32 {
        self.pdf_select(wo, wi, Select::All)
    }

    /// Density of [`Self::sample_select`] per steradian; 0 if specular.
    pub fn pdf_select(&self, wo: Vec3, wi: Vec3, select: Select) -> f32 {
        if self.is_specular() {
            return 0.0;
        }
        let half_vector = self.half_vector(wo, wi);
        half_vector.map_or(0.0, |m| self.value_and_pdf_of_m((wo, wi), m, Transport::Radiance, select).1)
    }

    /// Reflection or refraction, chosen by the Fresnel reflectance of the sampled microfacet.
    #[inline]
    pub fn sample(&self, wo: Vec3, uc: f32, u: [f32; 2]) -> Option<BsdfSample> {
        self.sample_select(wo, uc, u, Transport::Radiance, Select::All)
    }

    /// [`Self::sample`] of the selected lobes only.
    pub fn sample_select(
        &self,
        wo: Vec3,
        uc: f32,
        u: [f32; 2],
        transport: Transport,
        select: Select,
    ) -> Option<BsdfSample> {
        if wo.z == 0.0 {
            return None;
        }
        if self.is_specular() {
            return self.sample_specular(wo, uc, transport, select);
        }
        let m = self.distribution.sample_m(wo, u);
        let p_reflect = Self::p_reflect(select, fr_dielectric(wo.dot(m), self.eta))?;
        let (wi, lobe) = if uc < p_reflect {
            (reflect(wo, m), Lobe::REFLECTION)
        } else {
            (refract(wo, m, self.eta)?.0, Lobe::TRANSMISSION)
        };
        if (wo.z * wi.z > 0.0) != (lobe == Lobe::REFLECTION) || wi.z == 0.0 || wo.dot(m) * wo.z <= 0.0 {
            return None;
        }
        let eta_p = self.eta_prime(wo, wi);
        let (f, pdf) = self.value_and_pdf_of_m((wo, wi), (m, eta_p), transport, select);
        Some(BsdfSample { f: Rgb::splat(f), wi, pdf, lobe: Lobe::GLOSSY | lobe, eta: eta_p })
    }

    fn sample_specular(&self, wo: Vec3, uc: f32, transport: Transport, select: Select) -> Option<BsdfSample> {
        let fresnel = fr_dielectric(wo.z, self.eta);
        let p_reflect = Self::p_reflect(select, fresnel)?;
        if uc < p_reflect {
            let wi = Vec3::new(-wo.x, -wo.y, wo.z);
            let f = Rgb::splat(fresnel / wi.z.abs());
            return Some(BsdfSample { f, wi, pdf: p_reflect, lobe: Lobe::SPECULAR | Lobe::REFLECTION, eta: 1.0 });
        }
        let (wi, eta_p) = refract(wo, Vec3::Z, self.eta)?;
        let scale = match transport {
            Transport::Radiance => 1.0 / sqr(eta_p),
            Transport::Importance => 1.0,
        };
        let f = Rgb::splat((1.0 - fresnel) * scale / wi.z.abs());
        let lobe = Lobe::SPECULAR | Lobe::TRANSMISSION;
        (wi.z != 0.0).then_some(BsdfSample { f, wi, pdf: 1.0 - p_reflect, lobe, eta: eta_p })
    }
}
