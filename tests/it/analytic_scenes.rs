//! Scenes whose answer is known: every one with every integrator, estimator, light choice, sampler and ray tracer.
//!
//! The answer stands in the scene file beside its derivation. A configuration renders the 16 pixels with `RUNS`
//! different seeds; the means of the pictures are independent, and Student's t-test compares them with the answer.
//! The significance is `SIGNIFICANCE` for the whole set of tests (Šidák-corrected); seeds are fixed.

use super::light_hints::{Hints, hints};
use lumiris::film::PixelSums;
use lumiris::import::{LoadOptions, load};
use lumiris::lights::LightSamplerKind;
use lumiris::render::{RenderSettings, render};
use lumiris::scene::{AccelKind, World};
use lumiris::settings::{
    CorrelatedForm, CorrelatedSettings, EstimatorKind, IntegratorKind, OcvSettings, OptimalForm, ProposalPoints,
    Proposals, SamplingTechnique, Strata, Target,
};
use lumiris_numbers::estimators::mis::Heuristic;
use lumiris_numbers::estimators::ocv::Form;
use lumiris_numbers::estimators::stats::{Welford, sidak, t_test};
use lumiris_numbers::samplers::SamplerKind;
use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;

const RUNS: u32 = 12;
/// Probability that any test of the whole set fails by chance.
const SIGNIFICANCE: f64 = 1e-3;
/// What f32 arithmetic may be off where there is no noise, relative.
const ROUNDING: f64 = 3e-5;

pub fn scene_files() -> Vec<PathBuf> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/analytic");
    let mut files: Vec<PathBuf> = std::fs::read_dir(folder).unwrap().map(|e| e.unwrap().path()).collect();
    files.retain(|p| p.extension().is_some_and(|e| e == "pbrt"));
    files.sort();
    assert!(files.len() >= 19, "the analytic scenes are there");
    files
}

pub fn answer(path: &Path) -> [f64; 3] {
    let text = std::fs::read_to_string(path).unwrap();
    let line = text.lines().find_map(|l| l.strip_prefix("# answer:")).unwrap();
    let values: Vec<f64> = line.split_whitespace().map(|v| v.parse().unwrap()).collect();
    values.try_into().unwrap()
}

#[derive(Clone, Copy, Debug)]
struct Configuration {
    estimator: EstimatorKind,
    heuristic: Heuristic,
    samples: u32,
    /// Of `ocv`.
    ocv: OcvSettings,
    optimal_mis: OptimalForm,
    correlated: CorrelatedSettings,
    bsdf_share: f32,
    /// Of `ris`.
    proposals: u32,
    strata: Strata,
    points: ProposalPoints,
    target: Target,
    light_choice: LightSamplerKind,
    /// What photons tell of the visibility of lights.
    hints: Hints,
    /// Of `contributing`.
    rest_samples: u32,
    sampler: SamplerKind,
    accel: AccelKind,
}

fn configurations() -> Vec<Configuration> {
    let base = Configuration {
        estimator: EstimatorKind::Mis,
        heuristic: Heuristic::Power,
        samples: 2,
        ocv: OcvSettings::default(),
        optimal_mis: OptimalForm::Progressive,
        correlated: CorrelatedSettings::default(),
        bsdf_share: 0.5,
        proposals: 16,
        strata: Strata::Systematic,
        points: ProposalPoints::Stratified,
        target: Target::Fgl,
        light_choice: LightSamplerKind::Tree,
        hints: Hints::Absent,
        rest_samples: 1,
        sampler: SamplerKind::SobolBlueNoise,
        accel: AccelKind::Embree,
    };
    let mut all = vec![base];
    all.extend([1, 3, 16].map(|samples| Configuration { samples, ..base }));
    all.extend([Heuristic::Balance, Heuristic::Maximum].map(|heuristic| Configuration { heuristic, ..base }));
    all.extend([1, 4].map(|samples| Configuration { estimator: EstimatorKind::Mc, samples, ..base }));
    all.extend(
        [LightSamplerKind::Uniform, LightSamplerKind::Power].map(|light_choice| Configuration { light_choice, ..base }),
    );
    all.extend([SamplerKind::Independent, SamplerKind::Sobol].map(|sampler| Configuration { sampler, ..base }));
    all.push(Configuration { accel: AccelKind::Bvh, ..base });
    all.push(Configuration { accel: AccelKind::Bvh, estimator: EstimatorKind::Mc, ..base });
    all.extend(ris_configurations(&Configuration {
        estimator: EstimatorKind::Ris,
        heuristic: Heuristic::Balance,
        ..base
    }));
    all.extend(component_configurations(&Configuration { estimator: EstimatorKind::Ocv, ..base }));
    all.extend(correlated_configurations(&Configuration { estimator: EstimatorKind::Correlated, ..base }));
    all
}

