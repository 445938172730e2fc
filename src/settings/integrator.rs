//! Light transport: the integrator, and the estimator of direct light.
//!
//! Settings of other estimators than the chosen one are kept, so that options may come in any order.
//! `direct::Estimator` extracts the settings of the chosen estimator.

use super::photon_map::PhotonMapSettings;
use super::ris::RisSettings;
use crate::bsdfs::ProposalDensity;
use crate::lights::{LightChoice, LightSamplerKind};
use lumiris_numbers::estimators::heuristics::Heuristic;
use lumiris_numbers::estimators::ocv::MAX_COMPONENTS;
use strum::{EnumString, IntoStaticStr, VariantNames};

/// Light transport.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct IntegratorSettings {
    /// The integrator.
    pub kind: IntegratorKind,
    /// Maximum number of bounces; 1 is direct light. `irradiance-cache` counts the bounces of a record from the record.
    pub max_depth: u32,
    /// The first bounce at which Russian roulette on the throughput may end a path; `None`: only `max_depth` ends
    /// paths.
    pub roulette_depth: Option<u32>,
    /// Edge of the pixel blocks that share paths from their second diffuse vertex on; 1: no sharing. `None`: chosen by
    /// `auto`, or 1.
    pub path_reuse: Option<u32>,
    /// Light paths per camera sample for caustics; 0: none. `None`: chosen by `auto`, or 0.
    pub light_paths: Option<f32>,
    /// True if light groups have layers of their own in the image.
    pub light_groups: bool,
    /// Direct-light estimator at each path vertex.
    pub estimator: EstimatorKind,
    /// Samples per estimate (N): shadow segments per shading point. `None` is the default of the estimator,
    /// [`Self::sample_counts`].
    pub samples: Option<u32>,
    /// Samples per estimate at path vertices after the first. `None`: the number at the first vertex; `ris` halves it
    /// at every bounce.
    pub later_samples: Option<u32>,
    /// Weights of the techniques; see [`Self::heuristic`].
    pub heuristic: Option<Heuristic>,
    /// Fraction of the samples drawn by BSDF sampling, for estimators that combine it with light sampling (0 to 1);
    /// with two or more samples, each technique gets at least one. See [`Self::bsdf_fraction`].
    pub bsdf_fraction: Option<f32>,
    /// The light sampler.
    pub light_sampler: LightSamplerKind,
    /// Fraction of the light samples that go to infinite lights beside a light tree (0 to 1, exclusive). `None`: chosen
    /// by `auto`, or the same probability for each infinite light as for the whole tree.
    pub infinite_fraction: Option<f32>,
    /// Settings of `ris`.
    pub ris: RisSettings,
    /// Settings of `irradiance-cache`.
    pub cache: IrradianceCacheSettings,
    /// Settings of `photon-map`.
    pub photons: PhotonMapSettings,
    /// Settings of `ocv`.
    pub ocv: OcvSettings,
    /// Source of the weights of `optimal-mis`.
    pub optimal_mis: OptimalForm,
    /// Sampling technique of `correlated`.
    pub correlated_technique: SamplingTechnique,
    /// Settings of `contributing`.
    pub contributing: ContributingSettings,
    /// Proposals (M) per direction that continues a path, for BSDFs that can only be evaluated; 1 is plain importance
    /// sampling.
    pub bsdf_proposals: u32,
    /// Density of these proposals.
    pub bsdf_density: ProposalDensity,
}

impl Default for IntegratorSettings {
    fn default() -> Self {
        IntegratorSettings {
            kind: IntegratorKind::Path,
            max_depth: 5,
            roulette_depth: Some(4),
            path_reuse: None,
            light_paths: None,
            light_groups: true,
            estimator: EstimatorKind::Auto,
            samples: None,
            later_samples: None,
            heuristic: None,
            bsdf_fraction: None,
            light_sampler: LightSamplerKind::Tree,
            infinite_fraction: None,
            ris: RisSettings::default(),
            cache: IrradianceCacheSettings::default(),
            photons: PhotonMapSettings::default(),
            ocv: OcvSettings::default(),
            optimal_mis: OptimalForm::Progressive,
            correlated_technique: SamplingTechnique::Bsdf,
            contributing: ContributingSettings::default(),
            bsdf_proposals: 4,
            bsdf_density: ProposalDensity::Lobes,
        }
    }
}

