//! The choice of the estimator by the settings, and its dispatch to the files of the estimators.

use super::contributing::{self, Contributing};
use super::correlated::{self, Correlated};
use super::mc::{self, Mc};
use super::mis::Mis;
use super::ocv::{self, Ocv};
use super::optimal_mis::{self, OptimalMis};
use super::ris::{self, Ris};
use crate::direct::candidates::Candidates;
use crate::direct::components::Components;
use crate::direct::fits::Fits;
use crate::direct::point::ShadingPoint;
use crate::direct::shadow_segments::Segments;
use crate::direct::t1::{BsdfBuffers, T1};
use crate::scene::RenderJob;
use crate::settings::{EstimatorKind, IntegratorSettings, OcvForm, OptimalForm, SampleCounts};
use lumiris_numbers::estimators::ocv::NormalEquations;
use lumiris_numbers::math::Rgb;
use std::time::Instant;

/// An estimator of direct light with its settings.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Estimator {
    /// Light sampling, and BSDF sampling of specular lobes.
    Mc(Mc),
    /// Light and BSDF sampling, combined by multiple importance sampling.
    Mis(Mis),
    /// Resampled importance sampling.
    Ris(Ris),
    /// Optimizing control variates.
    Ocv(Ocv),
    /// Optimal weights of multiple importance sampling.
    OptimalMis(OptimalMis),
    /// Correlated sampling combined with importance sampling by one technique.
    Correlated(Correlated),
    /// Separate light sampling of contributing and of all other lights.
    Contributing(Contributing),
}

/// Candidates and segments of a batch, and the buffers of estimators.
#[derive(Debug, Default)]
pub(in crate::direct) struct PointBatch {
    pub(in crate::direct) candidates: Candidates,
    pub(in crate::direct) segments: Segments,
    bsdf: BsdfBuffers,
    ris: ris::RisBuffers,
    components: Components,
    correlated: correlated::CorrelatedBuffers,
    contributing: contributing::ContributingBuffers,
}

impl Estimator {
    /// The estimator at a path vertex, counted from 0.
    pub fn at_vertex(settings: &IntegratorSettings, vertex: u32) -> Self {
        if vertex == 0 { Self::new(settings, 0) } else { Self::new(&Self::without_fits(settings, 1), vertex) }
    }

    /// The settings with an estimator without fits, for later vertices and pilots. Progressive estimators are fitted to
    /// the first vertices of a pixel, which are close together. Later vertices lie anywhere, so `mis` is used there,
    /// with the sample count of the path vertex `vertex`.
    #[must_use]
    pub fn without_fits(settings: &IntegratorSettings, vertex: u32) -> IntegratorSettings {
        let estimator = Self::new(settings, 0);
        if !estimator.is_progressive() && !estimator.is_over_pixels() {
            return *settings;
        }
        let samples = Some(settings.sample_counts_at(vertex).samples);
        IntegratorSettings { estimator: EstimatorKind::Mis, samples, ..*settings }
    }

    fn new(settings: &IntegratorSettings, vertex: u32) -> Self {
        let samples = settings.sample_counts_at(vertex).samples;
        match settings.estimator {
            EstimatorKind::Mc => Estimator::Mc(Mc { samples }),
            EstimatorKind::Auto | EstimatorKind::Mis => Estimator::Mis(Mis::at_vertex(settings, vertex)),
            EstimatorKind::Ris => Estimator::Ris(Ris::at_vertex(settings, vertex)),
            EstimatorKind::Ocv => {
                Estimator::Ocv(Ocv { mis: Mis::at_vertex(settings, vertex), form: settings.ocv.form })
            }
            EstimatorKind::OptimalMis => {
                Estimator::OptimalMis(OptimalMis { mis: Mis::at_vertex(settings, vertex), form: settings.optimal_mis })
            }
            EstimatorKind::Correlated => {
                Estimator::Correlated(Correlated { samples, technique: settings.correlated_technique })
            }
            EstimatorKind::Contributing => {
                let noncontributing_samples = settings.contributing.noncontributing_samples();
                // Without samples of non-contributing lights, BSDF samples would hit lights that are left out
                let bsdf_samples = if noncontributing_samples > 0 { settings.contributing.bsdf_samples() } else { 0 };
                let heuristic = settings.heuristic();
                Estimator::Contributing(Contributing { samples, noncontributing_samples, bsdf_samples, heuristic })
            }
        }
    }

    /// Sample and proposal counts of an estimate, unless chosen per pixel.
    pub fn sample_counts(&self) -> SampleCounts {
        match self {
            Estimator::Ris(ris) => ris.sample_counts,
            Estimator::Mc(Mc { samples })
            | Estimator::Mis(Mis { samples, .. })
            | Estimator::Ocv(Ocv { mis: Mis { samples, .. }, .. })
            | Estimator::OptimalMis(OptimalMis { mis: Mis { samples, .. }, .. })
            | Estimator::Correlated(Correlated { samples, .. })
            | Estimator::Contributing(Contributing { samples, .. }) => {
                SampleCounts { samples: *samples, proposals: *samples }
            }
        }
    }

