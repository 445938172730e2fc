//! BSDFs that are given only by their value f(wo, wi), sampled by a density independent of their shape.
//!
//! Sampling and density are those of [`ProposalDensity`] and exact, so that MIS with light sampling is possible. The
//! density fits badly. [`super::resample()`] samples f |cos θi| itself in the limit of many proposals.

use super::default_lobes::{LobeDirection, ProposalDensity};
use super::lobe::BsdfSample;
use super::models::Model;
use lumiris_numbers::math::{Rgb, Vec3};

/// A reflectance model with the density that proposes directions for it.
#[derive(Clone, Copy, Debug)]
pub struct Evaluated {
    /// The value.
    pub model: Model,
    /// The density.
    pub density: ProposalDensity,
}

impl Evaluated {
    /// Value without cosine (1/sr).
    #[inline]
    pub fn f(&self, wo: Vec3, wi: Vec3) -> Rgb {
        self.model.f(wo, wi)
    }

    /// Density of [`Self::sample`] per steradian.
    #[inline]
    pub fn pdf(&self, wo: Vec3, wi: Vec3) -> f32 {
        self.density.pdf(wo, wi)
    }

    /// Samples the proposal density.
    #[inline]
    pub fn sample(&self, wo: Vec3, uc: f32, u: [f32; 2]) -> Option<BsdfSample> {
        let LobeDirection { wi, lobe } = self.density.sample(wo, uc, u)?;
        Some(BsdfSample { f: self.f(wo, wi), wi, pdf: self.pdf(wo, wi), lobe, eta: 1.0 })
    }
}
