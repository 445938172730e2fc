//! Light transport: what is computed, and how direct light is estimated.

use super::photon_map::PhotonMapSettings;
use super::ris::{Proposals, RisSettings, Target};
use crate::bsdfs::ProposalDensity;
use crate::lights::LightSamplerKind;
use lumiris_numbers::estimators::mis::Heuristic;
use lumiris_numbers::estimators::ocv::{Form, MAX_COMPONENTS};
use strum::{EnumString, IntoStaticStr, VariantNames};

/// Light transport.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct IntegratorSettings {
    /// What is computed.
    pub kind: IntegratorKind,
    /// Number of bounces; 1 is direct light. With `irradiance-cache` those that a record holds count from the record.
    pub max_depth: u32,
    /// Direct-light estimator at each path vertex.
    pub estimator: EstimatorKind,
    /// Samples per estimate (N): shadow segments per shading point. `None` is the choice of the estimator:
    /// [`DEFAULT_SAMPLES`], or [`DEFAULT_RIS_SAMPLES`].
    pub samples: Option<u32>,
    /// Weights of the techniques; see [`Self::heuristic`].
    pub heuristic: Option<Heuristic>,
    /// Share of the samples that is drawn by the BSDF, for the estimators that mix it with light sampling (0 to 1); each of both
    /// has at least one sample, if there are two.
    pub bsdf_share: f32,
    /// How a light is chosen.
    pub light_choice: LightSamplerKind,
    /// What is particular to `ris`.
    pub ris: RisSettings,
    /// What is particular to `irradiance-cache`.
    pub cache: IrradianceCacheSettings,
    /// What is particular to `photon-map`.
    pub photons: PhotonMapSettings,
    /// What is particular to `ocv`.
    pub ocv: OcvSettings,
    /// How `optimal-mis` finds its weights.
    pub optimal_mis: OptimalForm,
    /// What is particular to `correlated`.
    pub correlated: CorrelatedSettings,
    /// What is particular to `contributing`.
    pub contributing: ContributingSettings,
    /// Directions proposed for each that continues a path (M), where the BSDF is one that can only be evaluated; 1 is
    /// plain importance sampling.
    pub bsdf_proposals: u32,
    /// Density that proposes them.
    pub bsdf_density: ProposalDensity,
}

/// Samples per estimate of `mc` and `mis` where none are asked for.
pub const DEFAULT_SAMPLES: u32 = 2;
/// Samples per estimate of `ris` where none are asked for: what a shading point costs before its first proposal is worth more than
/// one sample, and powers of two are well distributed.
pub const DEFAULT_RIS_SAMPLES: u32 = 4;
/// Samples per estimate of `ocv`, `optimal-mis`, `correlated` and `contributing` where none are asked for.
pub const DEFAULT_OCV_SAMPLES: u32 = 4;

impl Default for IntegratorSettings {
    fn default() -> Self {
        IntegratorSettings {
            kind: IntegratorKind::Path,
            max_depth: 5,
            estimator: EstimatorKind::Mis,
            samples: None,
            heuristic: None,
            bsdf_share: 0.5,
            light_choice: LightSamplerKind::Tree,
            ris: RisSettings::default(),
            cache: IrradianceCacheSettings::default(),
            photons: PhotonMapSettings::default(),
            ocv: OcvSettings::default(),
            optimal_mis: OptimalForm::Progressive,
            correlated: CorrelatedSettings::default(),
            contributing: ContributingSettings::default(),
            bsdf_proposals: 4,
            bsdf_density: ProposalDensity::Lobes,
        }
    }
}

impl IntegratorSettings {
    /// The number of bounces that is really computed.
    pub fn depth(&self) -> u32 {
        match self.kind {
            IntegratorKind::Direct => self.max_depth.min(1),
            IntegratorKind::Path | IntegratorKind::IrradianceCache | IntegratorKind::PhotonMap => self.max_depth,
        }
    }

    /// MIS weights of `mis`, and of the techniques that propose for `ris`. Resampling has the least variance if proposals
    /// have, which the balance heuristic comes near; the power heuristic serves where everything proposed is traced.
    pub fn heuristic(&self) -> Heuristic {
        self.heuristic.unwrap_or(match self.estimator {
            EstimatorKind::Mc | EstimatorKind::Mis | EstimatorKind::Correlated | EstimatorKind::Contributing => {
                Heuristic::Power
            }
            EstimatorKind::Ris | EstimatorKind::Ocv | EstimatorKind::OptimalMis => Heuristic::Balance,
        })
    }

    /// True if an estimate uses coefficients that were fitted to earlier samples of its pixel.
    pub fn is_progressive(&self) -> bool {
        match self.estimator {
            EstimatorKind::Mc
            | EstimatorKind::Mis
            | EstimatorKind::Ris
            | EstimatorKind::Correlated
            | EstimatorKind::Contributing => false,
            EstimatorKind::Ocv => self.ocv.form == Form::Progressive,
            EstimatorKind::OptimalMis => self.optimal_mis == OptimalForm::Progressive,
        }
    }

