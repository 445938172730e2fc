//! Direct light at a batch of shading points, in four stages.
//!
//! ```text
//! points ─T1 propose─▶ candidates ─select─▶ contributions + segments ─T2 trace─▶ bits ─resolve─▶ radiance
//! ```
//!
//! * **T1, propose**: light and BSDF samples with the unshadowed integrand f = f_s·|cos θ|·L and the densities of every
//!   technique. It traces rays against emitters only, and ignores visibility.
//! * **select**: an estimator computes contributions from f and densities, and drops those that are zero.
//! * **T2, trace**: shadow segments in packets.
//! * **resolve**: the sum of the unoccluded contributions, or another combination by the estimator.

use super::estimators::{Estimator, PointBatch};
use super::fits::Fits;
use super::point::ShadingPoint;
use super::shadow_segments::SegmentOutcome;
use super::stats::DirectStats;
use crate::accel::RayBatch;
use crate::scene::RenderJob;
use lumiris_numbers::math::Rgb;
use std::time::Instant;

/// Estimates direct light; holds the buffers of one worker.
#[derive(Debug, Default)]
pub struct PointDirectLighting {
    batch: PointBatch,
    /// Counts and times so far.
    pub stats: DirectStats,
}

impl PointDirectLighting {
    /// The shadow segments of the last batch of points, in the order of tracing.
    pub fn segments(&self) -> &RayBatch {
        self.batch.segments.rays()
    }

    /// The samples of the last batch, in the order of [`Self::segments`].
    pub fn outcomes(&self) -> impl Iterator<Item = SegmentOutcome> {
        self.batch.segments.outcomes()
    }

    /// Estimates ∫ f_s L_direct |cos θ| dω for each point; `out[i]` belongs to `points[i]`. Progressive estimators use
    /// the `fits` of the points and add to them.
    pub fn estimate(
        &mut self,
        job: &RenderJob,
        estimator: &Estimator,
        points: &[ShadingPoint<'_>],
        fits: &mut Fits,
        out: &mut Vec<Rgb>,
    ) {
        out.clear();
        out.resize(points.len(), Rgb::BLACK);
        let batch = &mut self.batch;

        // T1: propose candidates. `ris` also selects: it draws from the proposals, chunk by chunk
        let start = Instant::now();
        estimator.propose(job, points, batch);
        let proposed = Instant::now();
        let drawing = batch.candidates.stats.select;

        // Select: contributions of the estimator, and their shadow segments
        estimator.select(&mut batch.candidates);
        batch.segments.gather(&batch.candidates);
        let selected = Instant::now();

        // T2: trace
        if estimator.selects_visible() {
            batch.segments.set_free();
        } else {
            let [segments, collisions] = batch.segments.trace(job, points);
            batch.candidates.stats.segments += segments;
            batch.candidates.stats.collisions += collisions;
        }
        let traced = Instant::now();

        // Resolve
        estimator.resolve(job, points, batch, fits, out);

        let stats = &mut batch.candidates.stats;
        stats.t1 = (proposed - start).saturating_sub(drawing);
        stats.select = drawing + (selected - proposed) + traced.elapsed();
        stats.t2 = traced - selected;
        self.stats.merge(stats);
    }
}
