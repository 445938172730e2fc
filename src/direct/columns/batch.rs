//! The vertices of a batch, and the samples drawn at them one after the other.

use super::techniques::Techniques;
use crate::direct::candidates::SampleAllocation;
use crate::direct::vertices::Vertices;
use crate::scene::RenderJob;

/// A sample of each vertex.
#[derive(Clone, Copy, Debug)]
pub(super) struct Round {
    /// True for light sampling, false for BSDF sampling.
    pub(super) by_light: bool,
    /// Index among the samples of the technique.
    pub(super) index: u32,
    /// Number of rows to sample: all, or only the first rows with a different allocation.
    pub(super) rows: usize,
    /// True if most rows have this sample.
    pub(super) is_usual: bool,
}

/// Common input of all steps.
#[derive(Clone, Copy)]
pub(super) struct VertexBatch<'a, 'w> {
    pub(super) job: &'a RenderJob,
    pub(super) techniques: &'a Techniques,
    pub(super) vertices: &'a Vertices<'w>,
    /// The allocation of most rows.
    pub(super) usual: SampleAllocation,
}

impl VertexBatch<'_, '_> {
    /// Sample `index` of a technique. The first `unusual` rows may have a different allocation.
    pub(super) fn round(&self, by_light: bool, index: u32, unusual: usize) -> Round {
        let usual = if by_light { self.usual.light_draws } else { self.usual.bsdf_draws };
        let is_usual = index < usual;
        Round { by_light, index, rows: if is_usual { self.vertices.len() } else { unusual }, is_usual }
    }
}