    /// Settings of direct light at the vertex of a path, which are counted from 0. What is fitted to earlier samples of a pixel is
    /// fitted to first vertices, which lie together; at later ones, which lie anywhere, estimates are those of `mis`.
    #[must_use]
    pub fn at_vertex(&self, vertex: u32) -> IntegratorSettings {
        if vertex == 0 || !self.is_progressive() {
            return *self;
        }
        IntegratorSettings { estimator: EstimatorKind::Mis, samples: Some(self.split().samples), ..*self }
    }

    /// True if direct light asks which lights photons have come from.
    pub fn uses_light_hints(&self) -> bool {
        self.light_choice == LightSamplerKind::Photons
            || self.estimator == EstimatorKind::Contributing
            || self.estimator == EstimatorKind::Ris && self.ris.target == Target::Visibility
    }

    /// True if lights that no photon came from are left out, which is biased.
    pub fn leaves_lights_out(&self) -> bool {
        self.estimator == EstimatorKind::Contributing && self.contributing.rest_samples == 0
    }

    /// True if an estimate is made of two independent halves.
    pub fn has_halves(&self) -> bool {
        match self.estimator {
            EstimatorKind::Mc
            | EstimatorKind::Mis
            | EstimatorKind::Ris
            | EstimatorKind::OptimalMis
            | EstimatorKind::Contributing => false,
            EstimatorKind::Ocv => self.ocv.form == Form::Crossfit,
            EstimatorKind::Correlated => self.correlated.form == CorrelatedForm::Crossfit,
        }
    }

    /// [`Self::split`] at the vertex of a path, which are counted from 0.
    pub fn split_at_vertex(&self, vertex: u32) -> Split {
        match self.estimator {
            EstimatorKind::Ris => self.split().after_bounces(vertex),
            EstimatorKind::Mc
            | EstimatorKind::Mis
            | EstimatorKind::Ocv
            | EstimatorKind::Correlated
            | EstimatorKind::Contributing
            | EstimatorKind::OptimalMis => self.split(),
        }
    }

    /// Samples and proposals of every estimate where they are not chosen per pixel.
    pub fn split(&self) -> Split {
        let default = match self.estimator {
            EstimatorKind::Mc | EstimatorKind::Mis => DEFAULT_SAMPLES,
            EstimatorKind::Ris => DEFAULT_RIS_SAMPLES,
            EstimatorKind::Ocv
            | EstimatorKind::OptimalMis
            | EstimatorKind::Correlated
            | EstimatorKind::Contributing => DEFAULT_OCV_SAMPLES,
        };
        let samples = self.samples.unwrap_or(default).max(1);
        match self.estimator {
            EstimatorKind::Mc
            | EstimatorKind::Mis
            | EstimatorKind::Ocv
            | EstimatorKind::OptimalMis
            | EstimatorKind::Correlated
            | EstimatorKind::Contributing => Split { samples, proposals: samples },
            EstimatorKind::Ris => {
                let proposals = match self.ris.proposals {
                    Proposals::Fixed(m) => m,
                    Proposals::Auto | Proposals::Optimal => (f64::from(samples) * self.ris.ratio()).round() as u32,
                };
                Split { samples, proposals: proposals.max(samples) }
            }
        }
    }
}

/// What is computed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, EnumString, IntoStaticStr, VariantNames)]
#[strum(serialize_all = "kebab-case")]
pub enum IntegratorKind {
    /// Emitted light and one bounce.
    Direct,
    /// Paths of up to `max_depth` bounces.
    Path,
    /// The same, with the light that diffuse surfaces reflect interpolated between records [Ward et al. 1988].
    IrradianceCache,
    /// The same, with the light that diffuse surfaces reflect from photon maps [Jensen 1996; Keller and Wald 2000].
    PhotonMap,
}

/// Irradiance caching [Ward et al. 1988; Ward and Heckbert 1992; Křivánek et al. 2008].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct IrradianceCacheSettings {
    /// What records hold.
    pub cached: Cached,
    /// κ: a record serves up to the distance κR from it, R being the harmonic mean distance of what it sees, and up to a turn
    /// of the normal by some √2·κ radians. The bias grows with it.
    pub error: f32,
    /// Least and greatest distance up to which a record serves, in pixels as they lie on its surface.
    pub radius: [f32; 2],
    /// Directions of the hemisphere of a record, in which indirect light is sampled.
    pub samples: u32,
    /// Estimates of the light of sources at each record, with `cached` `all`.
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
    /// Indirect light; light from sources is estimated at every camera ray's hit.
    Indirect,
    /// Indirect light and light from sources [Fan et al. 2006, §5.1].
    All,
}