impl IntegratorSettings {
    /// The maximum number of bounces of the integrator.
    pub fn depth(&self) -> u32 {
        match self.kind {
            IntegratorKind::Direct => self.max_depth.min(1),
            IntegratorKind::Path | IntegratorKind::IrradianceCache | IntegratorKind::PhotonMap => self.max_depth,
        }
    }

    /// The same settings with another integrator, as if it were chosen by name. `direct` has one bounce; others get the
    /// default number of bounces if there was only one.
    #[must_use]
    pub fn of_kind(self, kind: IntegratorKind) -> Self {
        let max_depth = match kind {
            IntegratorKind::Direct => 1,
            _ if self.kind == IntegratorKind::Direct => IntegratorSettings::default().max_depth,
            _ => self.max_depth,
        };
        IntegratorSettings { kind, max_depth, ..self }
    }

    /// MIS heuristic.
    pub fn heuristic(&self) -> Heuristic {
        let like = if self.is_like_mis() { EstimatorKind::Mis } else { self.estimator };
        self.heuristic.unwrap_or(like.default_heuristic())
    }

    /// Fraction of the samples drawn by BSDF sampling. `mis` continues a path by its only BSDF sample, which needs no
    /// additional ray. Control variates need samples of all components, unless they correct the samples of `mis`.
    pub fn bsdf_fraction(&self) -> f32 {
        self.bsdf_fraction.unwrap_or(if self.is_like_mis() { 0.25 } else { 0.5 })
    }

    /// The choice of lights.
    pub fn light_choice(&self) -> LightChoice {
        let volumes = self.samples_volumes_at(0) && self.samples_volumes_at(1);
        LightChoice { kind: self.light_sampler, infinite_fraction: self.infinite_fraction, volumes }
    }

    /// True if light samples at a path vertex, counted from 0, may include the emission of media. The path is then
    /// their only BSDF sample, which samples that emission too.
    fn samples_volumes_at(&self, vertex: u32) -> bool {
        let is_mis = matches!(self.estimator, EstimatorKind::Auto | EstimatorKind::Mis);
        let samples = self.sample_counts_at(vertex).samples;
        is_mis && samples >= 2 && bsdf_samples(samples, self.bsdf_fraction()) == 1
    }

    /// True if lights are chosen by a light tree, with infinite lights beside it.
    pub fn has_light_tree(&self) -> bool {
        matches!(self.light_sampler, LightSamplerKind::Tree | LightSamplerKind::VisibilityCache)
    }

    /// True if samples are drawn and weighted as in `mis`.
    fn is_like_mis(&self) -> bool {
        match self.estimator {
            EstimatorKind::Auto | EstimatorKind::Mis => true,
            EstimatorKind::Ocv => self.ocv.form == OcvForm::Pixels,
            EstimatorKind::Mc
            | EstimatorKind::Ris
            | EstimatorKind::OptimalMis
            | EstimatorKind::Correlated
            | EstimatorKind::Contributing => false,
        }
    }

    /// True if Russian roulette on the throughput decides about this bounce, counted from 1.
    pub fn has_roulette(&self, bounce: u32) -> bool {
        self.roulette_depth.is_some_and(|first| bounce >= first)
    }

    /// True if direct light uses the visibility cache.
    pub fn uses_visibility_cache(&self) -> bool {
        self.light_sampler == LightSamplerKind::VisibilityCache
            || self.estimator == EstimatorKind::Contributing
            || self.estimator == EstimatorKind::Ris && self.ris.target.uses_visibility_cache()
    }

    /// True if non-contributing lights are omitted, which is biased.
    pub fn leaves_lights_out(&self) -> bool {
        self.estimator == EstimatorKind::Contributing && self.contributing.noncontributing_samples() == 0
    }

    /// Default number of samples per estimate. Fixed costs of a shading point justify four: with `ris` always, with
    /// `mis` if there is one shading point per camera sample. Powers of two are well distributed.
    fn default_samples(&self) -> u32 {
        match self.estimator {
            EstimatorKind::Mc => 2,
            EstimatorKind::Auto | EstimatorKind::Mis if self.depth() > 1 => 2,
            EstimatorKind::Auto
            | EstimatorKind::Mis
            | EstimatorKind::Ris
            | EstimatorKind::Ocv
            | EstimatorKind::OptimalMis
            | EstimatorKind::Correlated
            | EstimatorKind::Contributing => 4,
        }
    }

    /// Sample and proposal counts of an estimate, unless chosen per pixel.
    pub fn sample_counts(&self) -> SampleCounts {
        let samples = self.samples.unwrap_or_else(|| self.default_samples()).max(1);
        let proposals = if self.estimator == EstimatorKind::Ris { self.ris.proposals_for(samples) } else { samples };
        SampleCounts { samples, proposals: proposals.max(samples) }
    }

