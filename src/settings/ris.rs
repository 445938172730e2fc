//! Settings of `ris`: proposals, strata and targets.

use lumiris_numbers::estimators::ris::choice::Costs;
use strum::{EnumString, IntoStaticStr, VariantNames};

/// Proposals per sample if no times were measured.
pub const DEFAULT_RATIO: f64 = 8.0;
/// Maximum number of proposals per sample by times alone: T1 and T2 exclude the fixed cost of a shading point, and more
/// than eight did not pay off on any scene measured (`docs/measurements/resampling`).
pub const MAX_RATIO: f64 = 8.0;

/// Resampled importance sampling [Talbot et al. 2005; Talbot 2005].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RisSettings {
    /// How many proposals (M).
    pub proposals: Proposals,
    /// Resampling of the proposals.
    pub strata: Strata,
    /// Distribution of the proposals over the lights.
    pub points: ProposalPoints,
    /// The target density.
    pub target: Target,
    /// Times of the stages, for `auto` and `optimal`; measured on this scene if `None`.
    pub stage_times: Option<StageTimes>,
}

impl Default for RisSettings {
    fn default() -> Self {
        RisSettings {
            proposals: Proposals::Auto,
            strata: Strata::Systematic,
            points: ProposalPoints::Stratified,
            target: Target::Fgl,
            stage_times: None,
        }
    }
}

impl RisSettings {
    /// Proposals for a number of samples.
    pub fn proposals_for(&self, samples: u32) -> u32 {
        match self.proposals {
            Proposals::Fixed(m) => m,
            Proposals::Auto | Proposals::Optimal => (f64::from(samples) * self.ratio()).round() as u32,
        }
    }

    /// Proposals for each sample by the times of the stages, M/N = T2/T1 [Talbot 2005, Eq. 4.4], from 1 to
    /// [`MAX_RATIO`]; [`DEFAULT_RATIO`] without times.
    pub fn ratio(&self) -> f64 {
        let by_times = |t: StageTimes| Costs { t1: t.t1, t2: t.t2 }.robust_ratio();
        self.stage_times.map_or(DEFAULT_RATIO, by_times).clamp(1.0, MAX_RATIO)
    }
}

/// Measured cost of the stages of an estimate.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StageTimes {
    /// T1: one proposal with its weight (ns).
    pub t1: f64,
    /// T2: the visibility of one sample (ns).
    pub t2: f64,
}

/// Choice of the number of proposals.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Proposals {
    /// This many.
    Fixed(u32),
    /// By a pilot of the image; M/N = T2/T1 [Talbot 2005, Eq. 4.4] by given times, or if the image is too small.
    Auto,
    /// Per pixel, from variances and times [Talbot 2005, Eq. 4.3].
    Optimal,
}

/// Strata of the samples over the proposals.
#[derive(Clone, Copy, Debug, PartialEq, Eq, EnumString, IntoStaticStr, VariantNames)]
#[strum(serialize_all = "kebab-case")]
pub enum Strata {
    /// Independent draws with replacement [Talbot 2005, Eq. 4.1].
    None,
    /// One draw from each of N strata of equally many proposals [Talbot 2005, §4.5.2.1].
    Proposals,
    /// One draw from each of N strata of nearly equal weight [Talbot 2005, §4.5.2.2].
    Weights,
    /// N draws at equal distances of the cumulative weight (systematic resampling).
    Systematic,
}

/// How the proposals of light sampling lie on the lights.
#[derive(Clone, Copy, Debug, PartialEq, Eq, EnumString, IntoStaticStr, VariantNames)]
#[strum(serialize_all = "kebab-case")]
pub enum ProposalPoints {
    /// Independent of each other.
    Independent,
    /// Stratified along a curve that visits all lights in turn and fills each of them [He and Owen 2016].
    Stratified,
}

/// The target q̂ of resampling.
#[derive(Clone, Copy, Debug, PartialEq, Eq, EnumString, IntoStaticStr, VariantNames)]
#[strum(serialize_all = "kebab-case")]
pub enum Target {
    /// Luminance of f·G·L: everything but visibility.
    Fgl,
    /// As `fgl`; in surrounding pixels, what the draws have of each group of lights tells what is seen of the group, which is a control
    /// variate of the pixel.
    FglControl,
    /// G·V: for surfaces and lights that are more expensive to evaluate than a ray is to trace.
    Gv,
    /// G·V·L: for surfaces that are more expensive to evaluate than a ray is to trace.
    Gvl,
    /// Luminance of f·G·L times an estimate of V for each light, from the visibility cache. Proposals are not traced.
    Visibility,
    /// As `visibility`, with the estimate as a control variate: samples are drawn where it is in doubt.
    VisibilityControl,
}

impl Target {
    /// True if proposals are traced before they are resampled.
    pub fn has_visibility(self) -> bool {
        match self {
            Target::Fgl | Target::FglControl | Target::Visibility | Target::VisibilityControl => false,
            Target::Gv | Target::Gvl => true,
        }
    }

    /// True if the visibility cache takes part.
    pub fn uses_visibility_cache(self) -> bool {
        matches!(self, Target::Visibility | Target::VisibilityControl)
    }
}
