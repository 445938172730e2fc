//! Scenes with media and the settings: threads, tiles, refusals, `auto`, and messages.

use super::{BOX, camera, cloud, film, job, media};
use lumiris::import::cache::FileCache;
use lumiris::import::{LoadOptions, load_text};
use lumiris::integrators::exclusions::{Feature, allows};
use lumiris::integrators::reuse;
use lumiris::planning::{Preparation, prepare};
use lumiris::render::{RenderSettings, render};
use lumiris::scene::{AccelKind, RenderJob};
use lumiris::settings::{EstimatorKind, IntegratorKind, Target};
use std::path::Path;
use std::sync::atomic::AtomicBool;

#[test]
fn images_through_media_depend_on_neither_threads_nor_tiles() {
    let text = camera("0.3 0.2 3", "", 6)
        + &format!(
            r#"MakeNamedMedium "cloud" {} LightSource "infinite" "rgb L" [1 1 1]
            Material "interface" MediumInterface "cloud" "" {BOX}"#,
            cloud(5.0, 0.1)
        );
    let job = job(&text, AccelKind::Embree);
    let image = |threads, tile_size| {
        let settings = RenderSettings { threads: Some(threads), tile_size, spp: 5, ..RenderSettings::default() };
        film(&job, settings).pixels().iter().map(|p| p.radiance).collect::<Vec<_>>()
    };
    let first = image(1, 16);
    assert!(first.iter().any(|p| p[0] > 0.0));
    for (threads, tile_size) in [(2, 1), (3, 2), (1, 3)] {
        assert_eq!(first, image(threads, tile_size));
    }
}

#[test]
fn settings_that_leave_media_out_are_refused() {
    let text = camera("0 0 3", "", 3)
        + &format!(
            r#"MakeNamedMedium "fog" LightSource "infinite" "rgb L" [1 1 1] Material "interface" MediumInterface "fog" "" {BOX}"#
        );
    let mut job = job(&text, AccelKind::Embree);
    let error = |job: &mut RenderJob| {
        let settings = RenderSettings::default();
        let rendered = render(job, &settings, &AtomicBool::new(false), &|_| ()).map(|_| ()).unwrap_err().to_string();
        assert_eq!(prepare(job, &Preparation::on(None)).unwrap_err().to_string(), rendered);
        rendered
    };
    for kind in [EstimatorKind::Ocv, EstimatorKind::OptimalMis, EstimatorKind::Correlated] {
        job.change(|s| s.integrator.estimator = kind);
        assert!(error(&mut job).contains("auto, mc, mis, ris and contributing"), "{kind:?}");
    }
    job.change(|s| (s.integrator.estimator, s.integrator.ris.target) = (EstimatorKind::Ris, Target::Gvl));
    assert!(error(&mut job).contains("target gvl"));
    job.change(|s| s.integrator.estimator = EstimatorKind::Mis);
    for kind in [IntegratorKind::IrradianceCache, IntegratorKind::PhotonMap] {
        job.change(|s| s.integrator.kind = kind);
        assert!(error(&mut job).contains("direct and path"), "{kind:?}");
    }
    // Path reuse is disabled with a warning
    job.change(|s| (s.integrator.kind, s.integrator.path_reuse) = (IntegratorKind::Path, Some(4)));
    assert!(!allows(&job, Feature::Sharing));
    let plan = prepare(&mut job, &Preparation::on(None)).unwrap();
    assert!(plan.warnings.iter().any(|w| w.contains("media")), "{:?}", plan.warnings);
}

/// `auto` chooses among the estimators that support media, and its image has the right mean.
#[test]
fn auto_knows_media() {
    let text = camera("0.3 0.2 3", "", 30).replace(
        "\"integer xresolution\" 4 \"integer yresolution\" 4",
        "\"integer xresolution\" 64 \"integer yresolution\" 64",
    ) + &format!(
        r#"MakeNamedMedium "fog" "rgb sigma_s" [1 0.5 0.2] "rgb sigma_a" [0 0 0] LightSource "infinite" "rgb L" [1 1 1]
            Material "interface" MediumInterface "fog" "" {BOX}"#
    );
    let mut job = job(&text, AccelKind::Embree);
    job.change(|s| (s.integrator.estimator, s.sampling.spp) = (EstimatorKind::Auto, 1024));
    prepare(&mut job, &Preparation::on(None)).unwrap();
    assert_eq!(reuse::edge(&job), 1);
    job.pixel_samples = None;
    let film = film(&job, RenderSettings { spp: 2, ..RenderSettings::default() });
    let mean = film.pixels().iter().map(|p| p.mean()[0]).sum::<f64>() / film.len() as f64;
    // 8192 samples with a standard deviation below 1
    assert!((mean - 1.0).abs() < 0.06, "{mean}");
}

