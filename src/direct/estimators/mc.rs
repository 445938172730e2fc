//! `mc`: light sampling only. Specular lobes, which light samples cannot hit, get one BSDF sample.

use crate::bsdfs::Bsdf;
use crate::direct::candidates::{Candidates, SampleAllocation, SampledBy};
use crate::direct::light_samples;
use crate::direct::point::ShadingPoint;
use crate::direct::t1::T1;

/// Light sampling.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Mc {
    /// Light samples (N).
    pub samples: u32,
}

impl Mc {
    pub(super) fn propose(&self, t1: &mut T1<'_>) {
        t1.propose(allocation_at, light_samples::draw);
    }
}

/// Allocation of `n` samples: light samples, and one BSDF sample if there are specular lobes. If all lobes are
/// specular, only BSDF samples.
pub(in crate::direct) fn allocation(n: u32, bsdf: &Bsdf<'_>) -> SampleAllocation {
    if bsdf.has_non_specular() {
        SampleAllocation::fixed(n, u32::from(bsdf.has_specular()))
    } else {
        SampleAllocation::fixed(0, n)
    }
}

/// The same for a shading point.
pub(super) fn allocation_at(point: &ShadingPoint<'_>) -> SampleAllocation {
    allocation(point.sample_counts.samples, &point.bsdf.bsdf)
}

/// Contributions. BSDF samples count for specular lobes only.
pub(super) fn select(candidates: &mut Candidates) {
    candidates.weigh(|c| match c.sampled_by {
        SampledBy::Bsdf => 0.0,
        SampledBy::Light | SampledBy::DeltaLight | SampledBy::DeltaBsdf => c.own_factor(),
    });
}
