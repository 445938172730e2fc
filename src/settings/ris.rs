//! What is particular to `ris`: proposals, strata and targets.

use lumiris_numbers::estimators::ris::choice::Costs;
use strum::{EnumString, IntoStaticStr, VariantNames};

/// Proposals for each sample where no times were measured.
pub const DEFAULT_RATIO: f64 = 8.0;
/// Most proposals for each sample that times alone ask for: T1 and T2 leave out what a shading point costs in any case, and on no
/// scene measured did more than eight pay, of which `docs/measurements/resampling` has the figures.
pub const MOST_RATIO: f64 = 8.0;

/// Resampled importance sampling [Talbot et al. 2005; Talbot 2005].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RisSettings {
    /// How many proposals (M).
    pub proposals: Proposals,
    /// How samples are drawn from the proposals.
    pub strata: Strata,
    /// How proposals lie on the lights.
    pub points: ProposalPoints,
    /// What samples are drawn in proportion to.
    pub target: Target,
    /// Times of the stages, from which `auto` and `optimal` choose; measured on this scene if not given.
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
    /// Proposals for each sample by the times of the stages, M/N = T2/T1 [Talbot 2005, Eq. 4.4], from 1 to [`MOST_RATIO`];
    /// [`DEFAULT_RATIO`] without times.
    pub fn ratio(&self) -> f64 {
        let by_times = |t: StageTimes| Costs { t1: t.t1, t2: t.t2 }.robust_ratio();
        self.stage_times.map_or(DEFAULT_RATIO, by_times).clamp(1.0, MOST_RATIO)
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

/// How the number of proposals is found.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Proposals {
    /// This many.
    Fixed(u32),
    /// M/N = T2/T1 [Talbot 2005, Eq. 4.4].
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
    /// One draw from each of N equal numbers of proposals [Talbot 2005, §4.5.2.1].
    Proposals,
    /// One draw from each of N parts of nearly equal weight [Talbot 2005, §4.5.2.2].
    Weights,
    /// N draws at equal distances of the cumulative weight.
    Systematic,
}

/// How the proposals of light sampling lie on the lights.
#[derive(Clone, Copy, Debug, PartialEq, Eq, EnumString, IntoStaticStr, VariantNames)]
#[strum(serialize_all = "kebab-case")]
pub enum ProposalPoints {
    /// Independent of each other.
    Independent,
    /// Stratified along a curve that passes all lights one after the other and fills each [He and Owen 2016].
    Stratified,
}

/// The target q̂ of resampling.
#[derive(Clone, Copy, Debug, PartialEq, Eq, EnumString, IntoStaticStr, VariantNames)]
#[strum(serialize_all = "kebab-case")]
pub enum Target {
    /// Luminance of f·G·L: everything but visibility.
    Fgl,
    /// G·V: for surfaces and lights that are dearer to evaluate than a ray is to trace.
    Gv,
    /// G·V·L: for surfaces that are dearer to evaluate than a ray is to trace.
    Gvl,
    /// Luminance of f·G·L times an estimate of V for each light, from photons. Nothing is traced.
    Visibility,
}

impl Target {
    /// True if proposals are traced before they are resampled.
    pub fn has_visibility(self) -> bool {
        match self {
            Target::Fgl | Target::Visibility => false,
            Target::Gv | Target::Gvl => true,
        }
    }
}
