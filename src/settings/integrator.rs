//! Light transport: the integrator, and how direct light is estimated.
//!
//! Settings of other estimators than the chosen one are kept: options may come in any order. What the chosen one needs,
//! `direct::Estimator` takes from here.

use super::photon_map::PhotonMapSettings;
use super::ris::RisSettings;
use crate::bsdfs::ProposalDensity;
use crate::lights::{LightChoice, LightSamplerKind};
use lumiris_numbers::estimators::mis::Heuristic;
use lumiris_numbers::estimators::ocv::MAX_COMPONENTS;
use strum::{EnumString, IntoStaticStr, VariantNames};

/// Light transport.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct IntegratorSettings {
    /// The integrator.
    pub kind: IntegratorKind,
    /// Maximum number of bounces; 1 is direct light. In records of `irradiance-cache` they are counted from the record.
    pub max_depth: u32,
    /// The bounce from which on paths end by Russian roulette on their throughput; `None`: they go on to `max_depth`.
    pub roulette_depth: Option<u32>,
    /// Edge of the blocks of pixels that share paths from their second diffuse vertex on; 1: none do. `None`: what `auto`
    /// chooses, or 1.
    pub path_reuse: Option<u32>,
    /// Light paths per camera sample that bring caustics; 0: none do. `None`: what `auto` chooses, or 0.
    pub light_paths: Option<f32>,
    /// Lights that name groups have layers of their own in the image.
    pub light_groups: bool,
    /// Direct-light estimator at each path vertex.
    pub estimator: EstimatorKind,
    /// Samples per estimate (N): shadow segments per shading point. `None` is the default of the estimator,
    /// [`Self::sample_counts`].
    pub samples: Option<u32>,
    /// Samples per estimate at later vertices of a path than the first. `None`: as many as at the first; `ris` halves them
    /// at every bounce.
    pub later_samples: Option<u32>,
    /// Weights of the techniques; see [`Self::heuristic`].
    pub heuristic: Option<Heuristic>,
    /// Fraction of the samples drawn by BSDF sampling, for estimators that combine it with light sampling (0 to 1);
    /// with two or more samples, each technique gets at least one. See [`Self::bsdf_fraction`].
    pub bsdf_fraction: Option<f32>,
    /// The light sampler.
    pub light_sampler: LightSamplerKind,
    /// Fraction of the light samples by a light tree that go to lights at infinity (0 to 1, exclusive). `None`: what `auto`
    /// chooses, or as many to each as to all other lights together.
    pub infinite_fraction: Option<f32>,
    /// Settings of `ris`.
    pub ris: RisSettings,
    /// Settings of `irradiance-cache`.
    pub cache: IrradianceCacheSettings,
    /// Settings of `photon-map`.
    pub photons: PhotonMapSettings,
    /// Settings of `ocv`.
    pub ocv: OcvSettings,
    /// How `optimal-mis` determines its weights.
    pub optimal_mis: OptimalForm,
    /// What draws the samples of `correlated`.
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

    /// The same with another integrator, as if it had been asked for by name: `direct` has one bounce, and others as many
    /// as by default if there was only one.
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

    /// Fraction of the samples drawn by BSDF sampling. That of `mis` lets a path continue by its only BSDF sample, which
    /// costs no ray of its own; control variates need samples of all components, unless they correct those of `mis`.
    pub fn bsdf_fraction(&self) -> f32 {
        self.bsdf_fraction.unwrap_or(if self.is_like_mis() { 0.25 } else { 0.5 })
    }

    /// How lights are chosen.
    pub fn light_choice(&self) -> LightChoice {
        let glows = self.finds_glows_at(0) && self.finds_glows_at(1);
        LightChoice { kind: self.light_sampler, infinite_fraction: self.infinite_fraction, glows }
    }

    /// True if light samples at a path vertex, counted from 0, may look for what media send out: then the path is their only
    /// BSDF sample, which finds it too.
    fn finds_glows_at(&self, vertex: u32) -> bool {
        let is_mis = matches!(self.estimator, EstimatorKind::Auto | EstimatorKind::Mis);
        let samples = self.sample_counts_at(vertex).samples;
        is_mis && samples >= 2 && bsdf_samples(samples, self.bsdf_fraction()) == 1
    }

    /// True if lights are chosen by a light tree, and those at infinity beside it.
    pub fn has_light_tree(&self) -> bool {
        matches!(self.light_sampler, LightSamplerKind::Tree | LightSamplerKind::Photons)
    }

    /// True if samples are drawn and weighted as `mis` does.
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

    /// True if the throughput of a path decides whether it takes the bounce of this number, counted from 1.
    pub fn has_roulette(&self, bounce: u32) -> bool {
        self.roulette_depth.is_some_and(|first| bounce >= first)
    }

    /// True if direct light uses the visibility cache.
    pub fn uses_visibility_cache(&self) -> bool {
        self.light_sampler == LightSamplerKind::Photons
            || self.estimator == EstimatorKind::Contributing
            || self.estimator == EstimatorKind::Ris && self.ris.target.uses_visibility_cache()
    }

    /// True if non-contributing lights are left out, which is biased.
    pub fn leaves_lights_out(&self) -> bool {
        self.estimator == EstimatorKind::Contributing && self.contributing.noncontributing_samples() == 0
    }

    /// Default number of samples per estimate. What is fixed in the cost of a shading point justifies four: with
    /// `ris` anywhere, with `mis` where a camera sample has one. Powers of two are well distributed.
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

