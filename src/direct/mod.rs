//! Direct lighting of a batch of shading points, in four explicit stages.
//!
//! ```text
//! points ─T1 propose─▶ candidates ─select─▶ contributions + segments ─T2 trace─▶ bits ─resolve─▶ radiance
//! ```
//!
//! * **T1** ([`propose`]): light and BSDF samples with their unshadowed integrand f = f_s·|cos θ|·L and the densities
//!   of every technique. It traces rays against emitters only, and does not know visibility.
//! * **select** ([`select`]): an estimator turns f and densities into contributions, and drops those that are zero.
//! * **T2** ([`visibility`]): shadow segments in packets.
//! * **resolve**: the sum of the contributions whose segments are unoccluded.

pub mod components;
pub mod contributing;
pub mod correlated;
pub mod mixture;
pub mod proposals;
pub mod propose;
pub mod ris;
pub mod select;
pub mod visibility;

use crate::accel::RayBatch;
use crate::lights::LightCtx;
use crate::materials::SurfaceBsdf;
use crate::scene::RenderJob;
use crate::settings::{EstimatorKind, IntegratorSettings, SampleCounts};
pub use components::Fits;
use components::{Components, halves};
use correlated::Correlated;
use lumiris_numbers::math::ray::offset_origin;
use lumiris_numbers::math::{Rgb, Vec3};
use lumiris_numbers::samplers::SampleStream;
use propose::Candidates;
use ris::Resampler;
use std::time::{Duration, Instant};
use visibility::Segments;

/// A point at which direct light is estimated.
#[derive(Clone, Copy, Debug)]
pub struct ShadingPoint<'a> {
    /// The point.
    pub p: Vec3,
    /// Bound of the rounding error of `p`.
    pub p_error: Vec3,
    /// Direction to the viewer, unit.
    pub wo: Vec3,
    /// Scattering at the point, with the frame and the geometric normal.
    pub bsdf: SurfaceBsdf<'a>,
    /// Time in 0..1.
    pub time: f32,
    /// Random numbers of this point; each technique uses its own domain.
    pub stream: SampleStream,
    /// Sample and proposal counts.
    pub sample_counts: SampleCounts,
    /// Index of the point's fit, if there are fits.
    pub fit: u32,
    /// The path goes on in the direction of the only BSDF sample, and its next segment finds the emitter: the sample
    /// counts in the weights of the others, and is not drawn here.
    pub bsdf_by_path: bool,
}

impl ShadingPoint<'_> {
    /// Number of light samples beside a BSDF sample that the path takes: all others, but none where every lobe is
    /// specular.
    pub fn light_samples_beside_path(&self) -> u32 {
        if self.bsdf.bsdf.has_non_specular() { self.sample_counts.samples.saturating_sub(1) } else { 0 }
    }

    /// The origin of a ray that leaves the point towards `w`.
    #[inline]
    pub fn origin(&self, w: Vec3) -> Vec3 {
        offset_origin(self.p, self.p_error, self.bsdf.n, w)
    }

    /// The context for sampling lights.
    #[inline]
    pub fn light_ctx(&self) -> LightCtx {
        LightCtx { p: self.p, n: self.bsdf.lit_normal(self.wo), ns: self.bsdf.frame.z }
    }
}

/// Counts and times of the stages.
#[derive(Clone, Copy, Debug, Default)]
pub struct DirectStats {
    /// Candidates drawn by T1.
    pub proposals: u64,
    /// Those of them that are light samples.
    pub light_proposals: u64,
    /// Rays traced against emitters.
    pub emitter_rays: u64,
    /// Shadow segments traced by T2.
    pub segments: u64,
    /// Time in T1.
    pub t1: Duration,
    /// Its part for light samples.
    pub t1_light: Duration,
    /// Time in select and resolve.
    pub select: Duration,
    /// Time in T2.
    pub t2: Duration,
    /// Time for normal equations and their solutions, which is part of `select`.
    pub solve: Duration,
    /// Systems solved or found to have no solution.
    pub systems: u64,
    /// Those without a solution, for which the MIS estimate is used, and those with linearly dependent columns, some of
    /// which were dropped.
    pub ill_conditioned: u64,
}

impl DirectStats {
    /// Adds the counts of another worker.
    pub fn merge(&mut self, other: &DirectStats) {
        self.proposals += other.proposals;
        self.light_proposals += other.light_proposals;
        self.emitter_rays += other.emitter_rays;
        self.segments += other.segments;
        self.t1 += other.t1;
        self.t1_light += other.t1_light;
        self.select += other.select;
        self.t2 += other.t2;
        self.solve += other.solve;
        self.systems += other.systems;
        self.ill_conditioned += other.ill_conditioned;
    }
}

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
