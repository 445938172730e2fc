//! The rows of the table: integrators, estimators, light choices, samplers and ray tracers.

use crate::visibility_cache::{CacheContents, cache_with};
use lumiris::import::{LoadOptions, load};
use lumiris::lights::LightSamplerKind;
use lumiris::scene::{AccelKind, RenderJob};
use lumiris::settings::{
    Cached, EstimatorKind, IntegratorKind, OcvForm, OcvSettings, OptimalForm, ProposalPoints, Proposals,
    SamplingTechnique, Strata, Target,
};
use lumiris_numbers::estimators::heuristics::Heuristic;
use lumiris_numbers::samplers::SamplerKind;
use std::fmt;
use std::path::Path;

/// Settings that must give the known answer.
#[derive(Clone, Copy, Debug)]
pub(super) struct Configuration {
    /// Light stored in the records of an irradiance cache; `None` for path tracing.
    pub cached: Option<Cached>,
    pub estimator: EstimatorKind,
    pub heuristic: Heuristic,
    pub samples: u32,
    /// For `ocv`.
    pub ocv: OcvSettings,
    pub optimal_mis: OptimalForm,
    pub correlated_technique: SamplingTechnique,
    pub bsdf_fraction: f32,
    /// Probability of choosing an infinite light; `None` for the automatic value.
    pub infinite_fraction: Option<f32>,
    /// For `ris`.
    pub proposals: u32,
    pub strata: Strata,
    pub points: ProposalPoints,
    pub target: Target,
    pub light_sampler: LightSamplerKind,
    /// The light visibility cache.
    pub visibility_cache: CacheContents,
    /// For `contributing`.
    pub noncontributing_samples: u32,
    pub sampler: SamplerKind,
    pub accel: AccelKind,
}

/// Camera samples per pixel.
pub(super) const SPP: u32 = 16;

/// Default configuration of the rows.
pub(super) const BASE: Configuration = Configuration {
    cached: None,
    estimator: EstimatorKind::Mis,
    heuristic: Heuristic::Power,
    samples: 2,
    ocv: OcvSettings { form: OcvForm::Progressive, components: None },
    optimal_mis: OptimalForm::Progressive,
    correlated_technique: SamplingTechnique::Bsdf,
    bsdf_fraction: 0.5,
    infinite_fraction: None,
    proposals: 16,
    strata: Strata::Systematic,
    points: ProposalPoints::Stratified,
    target: Target::Fgl,
    light_sampler: LightSamplerKind::Tree,
    visibility_cache: CacheContents::Absent,
    noncontributing_samples: 1,
    sampler: SamplerKind::SobolBlueNoise,
    accel: AccelKind::Embree,
};

/// Samplers other than the default.
const SAMPLERS: [SamplerKind; 3] = [SamplerKind::Independent, SamplerKind::Stratified, SamplerKind::Sobol];

fn path_configurations() -> Vec<Configuration> {
    let base = BASE;
    let mut all = vec![base];
    all.extend([1, 3, 16].map(|samples| Configuration { samples, ..base }));
    all.extend([Heuristic::Balance, Heuristic::Maximum].map(|heuristic| Configuration { heuristic, ..base }));
    all.extend([1, 4].map(|samples| Configuration { estimator: EstimatorKind::Mc, samples, ..base }));
    all.extend(
        [LightSamplerKind::Uniform, LightSamplerKind::Power]
            .map(|light_sampler| Configuration { light_sampler, ..base }),
    );
    all.extend(SAMPLERS.map(|sampler| Configuration { sampler, ..base }));
    all.push(Configuration { accel: AccelKind::Bvh, ..base });
    all.push(Configuration { accel: AccelKind::Bvh, estimator: EstimatorKind::Mc, ..base });
    let ris = Configuration { estimator: EstimatorKind::Ris, heuristic: Heuristic::Balance, ..base };
    all.extend(ris_configurations(&ris));
    all.extend(component_configurations(&Configuration { estimator: EstimatorKind::Ocv, ..base }));
    all
}