/// Number of BSDF samples among `n` ≥ 2 samples, of which they are a fraction: at least one, as of light samples.
pub fn bsdf_samples(n: u32, fraction: f32) -> u32 {
    ((n as f32 * fraction) as u32).clamp(1, n - 1)
}

/// What is computed.
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
    /// What records hold.
    pub cached: Cached,
    /// κ: a record is used up to a distance of κR, R being the harmonic mean distance to the surfaces that it sees, and
    /// up to a change of the normal by some √2·κ radians. The bias grows with it.
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

/// What the records of the irradiance cache hold.
#[derive(Clone, Copy, Debug, PartialEq, Eq, EnumString, IntoStaticStr, VariantNames)]
#[strum(serialize_all = "kebab-case")]
pub enum Cached {
    /// Indirect light; direct light is estimated at every hit of a camera ray.
    Indirect,
    /// Indirect and direct light [Fan et al. 2006, §5.1].
    All,
}

/// How direct light is estimated.
#[derive(Clone, Copy, Debug, PartialEq, Eq, EnumString, IntoStaticStr, VariantNames)]
#[strum(serialize_all = "kebab-case")]
pub enum EstimatorKind {
    /// What a rule chooses from what the camera sees: `mis` or `contributing`, with numbers of samples.
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
    /// Light sampling, separately of the contributing lights that the visibility cache finds and of all others [Keller
    /// and Wald 2000, §3].
    Contributing,
}

impl EstimatorKind {
    /// Default MIS heuristic of `mis`, and of the techniques that propose for `ris`. Resampling has minimal variance if
    /// the proposals have, which the balance heuristic approximates; the power heuristic is better where all samples
    /// are traced.
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
    /// How the coefficients are determined.
    pub form: OcvForm,
    /// Maximum number of components of the mixture: BSDF lobes and groups of lights; `None`: as many as possible.
    pub components: Option<u32>,
}

/// What the coefficients of `ocv` are fitted to; see [`lumiris_numbers::estimators::ocv::Form`].
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

/// How `optimal-mis` finds its weights.
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
    /// Samples on non-contributing lights (S_non), in addition to those of an estimate (S_con), if they are not the
    /// default. 0 is biased.
    pub noncontributing_samples: Option<u32>,
    /// BSDF samples where the BSDF is not diffuse (S_b), if they are not the default.
    pub bsdf_samples: Option<u32>,
}

impl ContributingSettings {
    /// Samples on non-contributing lights.
    pub fn noncontributing_samples(&self) -> u32 {
        self.noncontributing_samples.unwrap_or(2)
    }

    /// BSDF samples where the BSDF is not diffuse.
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
    /// M ≥ N; equal to N for estimators that trace what they propose.
    pub proposals: u32,
}

impl SampleCounts {
    /// Halves the counts for each bounce, down to one sample: the throughput of a path decreases, while the time per
    /// vertex does not. The ratio M/N stays the same.
    #[must_use]
    pub fn after_bounces(self, bounces: u32) -> SampleCounts {
        self.of_ratio((self.samples >> bounces.min(31)).max(1))
    }

    /// This many samples, with as many proposals for each.
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
