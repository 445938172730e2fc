//! Scattering at surfaces. Local frame: n = +z; `wo` to the viewer, `wi` to the light, both unit and away from the
//! surface. The models are those of pbrt-v4 [Pharr et al. 2023, ch. 9 and 14]; f of transmission is for radiance, that
//! is scaled by 1/η².
//!
//! Reading order: [`lobe`], [`fresnel`], [`microfacet`], [`kernel`], [`diffuse`], [`diffuse_transmission`], [`conductor`], [`dielectric`],
//! [`thin_dielectric`], [`coat_table`], [`coated_diffuse`], [`layered`], [`sheen`], [`principled`], [`hair`], [`measured`]; [`phase`] in media; then what can only be evaluated: [`models`],
//! [`default_lobes`], [`evaluated`], [`mod@resample`].

pub mod coat_table;
pub mod coated_diffuse;
pub mod conductor;
pub mod default_lobes;
pub mod dielectric;
pub mod diffuse;
pub mod diffuse_transmission;
pub mod evaluated;
pub mod fresnel;
pub mod hair;
pub mod kernel;
pub mod layered;
pub mod lobe;
pub mod measured;
pub mod microfacet;
pub mod models;
pub mod phase;
pub mod principled;
pub mod resample;
pub mod sheen;
#[cfg(test)]
mod tests;
pub mod thin_dielectric;

pub use coat_table::CoatTable;
pub use coated_diffuse::CoatedDiffuse;
pub use conductor::Conductor;
pub use default_lobes::ProposalDensity;
pub use dielectric::Dielectric;
pub use diffuse::Diffuse;
pub use diffuse_transmission::DiffuseTransmission;
pub use evaluated::Evaluated;
pub use hair::Hair;
pub use kernel::KernelBsdf;
pub use layered::{Base, Layered};
pub use lobe::{BsdfSample, Lobe};
pub use measured::{Measured, MeasuredTables};
pub use microfacet::TrowbridgeReitz;
pub use models::Model;
pub use phase::Phase;
pub use principled::Principled;
pub use resample::{Resampled, resample};
pub use thin_dielectric::ThinDielectric;

use dielectric::{Select, Transport};
use kernel::{evaluate, without_cos};
use lumiris_lanes::kernels;
use lumiris_numbers::math::{Rgb, Vec3};

/// Most lobes that [`Bsdf::first_lobe`] tells apart.
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
    /// Refraction by an interface, without the reflection: out of an interior whose reflections are no vertices.
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
    /// Reflection by tables of a measurement.
    Measured(Measured<'a>),
    /// Reflection that can only be evaluated.
    Evaluated(Evaluated),
    /// Scattering in a medium: no surface, and no cosine.
    Phase(Phase),
}

/// The roughness up to which surfaces are said to make caustics.
const MAX_CAUSTIC_ALPHA: f32 = 0.3;
/// The part of a surface that must be metal or glass for it.
const CAUSTIC_PART: f32 = 0.5;

/// The part of a BSDF that needs of the light no more than its irradiance, and what remains.
#[derive(Clone, Copy, Debug)]
pub struct Lambertian<'a> {
    /// Albedo for light that arrives on the side of `wo`.
    pub reflectance: Rgb,
    /// Albedo for light that arrives on the other side.
    pub transmittance: Rgb,
    /// The other lobes.
    pub rest: Option<Bsdf<'a>>,
}

/// Both directions in the upper hemisphere, the whole surface being symmetric; `None` if they are on different sides.
#[inline]
fn to_upper(wo: Vec3, wi: Vec3) -> Option<(Vec3, Vec3)> {
    if wo.z * wi.z <= 0.0 {
        None
    } else if wo.z < 0.0 {
        Some((-wo, -wi))
    } else {
        Some((wo, wi))
    }
}

impl<'a> Bsdf<'a> {
    /// Value without cosine (1/sr), without deltas. 0 at the horizon and never NaN or infinite.
    #[inline]
    pub fn f(&self, wo: Vec3, wi: Vec3) -> Rgb {
        self.f_and_pdf(wo, wi).0
    }

    /// Density of the non-specular part of [`Self::sample`] per steradian.
    #[inline]
    pub fn pdf(&self, wo: Vec3, wi: Vec3) -> f32 {
        self.f_cos_and_pdf(wo, wi).1
    }

    /// [`Self::f`] and [`Self::pdf`].
    #[inline]
    pub fn f_and_pdf(&self, wo: Vec3, wi: Vec3) -> (Rgb, f32) {
        let (f_cos, pdf) = self.f_cos_and_pdf(wo, wi);
        (if self.has_surface() { without_cos(f_cos, wi) } else { f_cos }, pdf)
    }