/// Irradiance caches.
fn cached_configurations() -> Vec<Configuration> {
    let of = |cached, estimator| Configuration { cached: Some(cached), estimator, ..BASE };
    vec![
        of(Cached::Indirect, EstimatorKind::Mis),
        of(Cached::All, EstimatorKind::Mis),
        of(Cached::All, EstimatorKind::Ris),
        of(Cached::Indirect, EstimatorKind::Ocv),
        of(Cached::All, EstimatorKind::Ocv),
    ]
}

/// Scene for MIS weights only: two kinds of light, one of which occludes the other, both sampled by both techniques.
const OF_WEIGHTS: &str = "lamp-in-sky";
/// Scene with the rows for MIS weights in addition: a BSDF with two lobes.
const OF_LOBES: &str = "phong-normal";

/// All rows of a scene.
pub(super) fn configurations(scene: &str) -> Vec<Configuration> {
    if scene == OF_WEIGHTS {
        return weight_configurations();
    }
    let mut all = [path_configurations(), visibility_cache_configurations(), cached_configurations()].concat();
    if scene == OF_LOBES {
        let names: Vec<String> = all.iter().map(ToString::to_string).collect();
        all.extend(weight_configurations().into_iter().filter(|c| !names.contains(&c.to_string())));
    }
    all
}

/// Settings that affect MIS weights, for every estimator with these settings.
fn weight_configurations() -> Vec<Configuration> {
    const HEURISTICS: [Heuristic; 3] = [Heuristic::Balance, Heuristic::Power, Heuristic::Maximum];
    let mis = BASE;
    let of = |estimator| Configuration { estimator, samples: 4, ..mis };
    let ocv = of(EstimatorKind::Ocv);
    let with_form = |form| Configuration { ocv: OcvSettings { form, ..ocv.ocv }, ..ocv };
    let pixels = with_form(OcvForm::Pixels);
    let optimal = of(EstimatorKind::OptimalMis);
    let ris = of(EstimatorKind::Ris);
    let contributing = Configuration { visibility_cache: CacheContents::Right, ..of(EstimatorKind::Contributing) };

    // Heuristics, BSDF fractions and fractions of infinite lights
    let mut all = Vec::new();
    for heuristic in HEURISTICS {
        all.extend([1, 2, 5].map(|samples| Configuration { heuristic, samples, ..pixels }));
        all.push(Configuration { heuristic, samples: 4, bsdf_fraction: 0.25, ..mis });
        all.push(Configuration { heuristic, sampler: SamplerKind::Independent, ..pixels });
        all.extend([ris, contributing].map(|c| Configuration { heuristic, proposals: 12, ..c }));
    }
    for bsdf_fraction in [0.25, 0.75] {
        all.extend([pixels, optimal].map(|c| Configuration { bsdf_fraction, ..c }));
    }
    for fraction in [0.2, 0.9] {
        let with_fraction = |c| Configuration { infinite_fraction: Some(fraction), ..c };
        all.extend([mis, ocv, pixels, optimal, ris].map(with_fraction));
    }
    all
}

