//! The BSDF of a surface point: one of the models, or the phase function of a medium.

use super::coated_diffuse::CoatedDiffuse;
use super::conductor::Conductor;
use super::dielectric::{Dielectric, Select, Transport};
use super::diffuse::Diffuse;
use super::diffuse_transmission::DiffuseTransmission;
use super::evaluated::Evaluated;
use super::hair::Hair;
use super::kernel::{Kernel, KernelBsdf as _, MAX_PARAMS, evaluate, without_cos};
use super::layered::Layered;
use super::lobe::{BsdfSample, BsdfValue, LobeWidth, MicrofacetLobe};
use super::measured::Measured;
use super::microfacet::TrowbridgeReitz;
use super::models::Model;
use super::phase::Phase;
use super::principled::Principled;
use super::thin_dielectric::ThinDielectric;
use lumiris_lanes::kernels;
use lumiris_numbers::math::{Rgb, Vec3};

/// Maximum number of lobes that [`Bsdf::first_lobe`] distinguishes.
pub const MAX_LOBES: usize = 2;

/// The scattering of one surface point.
#[derive(Clone, Copy, Debug)]
pub enum Bsdf<'a> {
    /// Lambertian reflection.
    Diffuse(Diffuse),
    /// Lambertian reflection and transmission.
    DiffuseTransmission(DiffuseTransmission),
    /// Metal.
    Conductor(Conductor),
    /// Glass.
    Dielectric(Dielectric),
    /// Refraction without reflection at an interface: the exit from an interior whose internal reflections are not path
    /// vertices.
    Exit(Dielectric),
    /// A sheet of glass.
    ThinDielectric(ThinDielectric),
    /// Lambertian under a clear coat.
    CoatedDiffuse(CoatedDiffuse<'a>),
    /// Any base under any coat, by random walks.
    Layered(Layered),
    /// Metal, glossy diffuse or glass under a coat.
    Principled(Principled),
    /// A fibre.
    Hair(Hair),
    /// Reflection by measured tables.
    Measured(Measured<'a>),
    /// Reflection that can only be evaluated.
    Evaluated(Evaluated),
    /// Scattering in a medium, without a surface and without a cosine.
    Phase(Phase),
}

/// Maximum roughness of surfaces that make caustics.
const MAX_CAUSTIC_ALPHA: f32 = 0.3;
/// Minimum fraction of metal or glass of surfaces that make caustics.
const CAUSTIC_PART: f32 = 0.5;

/// The part of a BSDF that depends only on the irradiance, and the rest.
#[derive(Clone, Copy, Debug)]
pub struct Lambertian<'a> {
    /// Albedo for light that arrives on the side of `wo`.
    pub reflectance: Rgb,
    /// Albedo for light that arrives on the other side.
    pub transmittance: Rgb,
    /// The other lobes.
    pub rest: Option<Bsdf<'a>>,
}

impl<'a> Bsdf<'a> {
    /// Value without cosine (1/sr), without deltas. 0 at the horizon and never NaN or infinite.
    #[inline]
    pub fn f(&self, wo: Vec3, wi: Vec3) -> Rgb {
        let f_cos = self.f_cos_and_pdf(wo, wi).f_cos;
        if self.has_surface() { without_cos(f_cos, wi) } else { f_cos }
    }

    /// Density of the non-specular part of [`Self::sample`] per steradian.
    #[inline]
    pub fn pdf(&self, wo: Vec3, wi: Vec3) -> f32 {
        self.f_cos_and_pdf(wo, wi).pdf
    }

