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
//!
//! [`estimators`] has a file for each estimator with its part in every stage. `mc`, `mis` and `ocv --ocv pixels` can
//! also estimate direct light in [`columns`] of [`vertices`]. The other files are shared by all estimators, in reading
//! order:
//!
//! | file | |
//! |---|---|
//! | [`point`], [`domain`] | shading points, and the domains of their random numbers |
//! | [`candidates`], [`stats`] | candidates, their contributions, counts and times |
//! | [`light_samples`], [`bsdf_samples`], [`t1`] | T1 by light sampling and by BSDF sampling |
//! | [`mixture`], [`components`], [`fits`] | component densities, normal equations, coefficients for later estimates |
//! | [`proposal_columns`] | light samples of resampling, in columns |
//! | [`shadow_segments`], [`transmittance`] | T2, in empty space and through media |

mod bsdf_samples;
pub mod candidates;
pub mod columns;
mod components;
pub(crate) mod domain;
pub mod estimators;
pub mod fits;
mod light_samples;
pub mod mixture;
pub mod point;
pub mod proposal_columns;
pub mod shadow_segments;
pub mod stats;
mod t1;
mod transmittance;
pub mod vertices;

use crate::accel::RayBatch;
use crate::lights::LightId;
use crate::scene::RenderJob;
pub use columns::{ColumnStage, Techniques};
use estimators::Batch;
pub use estimators::Estimator;
pub use fits::Fits;
use lumiris_numbers::math::{Rgb, Vec3};
pub use point::{ShadingPoint, lobe_for_lights};
pub use stats::DirectStats;
use std::time::Instant;
pub use vertices::Vertices;

/// Estimates direct light; holds the buffers of one worker.
#[derive(Debug, Default)]
pub struct DirectStage {
    batch: Batch,
    /// Counts and times so far.
    pub stats: DirectStats,
}

impl DirectStage {
    /// The shadow segments of the last batch of points, in the order of tracing.
    pub fn segments(&self) -> &RayBatch {
        self.batch.segments.rays()
    }

    /// The samples of the last batch, in the order of their points: index of the point, unshadowed contribution,
    /// visibility.
    pub fn outcomes(&self) -> impl Iterator<Item = (u32, Rgb, bool)> {
        self.batch.segments.outcomes()
    }

    /// The visible samples of the last batch, for estimators that add contributions up: index of the point, light with
    /// the direction to it, and contribution.
    pub fn visible(&self) -> impl Iterator<Item = (u32, (LightId, Vec3), Rgb)> {
        self.batch.segments.visible()
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
