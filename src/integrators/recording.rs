//! Copies of traced rays, for measurements.

use crate::accel::RayBatch;

/// Copies of the rays traced, batch by batch, for measurements.
#[derive(Clone, Debug, Default)]
pub struct Recording {
    /// Camera rays up to their first surface.
    pub camera: Vec<RayBatch>,
    /// All other path segments.
    pub bounces: Vec<RayBatch>,
    /// Shadow segments of first vertices.
    pub segments: Vec<RayBatch>,
    /// Shadow segments of later vertices.
    pub bounce_segments: Vec<RayBatch>,
}

impl Recording {
    /// The shadow segments of a vertex, counted from 0.
    pub(super) fn segments_at(&mut self, vertex: u32) -> &mut Vec<RayBatch> {
        if vertex == 0 { &mut self.segments } else { &mut self.bounce_segments }
    }
}
