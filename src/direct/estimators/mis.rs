//! `mis`: light and BSDF samples, combined by multiple importance sampling [Veach and Guibas 1995].
//!
//! The weight is [`Heuristic::weight_of_expected`], in `heuristics.rs` of `crates/numbers`, applied in three places:
//!
//! * stages: [`Candidate::factor`](crate::direct::candidates::Candidate::factor), and [`lumiris_lanes::ris_weights`]
//!   for the proposals of `ris`;
//! * columns: `weigh` in `direct/columns/column_direct_lighting.rs`, with the kernel `weigh` of
//!   [`lumiris_lanes::vertex`];
//! * an emitter hit by the next segment of the path, which is the BSDF sample: `LastVertices::weight` in
//!   `integrators/path_state.rs`.

use crate::bsdfs::Bsdf;
use crate::direct::candidates::{Candidates, SampleAllocation};
use crate::direct::light_samples;
use crate::direct::point::ShadingPoint;
use crate::direct::t1::T1;
use crate::settings::{IntegratorSettings, bsdf_samples};
use lumiris_numbers::estimators::heuristics::Heuristic;
use lumiris_numbers::samplers::SampleStream;

/// Light and BSDF sampling.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Mis {
    /// Samples of both techniques (N).
    pub samples: u32,
    /// Weights of the techniques.
    pub heuristic: Heuristic,
    /// Fraction of the samples that are BSDF samples.
    pub bsdf_fraction: f32,
}

impl Mis {
    /// The estimator at a path vertex, counted from 0.
    pub(super) fn at_vertex(settings: &IntegratorSettings, vertex: u32) -> Self {
        let samples = settings.sample_counts_at(vertex).samples;
        let bsdf_fraction = settings.bsdf_fraction();
        Mis { samples, heuristic: settings.heuristic(), bsdf_fraction }
    }

    /// Number of BSDF samples among `n` ≥ 2 samples.
    pub fn bsdf_samples(&self, n: u32) -> u32 {
        bsdf_samples(n, self.bsdf_fraction)
    }

    /// True if an estimate of `n` samples has exactly one BSDF sample, which can be the next path segment.
    pub fn has_one_bsdf_sample(&self, n: u32) -> bool {
        n >= 2 && self.bsdf_samples(n) == 1
    }

    /// Allocates `n` samples to the techniques at a point with this BSDF. `stream` has the random numbers of direct
    /// light.
    pub(in crate::direct) fn allocation(&self, n: u32, bsdf: &Bsdf<'_>, stream: &SampleStream) -> SampleAllocation {
        if n == 0 {
            return SampleAllocation::fixed(0, 0);
        }
        if !bsdf.has_non_specular() {
            return SampleAllocation::fixed(0, n);
        }
        if n == 1 {
            return SampleAllocation::one_of_both(stream);
        }
        let by_bsdf = self.bsdf_samples(n);
        SampleAllocation::fixed(n - by_bsdf, by_bsdf)
    }

    /// The same for a shading point.
    pub(super) fn allocation_at(&self, point: &ShadingPoint<'_>) -> SampleAllocation {
        self.allocation(point.sample_counts.samples, &point.bsdf.bsdf, &point.stream)
    }

    pub(super) fn propose(&self, t1: &mut T1<'_>) {
        t1.propose(|point| self.allocation_at(point), light_samples::draw);
    }

    pub(super) fn select(&self, candidates: &mut Candidates) {
        candidates.weigh(|c| c.factor(self.heuristic));
    }
}
