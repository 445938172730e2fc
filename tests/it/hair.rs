//! Curves and hair: parser errors, both ray tracers, and known answers.

use lumiris::accel::bvh::Bvh;
use lumiris::film::PixelSums;
use lumiris::geometry::Shape;
use lumiris::import::cache::FileCache;
use lumiris::import::{LoadOptions, Loaded, load_text};
use lumiris::render::{RenderSettings, render};
use lumiris::scene::{AccelKind, RenderJob};
use lumiris::settings::EstimatorKind;
use lumiris_bench::crosscheck::crosscheck;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

const HEAD: &str = r#"LookAt 0 0 -4  0 0 0  0 1 0
Camera "perspective" "float fov" 30
Film "rgb" "integer xresolution" 16 "integer yresolution" 16
Integrator "path" "integer maxdepth" 200
WorldBegin
LightSource "infinite" "rgb L" [ 1 1 1 ]
"#;

fn try_load(world: &str) -> Result<Loaded, String> {
    let text = format!("{HEAD}{world}");
    load_text(&text, "hair.pbrt", Path::new("."), &LoadOptions::default(), &FileCache::default())
        .map_err(|d| d.to_string())
}

fn job(world: &str, accel: AccelKind) -> RenderJob {
    try_load(world).unwrap().job(accel, None).unwrap()
}

/// Curves of all kinds that cross each other, directly and in an instance.
fn tangle(count: u32) -> String {
    let mut text = String::new();
    for i in 0..count {
        let x = |k: u32| (f64::from(i * 7 + k) * 12.9898).sin() * 0.9;
        let kind = ["flat", "cylinder", "ribbon"][i as usize % 3];
        let points: Vec<String> = (0..12).map(|k| format!("{:.4}", x(k))).collect();
        let normals = if kind == "ribbon" { "\"normal N\" [ 0 0 1  0 1 0.5 ]" } else { "" };
        let basis = if i % 2 == 0 { "bezier" } else { "bspline" };
        let points = points.join(" ");
        text += &format!(
            "Shape \"curve\" \"string type\" \"{kind}\" \"string basis\" \"{basis}\" \"point3 P\" [ {points} ] {normals}\
             \"float width0\" 0.08 \"float width1\" 0.02\n"
        );
    }
    text
}