    /// [`Self::f`] times [`Self::cos`], and [`Self::pdf`]; bit-identical to the kernel, if there is one.
    #[inline]
    pub fn f_cos_and_pdf(&self, wo: Vec3, wi: Vec3) -> BsdfValue {
        let (f, pdf) = match self {
            Bsdf::Diffuse(b) => return b.f_cos_and_pdf(wo, wi),
            Bsdf::DiffuseTransmission(b) => return b.f_cos_and_pdf(wo, wi),
            Bsdf::Conductor(b) => return b.f_cos_and_pdf(wo, wi),
            Bsdf::Dielectric(b) => return b.f_cos_and_pdf(wo, wi),
            Bsdf::Exit(b) => return evaluate::<kernels::Exit>(&b.params(), &[], wo, wi),
            Bsdf::CoatedDiffuse(b) => return b.f_cos_and_pdf(wo, wi),
            Bsdf::Principled(b) => return b.f_cos_and_pdf(wo, wi),
            Bsdf::ThinDielectric(_) => return BsdfValue::ZERO,

            // BSDFs without a kernel
            _ if (wo.z == 0.0 || wi.z == 0.0) && self.has_surface() => return BsdfValue::ZERO,
            Bsdf::Layered(b) => (b.f(wo, wi), b.pdf(wo, wi)),
            Bsdf::Hair(b) => (b.f(wo, wi), b.pdf(wo, wi)),
            Bsdf::Measured(b) => (b.f(wo, wi), b.pdf(wo, wi)),
            Bsdf::Evaluated(b) => (b.f(wo, wi), b.pdf(wo, wi)),
            Bsdf::Phase(b) => (Rgb::splat(b.p(wo, wi)), b.p(wo, wi)),
        };

        // Overflow counts as black
        let f_cos = f * self.cos(wi);
        BsdfValue {
            f_cos: if f_cos.is_finite() { f_cos } else { Rgb::BLACK },
            pdf: if pdf.is_finite() { pdf } else { 0.0 },
        }
    }

    /// Probability that [`Self::sample`] samples the first of at most two lobes, which it does if `uc` is less. The
    /// first lobe is the interface of a coat, the reflection of a diffuse transmitter, or the cosine lobe of a proposal
    /// density. 1 for BSDFs with one lobe.
    #[inline]
    pub fn first_lobe(&self, wo: Vec3) -> f32 {
        match self {
            Bsdf::DiffuseTransmission(b) => b.first_lobe(),
            Bsdf::CoatedDiffuse(b) => b.first_lobe(wo),
            Bsdf::Layered(b) => b.first_lobe(wo),
            Bsdf::Principled(b) => b.first_lobe(wo),
            Bsdf::Evaluated(b) => b.density.first_lobe(),
            Bsdf::Diffuse(_)
            | Bsdf::Conductor(_)
            | Bsdf::Dielectric(_)
            | Bsdf::Exit(_)
            | Bsdf::ThinDielectric(_)
            | Bsdf::Hair(_)
            | Bsdf::Measured(_)
            | Bsdf::Phase(_) => 1.0,
        }
    }

    /// The contribution of the first lobe to [`Self::pdf`], whose value is `pdf` (1/sr).
    #[inline]
    pub fn pdf_first_lobe(&self, wo: Vec3, wi: Vec3, pdf: f32) -> f32 {
        let first = match self {
            Bsdf::Diffuse(_)
            | Bsdf::Conductor(_)
            | Bsdf::Dielectric(_)
            | Bsdf::Exit(_)
            | Bsdf::ThinDielectric(_)
            | Bsdf::Hair(_)
            | Bsdf::Measured(_)
            | Bsdf::Phase(_) => return pdf,
            Bsdf::DiffuseTransmission(_) if wo.z * wi.z > 0.0 => return pdf,
            Bsdf::DiffuseTransmission(_) => return 0.0,
            Bsdf::CoatedDiffuse(b) => b.pdf_first_lobe(wo, wi),
            Bsdf::Layered(b) => b.pdf_first_lobe(wo, wi),
            Bsdf::Principled(b) => b.pdf_first_lobe(wo, wi),
            Bsdf::Evaluated(b) => b.density.pdf_first_lobe(wo, wi),
        };
        // May be non-finite or, by rounding, more than the whole
        if first > 0.0 { first.min(pdf) } else { 0.0 }
    }