/// All uses of the light visibility cache, with correct and wrong contents.
fn visibility_cache_configurations() -> Vec<Configuration> {
    use CacheContents::{Absent, Empty, Right, Wrong};
    let base = &BASE;
    let light_sampler = LightSamplerKind::VisibilityCache;

    // Choosing lights
    let mut all = [Absent, Empty, Right, Wrong]
        .map(|visibility_cache| Configuration { visibility_cache, light_sampler, ..*base })
        .to_vec();

    // Resampling by visibility
    let ris = Configuration {
        estimator: EstimatorKind::Ris,
        heuristic: Heuristic::Balance,
        target: Target::Visibility,
        ..*base
    };
    all.extend([Absent, Right, Wrong].map(|visibility_cache| Configuration { visibility_cache, ..ris }));
    all.extend([Right, Wrong].map(|visibility_cache| Configuration {
        visibility_cache,
        samples: 1,
        light_sampler,
        ..ris
    }));
    all.push(Configuration {
        visibility_cache: Wrong,
        strata: Strata::None,
        points: ProposalPoints::Independent,
        ..ris
    });
    let control = Configuration { target: Target::VisibilityControl, ..ris };
    all.extend([Absent, Right, Wrong].map(|visibility_cache| Configuration { visibility_cache, ..control }));
    all.push(Configuration { visibility_cache: Wrong, strata: Strata::None, ..control });

    // Other estimators
    let ocv = Configuration { estimator: EstimatorKind::Ocv, samples: 5, light_sampler, ..*base };
    all.extend([Right, Wrong].map(|visibility_cache| Configuration { visibility_cache, ..ocv }));
    all.push(Configuration { visibility_cache: Right, estimator: EstimatorKind::OptimalMis, samples: 8, ..ocv });
    let contributing = Configuration { estimator: EstimatorKind::Contributing, ..*base };
    all.extend([Absent, Empty, Right, Wrong].map(|visibility_cache| Configuration {
        visibility_cache,
        samples: 4,
        ..contributing
    }));
    all.extend([1, 2, 3, 16].map(|samples| Configuration { visibility_cache: Right, samples, ..contributing }));
    all.push(Configuration {
        visibility_cache: Wrong,
        samples: 2,
        noncontributing_samples: 3,
        light_sampler,
        ..contributing
    });
    all
}

/// `ocv` and `optimal-mis` in their unbiased forms.
fn component_configurations(base: &Configuration) -> Vec<Configuration> {
    let base = *base;
    let mut all = [1, 2, 3, 16].map(|samples| Configuration { samples, ..base }).to_vec();
    let pixels = OcvSettings { form: OcvForm::Pixels, ..base.ocv };
    all.extend([1, 2, 5].map(|samples| Configuration { samples, ocv: pixels, ..base }));
    all.push(Configuration { samples: 4, ocv: pixels, sampler: SamplerKind::Independent, ..base });
    all.extend([2, 8].map(|samples| Configuration { samples, estimator: EstimatorKind::OptimalMis, ..base }));
    let few = OcvSettings { components: Some(3), ..base.ocv };
    all.push(Configuration { samples: 8, ocv: few, ..base });
    all.push(Configuration { samples: 8, bsdf_fraction: 0.25, ..base });
    all.extend([LightSamplerKind::Uniform, LightSamplerKind::Power].map(|light_sampler| Configuration {
        samples: 5,
        light_sampler,
        ..base
    }));
    all.push(Configuration { samples: 4, sampler: SamplerKind::Independent, ..base });
    all.push(Configuration { samples: 4, accel: AccelKind::Bvh, ..base });
    all
}

fn ris_configurations(base: &Configuration) -> Vec<Configuration> {
    let base = *base;
    let counts = [(1, 1), (1, 2), (1, 8), (3, 7), (8, 8), (4, 64)];
    let mut all: Vec<_> = counts.map(|(samples, proposals)| Configuration { samples, proposals, ..base }).to_vec();
    all.extend([Strata::None, Strata::Proposals, Strata::Weights].map(|strata| Configuration { strata, ..base }));
    all.extend([Target::Gv, Target::Gvl].map(|target| Configuration { target, ..base }));
    all.extend(
        [LightSamplerKind::Uniform, LightSamplerKind::Power]
            .map(|light_sampler| Configuration { light_sampler, ..base }),
    );
    all.push(Configuration { points: ProposalPoints::Independent, ..base });
    all.push(Configuration { heuristic: Heuristic::Power, ..base });
    all.push(Configuration { sampler: SamplerKind::Independent, ..base });
    all.push(Configuration { accel: AccelKind::Bvh, ..base });
    all
}

/// The command-line name of a choice.
fn name(choice: impl Into<&'static str>) -> &'static str {
    choice.into()
}

/// Writes integrator, estimator and sampler, and all differences from the default.
impl fmt::Display for Configuration {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        // Always written
        match self.cached {
            Some(cached) => write!(f, "irradiance-cache {} ", name(cached))?,
            None => write!(f, "path ")?,
        }
        write!(f, "{} {} N={}", name(self.estimator), name(self.sampler), self.samples)?;
        self.write_estimator(f)?;

        // Written if not the default
        if self.light_sampler != BASE.light_sampler {
            write!(f, " lights={}", name(self.light_sampler))?;
        }
        if let Some(fraction) = self.infinite_fraction {
            write!(f, " infinite-fraction={fraction}")?;
        }
        match self.visibility_cache {
            CacheContents::Absent => {}
            CacheContents::Empty => write!(f, " hints=empty")?,
            CacheContents::Right => write!(f, " hints=right")?,
            CacheContents::Wrong => write!(f, " hints=wrong")?,
        }
        if self.accel != BASE.accel {
            write!(f, " {}", name(self.accel))?;
        }
        Ok(())
    }
}

