//! Sampling any BSDF by resampled importance sampling [Talbot et al. 2005, §5.2].
//!
//! M proposals x_j with density p come from [`Bsdf::sample`]; one of them, y, is drawn in proportion to q̂/p with the
//! target q̂ = luminance(f) |cos θ|. Its contribution weight
//!
//! W = 1/q̂(y) · (1/M) Σ_j q̂(x_j)/p(x_j)
//!
//! makes f |cos θ| L W an unbiased estimate of ∫ f |cos θ| L dω for every M, since the luminance is 0 only where f is.
//! With M = 1, W = 1/p. In the limit y has the density q̂/∫q̂, which for a grey surface is proportional to f |cos θ|.
//!
//! This works for any BSDF model. Specular lobes take part with probabilities in place of p, since f is relative to the
//! same measure. So do stochastic values (layered BSDFs), where f is the value returned with the sample.

use super::bsdf::Bsdf;
use super::lobe::Lobe;
use lumiris_numbers::estimators::ris::Reservoir;
use lumiris_numbers::math::{Rgb, Vec3};

/// A resampled direction. The weight of the path is `f·|cos θi|·weight` for all lobes.
#[derive(Clone, Copy, Debug)]
pub struct Resampled {
    /// Value without cosine (1/sr); for deltas, as returned by the sampler.
    pub f: Rgb,
    /// Direction to the light.
    pub wi: Vec3,
    /// W, in place of 1/pdf (sr).
    pub weight: f32,
    /// Kind of scattering.
    pub lobe: Lobe,
    /// Index of refraction on the side of `wi` relative to the side of `wo`; 1 for reflection.
    pub eta: f32,
}

/// Chooses one of `proposals` (M, at least 1) samples of `bsdf`. `u_proposal(j)` are the random numbers of proposal j,
/// the first of which chooses the lobe; `u_choice` chooses among the proposals. `None` if no proposal carries light.
pub fn resample(
    bsdf: &Bsdf<'_>,
    wo: Vec3,
    proposals: u32,
    u_proposal: impl Fn(u32) -> [f32; 3],
    u_choice: f32,
) -> Option<Resampled> {
    let proposals = proposals.max(1);
    let mut reservoir = Reservoir::new(u_choice);
    for j in 0..proposals {
        let [uc, u0, u1] = u_proposal(j);
        let Some(s) = bsdf.sample(wo, uc, [u0, u1]) else { continue };
        // The target is the luminance of f·|cos θ|
        let p_hat = s.f.luminance() * bsdf.cos(s.wi);
        reservoir.offer((s, p_hat), p_hat / s.pdf);
    }
    let sum = reservoir.sum();
    let (s, p_hat) = reservoir.into_kept()?;
    let weight = (sum / (f64::from(proposals) * f64::from(p_hat))) as f32;
    weight.is_finite().then_some(Resampled { f: s.f, wi: s.wi, weight, lobe: s.lobe, eta: s.eta })
}