    /// The strongest rough lobe about the mirror direction of `wo`. `None` if there is none, or if the BSDF also
    /// transmits light, which the lobe does not describe.
    #[inline]
    pub fn glossy_lobe(&self, wo: Vec3) -> Option<LobeWidth> {
        let MicrofacetLobe { distribution, share } = match self {
            Bsdf::Measured(b) => return Some(LobeWidth { alpha: b.alpha(), share: 1.0 }),
            Bsdf::Conductor(b) => MicrofacetLobe { distribution: b.distribution, share: 1.0 },
            Bsdf::CoatedDiffuse(b) => MicrofacetLobe { distribution: b.distribution(), share: b.first_lobe(wo) },
            Bsdf::Layered(b) => b.glossy_lobe(wo),
            Bsdf::Principled(b) => b.glossy_lobe(wo)?,
            Bsdf::Diffuse(_)
            | Bsdf::DiffuseTransmission(_)
            | Bsdf::Dielectric(_)
            | Bsdf::Exit(_)
            | Bsdf::ThinDielectric(_)
            | Bsdf::Hair(_)
            | Bsdf::Evaluated(_)
            | Bsdf::Phase(_) => return None,
        };
        let alpha = distribution.alpha_x.max(distribution.alpha_y);
        (!distribution.is_smooth()).then_some(LobeWidth { alpha, share })
    }

    /// True for metals and glass that are smooth or nearly so: their reflection or refraction makes caustics.
    pub fn makes_caustics(&self) -> bool {
        let is_narrow = |d: &TrowbridgeReitz| d.is_smooth() || d.alpha_x.max(d.alpha_y) <= MAX_CAUSTIC_ALPHA;
        match self {
            Bsdf::Conductor(b) => is_narrow(&b.distribution),
            Bsdf::Dielectric(b) => is_narrow(&b.distribution),
            Bsdf::ThinDielectric(_) => true,
            Bsdf::Principled(b) => is_narrow(&b.distribution) && b.metal_or_glass() > CAUSTIC_PART,
            _ => false,
        }
    }

    /// True if f and pdf are deterministic functions of the directions, and pdf is the density of sampled directions.
    /// False for estimates by random walks, for BSDFs that can only be evaluated, and for interiors.
    pub fn is_evaluated_exactly(&self) -> bool {
        !matches!(self, Bsdf::Exit(_) | Bsdf::Layered(_) | Bsdf::Hair(_) | Bsdf::Evaluated(_) | Bsdf::Phase(_))
    }

    /// False in a medium, where the horizon of the frame has no meaning and there is no cosine.
    #[inline]
    pub fn has_surface(&self) -> bool {
        !matches!(self, Bsdf::Phase(_))
    }

    /// |cos θ| of a direction in the frame, the factor of f; 1 in a medium.
    #[inline]
    pub fn cos(&self, w: Vec3) -> f32 {
        if self.has_surface() { w.z.abs() } else { 1.0 }
    }

    /// The index of refraction for transmitted light, which dispersion replaces for one wavelength.
    #[inline]
    pub fn eta_mut(&mut self) -> Option<&mut f32> {
        match self {
            Bsdf::Dielectric(b) => Some(&mut b.eta),
            Bsdf::Principled(b) => b.eta_mut(),
            Bsdf::Diffuse(_)
            | Bsdf::DiffuseTransmission(_)
            | Bsdf::Conductor(_)
            | Bsdf::Exit(_)
            | Bsdf::ThinDielectric(_)
            | Bsdf::CoatedDiffuse(_)
            | Bsdf::Layered(_)
            | Bsdf::Hair(_)
            | Bsdf::Measured(_)
            | Bsdf::Evaluated(_)
            | Bsdf::Phase(_) => None,
        }
    }

