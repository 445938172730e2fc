//! Resampled importance sampling of direct light [Talbot et al. 2005; Talbot 2005].
//!
//! T1 makes M proposals per point by light and BSDF sampling. Multiple importance sampling weights them into one set
//! [Talbot 2005, §4.6.1]; the target q̂ is the luminance of f·G·L. N proposals are drawn in proportion to q̂·r. Only
//! these are evaluated in colour and traced. The estimate is unbiased for any M ≥ N ≥ 1: given the proposals, its
//! expectation over the draws is the estimate that traces all proposals. The factor 1/N and the sum of all weights in
//! [Talbot 2005, Eq. 4.1] are in [`Draw::scale`].
//!
//! The target `visibility` multiplies q̂ by √V̂, where V̂ > 0 is the visibility of each light estimated from its
//! photons ([`crate::lights::learned_visibility`]). If V is 1 with probability V̂ and 0 otherwise, the density of
//! minimum variance is proportional to q̂·√V̂. Fewer occluded samples are drawn, and the estimate is unbiased for any
//! V̂.
//!
//! With the target `visibility-control`, V̂ is a control variate as well. The expected light Σ c_j V̂_j over all
//! proposals is added without a ray. Samples of the difference are drawn where V̂ is uncertain
//! ([`lumiris_numbers::estimators::ris::control`]).
//!
//! The targets with traced visibility (`gv`, `gvl`) reverse the order: all proposals are traced, and N of the visible
//! ones are shaded. Light samples do not need the BSDF before that.

use crate::bsdfs::Bsdf;
use crate::direct::candidates::{Candidate, Candidates, SampleAllocation};
use crate::direct::domain;
use crate::direct::point::ShadingPoint;
use crate::direct::proposal_columns::{LightProposals, PointProposals, ProposalColumns, ProposalTechniques};
use crate::direct::shadow_segments::Segments;
use crate::direct::t1::T1;
use crate::scene::RenderJob;
use crate::settings::{IntegratorSettings, ProposalPoints, RisSettings, SampleCounts, Strata, Target};
use lumiris_numbers::estimators::heuristics::Heuristic;
use lumiris_numbers::estimators::ris::{Draw, strata, stratified, systematic, with_replacement};
use lumiris_numbers::math::Rgb;
use lumiris_numbers::math::hash::{pcg4d, unit_f32};
use std::time::Instant;

/// Proposals per chunk: few enough to stay in the cache.
const CHUNK: usize = 2048;
/// |g| below which a phase function is wide.
const WIDE: f32 = 0.5;

/// Resampling of light and BSDF samples.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ris {
    /// Samples (N) and proposals (M).
    pub sample_counts: SampleCounts,
    /// Weights of the proposal techniques.
    pub heuristic: Heuristic,
    /// Distribution of the proposals over the lights.
    pub points: ProposalPoints,
    /// The target density.
    pub target: Target,
    /// How samples are drawn from the proposals.
    pub strata: Strata,
}

impl Ris {
    /// The estimator at a path vertex, counted from 0. Later vertices have fewer samples.
    pub(super) fn at_vertex(settings: &IntegratorSettings, vertex: u32) -> Self {
        let RisSettings { points, target, strata, .. } = settings.ris;
        let sample_counts = settings.sample_counts_at(vertex);
        Ris { sample_counts, heuristic: settings.heuristic(), points, target, strata }
    }

    /// True if the estimated visibility is a control variate.
    pub fn has_control(&self) -> bool {
        self.target == Target::VisibilityControl
    }

    /// Allocation and weights of the proposals of a point.
    fn techniques(&self, point: &ShadingPoint<'_>) -> ProposalTechniques {
        let SampleAllocation { n_light, n_bsdf, .. } = allocation(point);
        ProposalTechniques { n_light, n_bsdf, heuristic: self.heuristic, target: self.target }
    }

