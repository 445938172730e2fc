//! Candidates of T1: samples with their unshadowed integrands and the densities of all techniques.

use super::domain;
use super::stats::DirectStats;
use crate::lights::{LightId, SampleOfLight};
use lumiris_numbers::estimators::heuristics::{Heuristic, Technique};
use lumiris_numbers::estimators::mc;
use lumiris_numbers::math::{Ray, Rgb};
use lumiris_numbers::samplers::SampleStream;

/// The technique that sampled a candidate.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SampledBy {
    /// Light sampling.
    Light,
    /// Light sampling of a delta light.
    DeltaLight,
    /// BSDF sampling.
    Bsdf,
    /// BSDF sampling of a specular lobe.
    DeltaBsdf,
}

impl SampledBy {
    /// True if no other technique can sample the direction.
    pub fn is_delta(self) -> bool {
        match self {
            SampledBy::DeltaLight | SampledBy::DeltaBsdf => true,
            SampledBy::Light | SampledBy::Bsdf => false,
        }
    }
}

/// A candidate: a sample of incident light at a point.
#[derive(Clone, Copy, Debug)]
pub struct Candidate {
    /// Index of the shading point.
    pub point: u32,
    /// Technique.
    pub sampled_by: SampledBy,
    /// Unshadowed integrand f_s·|cos θ|·L.
    pub f: Rgb,
    /// The radiance L in `f`.
    pub li: Rgb,
    /// The light. For a BSDF sample that hits no surface, one of the infinite lights.
    pub light: LightId,
    /// Density of light sampling (1/sr), including the choice of the light; a probability for delta lights.
    pub p_light: f32,
    /// Density of BSDF sampling (1/sr); for specular lobes, the pdf returned by the BSDF.
    pub p_bsdf: f32,
    /// Expected number of light samples of the point.
    pub n_light: f32,
    /// Expected number of BSDF samples of the point.
    pub n_bsdf: f32,
    /// Part of `p_bsdf` of the first lobe, for estimators with components.
    pub p_lobe: f32,
    /// Group of the light, for estimators with components. Undefined if `p_light` is 0.
    pub group: u8,
    /// The shadow segment.
    pub segment: Ray,
}

impl Candidate {
    /// The light sample `drawn` from a point whose unshadowed integrand is `f`, without densities of other techniques and
    /// numbers of samples.
    #[inline]
    pub(super) fn of_light(point: u32, f: Rgb, drawn: &SampleOfLight, segment: Ray) -> Candidate {
        let SampleOfLight { light, sample } = *drawn;
        Candidate {
            point,
            sampled_by: if sample.is_delta { SampledBy::DeltaLight } else { SampledBy::Light },
            f,
            li: sample.li,
            light,
            p_light: sample.pdf,
            p_bsdf: 0.0,
            n_light: 0.0,
            n_bsdf: 0.0,
            p_lobe: 0.0,
            group: 0,
            segment,
        }
    }

    /// The factor 1/(n·p) of f in the estimate by the candidate's own technique.
    #[inline]
    pub fn own_factor(&self) -> f32 {
        match self.sampled_by {
            SampledBy::Light | SampledBy::DeltaLight => mc::factor(self.n_light, self.p_light),
            SampledBy::Bsdf | SampledBy::DeltaBsdf => mc::factor(self.n_bsdf, self.p_bsdf),
        }
    }

    /// The factor w/(n·p) of f in the MIS estimate of both techniques.
    #[inline]
    pub fn factor(&self, heuristic: Heuristic) -> f32 {
        let light = Technique { n: self.n_light, p: self.p_light };
        let bsdf = Technique { n: self.n_bsdf, p: self.p_bsdf };
        match self.sampled_by {
            SampledBy::DeltaLight | SampledBy::DeltaBsdf => self.own_factor(),
            SampledBy::Light => heuristic.factor(light, bsdf),
            SampledBy::Bsdf => heuristic.factor(bsdf, light),
        }
    }
}

/// Number of samples per technique at a point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct SampleAllocation {
    pub light_draws: u32,
    pub bsdf_draws: u32,
    /// Expected number of light samples.
    pub n_light: f32,
    pub n_bsdf: f32,
}

impl SampleAllocation {
    /// Fixed sample counts.
    pub(super) fn fixed(light: u32, bsdf: u32) -> Self {
        SampleAllocation { light_draws: light, bsdf_draws: bsdf, n_light: light as f32, n_bsdf: bsdf as f32 }
    }

    /// The same without BSDF samples if `by_path` is true: the next path segment is the BSDF sample.
    pub(super) fn drawn_by_path(self, by_path: bool) -> Self {
        if by_path { SampleAllocation { bsdf_draws: 0, ..self } } else { self }
    }

    /// A single sample of a random technique; each has an expected number of one half.
    pub(super) fn one_of_both(stream: &SampleStream) -> Self {
        let light = stream.domain(domain::TECHNIQUE).draw::<1>()[0] < 0.5;
        SampleAllocation { light_draws: u32::from(light), bsdf_draws: u32::from(!light), n_light: 0.5, n_bsdf: 0.5 }
    }
}

/// All candidates of a batch.
#[derive(Debug, Default)]
pub struct Candidates {
    /// Candidates with a non-zero integrand.
    pub records: Vec<Candidate>,
    /// Unshadowed contribution of each candidate: the result of select.
    pub contributions: Vec<Rgb>,
    /// Counts of the batch, and times of parts of its stages.
    pub stats: DirectStats,
}

impl Candidates {
    /// Removes all candidates.
    pub(super) fn clear(&mut self) {
        self.records.clear();
        self.contributions.clear();
        self.stats = DirectStats::default();
    }

    /// Select for estimators that trace all candidates: the contribution is f times `factor`.
    pub(super) fn weigh(&mut self, factor: impl Fn(&Candidate) -> f32) {
        self.contributions.extend(self.records.iter().map(|c| c.f * factor(c)));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use lumiris_numbers::math::Vec3;

    fn candidate(sampled_by: SampledBy) -> Candidate {
        let segment = Ray { o: Vec3::ZERO, d: Vec3::Z, t_max: 1.0, time: 0.0 };
        let (f, li, light) = (Rgb::WHITE, Rgb::WHITE, 0);
        let (p_light, p_bsdf, n_light, n_bsdf) = (0.5, 2.0, 3.0, 1.0);
        Candidate {
            point: 0,
            sampled_by,
            f,
            li,
            light,
            p_light,
            p_bsdf,
            n_light,
            n_bsdf,
            p_lobe: 0.0,
            group: 0,
            segment,
        }
    }

    #[test]
    fn mis_weights_of_both_techniques_sum_to_one_and_delta_samples_have_the_weight_one() {
        for heuristic in [Heuristic::Balance, Heuristic::Power] {
            // A factor is w/(n·p)
            let [light, bsdf] = [SampledBy::Light, SampledBy::Bsdf].map(|by| candidate(by).factor(heuristic));
            assert!((light * 3.0 * 0.5 + bsdf * 1.0 * 2.0 - 1.0).abs() < 1e-6, "{heuristic:?}");
            assert!((candidate(SampledBy::DeltaLight).factor(heuristic) - 1.0 / 1.5).abs() < 1e-6);
            assert!((candidate(SampledBy::DeltaBsdf).factor(heuristic) - 1.0 / 2.0).abs() < 1e-6);
        }
    }
}
