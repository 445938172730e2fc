//! Settings of `ris`: proposals, strata and targets.

use lumiris_numbers::estimators::ris::sample_counts::Costs;
use strum::{EnumString, IntoStaticStr, VariantNames};

/// Relative costs of a proposal, T1, and of a sample, T2: M/N = T2/T1 = 3 [Talbot 2005, Eq. 4.4]. The measured ratio of
/// the times is 1 to 7, depending on scene and processor (`docs/measurements/resampling/README.md`).
pub const COSTS: Costs = Costs { t1: 1.0, t2: 3.0 };

/// Resampled importance sampling [Talbot et al. 2005; Talbot 2005].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RisSettings {
    /// Number of proposals (M).
    pub proposals: Proposals,
    /// Resampling of the proposals.
    pub strata: Strata,
    /// Distribution of the proposals over the lights.
    pub points: ProposalPoints,
    /// The target density.
    pub target: Target,
}

impl Default for RisSettings {
    fn default() -> Self {
        RisSettings {
            proposals: Proposals::Auto,
            strata: Strata::Systematic,
            points: ProposalPoints::Stratified,
            target: Target::Fgl,
        }
    }
}

impl RisSettings {
    /// Proposals for a number of samples.
    pub fn proposals_for(&self, samples: u32) -> u32 {
        match self.proposals {
            Proposals::Fixed(m) => m,
            Proposals::Auto | Proposals::Optimal => (f64::from(samples) * COSTS.robust_ratio()).round() as u32,
        }
    }
}

/// Choice of the number of proposals.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Proposals {
    /// A fixed number.
    Fixed(u32),
    /// Three for each sample ([`COSTS`]).
    Auto,
    /// Per pixel, from variances [Talbot 2005, Eq. 4.3].
    Optimal,
}

/// Strata of the samples over the proposals.
#[derive(Clone, Copy, Debug, PartialEq, Eq, EnumString, IntoStaticStr, VariantNames)]
#[strum(serialize_all = "kebab-case")]
pub enum Strata {
    /// Independent draws with replacement [Talbot 2005, Eq. 4.1].
    None,
    /// One draw from each of N strata with equal numbers of proposals [Talbot 2005, §4.5.2.1].
    Proposals,
    /// One draw from each of N strata of nearly equal weight [Talbot 2005, §4.5.2.2].
    Weights,
    /// N draws at equal distances of the cumulative weight (systematic resampling).
    Systematic,
}

/// The distribution of light proposals over the lights.
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
    /// G·V: for surfaces and lights that are more expensive to evaluate than tracing a ray.
    Gv,
    /// G·V·L: for surfaces that are more expensive to evaluate than tracing a ray.
    Gvl,
    /// Luminance of f·G·L times an estimate of V for each light, from the visibility cache. Proposals are not traced.
    Visibility,
    /// As `visibility`, with the estimate as a control variate: samples are drawn where V is uncertain.
    VisibilityControl,
}

impl Target {
    /// True if proposals are traced before they are resampled.
    pub fn has_visibility(self) -> bool {
        match self {
            Target::Fgl | Target::Visibility | Target::VisibilityControl => false,
            Target::Gv | Target::Gvl => true,
        }
    }

    /// True if the target uses the visibility cache.
    pub fn uses_visibility_cache(self) -> bool {
        matches!(self, Target::Visibility | Target::VisibilityControl)
    }
}
