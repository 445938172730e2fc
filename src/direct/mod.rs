//! Direct lighting of a batch of shading points, in four explicit stages.
//!
//! ```text
//! points ─T1 propose─▶ candidates ─select─▶ contributions + segments ─T2 trace─▶ bits ─resolve─▶ radiance
//! ```
//!
//! * **T1** ([`propose`]): light and BSDF samples with their unshadowed integrand f = f_s·|cos θ|·L and the densities
//!   of every technique. It traces rays against emitters only, and does not know visibility.
//! * **select** ([`select`]): an estimator turns f and densities into contributions, and drops those that are zero.
//! * **T2** ([`shadow_segments`]): shadow segments in packets.
//! * **resolve**: the sum of the contributions whose segments are unoccluded.

pub mod components;
pub mod contributing;
pub mod correlated;
pub(crate) mod domain;
pub mod mixture;
pub mod point;
pub mod proposal_columns;
pub mod propose;
pub mod ris;
pub mod select;
pub mod shadow_segments;
pub mod stats;

use crate::accel::RayBatch;
use crate::scene::RenderJob;
use crate::settings::{EstimatorKind, IntegratorSettings};
use components::Components;
pub use components::Fits;
use correlated::Correlated;
use lumiris_numbers::math::Rgb;
pub use point::ShadingPoint;
use point::halves;
use propose::Candidates;
use ris::Resampler;
use shadow_segments::Segments;
pub use stats::DirectStats;
use std::time::Instant;

/// The buffers of the stage; reused from batch to batch.
#[derive(Debug, Default)]
pub struct DirectStage {
    candidates: Candidates,
    resampler: Resampler,
    components: Components,
    correlated: Correlated,
    contributions: Vec<Rgb>,
    segments: Segments,
    /// Counts and times so far.
    pub stats: DirectStats,
}

impl DirectStage {
    /// The shadow segments of the last batch of points, in the order in which they were traced.
    pub fn segments(&self) -> &RayBatch {
        self.segments.rays()
    }

    /// The samples of the last batch, in the order of their points: point, contribution if visible, visibility.
    pub fn outcomes(&self) -> impl Iterator<Item = (u32, Rgb, bool)> {
        self.segments.outcomes()
    }

    /// Estimates ∫ f_s L_direct |cos θ| dω for each point; `out[i]` belongs to `points[i]`. Estimators that are
    /// progressive use the points' `fits` and add to them.
    pub fn estimate(
        &mut self,
        job: &RenderJob,
        settings: &IntegratorSettings,
        points: &[ShadingPoint<'_>],
        fits: &mut Fits,
        out: &mut Vec<Rgb>,
    ) {
        let count = points.len();
        let halves = settings.has_halves().then(|| halves(points));
        let points = halves.as_deref().unwrap_or(points);

        // T1: propose candidates
        let start = Instant::now();
        if settings.estimator == EstimatorKind::Correlated {
            self.correlated.propose(job, settings, points, &mut self.candidates);
        } else {
            self.candidates.propose(job, settings, points);
        }
        let mut t1 = start.elapsed();
        let mut t1_light = self.candidates.light_time;

        // Select: contributions of the estimator, and the segments that decide them
        let proposed = Instant::now();
        let mut is_visible = false;
        match settings.estimator {
            EstimatorKind::Mc
            | EstimatorKind::Mis
            | EstimatorKind::Ocv
            | EstimatorKind::OptimalMis
            | EstimatorKind::Correlated
            | EstimatorKind::Contributing => {
                select::contributions(settings, &self.candidates, &mut self.contributions);
            }
            EstimatorKind::Ris => {
                self.resampler.run(job, settings, points, &mut self.candidates, &mut self.contributions);
                t1 += self.resampler.t1;
                t1_light += self.resampler.t1;
                is_visible = settings.ris.target.has_visibility();
            }
        }
        self.segments.gather(&self.candidates, &self.contributions);
        let select = proposed.elapsed() - (t1_light - self.candidates.light_time);

        // T2: trace
        let selected = Instant::now();
        if is_visible {
            self.segments.set_free();
        } else {
            self.segments.trace(&*job.world.accel);
            self.stats.segments += self.segments.len() as u64;
        }
        let traced_at = Instant::now();

        // Resolve
        out.clear();
        out.resize(count, Rgb::BLACK);
        if settings.estimator.has_components() {
            let traced = (&mut self.candidates, &self.contributions[..], &self.segments);
            self.components.resolve(job, settings, points, traced, fits, out);
            self.stats.solve += traced_at.elapsed();
            self.stats.systems += self.components.systems;
            self.stats.ill_conditioned += self.components.ill_conditioned;
            self.stats.emitter_rays += self.components.emitter_rays;
        } else if settings.estimator == EstimatorKind::Correlated {
            let form = settings.correlated.form;
            self.correlated.resolve(form, &self.candidates, &self.contributions, &self.segments, out);
        } else {
            self.segments.resolve(out);
        }

        self.stats.proposals += self.candidates.proposals;
        self.stats.light_proposals += self.candidates.light_proposals;
        self.stats.emitter_rays += self.candidates.emitter_rays;
        self.stats.segments += self.resampler.probed;
        self.stats.t1 += t1;
        self.stats.t1_light += t1_light;
        self.stats.select += select + traced_at.elapsed();
        self.stats.t2 += traced_at - selected;
    }
}