/// Everything that asks photons which lights are seen, whatever they say.
fn hinted_configurations() -> Vec<Configuration> {
    use Hints::{Absent, Empty, Right, Wrong};
    let base = &configurations()[0];
    let light_choice = LightSamplerKind::Photons;
    let mut all = [Absent, Empty, Right, Wrong].map(|hints| Configuration { hints, light_choice, ..*base }).to_vec();
    let ris = Configuration {
        estimator: EstimatorKind::Ris,
        heuristic: Heuristic::Balance,
        target: Target::Visibility,
        ..*base
    };
    all.extend([Absent, Right, Wrong].map(|hints| Configuration { hints, ..ris }));
    all.extend([Right, Wrong].map(|hints| Configuration { hints, samples: 1, light_choice, ..ris }));
    all.push(Configuration { hints: Wrong, strata: Strata::None, points: ProposalPoints::Independent, ..ris });
    let ocv = Configuration { estimator: EstimatorKind::Ocv, samples: 5, light_choice, ..*base };
    all.extend([Right, Wrong].map(|hints| Configuration { hints, ..ocv }));
    all.push(Configuration { hints: Right, estimator: EstimatorKind::OptimalMis, samples: 8, ..ocv });
    let correlated = CorrelatedSettings { form: CorrelatedForm::Crossfit, technique: SamplingTechnique::Light };
    all.push(Configuration { estimator: EstimatorKind::Correlated, correlated, hints: Right, ..ocv });
    let contributing = Configuration { estimator: EstimatorKind::Contributing, ..*base };
    all.extend([Absent, Empty, Right, Wrong].map(|hints| Configuration { hints, samples: 4, ..contributing }));
    all.extend([1, 2, 3, 16].map(|samples| Configuration { hints: Right, samples, ..contributing }));
    all.push(Configuration { hints: Wrong, samples: 2, rest_samples: 3, light_choice, ..contributing });
    all
}

/// `correlated` in its unbiased form.
fn correlated_configurations(base: &Configuration) -> Vec<Configuration> {
    let of = |technique| Configuration {
        correlated: CorrelatedSettings { form: CorrelatedForm::Crossfit, technique },
        ..*base
    };
    let (bsdf, light) = (of(SamplingTechnique::Bsdf), of(SamplingTechnique::Light));
    let mut all = [1, 2, 3, 4, 16].map(|samples| Configuration { samples, ..bsdf }).to_vec();
    all.extend([1, 2, 5, 16].map(|samples| Configuration { samples, ..light }));
    all.extend([LightSamplerKind::Uniform, LightSamplerKind::Power].map(|light_choice| Configuration {
        samples: 5,
        light_choice,
        ..light
    }));
    all.push(Configuration { samples: 4, sampler: SamplerKind::Independent, ..bsdf });
    all.push(Configuration { samples: 4, accel: AccelKind::Bvh, ..bsdf });
    all
}