    /// True if light from the side opposite to `wo` may scatter to `wo`.
    #[inline]
    pub fn transmits(&self) -> bool {
        match self {
            Bsdf::DiffuseTransmission(_)
            | Bsdf::Dielectric(_)
            | Bsdf::Exit(_)
            | Bsdf::ThinDielectric(_)
            | Bsdf::Hair(_)
            | Bsdf::Phase(_) => true,
            Bsdf::Principled(b) => b.transmission > 0.0,
            Bsdf::Diffuse(_)
            | Bsdf::Conductor(_)
            | Bsdf::CoatedDiffuse(_)
            | Bsdf::Layered(_)
            | Bsdf::Measured(_)
            | Bsdf::Evaluated(_) => false,
        }
    }

    /// Probability of a lobe of [`Self::sample`] with a cosine or uniform density on the side of `wo`. |cos θi|/pdf is
    /// then at most 2π over this probability, and all directions of that side are sampled, independent of f. 0 for
    /// BSDFs without such a lobe.
    pub fn wide_lobe(&self, wo: Vec3) -> f32 {
        match self {
            Bsdf::Diffuse(_) => 1.0,
            Bsdf::DiffuseTransmission(_) | Bsdf::Evaluated(_) => self.first_lobe(wo),
            Bsdf::Principled(b) => b.wide_lobe(wo),
            Bsdf::CoatedDiffuse(_) | Bsdf::Layered(_) => 1.0 - self.first_lobe(wo),
            Bsdf::Conductor(_)
            | Bsdf::Dielectric(_)
            | Bsdf::Exit(_)
            | Bsdf::ThinDielectric(_)
            | Bsdf::Hair(_)
            | Bsdf::Measured(_)
            | Bsdf::Phase(_) => 0.0,
        }
    }

    /// Samples a direction `wi`: a lobe by `uc`, a direction within it by `u`. `None` if the sample carries no light.
    #[inline]
    pub fn sample(&self, wo: Vec3, uc: f32, u: [f32; 2]) -> Option<BsdfSample> {
        self.sample_direction(wo, uc, u).filter(|s| s.f.is_finite() && !s.f.is_black())
    }

    /// As [`Self::sample`], but includes directions that carry no light; `None` only where the density has a defect.
    /// Non-specular samples are therefore distributed by [`Self::pdf`].
    #[inline]
    pub fn sample_direction(&self, wo: Vec3, uc: f32, u: [f32; 2]) -> Option<BsdfSample> {
        let has_surface = self.has_surface();
        if wo.z == 0.0 && has_surface {
            return None;
        }
        let sample = match self {
            Bsdf::Diffuse(b) => b.sample(wo, uc, u),
            Bsdf::DiffuseTransmission(b) => b.sample(wo, uc, u),
            Bsdf::Conductor(b) => b.sample(wo, uc, u),
            Bsdf::Dielectric(b) => b.sample(wo, uc, u),
            Bsdf::Exit(b) => b.sample_select(wo, uc, u, Transport::Radiance, Select::Transmission),
            Bsdf::ThinDielectric(b) => b.sample(wo, uc, u),
            Bsdf::CoatedDiffuse(b) => b.sample(wo, uc, u),
            Bsdf::Layered(b) => b.sample(wo, uc, u),
            Bsdf::Principled(b) => b.sample(wo, uc, u),
            Bsdf::Hair(b) => b.sample(wo, uc, u),
            Bsdf::Measured(b) => b.sample(wo, u),
            Bsdf::Evaluated(b) => b.sample(wo, uc, u),
            Bsdf::Phase(b) => b.sample(wo, u),
        };

        // Directions in the plane of the surface have no density
        sample.filter(|s| s.pdf > 0.0 && s.pdf.is_finite() && (s.wi.z != 0.0 || !has_surface))
    }