/// How direct light is estimated.
#[derive(Clone, Copy, Debug, PartialEq, Eq, EnumString, IntoStaticStr, VariantNames)]
#[strum(serialize_all = "kebab-case")]
pub enum EstimatorKind {
    /// Light sampling only (and the specular lobes of BSDFs).
    Mc,
    /// Light and BSDF sampling, weighted.
    Mis,
    /// Resampled importance sampling: few of many proposals are traced [Talbot et al. 2005].
    Ris,
    /// Optimizing control variates: a mixture of the sampling densities, fitted to the integrand [Fan et al. 2006].
    Ocv,
    /// Optimal weights of multiple importance sampling [Kondapaneni et al. 2019].
    OptimalMis,
    /// Importance sampling by one technique, combined with correlated sampling [Szécsi, Sbert and Szirmay-Kalos 2004].
    Correlated,
    /// Light sampling, by itself of the lights that photons say are seen and of all others [Keller and Wald 2000, §3].
    Contributing,
}

impl EstimatorKind {
    /// True if samples are drawn for each group of lights by itself, and are measured against the density of each component of
    /// the mixture.
    pub fn has_components(self) -> bool {
        match self {
            EstimatorKind::Mc
            | EstimatorKind::Mis
            | EstimatorKind::Ris
            | EstimatorKind::Correlated
            | EstimatorKind::Contributing => false,
            EstimatorKind::Ocv | EstimatorKind::OptimalMis => true,
        }
    }
}

/// Optimizing control variates [Fan et al. 2006].
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct OcvSettings {
    /// How the coefficients are found.
    pub form: Form,
    /// Most components of the mixture: lobes of BSDFs and groups of lights; `None` is as many as there can be.
    pub components: Option<u32>,
}

impl OcvSettings {
    /// Most components.
    pub fn most_components(&self) -> usize {
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

/// Combined correlated and importance sampling [Szécsi, Sbert and Szirmay-Kalos 2004].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct CorrelatedSettings {
    /// How the weight is found.
    pub form: CorrelatedForm,
    /// What draws the samples.
    pub technique: SamplingTechnique,
}

impl Default for CorrelatedSettings {
    fn default() -> Self {
        CorrelatedSettings { form: CorrelatedForm::Combined, technique: SamplingTechnique::Bsdf }
    }
}

/// How `correlated` finds the weight of its two estimates.
#[derive(Clone, Copy, Debug, PartialEq, Eq, EnumString, IntoStaticStr, VariantNames)]
#[strum(serialize_all = "kebab-case")]
pub enum CorrelatedForm {
    /// From the samples of the estimate. Biased.
    Combined,
    /// From the other half of them.
    Crossfit,
}

/// Direct light by the lights that photons say are seen [Keller and Wald 2000, §3].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ContributingSettings {
    /// Samples on the lights that no photon came from (S_non), besides those of an estimate (S_con). 0 is biased.
    pub rest_samples: u32,
}

impl Default for ContributingSettings {
    fn default() -> Self {
        ContributingSettings { rest_samples: 1 }
    }
}

/// A technique that draws directions of light.
#[derive(Clone, Copy, Debug, PartialEq, Eq, EnumString, IntoStaticStr, VariantNames)]
#[strum(serialize_all = "kebab-case")]
pub enum SamplingTechnique {
    /// In proportion to the BSDF, nearly.
    Bsdf,
    /// Points on lights.
    Light,
}

/// Numbers of one estimate: N samples (shadow segments) of M proposals.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Split {
    /// N.
    pub samples: u32,
    /// M ≥ N; equal to N for estimators that trace what they propose.
    pub proposals: u32,
}

impl Split {
    /// Half as many for each bounce that a path has made, at least one sample: what a path still carries grows less, and the
    /// time of its vertices does not. The ratio M/N stays.
    #[must_use]
    pub fn after_bounces(self, bounces: u32) -> Split {
        let samples = (self.samples >> bounces.min(31)).max(1);
        let proposals = (u64::from(self.proposals) * u64::from(samples)).div_ceil(u64::from(self.samples.max(1)));
        Split { samples, proposals: proposals as u32 }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn later_vertices_have_fewer_samples_of_the_same_ratio() {
        let split = Split { samples: 5, proposals: 40 };
        assert_eq!(split.after_bounces(0), split);
        assert_eq!(split.after_bounces(1), Split { samples: 2, proposals: 16 });
        assert_eq!(split.after_bounces(100), Split { samples: 1, proposals: 8 });
        assert_eq!(Split { samples: 4, proposals: 7 }.after_bounces(1), Split { samples: 2, proposals: 4 });
    }

    #[test]
    fn there_are_never_fewer_proposals_than_samples() {
        let mut s = IntegratorSettings { estimator: EstimatorKind::Ris, samples: Some(16), ..Default::default() };
        s.ris.proposals = Proposals::Fixed(4);
        assert_eq!(s.split(), Split { samples: 16, proposals: 16 });
        s.estimator = EstimatorKind::Mis;
        assert_eq!(s.split(), Split { samples: 16, proposals: 16 });
    }
}