    /// T1 and select, alternately: makes the proposals of a chunk of points and draws samples from them. Only the
    /// samples become candidates, with their contributions.
    pub(super) fn propose_and_draw(&self, t1: &mut T1<'_>, b: &mut RisBuffers) {
        // BSDF samples of all points. Light samples are only counted here, and made in chunks
        t1.propose(allocation, |_, _, _, allocation, _| allocation.light_draws);
        let T1 { job, points, candidates, .. } = t1;
        let bsdf_samples = std::mem::replace(&mut candidates.records, std::mem::take(&mut b.bsdf_samples));
        candidates.records.clear();
        b.controls.clear();

        let mut rest = Chunk { first: 0, points, bsdf: &bsdf_samples };
        while !rest.points.is_empty() {
            let start = Instant::now();
            let chunk = self.propose_chunk(job, &mut rest, b);
            if self.target.has_visibility() {
                candidates.stats.segments += b.probe(job, &chunk);
            }
            let proposed = Instant::now();
            self.draw_chunk(&chunk, b, candidates);
            candidates.stats.t1_light += proposed - start;
            candidates.stats.select += proposed.elapsed();
        }
        b.bsdf_samples = bsdf_samples;
    }

    /// T1: takes a chunk from the remaining points, and makes its proposals.
    fn propose_chunk<'a>(&self, job: &RenderJob, rest: &mut Chunk<'a>, b: &mut RisBuffers) -> Chunk<'a> {
        b.proposals.clear();
        b.numbers.clear();
        let Chunk { first, points, bsdf } = *rest;

        // Add points until the chunk is full; `bsdf` is sorted by point
        let (mut count, mut next) = (0, 0);
        while count < points.len() && (b.proposals.count() < CHUNK || count == 0) {
            let point = &points[count];
            let begin = next;
            while next < bsdf.len() && bsdf[next].point == (first + count) as u32 {
                next += 1;
            }
            let numbers = point.stream.domain(domain::RESAMPLE).draw::<2>();
            b.numbers.push(numbers);
            let draws = allocation(point).light_draws;
            let light = LightProposals { draws, points: self.points, phi: numbers[0] };
            b.proposals.add(job, point, &self.techniques(point), light, &bsdf[begin..next]);
            count += 1;
        }

        // Weights of the light samples
        b.proposals.evaluate(job, &points[..count], |point| self.techniques(point));
        *rest = Chunk { first: first + count, points: &points[count..], bsdf: &bsdf[next..] };
        Chunk { first, points: &points[..count], bsdf: &bsdf[..next] }
    }

    /// Select: draws the samples of the points of a chunk.
    fn draw_chunk(&self, chunk: &Chunk<'_>, b: &mut RisBuffers, candidates: &mut Candidates) {
        let mut bsdf = chunk.bsdf;
        for (i, point) in chunk.points.iter().enumerate() {
            let range = b.proposals.points()[i];

            // Draw from the proposals
            self.draw(point, range, b.numbers[i][1], b);
            let (own, rest) = bsdf.split_at(range.end - range.bsdf_start);
            bsdf = rest;

            // Evaluate the samples. With a control variate, `control` gets the part without visibility
            let mut control = self.has_control().then(|| b.proposals.control(range, own));
            for draw in &b.draws {
                let place = range.start + draw.index as usize;
                let evaluated = if place < range.bsdf_start {
                    b.proposals.candidate(place, (chunk.first + i) as u32, point, self.target)
                } else {
                    Some(own[place - range.bsdf_start])
                };
                if let Some(candidate) = evaluated {
                    let contribution = candidate.f * (b.proposals.r[place] * draw.scale);
                    if let Some(control) = control.as_mut().filter(|_| contribution.is_finite()) {
                        control.draw(contribution, b.proposals.visibility[place]);
                    }
                    candidates.contributions.push(contribution);
                    candidates.records.push(candidate);
                }
            }
            b.controls.extend(control.map(|control| control.sum()));
        }
    }

    /// Draws N proposals of a point.
    fn draw(&self, point: &ShadingPoint<'_>, range: PointProposals, u: f32, b: &mut RisBuffers) {
        let weights = &b.proposals.weight[range.start..range.end];

        // The number u is used directly for systematic sampling; other methods derive independent numbers from it
        let n = point.sample_counts.samples as usize;
        match self.strata {
            Strata::Systematic => systematic(weights, n as u32, u, &mut b.draws),
            Strata::None => {
                independent_numbers(u, n, &mut b.u);
                with_replacement(weights, &b.u, &mut b.draws);
            }
            Strata::Proposals => {
                strata::equal_proposals(weights.len(), n, &mut b.ends);
                independent_numbers(u, b.ends.len(), &mut b.u);
                stratified(weights, &b.ends, &b.u, &mut b.draws);
            }
            Strata::Weights => {
                let [bounds] = point.stream.domain(domain::STRATA).draw::<1>();
                independent_numbers(bounds, n, &mut b.u);
                strata::equal_weights(weights, n, &b.u, &mut b.ends);
                independent_numbers(u, b.ends.len(), &mut b.u);
                stratified(weights, &b.ends, &b.u, &mut b.draws);
            }
        }
    }
}