    /// True for BSDFs without a peak, which say little about the direction of the light. Phase functions may have one.
    #[inline]
    pub fn is_wide(&self) -> bool {
        match self {
            Bsdf::Diffuse(_) | Bsdf::DiffuseTransmission(_) | Bsdf::Evaluated(_) => true,
            Bsdf::CoatedDiffuse(_)
            | Bsdf::Conductor(_)
            | Bsdf::Dielectric(_)
            | Bsdf::Exit(_)
            | Bsdf::ThinDielectric(_)
            | Bsdf::Layered(_)
            | Bsdf::Phase(_)
            | Bsdf::Hair(_)
            | Bsdf::Measured(_)
            | Bsdf::Principled(_) => false,
        }
    }

    /// True if [`Self::f`] is not 0 everywhere: light sampling can contribute.
    #[inline]
    pub fn has_non_specular(&self) -> bool {
        match self {
            Bsdf::Diffuse(_)
            | Bsdf::DiffuseTransmission(_)
            | Bsdf::CoatedDiffuse(_)
            | Bsdf::Principled(_)
            | Bsdf::Hair(_)
            | Bsdf::Measured(_)
            | Bsdf::Phase(_)
            | Bsdf::Evaluated(_) => true,
            Bsdf::Conductor(b) => !b.distribution.is_smooth(),
            Bsdf::Dielectric(b) | Bsdf::Exit(b) => !b.is_specular(),
            Bsdf::ThinDielectric(_) => false,
            Bsdf::Layered(b) => b.has_non_specular(),
        }
    }

    /// True if [`Self::sample`] can return deltas.
    #[inline]
    pub fn has_specular(&self) -> bool {
        match self {
            Bsdf::Diffuse(_)
            | Bsdf::DiffuseTransmission(_)
            | Bsdf::Principled(_)
            | Bsdf::Hair(_)
            | Bsdf::Measured(_)
            | Bsdf::Evaluated(_)
            | Bsdf::Phase(_) => false,
            Bsdf::Conductor(b) => b.distribution.is_smooth(),
            Bsdf::Dielectric(b) | Bsdf::Exit(b) => b.is_specular(),
            Bsdf::ThinDielectric(_) => true,
            Bsdf::CoatedDiffuse(b) => b.has_specular(),
            Bsdf::Layered(b) => b.has_specular(),
        }
    }

    /// True if [`Self::sample`] follows a density that is independent of [`Self::f`], so that
    /// [`resample`](super::resample()) is worthwhile.
    #[inline]
    pub fn is_only_evaluated(&self) -> bool {
        matches!(self, Bsdf::Evaluated(_))
    }

