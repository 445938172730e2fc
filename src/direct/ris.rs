//! Resampled importance sampling of direct light [Talbot et al. 2005; Talbot 2005].
//!
//! T1 makes M proposals per point by light and BSDF sampling, which multiple importance sampling weights into one set
//! [Talbot 2005, §4.6.1] with the luminance of f·G·L as target q̂. N of them are drawn in proportion to q̂·r, and only
//! these are evaluated in colour and traced. This is unbiased for any M ≥ N ≥ 1: given the proposals, the expectation
//! over the draws is the estimate that would trace all of them.
//!
//! The target `visibility` multiplies q̂ by an estimate V̂ > 0 of the visibility of each light, from the visibility
//! cache ([`crate::lights::visibility_cache`]): fewer occluded samples are drawn, and the estimate is unbiased for any
//! V̂.
//!
//! Targets with visibility reverse the order: proposals are traced, and N of the visible ones are shaded; light samples
//! do not need the BSDF before that.

use super::domain;
use super::point::ShadingPoint;
use super::proposal_columns::{PointProposals, ProposalColumns, Techniques};
use super::propose::{self, Candidate, Candidates, SampleAllocation};
use super::shadow_segments::Segments;
use crate::bsdfs::Bsdf;
use crate::scene::RenderJob;
use crate::settings::{IntegratorSettings, Strata};
use lumiris_numbers::estimators::ris::{Draw, strata, stratified, systematic, with_replacement};
use lumiris_numbers::math::Rgb;
use lumiris_numbers::math::hash::{pcg4d, unit_f32};
use std::time::{Duration, Instant};

/// Proposals that are generated before samples are drawn from them: few enough to stay in the processor's cache.
const CHUNK: usize = 2048;

/// The stage's buffers.
#[derive(Debug, Default)]
pub struct Resampler {
    proposals: ProposalColumns,
    draws: Vec<Draw>,
    ends: Vec<u32>,
    u: Vec<f32>,
    probes: Segments,
    /// Per point of the chunk, the numbers for the places of proposals and for the draws: well distributed over the
    /// samples of a pixel.
    numbers: Vec<[f32; 2]>,
    /// Time for proposals and their targets.
    pub t1: Duration,
    /// Segments traced for targets with visibility.
    pub probed: u64,
}

/// The proposals of a point by light and by BSDF sampling: M together, unless the BSDF is all specular.
///
/// A BSDF sample costs as much as ten light samples, which are made many at a time, and a wide BSDF says little of
/// where the light is: it gets one proposal in sixteen, one with a peak two; but where there are few proposals for each
/// sample, one BSDF sample for every two samples, or four if it is wide.
pub(super) fn allocation(point: &ShadingPoint<'_>) -> SampleAllocation {
    let (m, n) = (point.sample_counts.proposals, point.sample_counts.samples);
    let bsdf = &point.bsdf.bsdf;
    if !bsdf.has_non_specular() {
        return SampleAllocation::fixed(0, n);
    }
    let (of_proposals, of_samples) = match bsdf {
        Bsdf::Diffuse(_) | Bsdf::DiffuseTransmission(_) | Bsdf::Evaluated(_) => (0.0625, 0.25),
        Bsdf::CoatedDiffuse(_)
        | Bsdf::Conductor(_)
        | Bsdf::Dielectric(_)
        | Bsdf::ThinDielectric(_)
        | Bsdf::Layered(_) => (0.125, 0.5),
    };
    let by_bsdf = (m as f32 * of_proposals).max(n as f32 * of_samples);
    // A power of two, for which the points of a Sobol' sequence are best distributed
    let by_bsdf = 1 << (by_bsdf.log2().round().max(0.0) as u32);
    let by_bsdf = if by_bsdf < m { by_bsdf } else { 1 };
    if m == 1 { SampleAllocation::one_of_both(point) } else { SampleAllocation::fixed(m - by_bsdf, by_bsdf) }
}

/// How the proposals of a point are weighted.
fn techniques(settings: &IntegratorSettings, point: &ShadingPoint<'_>) -> Techniques {
    let SampleAllocation { n_light, n_bsdf, .. } = allocation(point);
    Techniques { n_light, n_bsdf, heuristic: settings.heuristic(), target: settings.ris.target }
}