/// Allocation of the M proposals of a point to light and BSDF sampling. If the BSDF has specular lobes only, N BSDF
/// samples.
///
/// A BSDF sample costs as much as ten light samples, which are made many at a time. A wide BSDF, which says little
/// about the direction of the light, gets one proposal in sixteen; a BSDF with a peak gets two in sixteen. If there are
/// few proposals per sample, there is at least one BSDF sample per two samples, or per four samples if the BSDF is
/// wide.
fn allocation(point: &ShadingPoint<'_>) -> SampleAllocation {
    let (m, n) = (point.sample_counts.proposals, point.sample_counts.samples);
    let bsdf = &point.bsdf.bsdf;
    if !bsdf.has_non_specular() {
        return SampleAllocation::fixed(0, n);
    }
    let is_wide = bsdf.is_wide() || matches!(bsdf, Bsdf::Phase(phase) if phase.g().abs() < WIDE);
    let [of_proposals, of_samples] = if is_wide { [0.0625, 0.25] } else { [0.125, 0.5] };
    let by_bsdf = (m as f32 * of_proposals).max(n as f32 * of_samples);
    // A power of two, for the best distribution of a Sobol' sequence
    let by_bsdf = 1 << (by_bsdf.log2().round().max(0.0) as u32);
    let by_bsdf = if by_bsdf < m { by_bsdf } else { 1 };
    if m == 1 { SampleAllocation::one_of_both(&point.stream) } else { SampleAllocation::fixed(m - by_bsdf, by_bsdf) }
}

/// Consecutive points of a batch.
#[derive(Clone, Copy, Debug)]
struct Chunk<'a> {
    /// Index of the first point.
    first: usize,
    points: &'a [ShadingPoint<'a>],
    /// BSDF samples of these points, in their order.
    bsdf: &'a [Candidate],
}

/// Buffers kept from batch to batch.
#[derive(Debug, Default)]
pub(super) struct RisBuffers {
    bsdf_samples: Vec<Candidate>,
    proposals: ProposalColumns,
    draws: Vec<Draw>,
    ends: Vec<u32>,
    u: Vec<f32>,
    probes: Segments,
    /// Per point: the part of the estimate without visibility, if V̂ is a control variate.
    pub(super) controls: Vec<Rgb>,
    /// Per point of the chunk: random numbers for the positions of proposals and for the draws, well distributed over
    /// the samples of a pixel.
    numbers: Vec<[f32; 2]>,
}

impl RisBuffers {
    /// Traces all proposals, and sets the weights of occluded ones to 0. Returns the number of segments.
    fn probe(&mut self, job: &RenderJob, chunk: &Chunk<'_>) -> u64 {
        self.probes.clear();

        // Segments of the proposals with a weight
        let mut bsdf = chunk.bsdf.iter();
        let mut probed = Vec::new();
        for (i, point) in chunk.points.iter().enumerate() {
            let range = self.proposals.points()[i];
            for place in range.start..range.end {
                let by_bsdf = if place >= range.bsdf_start { bsdf.next() } else { None };
                if !(self.proposals.weight[place] > 0.0) {
                    continue;
                }
                let segment = match by_bsdf {
                    Some(candidate) => Some((candidate.light, candidate.segment)),
                    None => self.proposals.light_sample(place).map(|s| (s.light, point.light_segment(&s.sample))),
                };
                match segment {
                    Some((light, segment)) => {
                        self.probes.push(&segment, i as u32, light, Rgb::BLACK);
                        probed.push(place);
                    }
                    None => self.proposals.weight[place] = 0.0,
                }
            }
        }

        // Occluded proposals have no weight
        self.probes.trace(job, chunk.points);
        for (&place, &occluded) in probed.iter().zip(self.probes.occluded()) {
            if occluded {
                self.proposals.weight[place] = 0.0;
            }
        }
        probed.len() as u64
    }
}

/// `count` independent numbers; the first one is `u`.
fn independent_numbers(u: f32, count: usize, out: &mut Vec<f32>) {
    out.clear();
    let other = |i: usize| unit_f32(pcg4d([u.to_bits(), i as u32, 0x9e37_79b9, 1])[0]);
    out.extend((0..count).map(|i| if i == 0 { u } else { other(i) }));
}
