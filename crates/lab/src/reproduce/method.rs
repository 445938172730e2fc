//! The compared methods: estimators of direct light with their settings.

use lumiris::lights::LightSamplerKind;
use lumiris::settings::{
    Cached, EstimatorKind, IntegratorKind, IntegratorSettings, OcvForm, OptimalForm, ProposalPoints, Proposals,
    Settings, Strata, Target,
};
use lumiris_numbers::estimators::heuristics::Heuristic;
use lumiris_numbers::samplers::SamplerKind;

/// Light transport.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Transport {
    /// Direct light only.
    Direct,
    /// Paths with the depth of the scene file.
    Path,
    /// The same, with the light reflected by diffuse surfaces interpolated between records.
    Cached,
}

/// Distribution of the random numbers of a pixel.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Points {
    /// Independent.
    Independent,
    /// Samples of an estimate, or proposals of `ris`, are well distributed over the lights; camera rays are
    /// independent.
    PerEstimate,
    /// Well distributed over the camera rays of the pixel, too.
    PerPixel,
}

impl Points {
    /// Name in the file of numbers.
    pub fn name(self) -> &'static str {
        match self {
            Points::Independent => "independent",
            Points::PerEstimate => "stratified in each estimate",
            Points::PerPixel => "stratified over all rays",
        }
    }
}

/// A method: an estimator of direct light with its settings.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Method {
    /// Light transport.
    pub transport: Transport,
    /// Estimator of direct light.
    pub estimator: EstimatorKind,
    /// Light sampler.
    pub light_sampler: LightSamplerKind,
    /// Weights of the techniques; `None` for the estimator's default.
    pub heuristic: Option<Heuristic>,
    /// Source of the coefficients of `ocv`.
    pub form: OcvForm,
    /// Source of the weights of `optimal-mis`.
    pub optimal: OptimalForm,
    /// N.
    pub samples: u32,
    /// M, for `ris`.
    pub proposals: u32,
    /// Target density of `ris`.
    pub target: Target,
    /// Samples of `contributing` on the non-contributing lights.
    pub noncontributing_samples: u32,
    /// Samples over proposals, for `ris`.
    pub strata: Strata,
    /// True if `ris` uses M and N of each pixel from [`Stage::plan_per_pixel`](super::measure::Stage::plan_per_pixel).
    pub per_pixel: bool,
    /// Distribution of random numbers.
    pub points: Points,
}

impl Method {
    /// Light sampling with independent random numbers.
    pub fn mc(samples: u32) -> Self {
        let estimator = EstimatorKind::Mc;
        Method {
            transport: Transport::Direct,
            estimator,
            light_sampler: LightSamplerKind::Tree,
            heuristic: None,
            form: OcvForm::Progressive,
            optimal: OptimalForm::Progressive,
            samples,
            proposals: samples,
            target: Target::Fgl,
            noncontributing_samples: 1,
            strata: Strata::None,
            per_pixel: false,
            points: Points::Independent,
        }
    }

    /// Light and BSDF sampling with independent random numbers.
    pub fn mis(samples: u32) -> Self {
        Method { estimator: EstimatorKind::Mis, ..Method::mc(samples) }
    }

    /// Optimizing control variates with independent random numbers.
    pub fn ocv(form: OcvForm, samples: u32) -> Self {
        Method { estimator: EstimatorKind::Ocv, form, ..Method::mc(samples) }
    }

    /// Optimal weights of the techniques with independent random numbers.
    pub fn optimal_mis(optimal: OptimalForm, samples: u32) -> Self {
        Method { estimator: EstimatorKind::OptimalMis, optimal, ..Method::mc(samples) }
    }

    /// Combined correlated and importance sampling by the BSDF with independent random numbers.
    pub fn correlated(samples: u32) -> Self {
        Method { estimator: EstimatorKind::Correlated, ..Method::mc(samples) }
    }

    /// Separate sampling of the lights with photons and of the others, with independent random numbers.
    pub fn contributing(samples: u32, noncontributing_samples: u32) -> Self {
        Method { estimator: EstimatorKind::Contributing, noncontributing_samples, ..Method::mc(samples) }
    }

    /// Resampled importance sampling with independent random numbers and draws.
    pub fn ris(proposals: u32, samples: u32) -> Self {
        Method { estimator: EstimatorKind::Ris, proposals: proposals.max(samples), ..Method::mc(samples) }
    }

    /// The same with points that are well distributed over all camera rays of a pixel.
    pub fn stratified(self) -> Self {
        Method { points: Points::PerPixel, ..self }
    }

    /// The same with another light sampler.
    pub fn lights_by(self, light_sampler: LightSamplerKind) -> Self {
        Method { light_sampler, ..self }
    }

    /// The same with other weights of the techniques.
    pub fn weighted(self, heuristic: Heuristic) -> Self {
        Method { heuristic: Some(heuristic), ..self }
    }

    /// The same with strata of samples.
    pub fn strata(self, strata: Strata) -> Self {
        Method { strata, ..self }
    }

    /// The same with another light transport.
    pub fn of(self, transport: Transport) -> Self {
        Method { transport, ..self }
    }

    /// Applies the method to the settings; `depth` is the number of bounces in the scene file.
    pub(super) fn apply(&self, settings: &mut Settings, depth: u32) {
        // Integrator and estimator
        let (kind, max_depth) = match self.transport {
            Transport::Direct => (IntegratorKind::Direct, 1),
            Transport::Path => (IntegratorKind::Path, depth),
            Transport::Cached => (IntegratorKind::IrradianceCache, depth),
        };
        let i = &mut settings.integrator;
        *i = IntegratorSettings {
            kind,
            max_depth,
            estimator: self.estimator,
            samples: Some(self.samples),
            heuristic: self.heuristic,
            optimal_mis: self.optimal,
            light_sampler: self.light_sampler,
            ..*i
        };

        // Variants of the estimators
        i.ocv.form = self.form;
        i.cache.cached = Cached::All;
        i.ris.proposals = if self.per_pixel { Proposals::Optimal } else { Proposals::Fixed(self.proposals) };
        i.ris.strata = self.strata;
        i.ris.target = self.target;
        i.contributing.noncontributing_samples = Some(self.noncontributing_samples);

        // Sampler and proposal points
        (settings.sampling.sampler, i.ris.points) = match self.points {
            Points::Independent => (SamplerKind::Independent, ProposalPoints::Independent),
            Points::PerEstimate => (SamplerKind::Stratified, ProposalPoints::Stratified),
            Points::PerPixel => (SamplerKind::Sobol, ProposalPoints::Stratified),
        };
    }
}
