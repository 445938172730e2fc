//! Table of feature conflicts: each row refuses with its own sentence, and all allowed combinations have the light of
//! plain path tracing.

use lumiris::film::Film;
use lumiris::import::cache::FileCache;
use lumiris::import::{LoadOptions, load_text};
use lumiris::integrators::exclusions::{Feature, OPTIONAL, TABLE, between, conflict, refusal};
use lumiris::integrators::{light_layers, light_paths, reuse};
use lumiris::planning::{Preparation, prepare};
use lumiris::render::output::{Aov, layers};
use lumiris::render::{RenderSettings, render};
use lumiris::scene::{AccelKind, RenderJob};
use lumiris::settings::{EstimatorKind, IntegratorKind, IntegratorSettings, OcvForm, Target};
use lumiris_numbers::estimators::stats::Welford;
use lumiris_test_support::power::by_power;
use lumiris_test_support::significance::{critical_t, detectable_deviation};
use rayon::prelude::*;
use std::collections::HashMap;
use std::path::Path;
use std::sync::atomic::AtomicBool;

/// A scene in parts, with its integrator settings.
#[derive(Clone)]
struct Scene {
    before: String,
    camera: &'static str,
    lamp: &'static str,
    shapes: String,
    settings: IntegratorSettings,
}

impl Scene {
    /// A corner with a metal ball, below a lamp and a dim sky.
    fn new() -> Scene {
        // In a form that features can change
        Scene {
            before: String::new(),
            camera: r#""perspective" "float fov" 50 "float shutterclose" 1"#,
            lamp: r#"AttributeBegin AreaLightSource "diffuse" "rgb L" [5 4 3] "string lightgroup" "key"
                Shape "bilinearmesh" "point3 P" [-1 2.8 -1  1 2.8 -1  -1 2.8 1  1 2.8 1] AttributeEnd"#,
            shapes: r#"LightSource "infinite" "rgb L" [0.2 0.3 0.4]
                Material "diffuse" "rgb reflectance" [0.7 0.6 0.5]
                Shape "bilinearmesh" "point3 P" [-3 0 -3  3 0 -3  -3 0 3  3 0 3]
                Shape "bilinearmesh" "point3 P" [-3 0 1.5  3 0 1.5  -3 3 1.5  3 3 1.5]
                AttributeBegin Material "conductor" "float roughness" 0.2
                Translate 0.8 0.4 0 Shape "sphere" "float radius" 0.4 AttributeEnd "#
                .to_owned(),
            settings: IntegratorSettings {
                estimator: EstimatorKind::Mis,
                samples: Some(4),
                max_depth: 4,
                light_groups: false,
                ..IntegratorSettings::default()
            },
        }
    }

    fn with(features: &[&Entry]) -> Scene {
        let mut scene = Scene::new();
        features.iter().for_each(|(_, _, change)| change(&mut scene));
        scene
    }

    fn estimate_by(&mut self, estimator: EstimatorKind) {
        self.settings.estimator = estimator;
    }

    fn resample_for(&mut self, target: Target) {
        (self.settings.estimator, self.settings.ris.target) = (EstimatorKind::Ris, target);
    }

    fn job(&self) -> RenderJob {
        let Scene { before, camera, lamp, shapes, settings } = self;
        let text = format!(
            r#"{before} LookAt 0 1.2 -4  0 0.8 0  0 1 0  Camera {camera} MediumInterface "" ""
            Film "rgb" "integer xresolution" 8 "integer yresolution" 8 WorldBegin {lamp} {shapes}"#
        );
        let loaded = load_text(&text, "features", Path::new("."), &LoadOptions::default(), &FileCache::default());
        let mut loaded = loaded.map_err(|d| d.to_string()).unwrap();
        loaded.settings.integrator = *settings;
        loaded.job(AccelKind::Embree, None).unwrap()
    }

    /// Everything that distinguishes scenes rendered by plain paths.
    fn key(&self) -> String {
        format!("{:?}", (&self.before, self.camera, self.lamp, &self.shapes, self.settings))
    }