/// `ocv` and `optimal-mis` in their unbiased forms.
fn component_configurations(base: &Configuration) -> Vec<Configuration> {
    let base = *base;
    let mut all = [1, 2, 3, 16].map(|samples| Configuration { samples, ..base }).to_vec();
    let crossfit = OcvSettings { form: Form::Crossfit, ..base.ocv };
    all.extend([2, 5, 16].map(|samples| Configuration { samples, ocv: crossfit, ..base }));
    all.extend([2, 8].map(|samples| Configuration { samples, estimator: EstimatorKind::OptimalMis, ..base }));
    let few = OcvSettings { components: Some(3), ..base.ocv };
    all.push(Configuration { samples: 8, ocv: few, ..base });
    all.push(Configuration { samples: 8, bsdf_share: 0.25, ..base });
    all.extend([LightSamplerKind::Uniform, LightSamplerKind::Power].map(|light_choice| Configuration {
        samples: 5,
        light_choice,
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
        [LightSamplerKind::Uniform, LightSamplerKind::Power].map(|light_choice| Configuration { light_choice, ..base }),
    );
    all.push(Configuration { points: ProposalPoints::Independent, ..base });
    all.push(Configuration { heuristic: Heuristic::Power, ..base });
    all.push(Configuration { sampler: SamplerKind::Independent, ..base });
    all.push(Configuration { accel: AccelKind::Bvh, ..base });
    all
}

fn world(path: &Path, c: &Configuration) -> World {
    let mut scene = load(path, &LoadOptions::default()).map_err(|d| d.to_string()).unwrap().scene;
    scene.integrator.estimator = c.estimator;
    scene.integrator.heuristic = Some(c.heuristic);
    scene.integrator.samples = Some(c.samples);
    scene.integrator.ocv = c.ocv;
    scene.integrator.optimal_mis = c.optimal_mis;
    scene.integrator.correlated = c.correlated;
    scene.integrator.bsdf_share = c.bsdf_share;
    scene.integrator.ris.proposals = Proposals::Fixed(c.proposals);
    scene.integrator.ris.strata = c.strata;
    scene.integrator.ris.points = c.points;
    scene.integrator.ris.target = c.target;
    scene.integrator.light_choice = c.light_choice;
    scene.integrator.contributing.rest_samples = c.rest_samples;
    scene.lights.set_kind(c.light_choice);
    scene.sampling.sampler = c.sampler;
    let mut world = World::new(scene, c.accel, None).unwrap();
    let hints = hints(&world, c.hints);
    world.scene.lights.set_hints(hints);
    world
}

/// Means of the pictures of `RUNS` seeds, per channel.
pub fn picture_means(world: &mut World) -> [Welford; 3] {
    let mut means = [Welford::default(); 3];
    for seed in 0..RUNS {
        world.scene.sampling.seed = seed;
        let settings = RenderSettings { threads: Some(1), spp: world.scene.sampling.spp, ..RenderSettings::default() };
        let film = render(world, &settings, &AtomicBool::new(false), &|_| ()).unwrap().film;
        for (channel, mean) in means.iter_mut().enumerate() {
            let sum: f64 = film.pixels.iter().map(|p: &PixelSums| p.mean()[channel]).sum();
            mean.add(sum / film.pixels.len() as f64);
        }
    }
    means
}

/// Compares the answers of all scenes.
fn check(list: &[Configuration]) {
    let files = scene_files();
    let tests = files.len() * (configurations().len() + hinted_configurations().len()) * 3;
    let significance = sidak(SIGNIFICANCE, tests);
    let mut failures = Vec::new();
    for path in &files {
        let answer = answer(path);
        for c in list {
            let means = picture_means(&mut world(path, c));
            for (channel, mean) in means.iter().enumerate() {
                let exact = (mean.mean() - answer[channel]).abs() <= ROUNDING * answer[channel].abs();
                if !exact && t_test(mean, answer[channel]).p_value < significance {
                    failures.push(format!(
                        "{} {c:?}: channel {channel} {mean:?}, not {}",
                        path.display(),
                        answer[channel]
                    ));
                }
            }
        }
    }
    assert!(failures.is_empty(), "{} of {tests}:\n{}", failures.len(), failures.join("\n"));
}

#[test]
fn every_configuration_gives_the_known_answer() {
    check(&configurations());
}

#[test]
fn whatever_photons_say_of_lights_the_answer_is_the_known_one() {
    check(&hinted_configurations());
}

#[test]
fn the_test_notices_a_bias_of_one_percent() {
    // The oracle itself: with the answer moved by 1 %, scenes with noise and without it must fail.
    for name in ["rectangle", "point", "furnace-closed-4"] {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/analytic").join(name).with_extension("pbrt");
        let means = picture_means(&mut world(&path, &configurations()[3]));
        let wrong = answer(&path)[0] * 1.01;
        assert!(t_test(&means[0], wrong).p_value < 1e-4, "{name}: {:?} passes for {wrong}", means[0]);
    }
}

#[test]
fn forms_that_fit_their_own_samples_are_near_the_answer() {
    // Biased, by O(1/N): at N = 64 by less than 5 % here
    for name in ["rectangle", "hidden-rectangle", "many-points", "half-environment", "sphere"] {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/analytic").join(name).with_extension("pbrt");
        let base = Configuration { estimator: EstimatorKind::Ocv, samples: 64, ..configurations()[0] };
        let form = |form| Configuration { ocv: OcvSettings { form, ..base.ocv }, ..base };
        let direct = Configuration { estimator: EstimatorKind::OptimalMis, optimal_mis: OptimalForm::Direct, ..base };
        let combined = |technique| Configuration {
            estimator: EstimatorKind::Correlated,
            correlated: CorrelatedSettings { form: CorrelatedForm::Combined, technique },
            ..base
        };
        let [bsdf, light] = [SamplingTechnique::Bsdf, SamplingTechnique::Light].map(combined);
        for c in [form(Form::Paper), form(Form::Regression), direct, bsdf, light] {
            let mean = picture_means(&mut world(&path, &c))[0].mean();
            let ratio = mean / answer(&path)[0];
            assert!((ratio - 1.0).abs() < 0.05, "{name} {c:?}: {ratio}");
        }
    }
}

#[test]
fn direct_is_path_of_one_bounce() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/analytic/furnace-closed-4.pbrt");
    let mut world = world(&path, &configurations()[0]);
    world.scene.integrator.kind = IntegratorKind::Direct;
    let settings = RenderSettings { spp: 4, ..RenderSettings::default() };
    let direct = render(&world, &settings, &AtomicBool::new(false), &|_| ()).unwrap().film;
    world.scene.integrator.kind = IntegratorKind::Path;
    world.scene.integrator.max_depth = 1;
    let path = render(&world, &settings, &AtomicBool::new(false), &|_| ()).unwrap().film;
    let means = |film: &lumiris::film::Film| film.pixels.iter().map(PixelSums::mean).collect::<Vec<_>>();
    assert_eq!(means(&direct), means(&path));
}