    /// Sample and proposal counts of an estimate at a path vertex, counted from 0, unless chosen per pixel.
    pub fn sample_counts_at(&self, vertex: u32) -> SampleCounts {
        let first = self.sample_counts();
        match self.later_samples.filter(|_| vertex > 0) {
            Some(samples) => first.of_ratio(samples.max(1)),
            None if self.estimator == EstimatorKind::Ris => first.after_bounces(vertex),
            None => first,
        }
    }
}

/// Number of BSDF samples among `n` ≥ 2 samples, for the given fraction; at least one sample of each technique.
pub fn bsdf_samples(n: u32, fraction: f32) -> u32 {
    ((n as f32 * fraction) as u32).clamp(1, n - 1)
}

/// The integrator.
#[derive(Clone, Copy, Debug, PartialEq, Eq, EnumString, IntoStaticStr, VariantNames)]
#[strum(serialize_all = "kebab-case")]
pub enum IntegratorKind {
    /// Emitted light and one bounce.
    Direct,
    /// Path tracing of up to `max_depth` bounces.
    Path,
    /// Paths, with the light reflected by diffuse surfaces interpolated between records [Ward et al. 1988].
    IrradianceCache,
    /// Paths, with the light reflected by diffuse surfaces from photon maps [Jensen 1996; Keller and Wald 2000].
    PhotonMap,
}

/// Irradiance caching [Ward et al. 1988; Ward and Heckbert 1992; Křivánek et al. 2008].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct IrradianceCacheSettings {
    /// The content of records.
    pub cached: Cached,
    /// κ: a record is used up to a distance of κR, where R is the harmonic mean distance to the surfaces visible from
    /// it, and up to a change of the normal by about √2·κ radians. The bias increases with κ.
    pub error: f32,
    /// Minimum and maximum radius of a record, in pixels projected onto its surface.
    pub radius: [f32; 2],
    /// Directions per record in which indirect light is sampled.
    pub samples: u32,
    /// Estimates of direct light per record, with `cached` `all`.
    pub passes: u32,
}

impl Default for IrradianceCacheSettings {
    fn default() -> Self {
        IrradianceCacheSettings { cached: Cached::Indirect, error: 0.25, radius: [3.0, 20.0], samples: 256, passes: 4 }
    }
}

/// The content of the records of the irradiance cache.
#[derive(Clone, Copy, Debug, PartialEq, Eq, EnumString, IntoStaticStr, VariantNames)]
#[strum(serialize_all = "kebab-case")]
pub enum Cached {
    /// Indirect light; direct light is estimated at every hit of a camera ray.
    Indirect,
    /// Indirect and direct light [Fan et al. 2006, §5.1].
    All,
}

/// The estimator of direct light.
#[derive(Clone, Copy, Debug, PartialEq, Eq, EnumString, IntoStaticStr, VariantNames)]
#[strum(serialize_all = "kebab-case")]
pub enum EstimatorKind {
    /// Chosen by a rule from the hits of camera rays: `mis` or `contributing`, with sample counts.
    Auto,
    /// Light sampling only (and the specular lobes of BSDFs).
    Mc,
    /// Light and BSDF sampling, combined by multiple importance sampling.
    Mis,
    /// Resampled importance sampling: few of many proposals are traced [Talbot et al. 2005].
    Ris,
    /// Optimizing control variates: a mixture of the sampling densities, fitted to the integrand [Fan et al. 2006].
    Ocv,
    /// Optimal weights of multiple importance sampling [Kondapaneni et al. 2019].
    OptimalMis,
    /// Importance sampling by one technique, combined with correlated sampling [Szécsi, Sbert and Szirmay-Kalos 2004].
    Correlated,
    /// Light sampling, with separate samples of the contributing lights of the visibility cache and of all others
    /// [Keller and Wald 2000, §3].
    Contributing,
}

impl EstimatorKind {
    /// Default MIS heuristic of `mis`, and of the proposal techniques of `ris`. Resampling has minimal variance if the
    /// proposals have minimal variance, which the balance heuristic approximates. The power heuristic is better if all
    /// samples are traced.
    pub fn default_heuristic(self) -> Heuristic {
        match self {
            EstimatorKind::Ris | EstimatorKind::Ocv | EstimatorKind::OptimalMis => Heuristic::Balance,
            _ => Heuristic::Power,
        }
    }
}