    /// The same scene with plain paths only.
    fn plain(&self) -> Scene {
        let IntegratorSettings { kind, max_depth, .. } = self.settings;
        let base = Scene::new().settings;
        let settings = IntegratorSettings { kind, max_depth, estimator: EstimatorKind::Mc, samples: Some(2), ..base };
        Scene { settings, ..self.clone() }
    }
}

/// A feature, and a change that gives it to a scene. Two features never change the same part.
type Entry = (&'static str, Feature, fn(&mut Scene));

const ALL: &[Entry] = &[
    ("mist", Feature::Media, |s| {
        s.before += r#"MakeNamedMedium "mist" "rgb sigma_a" [0.01 0.01 0.02] "rgb sigma_s" [0.03 0.02 0.02]
            MediumInterface "" "mist" "#;
    }),
    ("subsurface", Feature::Media, |s| {
        s.shapes += r#"AttributeBegin Material "subsurface" "rgb reflectance" [0.8 0.5 0.2] "float mfp" 0.3
            Translate -0.8 0.4 -0.6 Shape "sphere" "float radius" 0.4 AttributeEnd "#;
    }),
    ("volume emission", Feature::VolumeEmission, |s| {
        s.shapes += r#"MakeNamedMedium "glow" "rgb sigma_a" [0.6 0.6 0.6] "rgb sigma_s" [0.5 0.5 0.5] "rgb Le" [0.6 0.4 0.2]
            AttributeBegin MediumInterface "glow" "" Material "interface"
            Translate -0.6 1.4 0 Shape "sphere" "float radius" 0.4 AttributeEnd "#;
    }),
    ("interface", Feature::Passable, |s| {
        s.shapes += r#"MakeNamedMaterial "nothing" "string type" "interface"
            MakeNamedMaterial "black" "string type" "diffuse" "rgb reflectance" [0 0 0]
            AttributeBegin Material "mix" "string materials" ["nothing" "black"] "float amount" 0.5
            Shape "bilinearmesh" "point3 P" [-1.5 1.6 -0.5  0 1.6 -0.5  -1.5 1.6 1  0 1.6 1] AttributeEnd "#;
    }),
    ("alpha", Feature::Alpha, |s| {
        s.shapes += r#"AttributeBegin Material "diffuse" Shape "bilinearmesh" "float alpha" 0.5
            "point3 P" [-1.5 1.5 -0.4  0 1.5 -0.4  -1.5 1.5 1.1  0 1.5 1.1] AttributeEnd "#;
    }),
    ("motion", Feature::MovingObjects, |s| {
        s.shapes += r#"AttributeBegin ActiveTransform EndTime Translate 1 0.3 0 ActiveTransform All
            Translate -1 0.6 0.4 Shape "sphere" "float radius" 0.5 AttributeEnd "#;
    }),
    ("moving camera", Feature::MovingCamera, |s| {
        s.before += "ActiveTransform EndTime Translate 0.5 0 0 ActiveTransform All ";
    }),
    ("dispersion", Feature::Dispersion, |s| {
        s.shapes += r#"AttributeBegin Material "dielectric" "spectrum eta" "glass-SF11" "float roughness" 0.2
            Translate -0.2 0.5 -0.9 Shape "sphere" "float radius" 0.3 AttributeEnd "#;
    }),
    ("point light", Feature::NoAreaLight, |s| {
        s.lamp = r#"LightSource "point" "rgb I" [5 4 3] "point3 from" [0.3 2.8 0] "string lightgroup" "key""#;
    }),
    ("parallel rays", Feature::NoProjection, |s| {
        s.camera = r#""orthographic" "float screenwindow" [-1.5 1.5 -1.5 1.5] "float shutterclose" 1"#;
    }),
    ("direct", Feature::Integrator(IntegratorKind::Direct), |s| {
        s.settings = s.settings.of_kind(IntegratorKind::Direct);
    }),
    ("cache", Feature::Integrator(IntegratorKind::IrradianceCache), |s| {
        s.settings.kind = IntegratorKind::IrradianceCache;
    }),
    ("photon map", Feature::Integrator(IntegratorKind::PhotonMap), |s| s.settings.kind = IntegratorKind::PhotonMap),
    ("one bounce", Feature::Fewer(2), |s| s.settings.max_depth = 1),
    ("two bounces", Feature::Fewer(3), |s| s.settings.max_depth = 2),
    ("one sample", Feature::OtherContinuation, |s| s.settings.samples = Some(1)),
    ("ocv", Feature::Estimator(EstimatorKind::Ocv), |s| s.estimate_by(EstimatorKind::Ocv)),
    ("optimal mis", Feature::Estimator(EstimatorKind::OptimalMis), |s| s.estimate_by(EstimatorKind::OptimalMis)),
    ("correlated", Feature::Estimator(EstimatorKind::Correlated), |s| s.estimate_by(EstimatorKind::Correlated)),
    ("contributing", Feature::Estimator(EstimatorKind::Contributing), |s| s.estimate_by(EstimatorKind::Contributing)),
    ("progressive", Feature::Progressive, |s| {
        (s.settings.estimator, s.settings.ocv.form) = (EstimatorKind::Ocv, OcvForm::Progressive);
    }),
    ("fgl", Feature::Target(Target::Fgl), |s| s.resample_for(Target::Fgl)),
    ("gv", Feature::Target(Target::Gv), |s| s.resample_for(Target::Gv)),
    ("gvl", Feature::Target(Target::Gvl), |s| s.resample_for(Target::Gvl)),
    ("visibility", Feature::Target(Target::Visibility), |s| s.resample_for(Target::Visibility)),
    ("control", Feature::Target(Target::VisibilityControl), |s| s.resample_for(Target::VisibilityControl)),
    ("light groups", Feature::LightGroups, |s| s.settings.light_groups = true),
    ("light paths", Feature::LightPaths, |s| s.settings.light_paths = Some(1.0)),
    ("shared paths", Feature::Sharing, |s| s.settings.path_reuse = Some(3)),
];

fn film(job: &RenderJob, spp: u32) -> Result<Film, String> {
    let settings = RenderSettings { spp, threads: Some(1), ..RenderSettings::default() };
    let rendering = render(job, &settings, &AtomicBool::new(false), &|_| ());
    rendering.map(|rendering| rendering.film).map_err(|error| error.to_string())
}

/// The message is the row's sentence. Conflicting settings are refused, or ignored with a warning.
#[test]
fn each_row_of_the_table_excludes_by_its_own_sentence() {
    let entry = |feature| ALL.iter().find(|entry| entry.1 == feature);
    let mut pairs = 0;
    for &(features, all, why) in TABLE {
        for (&feature, &by) in features.iter().flat_map(|feature| all.iter().map(move |by| (feature, by))) {
            pairs += 1;
            let sentence = between(feature, by).unwrap().to_string();
            assert!(sentence.contains(why), "{feature:?}, {by:?}: {sentence}");
            let (Some(one), Some(other)) = (entry(feature), entry(by)) else { continue };
            let mut job = Scene::with(&[one, other]).job();
            let settings = job.settings().integrator;
            let found = conflict(&job, &settings, feature).map(|conflict| conflict.to_string());
            assert_eq!(found.as_ref(), Some(&sentence), "{feature:?}, {by:?}");
            if OPTIONAL.iter().any(|row| row.0 == feature) {
                let warnings = prepare(&mut job, &Preparation::on(Some(1))).unwrap().warnings;
                let is_said = warnings.iter().any(|warning| warning.ends_with(&sentence));
                // Options without effect on an integrator have another warning
                assert!(
                    is_said || matches!(by, Feature::Integrator(_) | Feature::Fewer(2)),
                    "{sentence}: {warnings:?}"
                );
                let kept = (reuse::edge(&job), light_paths::per_sample(&job), light_layers::count(&job));
                match feature {
                    Feature::Sharing => assert_eq!(kept.0, 1),
                    Feature::LightPaths => assert!(kept.1 == 0.0),
                    _ => assert_eq!(kept.2, 0),
                }
            } else {
                assert_eq!(film(&job, 1).err(), Some(sentence));
            }
        }
    }
    assert_eq!(pairs, 43, "a row is missing, or this number");
}

/// Means of the channels over images of these seeds, and of all light layers if there are any.
fn means(scene: &Scene, seeds: std::ops::Range<u32>) -> [Welford; 3] {
    let mut job = scene.job();
    prepare(&mut job, &Preparation::on(Some(1))).unwrap();
    let mut means = [Welford::default(); 3];
    for seed in seeds {
        job.change(|s| s.sampling.seed = seed);
        let film = film(&job, 8).unwrap();
        let images = layers(&film, &[Aov::LightGroups], None);
        let parts = if light_layers::count(&job) > 0 { &images[1..] } else { &images[..] };
        let pixels = || parts.iter().flat_map(|(_, image)| image.data.as_chunks::<3>().0);
        for (c, mean) in means.iter_mut().enumerate() {
            mean.add(pixels().map(|pixel| f64::from(pixel[c])).sum::<f64>() / film.len() as f64);
        }
    }
    means
}

/// Two-sided t-tests of three channels of 169 pairs, at a level of 10⁻⁷ each: correct images are rejected with a
/// probability below 10⁻⁴. A bias of 30 % (10 % in `make test-power`) is detected with a probability of 0.99.
#[test]
fn features_that_the_table_allows_have_the_light_of_plain_paths() {
    let count = by_power(48, 12);
    let freedom = u64::from(2 * count - 2);
    let (limit, deviation) = (critical_t(1e-7, freedom), detectable_deviation(1e-7, 0.99, freedom));
    // These integrators are biased, and so is `correlated`, which weights its two estimates with the same samples
    let is_biased = |s: &IntegratorSettings| {
        matches!(s.kind, IntegratorKind::IrradianceCache | IntegratorKind::PhotonMap)
            || s.estimator == EstimatorKind::Correlated
    };
    let allowed = |pair: &[&Entry; 2]| {
        let scene = Scene::with(pair);
        let job = scene.job();
        let works = |entry: &&Entry| {
            entry.1.is_wanted(&job, &scene.settings) && conflict(&job, &scene.settings, entry.1).is_none()
        };
        let is_allowed = refusal(&job, &scene.settings).is_none() && pair.iter().all(works);
        (is_allowed && !is_biased(&scene.settings)).then(|| (format!("{}, {}", pair[0].0, pair[1].0), scene))
    };
    // Without features that are numbers of bounces and samples
    let is_kind = |entry: &&Entry| !matches!(entry.1, Feature::Fewer(_) | Feature::OtherContinuation);
    let all: Vec<&Entry> = ALL.iter().filter(is_kind).collect();
    let pairs: Vec<[&Entry; 2]> =
        (0..all.len()).flat_map(|i| all[..i].iter().map(|one| [*one, all[i]]).collect::<Vec<_>>()).collect();
    let scenes: Vec<(String, Scene)> = pairs.par_iter().filter_map(allowed).collect();
    let plain: HashMap<String, Scene> = scenes.iter().map(|(_, scene)| (scene.plain().key(), scene.plain())).collect();
    let plain: HashMap<&String, _> = plain.par_iter().map(|(key, scene)| (key, means(scene, 0..count))).collect();
    let compare = |(name, scene): &(String, Scene)| {
        let (plain, other) = (&plain[&scene.plain().key()], means(scene, count..2 * count));
        let wrong = plain.iter().zip(&other).filter_map(|(a, b)| {
            let error = a.standard_error().hypot(b.standard_error()) + 1e-6 * a.mean();
            let is_wrong =
                (a.mean() - b.mean()).abs() > limit * error || deviation * error > by_power(0.1, 0.3) * a.mean();
            is_wrong.then(|| format!("{name}: {} ± {error}, not {}", b.mean(), a.mean()))
        });
        wrong.collect::<Vec<_>>()
    };
    let wrong: Vec<String> = scenes.par_iter().flat_map(compare).collect();
    assert!(wrong.is_empty(), "{wrong:#?}");
    assert_eq!(scenes.len(), 169, "a row is missing, or this number");
}