/// With emissive media, `auto` chooses an estimator that samples their emission as light.
#[test]
fn auto_has_light_samples_of_what_glows() {
    for (depth, edge) in [(1, 16), (5, 16)] {
        // A scene with an emissive medium and 20 point lights
        let resolution = format!("\"integer xresolution\" {edge} \"integer yresolution\" {edge}");
        let mut text =
            camera("0.3 0.2 3", "", depth).replace("\"integer xresolution\" 4 \"integer yresolution\" 4", &resolution);
        text += &format!(
            r#"MakeNamedMedium "fire" {} AttributeBegin Material "interface" MediumInterface "fire" "" {BOX} AttributeEnd
            Shape "trianglemesh" "point3 P" [-9 -9 -2  9 -9 -2  9 9 -2  -9 9 -2] "integer indices" [0 1 2 0 2 3] "#,
            media(0.1, 0.8, r#""rgb Le" [3 2 1]"#)[1].1
        );
        for i in 0..20 {
            text += &format!("LightSource \"point\" \"rgb I\" [ 1 1 1 ] \"point3 from\" [ {i} 3 0 ]\n");
        }

        // `auto` chooses the estimator
        let mut job = job(&text, AccelKind::Embree);
        job.change(|s| {
            (s.integrator.estimator, s.sampling.spp) = (EstimatorKind::Auto, 512);
            s.integrator.kind = if depth == 1 { IntegratorKind::Direct } else { IntegratorKind::Path };
        });
        let plan = prepare(&mut job, &Preparation::on(None)).unwrap();
        assert!(job.lights.samples_volumes(), "{depth} bounces, {edge} pixels: {:?}", plan.chosen);
    }
}

/// Errors in a scene file are reported with their positions.
#[test]
fn faults_in_media_are_reported_with_their_places() {
    // The error report of a scene with the medium
    let report = |medium: &str| {
        let text = format!("WorldBegin\nMakeNamedMedium \"m\" {medium}");
        let loaded = load_text(&text, "media", Path::new("."), &LoadOptions::default(), &FileCache::default());
        loaded.map(|_| ()).unwrap_err().to_string()
    };

    // Wrong parameters and their messages
    let grid = r#""string type" "uniformgrid" "integer nx" 2"#;
    for (medium, fault) in [
        (r#""string type" "fog""#.to_owned(), "unknown medium `fog`"),
        (r#""rgb sigma_a" [-1 0 0]"#.to_owned(), "a colour must not be negative"),
        (r#""float scale" -2"#.to_owned(), "scale must be finite and not negative"),
        (r#""float g" 1.5"#.to_owned(), "g must be from -1 to 1"),
        (r#""string preset" "Milk""#.to_owned(), "unknown preset `Milk`"),
        (r#""float density" 1"#.to_owned(), "density"),
        (format!(r#"{grid} "float density" [1 2 3]"#), "density has 3 values, and nx × ny × nz = 2 × 1 × 1"),
        (format!(r#"{grid} "float density" [1 -2]"#), "density must be finite and not negative"),
        (grid.to_owned(), "a uniformgrid needs `float density`"),
        (
            format!(r#"{grid} "float density" [1 2] "float temperature" [1 2] "rgb Le" [1 1 1]"#),
            "by `Le` or by `temperature`, not by both",
        ),
        (r#""string type" "uniformgrid" "integer nz" 0 "float density" []"#.to_owned(), "nz must be positive, not 0"),
        (r#""string type" "cloud" "point3 p0" [0 1 0]"#.to_owned(), "p0 and p1 must differ along every axis"),
        (r#""string type" "rgbgrid""#.to_owned(), "an rgbgrid needs `rgb sigma_a` or `rgb sigma_s`"),
        (r#""string type" "rgbgrid" "rgb sigma_s" [1 1 1] "rgb Le" [1 1 1]"#.to_owned(), "needs `rgb sigma_a`"),
        (r#""string type" "rgbgrid" "rgb sigma_s" [1 1 1 2 2 2]"#.to_owned(), "sigma_s has 2 values"),
        ("\nMakeNamedMedium \"m\"".to_owned(), "medium `m` is defined twice"),
        ("\nMediumInterface \"n\" \"m\" Shape \"sphere\"".to_owned(), "unknown medium `n`"),
    ] {
        let found = report(&medium);
        assert!(found.contains(fault) && found.contains("media:"), "{medium}: {found}");
    }
}

/// Media without references leave the image unchanged.
#[test]
fn media_that_nothing_refers_to_leave_a_scene_as_it_is() {
    let unused = camera("0 0 3", "", 3)
        + &format!(
            r#"MakeNamedMedium "fog" LightSource "infinite" "rgb L" [1 1 1] MediumInterface "fog" "fog" Material "interface" {BOX}"#
        );
    let job = job(&unused, AccelKind::Embree);
    assert!(job.world.scene.media.is_empty() && job.world.scene.surfaces.is_empty());
}

/// Features come from the first surface behind media, even where every path ends before it.
#[test]
fn features_are_those_of_the_first_surface_behind_media() {
    // Dense fog before a diffuse square
    let text = camera("0 0 3", "", 3)
        + &format!(
            r#"MakeNamedMedium "fog" "rgb sigma_s" [9 9 9] "rgb sigma_a" [0 0 0] LightSource "infinite" "rgb L" [1 1 1]
            Material "interface" MediumInterface "fog" "" {BOX} MediumInterface "" ""
            Material "diffuse" "rgb reflectance" [0.2 0.4 0.6]
            Shape "trianglemesh" "point3 P" [-9 -9 -2  9 -9 -2  9 9 -2  -9 9 -2] "integer indices" [0 1 2 0 2 3]"#
        );

    // All camera rays hit the square: distance, albedo and normal
    let job = job(&text, AccelKind::Embree);
    let film = film(&job, RenderSettings { spp: 8, ..RenderSettings::default() });
    for p in film.pixels() {
        let n = p.hits as f64;
        assert_eq!(p.hits, p.count);
        assert!((p.depth / n - 5.0).abs() < 1e-5, "{}", p.depth / n);
        for (found, expected) in p.albedo.iter().zip([0.2, 0.4, 0.6]) {
            assert!((found / n - expected).abs() < 1e-5);
        }
        assert!((p.normal[2] / n - 1.0).abs() < 1e-5);
    }
}