impl Resampler {
    /// Draws the samples of all points: `out` gets one candidate for each, `contributions` what it adds if its segment
    /// is free. `bsdf_samples` are sorted by point.
    pub(super) fn run(
        &mut self,
        job: &RenderJob,
        settings: &IntegratorSettings,
        points: &[ShadingPoint<'_>],
        candidates: &mut Candidates,
        contributions: &mut Vec<Rgb>,
    ) {
        let bsdf_samples = std::mem::take(&mut candidates.records);
        candidates.records = std::mem::take(&mut candidates.spare);
        candidates.records.clear();
        contributions.clear();
        (self.t1, self.probed) = (Duration::ZERO, 0);

        let mut next = 0;
        let mut first = 0;
        while first < points.len() {
            // T1: proposals of some points
            let start = Instant::now();
            self.proposals.clear();
            self.numbers.clear();
            let (first_point, first_sample) = (first, next);
            while first < points.len() && (self.proposals.count() < CHUNK || first == first_point) {
                let point = &points[first];
                let begin = next;
                while next < bsdf_samples.len() && bsdf_samples[next].point == first as u32 {
                    next += 1;
                }
                self.propose(job, settings, point, &bsdf_samples[begin..next]);
                first += 1;
            }
            let chunk = &points[first_point..first];
            let bsdf_of_chunk = &bsdf_samples[first_sample..next];
            self.proposals.evaluate(job, chunk, |point| techniques(settings, point));
            if settings.ris.target.has_visibility() {
                self.probe(job, chunk, bsdf_of_chunk);
            }
            self.t1 += start.elapsed();

            // Select
            let mut bsdf = bsdf_of_chunk;
            for (i, point) in chunk.iter().enumerate() {
                let range = self.proposals.points()[i];
                self.draw(settings, point, range, self.numbers[i][1]);
                let (own, rest) = bsdf.split_at(range.end - range.bsdf_start);
                bsdf = rest;
                for draw in &self.draws {
                    let place = range.start + draw.index as usize;
                    let evaluated = if place < range.bsdf_start {
                        let index = (first_point + i) as u32;
                        let sample = self.proposals.light_sample(place);
                        sample.and_then(|s| {
                            propose::unshadowed_candidate(index, point, &SampleAllocation::fixed(0, 0), s)
                        })
                    } else {
                        Some(own[place - range.bsdf_start])
                    };
                    if let Some(candidate) = evaluated {
                        contributions.push(candidate.f * (self.proposals.r[place] * draw.scale));
                        candidates.records.push(candidate);
                    }
                }
            }
        }
        candidates.spare = bsdf_samples;
    }

    fn propose(
        &mut self,
        job: &RenderJob,
        settings: &IntegratorSettings,
        point: &ShadingPoint<'_>,
        bsdf: &[Candidate],
    ) {
        let numbers = point.stream.domain(domain::RESAMPLE).draw::<2>();
        self.numbers.push(numbers);
        let positions = (allocation(point).light_draws, settings.ris.points, numbers[0]);
        self.proposals.add(job, point, &techniques(settings, point), positions, bsdf);
    }

    /// Traces all proposals and sets the weights of those that are not visible to 0.
    fn probe(&mut self, job: &RenderJob, points: &[ShadingPoint<'_>], bsdf_samples: &[Candidate]) {
        self.probes.clear();
        let mut bsdf = bsdf_samples.iter();
        let mut probed = Vec::new();
        for (i, point) in points.iter().enumerate() {
            let range = self.proposals.points()[i];
            for place in range.start..range.end {
                let by_bsdf = if place >= range.bsdf_start { bsdf.next() } else { None };
                if !(self.proposals.weight[place] > 0.0) {
                    continue;
                }
                let segment = match by_bsdf {
                    Some(candidate) => Some(candidate.segment),
                    None => self.proposals.light_sample(place).map(|(_, s)| point.light_segment(&s)),
                };
                match segment {
                    Some(segment) => {
                        self.probes.push(&segment, i as u32, Rgb::BLACK);
                        probed.push(place);
                    }
                    None => self.proposals.weight[place] = 0.0,
                }
            }
        }
        self.probes.trace(&*job.world.accel);
        self.probed += probed.len() as u64;
        for (&place, &occluded) in probed.iter().zip(self.probes.occluded()) {
            if occluded {
                self.proposals.weight[place] = 0.0;
            }
        }
    }

    /// Draws N proposals of a point.
    fn draw(&mut self, settings: &IntegratorSettings, point: &ShadingPoint<'_>, range: PointProposals, u: f32) {
        let weights = &self.proposals.weight[range.start..range.end];
        let n = point.sample_counts.samples as usize;
        match settings.ris.strata {
            Strata::Systematic => systematic(weights, n as u32, u, &mut self.draws),
            Strata::None => {
                independent_numbers(u, n, &mut self.u);
                with_replacement(weights, &self.u, &mut self.draws);
            }
            Strata::Proposals => {
                strata::equal_proposals(weights.len(), n, &mut self.ends);
                independent_numbers(u, self.ends.len(), &mut self.u);
                stratified(weights, &self.ends, &self.u, &mut self.draws);
            }
            Strata::Weights => {
                let [bounds] = point.stream.domain(domain::STRATA).draw::<1>();
                independent_numbers(bounds, n, &mut self.u);
                strata::equal_weights(weights, n, &self.u, &mut self.ends);
                independent_numbers(u, self.ends.len(), &mut self.u);
                stratified(weights, &self.ends, &self.u, &mut self.draws);
            }
        }
    }
}

/// `count` independent numbers, the first of which is `u` itself.
fn independent_numbers(u: f32, count: usize, out: &mut Vec<f32>) {
    out.clear();
    let other = |i: usize| unit_f32(pcg4d([u.to_bits(), i as u32, 0x9e37_79b9, 1])[0]);
    out.extend((0..count).map(|i| if i == 0 { u } else { other(i) }));
}