impl Configuration {
    fn write_estimator(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        // Settings of the estimator
        match self.estimator {
            EstimatorKind::Auto | EstimatorKind::Mc => {}
            EstimatorKind::Mis => {
                write!(f, " {}", name(self.heuristic))?;
                if self.bsdf_fraction != BASE.bsdf_fraction {
                    write!(f, " bsdf-fraction={}", self.bsdf_fraction)?;
                }
            }
            EstimatorKind::Ris => {
                let (strata, points, target) = (name(self.strata), name(self.points), name(self.target));
                write!(
                    f,
                    " M={} {} strata={strata} points={points} target={target}",
                    self.proposals,
                    name(self.heuristic)
                )?;
            }
            EstimatorKind::Ocv => {
                write!(f, " {} bsdf-share={}", name(self.ocv.form), self.bsdf_fraction)?;
                self.write_heuristic(f)?;
                if let Some(components) = self.ocv.components {
                    write!(f, " components={components}")?;
                }
            }
            EstimatorKind::OptimalMis => {
                write!(f, " {}", name(self.optimal_mis))?;
                if self.bsdf_fraction != BASE.bsdf_fraction {
                    write!(f, " bsdf-fraction={}", self.bsdf_fraction)?;
                }
            }
            EstimatorKind::Correlated => {
                write!(f, " {}", name(self.correlated_technique))?;
            }
            EstimatorKind::Contributing => {
                write!(f, " rest={}", self.noncontributing_samples)?;
                self.write_heuristic(f)?;
            }
        }
        Ok(())
    }

    /// Writes the heuristic if it is not the default.
    fn write_heuristic(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.heuristic == BASE.heuristic { Ok(()) } else { write!(f, " {}", name(self.heuristic)) }
    }
}

/// Loads the scene with these settings, as an image of `edge` × `edge` pixels of the same rectangle.
pub(super) fn job(path: &Path, c: &Configuration, edge: u32) -> RenderJob {
    // Estimator
    let options = LoadOptions { resolution: Some([edge; 2]), ..LoadOptions::default() };
    let mut loaded = load(path, &options).map_err(|d| d.to_string()).unwrap();
    assert_eq!(loaded.settings.sampling.spp, SPP, "{}", path.display());
    let settings = &mut loaded.settings.integrator;
    settings.estimator = c.estimator;
    settings.heuristic = Some(c.heuristic);
    settings.samples = Some(c.samples);
    settings.ocv = c.ocv;
    settings.optimal_mis = c.optimal_mis;
    settings.correlated_technique = c.correlated_technique;
    settings.bsdf_fraction = Some(c.bsdf_fraction);
    settings.infinite_fraction = c.infinite_fraction;
    settings.ris.proposals = Proposals::Fixed(c.proposals);
    settings.ris.strata = c.strata;
    settings.ris.points = c.points;
    settings.ris.target = c.target;
    settings.light_sampler = c.light_sampler;
    settings.contributing.noncontributing_samples = Some(c.noncontributing_samples);

    // Integrator
    if let Some(cached) = c.cached {
        settings.kind = IntegratorKind::IrradianceCache;
        settings.cache.cached = cached;
        settings.cache.samples = 64;
        settings.cache.passes = 32;
    }

    // Sampler, ray tracer and visibility cache
    loaded.settings.sampling.sampler = c.sampler;
    let mut job = loaded.job(c.accel, None).unwrap();
    let visibility_cache = cache_with(&job, c.visibility_cache);
    job.lights.set_visibility_cache(visibility_cache);
    job
}