#[test]
fn wrong_curves_are_errors_with_a_place() {
    let wrong = [
        (r#""point3 P" [ 0 0 0  1 0 0  2 0 0 ]"#, "3 control points", "hair.pbrt:7:"),
        (r#""point3 P" [ 0 0 0  1 0 0  2 0 0  3 0 0  4 0 0 ]"#, "4, 7, 10", "hair.pbrt:7:"),
        (r#""integer degree" 4 "point3 P" [ 0 0 0  1 0 0  2 0 0  3 0 0 ]"#, "2 or 3, not 4", "hair.pbrt:7:"),
        (r#""float width" -1 "point3 P" [ 0 0 0  1 0 0  2 0 0  3 0 0 ]"#, "not negative, not -1", "hair.pbrt:7:"),
        (r#""float width1" -2 "point3 P" [ 0 0 0  1 0 0  2 0 0  3 0 0 ]"#, "width1", "hair.pbrt:7:"),
        (r#""string type" "flatt" "point3 P" [ 0 0 0  1 0 0  2 0 0  3 0 0 ]"#, "did you mean `flat`", "hair.pbrt:7:"),
        (r#""string type" "ribbon" "point3 P" [ 0 0 0  1 0 0  2 0 0  3 0 0 ]"#, "needs 2 normals", "hair.pbrt:7:"),
        (r#""string basis" "nurbs" "point3 P" [ 0 0 0  1 0 0  2 0 0  3 0 0 ]"#, "basis", "hair.pbrt:7:"),
        ("", "needs `point3 P`", "hair.pbrt:7:"),
    ];
    for (parameters, message, place) in wrong {
        let Err(error) = try_load(&format!("Shape \"curve\" {parameters}\n")) else { panic!("{parameters}") };
        assert!(error.contains(message) && error.contains(place), "{parameters}: {error}");
    }
}

#[test]
fn all_bases_and_degrees_are_the_same_curve() {
    let curve = |parameters: &str| {
        let loaded = try_load(&format!("Shape \"curve\" {parameters}\n")).unwrap();
        match &loaded.scene.geometry.geometries[0].shape {
            Shape::Curves(set) => set.curves().to_vec(),
            other => panic!("{other:?}"),
        }
    };
    // The same straight line with the same parametrisation
    let cubic = curve(r#""point3 P" [ 0 0 0  1 0 0  2 0 0  3 0 0 ]"#);
    let same = [
        r#""integer degree" 2 "point3 P" [ 0 0 0  1.5 0 0  3 0 0 ]"#,
        r#""string basis" "bspline" "point3 P" [ -3 0 0  0 0 0  3 0 0  6 0 0 ]"#,
        r#""string basis" "bspline" "integer degree" 2 "point3 P" [ -1.5 0 0  1.5 0 0  4.5 0 0 ]"#,
    ];
    for parameters in same {
        let found = curve(parameters);
        assert_eq!(found.len(), 1);
        for (a, b) in found[0].points.iter().zip(cubic[0].points) {
            assert!((*a - b).length() < 1e-6, "{parameters} {found:?}");
        }
    }
    let two =
        curve(r#""point3 P" [ 0 0 0  1 0 0  2 0 0  3 0 0  4 0 0  5 0 0  6 1 0 ] "float width0" 1 "float width1" 0"#);
    assert_eq!((two.len(), two[0].width, two[1].width), (2, [1.0, 0.5], [0.5, 0.0]));
}

#[test]
fn directives_that_are_alike_share_a_geometry() {
    let line = "Shape \"curve\" \"point3 P\" [ 0 0 0  1 0 0  2 0 0  3 0 0 ] \"float width\" 0.1\n";
    let all = line.repeat(1000);
    let loaded = try_load(&format!("{all}Material \"hair\"\n{all}Translate 1 0 0\n{all}")).unwrap();
    let set = &loaded.scene.geometry;
    assert_eq!((set.geometries.len(), set.primitive_counts().curves), (3, 3000));
}

#[test]
fn embree_and_the_bvh_meet_the_same_curves() {
    let world = tangle(60);
    let text =
        format!("{world}ObjectBegin \"o\"\n{world}ObjectEnd\nScale 0.5 1.5 1\nRotate 40 1 2 3\nObjectInstance \"o\"\n");
    let job = job(&text, AccelKind::Embree);
    let bvh = Bvh::new(Arc::clone(&job.world.scene.geometry), None);
    let report = crosscheck(&job, &bvh, 20_000);
    assert!(report.tallies.iter().any(|(_, tally)| tally.hits > 2000), "{report:#?}");
    assert_eq!(report.disagreements(), 0, "{report:#?}");
}

/// Mean and standard error of the image over seeds.
fn mean_of_images(job: &mut RenderJob, estimator: EstimatorKind, seeds: u32, spp: u32) -> (f64, f64) {
    let images: Vec<f64> = (0..seeds)
        .map(|seed| {
            job.change(|s| {
                s.sampling.seed = seed + 1000 * estimator as u32;
                s.integrator.estimator = estimator;
            });
            let settings = RenderSettings { spp, ..RenderSettings::default() };
            let film = render(job, &settings, &AtomicBool::new(false), &|_| ()).unwrap().film;
            let pixels: Vec<f64> = film.pixels().iter().map(|p| PixelSums::mean(p)[1]).collect();
            pixels.iter().sum::<f64>() / pixels.len() as f64
        })
        .collect();
    let n = f64::from(seeds);
    let mean = images.iter().sum::<f64>() / n;
    let variance = images.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / (n - 1.0);
    (mean, (variance / n).sqrt())
}

#[test]
fn hair_without_absorption_vanishes_in_a_furnace() {
    // Fibres lose nothing, so every path ends in light of radiance 1. |t| < 5.2 with 31 degrees of freedom has a level
    // of 10⁻⁵. The tolerance of 0.1 % covers paths cut off at depth 200.
    let world = format!("Material \"hair\" \"rgb sigma_a\" [ 0 0 0 ]\n{}", tangle(40));
    let mut job = job(&world, AccelKind::Embree);
    for estimator in [EstimatorKind::Mc, EstimatorKind::Mis, EstimatorKind::Ris] {
        let (mean, error) = mean_of_images(&mut job, estimator, 32, 16);
        assert!((mean - 1.0).abs() < 5.2 * error + 1e-3, "{estimator:?}: {mean} ± {error}");
        assert!(error < 0.01, "{estimator:?}: a bias of 5 % would pass: {error}");
    }
}

#[test]
fn estimators_and_tracers_agree_on_brown_hair() {
    let world = format!("Material \"hair\"\n{}", tangle(40));
    let mut answers = Vec::new();
    for accel in [AccelKind::Embree, AccelKind::Bvh] {
        let mut job = job(&world, accel);
        for estimator in [EstimatorKind::Mc, EstimatorKind::Mis, EstimatorKind::Ris] {
            answers.push((accel, estimator, mean_of_images(&mut job, estimator, 16, 16)));
        }
    }
    // The tracers have the same bits
    for i in 0..3 {
        assert_eq!(answers[i].2, answers[i + 3].2, "{answers:?}");
    }
    let (reference, e0) = answers[1].2;
    assert!(reference < 0.95, "the hair absorbs: {reference}");
    for (accel, estimator, (mean, error)) in answers {
        let t = (mean - reference) / (error.hypot(e0)).max(1e-12);
        assert!(t.abs() < 5.5, "{accel:?} {estimator:?}: {mean} ± {error}, {reference} ± {e0}");
    }
}
