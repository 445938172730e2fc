//! Candidates of T1: samples with their unshadowed integrands and the densities of all techniques.

use super::domain;
use super::stats::DirectStats;
use crate::lights::LightId;
use lumiris_numbers::estimators::mc;
use lumiris_numbers::estimators::mis::{Heuristic, Technique};
use lumiris_numbers::math::{Ray, Rgb};
use lumiris_numbers::samplers::SampleStream;

/// Which technique drew a candidate.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Drawn {
    /// Light sampling.
    Light,
    /// Light sampling of a light without extent in solid angle.
    DeltaLight,
    /// BSDF sampling.
    Bsdf,
    /// A specular lobe.
    DeltaBsdf,
}

impl Drawn {
    /// True if no other technique can draw the direction.
    pub fn is_delta(self) -> bool {
        match self {
            Drawn::DeltaLight | Drawn::DeltaBsdf => true,
            Drawn::Light | Drawn::Bsdf => false,
        }
    }
}

/// A candidate: one direction of light at one point.
#[derive(Clone, Copy, Debug)]
pub struct Candidate {
    /// Index of the shading point.
    pub point: u32,
    /// Technique.
    pub drawn: Drawn,
    /// Unshadowed integrand f_s·|cos θ|·L.
    pub f: Rgb,
    /// The radiance L in it.
    pub li: Rgb,
    /// The light; one of those at infinity for a direction of BSDF sampling that meets no surface.
    pub light: LightId,
    /// Density of light sampling at the direction (per steradian, light choice included; a probability for deltas).
    pub p_light: f32,
    /// Density of BSDF sampling (per steradian; as the BSDF gives it for specular lobes).
    pub p_bsdf: f32,
    /// Expected number of light samples of the point.
    pub n_light: f32,
    /// Expected number of BSDF samples of the point.
    pub n_bsdf: f32,
    /// The part of `p_bsdf` that is the first lobe's; kept for estimators with components.
    pub p_lobe: f32,
    /// Group of the light; kept for estimators with components. Without meaning where `p_light` is 0.
    pub group: u8,
    /// The segment that must be unoccluded for the candidate to count.
    pub segment: Ray,
}

impl Candidate {
    /// The factor 1/(n·p) of f in the estimate over the samples of the candidate's own technique.
    #[inline]
    pub fn own_factor(&self) -> f32 {
        match self.drawn {
            Drawn::Light | Drawn::DeltaLight => mc::weight(self.n_light, self.p_light),
            Drawn::Bsdf | Drawn::DeltaBsdf => mc::weight(self.n_bsdf, self.p_bsdf),
        }
    }

    /// The factor w/(n·p) of f in the estimate over all candidates of a point, if both techniques are used.
    #[inline]
    pub fn factor(&self, heuristic: Heuristic) -> f32 {
        let light = Technique { n: self.n_light, p: self.p_light };
        let bsdf = Technique { n: self.n_bsdf, p: self.p_bsdf };
        match self.drawn {
            Drawn::DeltaLight | Drawn::DeltaBsdf => self.own_factor(),
            Drawn::Light => heuristic.factor(light, bsdf),
            Drawn::Bsdf => heuristic.factor(bsdf, light),
        }
    }
}

/// The number of samples per technique at a point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct SampleAllocation {
    pub light_draws: u32,
    pub bsdf_draws: u32,
    /// Expected numbers.
    pub n_light: f32,
    pub n_bsdf: f32,
}

impl SampleAllocation {
    /// Fixed numbers of samples.
    pub(super) fn fixed(light: u32, bsdf: u32) -> Self {
        SampleAllocation { light_draws: light, bsdf_draws: bsdf, n_light: light as f32, n_bsdf: bsdf as f32 }
    }

    /// The same, where the BSDF sample may be drawn by the path.
    pub(super) fn drawn_by_path(self, by_path: bool) -> Self {
        if by_path { SampleAllocation { bsdf_draws: 0, ..self } } else { self }
    }

    /// A single sample that chooses its technique at random: the expected numbers are one half each.
    pub(super) fn one_of_both(stream: &SampleStream) -> Self {
        let light = stream.domain(domain::TECHNIQUE).draw::<1>()[0] < 0.5;
        SampleAllocation { light_draws: u32::from(light), bsdf_draws: u32::from(!light), n_light: 0.5, n_bsdf: 0.5 }
    }
}

/// All candidates of a batch.
#[derive(Debug, Default)]
pub struct Candidates {
    /// Those with a non-zero integrand.
    pub records: Vec<Candidate>,
    /// What each of them contributes if its segment is unoccluded: the result of select.
    pub contributions: Vec<Rgb>,
    /// Counts of the batch, and those of its times that are parts of stages.
    pub stats: DirectStats,
}

impl Candidates {
    /// Removes all.
    pub(super) fn clear(&mut self) {
        self.records.clear();
        self.contributions.clear();
        self.stats = DirectStats::default();
    }

    /// Select where all candidates are traced: the contribution of each is f times its factor.
    pub(super) fn weigh(&mut self, factor: impl Fn(&Candidate) -> f32) {
        self.contributions.extend(self.records.iter().map(|c| c.f * factor(c)));
    }
}