    /// The Lambertian part for the direction `wo`; `None` if there is none. For the base below a coat, the dependence
    /// on the incident direction (the coat's transmittance) is replaced by its mean, which is exact under uniform
    /// illumination. All others are exact.
    pub fn lambertian(&self, wo: Vec3) -> Option<Lambertian<'a>> {
        let of = |reflectance, transmittance, rest| Some(Lambertian { reflectance, transmittance, rest });
        match self {
            Bsdf::Diffuse(b) => of(b.reflectance, Rgb::BLACK, None),
            Bsdf::DiffuseTransmission(b) => of(b.reflectance, b.transmittance, None),
            Bsdf::CoatedDiffuse(b) => of(b.base_albedo(wo), Rgb::BLACK, Some(Bsdf::CoatedDiffuse(b.without_base()))),
            Bsdf::Evaluated(Evaluated { model: Model::Diffuse(reflectance), .. }) => of(*reflectance, Rgb::BLACK, None),
            Bsdf::Conductor(_)
            | Bsdf::Dielectric(_)
            | Bsdf::Exit(_)
            | Bsdf::ThinDielectric(_)
            | Bsdf::Layered(_)
            | Bsdf::Principled(_)
            | Bsdf::Hair(_)
            | Bsdf::Measured(_)
            | Bsdf::Phase(_)
            | Bsdf::Evaluated(_) => None,
        }
    }

    /// Fraction of uniform light that is scattered to `wo`, for the albedo image. Exact for Lambertian and coated
    /// BSDFs. Otherwise the unbiased estimate f |cos θ|/pdf of one sample, drawn by the random numbers of `u`. One
    /// sample suffices: each camera sample has its own, and several would cost more than the light transport.
    pub fn albedo_estimate(&self, wo: Vec3, u: impl FnOnce() -> [f32; 3]) -> Rgb {
        match self {
            Bsdf::Diffuse(b) => b.reflectance,
            Bsdf::DiffuseTransmission(b) => b.reflectance + b.transmittance,
            Bsdf::CoatedDiffuse(b) => b.albedo(wo),
            Bsdf::Evaluated(Evaluated { model: Model::Diffuse(reflectance), .. }) => *reflectance,
            Bsdf::Phase(_) => Rgb::WHITE,
            Bsdf::Conductor(_)
            | Bsdf::Dielectric(_)
            | Bsdf::Exit(_)
            | Bsdf::ThinDielectric(_)
            | Bsdf::Layered(_)
            | Bsdf::Principled(_)
            | Bsdf::Hair(_)
            | Bsdf::Measured(_)
            | Bsdf::Evaluated(_) => {
                // f |cos θ|/pdf of one sample
                let [uc, u0, u1] = u();
                self.sample(wo, uc, [u0, u1]).map_or(Rgb::BLACK, |s| s.f * (s.wi.z.abs() / s.pdf))
            }
        }
    }
}

/// The parameters, followed by zeros.
fn padded(params: &[f32]) -> [f32; MAX_PARAMS] {
    let mut all = [0.0; MAX_PARAMS];
    all[..params.len()].copy_from_slice(params);
    all
}

impl Bsdf<'_> {
    /// The [`Kernel::params`] parameters of its kernel.
    pub fn params(&self) -> [f32; MAX_PARAMS] {
        match self {
            Bsdf::Diffuse(b) => padded(&b.params()),
            Bsdf::DiffuseTransmission(b) => padded(&b.params()),
            Bsdf::Conductor(b) => padded(&b.params()),
            Bsdf::Dielectric(b) => padded(&b.params()),
            Bsdf::Exit(b) => padded(&b.params()),
            Bsdf::ThinDielectric(b) => padded(&b.params()),
            Bsdf::CoatedDiffuse(b) => padded(&b.params()),
            Bsdf::Principled(b) => padded(&b.params()),
            Bsdf::Layered(_) | Bsdf::Hair(_) | Bsdf::Measured(_) | Bsdf::Evaluated(_) | Bsdf::Phase(_) => padded(&[]),
        }
    }

    /// The kernel that evaluates it; `None` without one.
    #[inline]
    pub fn kernel(&self) -> Option<Kernel> {
        match self {
            Bsdf::Diffuse(_) => Some(Kernel::Diffuse),
            Bsdf::DiffuseTransmission(_) => Some(Kernel::DiffuseTransmission),
            Bsdf::Conductor(_) => Some(Kernel::Conductor),
            Bsdf::Dielectric(_) => Some(Kernel::Dielectric),
            Bsdf::Exit(_) => Some(Kernel::Exit),
            Bsdf::ThinDielectric(_) => Some(Kernel::ThinDielectric),
            Bsdf::CoatedDiffuse(b) => b.kernel(),
            Bsdf::Principled(_) => Some(Kernel::Principled),
            Bsdf::Layered(_) | Bsdf::Hair(_) | Bsdf::Measured(_) | Bsdf::Evaluated(_) | Bsdf::Phase(_) => None,
        }
    }

    /// The tables of its kernel; the coats of a scene share them.
    pub fn tables(&self) -> &[f32] {
        if let Bsdf::CoatedDiffuse(b) = self { b.tables() } else { &[] }
    }
}