    /// [`Self::f`] times [`Self::cos`], and [`Self::pdf`]: the bits of the kernel if there is one.
    #[inline]
    pub fn f_cos_and_pdf(&self, wo: Vec3, wi: Vec3) -> (Rgb, f32) {
        let (f, pdf) = match self {
            Bsdf::Diffuse(b) => return b.f_cos_and_pdf(wo, wi),
            Bsdf::DiffuseTransmission(b) => return b.f_cos_and_pdf(wo, wi),
            Bsdf::Conductor(b) => return b.f_cos_and_pdf(wo, wi),
            Bsdf::Dielectric(b) => return b.f_cos_and_pdf(wo, wi),
            Bsdf::Exit(b) => return evaluate::<kernels::Exit>(&b.params(), &[], wo, wi),
            Bsdf::CoatedDiffuse(b) => return b.f_cos_and_pdf(wo, wi),
            Bsdf::Principled(b) => return b.f_cos_and_pdf(wo, wi),
            Bsdf::ThinDielectric(_) => return (Rgb::BLACK, 0.0),
            _ if (wo.z == 0.0 || wi.z == 0.0) && self.has_surface() => return (Rgb::BLACK, 0.0),
            Bsdf::Layered(b) => (b.f(wo, wi), b.pdf(wo, wi)),
            Bsdf::Hair(b) => (b.f(wo, wi), b.pdf(wo, wi)),
            Bsdf::Measured(b) => (b.f(wo, wi), b.pdf(wo, wi)),
            Bsdf::Evaluated(b) => (b.f(wo, wi), b.pdf(wo, wi)),
            Bsdf::Phase(b) => (Rgb::splat(b.p(wo, wi)), b.p(wo, wi)),
        };
        let f_cos = f * self.cos(wi);
        (if f_cos.is_finite() { f_cos } else { Rgb::BLACK }, if pdf.is_finite() { pdf } else { 0.0 })
    }

    /// Probability that [`Self::sample`] samples the first of at most two lobes, which it does if `uc` is less: the
    /// interface of a coat, the reflection of a diffuse transmitter, the cosine lobe of a proposal density. 1 for BSDFs
    /// of one lobe.
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

    /// The part of [`Self::pdf`], whose value `pdf` is, that the first lobe contributes (1/sr).
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
        // Not finite or, by rounding, more than the whole
        if first > 0.0 { first.min(pdf) } else { 0.0 }
    }

    /// The strongest rough lobe about the mirror direction of `wo`: its α, the greater one where it is anisotropic, and its
    /// part of the albedo (0 to 1). `None` if there is none, or if light passes as well, of which it would tell nothing.
    #[inline]
    pub fn glossy_lobe(&self, wo: Vec3) -> Option<(f32, f32)> {
        let (distribution, share) = match self {
            Bsdf::Measured(b) => return Some((b.alpha(), 1.0)),
            Bsdf::Conductor(b) => (b.distribution, 1.0),
            Bsdf::CoatedDiffuse(b) => (b.distribution(), b.first_lobe(wo)),
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
        (!distribution.is_smooth()).then_some((distribution.alpha_x.max(distribution.alpha_y), share))
    }

    /// True for metals and glass that are smooth or nearly so: light that they send on is bundled to caustics.
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

    /// True if f and pdf are functions of the directions, and pdf is that of sampled directions: not estimates by random
    /// walks, not of what can only be evaluated, and not of interiors.
    pub fn is_evaluated_exactly(&self) -> bool {
        !matches!(self, Bsdf::Exit(_) | Bsdf::Layered(_) | Bsdf::Hair(_) | Bsdf::Evaluated(_) | Bsdf::Phase(_))
    }

    /// False in a medium, where directions along the horizon of the frame are no others, and there is no cosine.
    #[inline]
    pub fn has_surface(&self) -> bool {
        !matches!(self, Bsdf::Phase(_))
    }

    /// |cos θ| of a direction in the frame, by which f is multiplied; 1 in a medium.
    #[inline]
    pub fn cos(&self, w: Vec3) -> f32 {
        if self.has_surface() { w.z.abs() } else { 1.0 }
    }

    /// The index of refraction of light that passes, where another takes its place for one wavelength.
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

    /// True if light that arrives on the other side than that of `wo` may reach it.
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

    /// Probability of a lobe of [`Self::sample`] whose density is that of the cosine or uniform, on the side of `wo`:
    /// |cos θi|/pdf is at most 2π over this everywhere there, and directions are found that no f tells of. 0 for BSDFs
    /// without such a lobe.
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

    /// A direction `wi`, by `uc` among the lobes and `u` within one. `None` if the sample carries no light.
    #[inline]
    pub fn sample(&self, wo: Vec3, uc: f32, u: [f32; 2]) -> Option<BsdfSample> {
        self.sample_direction(wo, uc, u).filter(|s| s.f.is_finite() && !s.f.is_black())
    }

    /// As [`Self::sample`], but also directions that carry no light: `None` only where the density has a defect. So the
    /// directions of non-specular samples are distributed by [`Self::pdf`].
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
        sample.filter(|s| s.pdf > 0.0 && s.pdf.is_finite() && (s.wi.z != 0.0 || !has_surface))
    }

    /// True if [`Self::f`] is not always 0: the point can be lit by sampling lights.
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

    /// True if [`Self::sample`] follows a density that knows nothing of [`Self::f`], so that [`resample()`] pays.
    #[inline]
    pub fn is_only_evaluated(&self) -> bool {
        matches!(self, Bsdf::Evaluated(_))
    }

    /// The Lambertian part as seen from `wo`; `None` if there is none. Exact but for the base below a coat, whose
    /// dependence on the direction of the light (the coat's transmittance) is replaced by its mean: exact under even
    /// light.
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

    /// Fraction of uniform light that reaches `wo`, for the albedo image: exact for the Lambertian and coated ones,
    /// otherwise the unbiased estimate f |cos θ|/pdf of one sample, drawn by the numbers that `u` gives. One is enough:
    /// an image has a sample of its own for each camera sample, and many for each would cost more than all light
    /// transport.
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
                let [uc, u0, u1] = u();
                self.sample(wo, uc, [u0, u1]).map_or(Rgb::BLACK, |s| s.f * (s.wi.z.abs() / s.pdf))
            }
        }
    }
}