    /// True if an estimate uses coefficients fitted to earlier samples of its pixel.
    pub fn is_progressive(&self) -> bool {
        match self {
            Estimator::Ocv(ocv) => ocv.form == OcvForm::Progressive,
            Estimator::OptimalMis(optimal) => optimal.form == OptimalForm::Progressive,
            _ => false,
        }
    }

    /// True if the estimates of a pixel are corrected by coefficients fitted to other pixels.
    pub fn is_over_pixels(&self) -> bool {
        match self {
            Estimator::Ocv(ocv) => ocv.form == OcvForm::Pixels,
            _ => false,
        }
    }

    /// True if all selected candidates are visible, so that segments need not be traced.
    pub(in crate::direct) fn selects_visible(&self) -> bool {
        matches!(self, Estimator::Ris(ris) if ris.target.has_visibility())
    }

    /// `count` fits without samples; none if estimates do not use fits.
    pub fn fits(&self, job: &RenderJob, count: usize) -> Fits {
        let solver = match self {
            _ if self.is_over_pixels() => return Fits::of_pixels(job.controls(), count),
            Estimator::Ocv(_) if self.is_progressive() => ocv::solve,
            Estimator::OptimalMis(_) if self.is_progressive() => optimal_mis::solve,
            _ => return Fits::default(),
        };
        Fits::new(NormalEquations::new(job.components()), solver, count)
    }

    /// T1: candidates with their unshadowed integrands and the densities of all techniques.
    pub(in crate::direct) fn propose(&self, job: &RenderJob, points: &[ShadingPoint<'_>], batch: &mut PointBatch) {
        let PointBatch { candidates, bsdf, .. } = batch;
        candidates.clear();
        let t1 = &mut T1 { job, points, bsdf, candidates };
        match self {
            Estimator::Mc(mc) => mc.propose(t1),
            // Control variates over pixels are computed in columns; elsewhere there are none, which leaves `mis`
            Estimator::Mis(mis) | Estimator::Ocv(Ocv { mis, form: OcvForm::Pixels }) => mis.propose(t1),
            Estimator::Ris(ris) => ris.propose_and_draw(t1, &mut batch.ris),
            Estimator::Ocv(Ocv { mis, .. }) | Estimator::OptimalMis(OptimalMis { mis, .. }) => {
                batch.components.propose(t1, |point| mis.allocation_at(point));
            }
            Estimator::Correlated(c) => c.propose(t1, &mut batch.correlated),
            Estimator::Contributing(c) => c.propose(t1, &mut batch.contributing),
        }
    }

    /// Select: the unshadowed contribution of each candidate.
    pub(in crate::direct) fn select(&self, candidates: &mut Candidates) {
        match self {
            Estimator::Mc(_) => mc::select(candidates),
            Estimator::Contributing(contributing) => contributing.select(candidates),
            Estimator::Mis(mis) | Estimator::Ocv(Ocv { mis, .. }) | Estimator::OptimalMis(OptimalMis { mis, .. }) => {
                mis.select(candidates)
            }
            Estimator::Correlated(_) => Correlated::select(candidates),
            // Already drawn from each chunk of proposals
            Estimator::Ris(_) => {}
        }
    }

    /// Resolve: the estimates from the traced candidates. `out` has a zero for each point.
    pub(in crate::direct) fn resolve(
        &self,
        job: &RenderJob,
        points: &[ShadingPoint<'_>],
        batch: &mut PointBatch,
        fits: &mut Fits,
        out: &mut [Rgb],
    ) {
        let PointBatch { candidates, segments, components, correlated, ris, .. } = batch;
        let start = Instant::now();

        // The time of normal equations counts as `solve`
        match self {
            Estimator::Mc(_)
            | Estimator::Mis(_)
            | Estimator::Ocv(Ocv { form: OcvForm::Pixels, .. })
            | Estimator::Contributing(_) => segments.resolve(out),
            Estimator::Ris(_) => {
                segments.resolve(out);
                out.iter_mut().zip(&ris.controls).for_each(|(out, &control)| *out += control);
            }
            Estimator::Ocv(ocv) => {
                components.sum(job, candidates, segments);
                ocv.resolve(points, components, &mut candidates.stats, fits, out);
                candidates.stats.solve += start.elapsed();
            }
            Estimator::OptimalMis(optimal) => {
                components.sum(job, candidates, segments);
                optimal.resolve(points, components, &mut candidates.stats, fits, out);
                candidates.stats.solve += start.elapsed();
            }
            Estimator::Correlated(_) => Correlated::resolve(candidates, segments, correlated, out),
        }
    }
}