/// Optimizing control variates [Fan et al. 2006].
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct OcvSettings {
    /// The samples that determine the coefficients.
    pub form: OcvForm,
    /// Maximum number of components of the mixture: BSDF lobes and groups of lights; `None`: as many as possible.
    pub components: Option<u32>,
}

/// The samples that `ocv` fits its coefficients to; see [`lumiris_numbers::estimators::ocv::Form`].
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, EnumString, IntoStaticStr, VariantNames)]
#[strum(serialize_all = "kebab-case")]
pub enum OcvForm {
    /// The same samples. Biased.
    Paper,
    /// Earlier samples of the pixel.
    Progressive,
    /// The surrounding pixels.
    #[default]
    Pixels,
}

impl OcvSettings {
    /// Maximum number of components.
    pub fn max_components(&self) -> usize {
        self.components.map_or(MAX_COMPONENTS, |c| (c as usize).clamp(2, MAX_COMPONENTS))
    }
}

/// Source of the weights of `optimal-mis`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, EnumString, IntoStaticStr, VariantNames)]
#[strum(serialize_all = "kebab-case")]
pub enum OptimalForm {
    /// From the samples of the estimate. Biased.
    Direct,
    /// From earlier samples of the pixel.
    Progressive,
}

/// Direct light with separate samples on contributing and non-contributing lights [Keller and Wald 2000, §3].
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ContributingSettings {
    /// Samples on non-contributing lights (S_non), in addition to the samples of an estimate (S_con); `None` for the
    /// default. 0 is biased.
    pub noncontributing_samples: Option<u32>,
    /// BSDF samples if the BSDF is not diffuse (S_b); `None` for the default.
    pub bsdf_samples: Option<u32>,
}

impl ContributingSettings {
    /// Samples on non-contributing lights.
    pub fn noncontributing_samples(&self) -> u32 {
        self.noncontributing_samples.unwrap_or(2)
    }

    /// BSDF samples if the BSDF is not diffuse.
    pub fn bsdf_samples(&self) -> u32 {
        self.bsdf_samples.unwrap_or(1)
    }
}

/// A technique for sampling directions.
#[derive(Clone, Copy, Debug, PartialEq, Eq, EnumString, IntoStaticStr, VariantNames)]
#[strum(serialize_all = "kebab-case")]
pub enum SamplingTechnique {
    /// BSDF sampling.
    Bsdf,
    /// Light sampling.
    Light,
}

/// Sample counts of one estimate: N samples (shadow segments), resampled from M proposals.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct SampleCounts {
    /// N.
    pub samples: u32,
    /// M ≥ N; equal to N for estimators that trace all proposals.
    pub proposals: u32,
}

impl SampleCounts {
    /// Halves the counts for each bounce, down to one sample: the throughput of a path decreases, while the time per
    /// vertex does not. The ratio M/N stays the same.
    #[must_use]
    pub fn after_bounces(self, bounces: u32) -> SampleCounts {
        self.of_ratio((self.samples >> bounces.min(31)).max(1))
    }

    /// The given number of samples, with the same number of proposals for each.
    fn of_ratio(self, samples: u32) -> SampleCounts {
        let proposals = (u64::from(self.proposals) * u64::from(samples)).div_ceil(u64::from(self.samples.max(1)));
        SampleCounts { samples, proposals: proposals as u32 }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::settings::Proposals;

    #[test]
    fn later_vertices_have_fewer_samples_of_the_same_ratio() {
        let sample_counts = SampleCounts { samples: 5, proposals: 40 };
        assert_eq!(sample_counts.after_bounces(0), sample_counts);
        assert_eq!(sample_counts.after_bounces(1), SampleCounts { samples: 2, proposals: 16 });
        assert_eq!(sample_counts.after_bounces(100), SampleCounts { samples: 1, proposals: 8 });
        assert_eq!(
            SampleCounts { samples: 4, proposals: 7 }.after_bounces(1),
            SampleCounts { samples: 2, proposals: 4 }
        );
    }

    #[test]
    fn there_are_never_fewer_proposals_than_samples() {
        let mut s = IntegratorSettings { estimator: EstimatorKind::Ris, samples: Some(16), ..Default::default() };
        s.ris.proposals = Proposals::Fixed(4);
        assert_eq!(s.sample_counts(), SampleCounts { samples: 16, proposals: 16 });
        s.estimator = EstimatorKind::Mis;
        assert_eq!(s.sample_counts(), SampleCounts { samples: 16, proposals: 16 });
    }
}
