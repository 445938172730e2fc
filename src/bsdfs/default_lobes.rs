//! Default sampling densities for BSDFs that can only be evaluated.
//!
//! [`ProposalDensity::Lobes`] follows [Talbot et al. 2005, §5.2]: a cosine-weighted hemisphere mixed with lobes about
//! the mirror direction of `wo` and about `wo` itself,
//!
//! p(wi) = w_c |cos θi|/π + w_m p_α(wi; α_m) + w_r p_α(R wi; α_r),   R (x, y, z) = (−x, −y, z)
//!
//! where p_α(wi) = D_wo(m)/(4 wo·m) is the density of reflection by the visible normals of a GGX surface, and m is the
//! half vector. GGX has long tails, so that a single width serves BSDF lobes of many widths, and its lobes have the
//! correct shape at grazing angles. Directions below the horizon of `wo` are failed samples: p integrates to slightly
//! less than 1 and remains exact.
//!
//! Weights and widths were chosen by the relative variance (∫ g²/p)/(∫ g)² − 1 of g = f |cos θi| over four angles of 18
//! BSDFs (Lambert, Oren-Nayar, Beckmann of slope 0.1 to 0.5, cosine lobes of exponent 10 to 150 of both kinds,
//! Ashikhmin-Shirley, and mixtures). The mean logarithm of 1 plus that variance is
//!
//! | density | mean log second moment | worst relative variance |
//! |---|---|---|
//! | uniform hemisphere | 2.30 | 748 |
//! | cosine hemisphere | 2.30 | 2620 |
//! | 0.5, 0.3, 0.2 with α = 0.3, 0.3 | 1.51 | 106 |
//! | 0.5, 0.3, 0.2 with powers of a cosine of exponent 40, 40 about the two directions | 1.19 | 61 |
//! | 0.5, 0.3, 0.2 with α = 0.1, 0.15 (used) | 1.16 | 22 |
//! | 0.4, 0.2, 0.2, 0.2 with two mirror lobes, α = 0.1, 0.3, and 0.15 | 1.15 | 22 |
//!
//! A Lambertian BSDF, which a pure cosine density would match, has a relative variance of 0.34 to 0.69.

use super::fresnel::{reflect, to_upper};
use super::lobe::Lobe;
use super::microfacet::TrowbridgeReitz;
use lumiris_numbers::math::{Vec3, warp};
use strum::{EnumIter, EnumString, IntoStaticStr, VariantNames};

/// Weight of the cosine lobe.
const COSINE_WEIGHT: f32 = 0.5;
/// Weight of the mirror lobe.
const MIRROR_WEIGHT: f32 = 0.3;
/// Weight of the retroreflective lobe.
const RETRO_WEIGHT: f32 = 1.0 - COSINE_WEIGHT - MIRROR_WEIGHT;
/// Width of the mirror lobe.
const MIRROR: TrowbridgeReitz = TrowbridgeReitz { alpha_x: 0.1, alpha_y: 0.1 };
/// Width of the retroreflective lobe.
const RETRO: TrowbridgeReitz = TrowbridgeReitz { alpha_x: 0.15, alpha_y: 0.15 };

/// A sampling density on the side of `wo`, independent of the BSDF.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, EnumIter, EnumString, IntoStaticStr, VariantNames)]
#[strum(serialize_all = "kebab-case")]
pub enum ProposalDensity {
    /// Cosine-weighted hemisphere with a mirror lobe and a retroreflective one.
    #[default]
    Lobes,
    /// Uniform hemisphere, for comparison.
    Uniform,
}

/// A sampled direction, and its lobe.
#[derive(Clone, Copy, Debug)]
pub struct LobeDirection {
    /// The direction.
    pub wi: Vec3,
    /// The lobe.
    pub lobe: Lobe,
}

impl ProposalDensity {
    /// Samples a direction on the side of `wo`: a lobe by `uc`, a direction within it by `u`. `None` if the direction
    /// is below the horizon.
    #[inline]
    pub fn sample(self, wo: Vec3, uc: f32, u: [f32; 2]) -> Option<LobeDirection> {
        let flip = if wo.z < 0.0 { -1.0 } else { 1.0 };
        let LobeDirection { wi, lobe } = match self {
            ProposalDensity::Lobes => sample_lobes(wo * flip, uc, u),
            ProposalDensity::Uniform => LobeDirection { wi: warp::sample_uniform_hemisphere(u), lobe: Lobe::DIFFUSE },
        };
        (wi.z > 0.0).then_some(LobeDirection { wi: wi * flip, lobe: lobe | Lobe::REFLECTION })
    }

    /// Probability of the cosine lobe, see [`super::Bsdf::first_lobe`].
    pub(super) fn first_lobe(self) -> f32 {
        match self {
            ProposalDensity::Lobes => COSINE_WEIGHT,
            ProposalDensity::Uniform => 1.0,
        }
    }

    /// Density of the cosine lobe, including its probability, see [`super::Bsdf::pdf_first_lobe`].
    pub(super) fn pdf_first_lobe(self, wo: Vec3, wi: Vec3) -> f32 {
        match (self, to_upper(wo, wi)) {
            (_, None) => 0.0,
            (ProposalDensity::Lobes, Some([_, wi])) => COSINE_WEIGHT * warp::pdf_cosine_hemisphere(wi),
            (ProposalDensity::Uniform, Some([_, wi])) => warp::pdf_uniform_hemisphere(wi),
        }
    }

    /// Density of [`Self::sample`] per steradian.
    #[inline]
    pub fn pdf(self, wo: Vec3, wi: Vec3) -> f32 {
        let Some([wo, wi]) = to_upper(wo, wi) else { return 0.0 };
        match self {
            ProposalDensity::Lobes => pdf_lobes(wo, wi),
            ProposalDensity::Uniform => warp::pdf_uniform_hemisphere(wi),
        }
    }
}

fn sample_lobes(wo: Vec3, uc: f32, u: [f32; 2]) -> LobeDirection {
    if uc < COSINE_WEIGHT {
        LobeDirection { wi: warp::sample_cosine_hemisphere(u), lobe: Lobe::DIFFUSE }
    } else if uc < COSINE_WEIGHT + MIRROR_WEIGHT {
        LobeDirection { wi: reflect(wo, MIRROR.sample_m(wo, u)), lobe: Lobe::GLOSSY }
    } else {
        LobeDirection { wi: rotated(reflect(wo, RETRO.sample_m(wo, u))), lobe: Lobe::GLOSSY }
    }
}

fn pdf_lobes(wo: Vec3, wi: Vec3) -> f32 {
    COSINE_WEIGHT * warp::pdf_cosine_hemisphere(wi)
        + MIRROR_WEIGHT * MIRROR.pdf_reflection(wo, wi)
        + RETRO_WEIGHT * RETRO.pdf_reflection(wo, rotated(wi))
}

/// Rotates by 180° about the normal.
fn rotated(w: Vec3) -> Vec3 {
    Vec3::new(-w.x, -w.y, w.z)
}
