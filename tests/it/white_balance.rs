//! `whitebalance` of a film: a linear map of the film without it.

use lumiris::film::Film;
use lumiris::imaging::Image;
use lumiris::import::cache::FileCache;
use lumiris::import::{LoadOptions, load_text};
use lumiris::render::output::{Aov, layers};
use lumiris::render::{RenderSettings, render};
use lumiris::scene::{AccelKind, RenderJob};
use lumiris::settings::{EstimatorKind, IntegratorKind};
use lumiris_formats::color_space::white_balance;
use lumiris_numbers::math::Vec3;
use std::path::Path;
use std::sync::atomic::AtomicBool;

/// Coloured light of two groups on coloured surfaces.
fn scene(film: &str) -> String {
    format!(
        r#"LookAt 0 1 -4  0 0 0  0 1 0
        Camera "perspective" "float fov" 50
        Film "rgb" "integer xresolution" 8 "integer yresolution" 8 {film}
        WorldBegin
        LightSource "infinite" "rgb L" [0.3 0.5 0.9] "string lightgroup" "sky"
        AttributeBegin AreaLightSource "diffuse" "rgb L" [9 5 1] Translate 0 2 0 Shape "sphere" "float radius" 0.4 AttributeEnd
        Material "diffuse" "rgb reflectance" [0.8 0.4 0.1]
        Shape "sphere" "float radius" 0.7
        Material "diffuse" "rgb reflectance" [0.2 0.6 0.4]
        Translate 0 -0.7 0
        Shape "trianglemesh" "point3 P" [ -5 0 -5  5 0 -5  5 0 5  -5 0 5 ] "integer indices" [ 0 1 2 0 2 3 ]"#
    )
}

fn load(film: &str) -> Result<RenderJob, String> {
    let loaded = load_text(&scene(film), "film.pbrt", Path::new("."), &LoadOptions::default(), &FileCache::default());
    Ok(loaded.map_err(|d| d.to_string())?.job(AccelKind::Embree, None).unwrap())
}

fn film(job: &RenderJob) -> Film {
    render(job, &RenderSettings { spp: 8, ..RenderSettings::default() }, &AtomicBool::new(false), &|_| ()).unwrap().film
}

/// Means of a film and of its layers.
fn means(film: &Film) -> Vec<Vec<[f64; 3]>> {
    let of = |image: &Image| image.data.as_chunks::<3>().0.iter().map(|pixel| pixel.map(f64::from)).collect();
    layers(film, &[Aov::LightGroups], None).iter().map(|(_, image)| of(image)).collect()
}

#[test]
fn the_balanced_image_is_the_map_of_the_other() {
    let map = white_balance(3200.0).unwrap();
    for (kind, estimator) in [
        (IntegratorKind::Path, EstimatorKind::Mis),
        (IntegratorKind::Direct, EstimatorKind::Ris),
        (IntegratorKind::Direct, EstimatorKind::Ocv),
        (IntegratorKind::IrradianceCache, EstimatorKind::Mis),
    ] {
        let [balanced, plain] = ["\"float whitebalance\" 3200", ""].map(|parameters| {
            let mut job = load(parameters).unwrap();
            job.change(|s| (s.integrator.kind, s.integrator.estimator) = (kind, estimator));
            means(&film(&job))
        });
        assert_eq!(balanced.len(), plain.len());
        for (balanced, plain) in balanced.iter().flatten().zip(plain.iter().flatten()) {
            let expected = map * Vec3::from_array(plain.map(|v| v as f32));
            let difference = (Vec3::from_array(balanced.map(|v| v as f32)) - expected).abs().max_element();
            // Control variates are fitted to other colours, which changes their noise
            let tolerance = if estimator == EstimatorKind::Ocv { 0.2 } else { 1e-4 };
            assert!(difference <= tolerance * expected.abs().max_element(), "{estimator:?}: {balanced:?} {expected}");
        }
    }
}

#[test]
fn temperatures_that_no_camera_has_are_errors() {
    for kelvin in ["-1", "20", "1e9"] {
        let error = load(&format!("\"float whitebalance\" {kelvin}")).err().unwrap();
        assert!(error.contains("from 1000 to 25000 K") && error.contains("film.pbrt:3:"), "{error}");
    }
    assert!(load("\"float whitebalance\" 0").unwrap().world.scene.film.balance.is_none());
}

#[test]
fn sensors_have_the_exposure_and_the_white_balance_of_pbrt() {
    let film_of = |parameters: &str| load(parameters).unwrap().world.scene.film;
    // The shutter is open for 1 s
    for (parameters, scale) in [
        ("", 1.0),
        ("\"float iso\" 400", 4.0),
        ("\"string sensor\" \"cie1931\" \"float iso\" 50", 0.5),
        ("\"string sensor\" \"nikon_d850\"", 1.0),
        ("\"string sensor\" \"sony_ilce_9\" \"float iso\" 150", 1.5),
    ] {
        assert_eq!(film_of(parameters).scale, scale, "{parameters}");
    }
    let open = |seconds: &str, film: &str| {
        let shutter = format!("\"float fov\" 50 \"float shutteropen\" 1 \"float shutterclose\" {seconds}");
        let text = scene(film).replace("\"float fov\" 50", &shutter);
        load_text(&text, "film.pbrt", Path::new("."), &LoadOptions::default(), &FileCache::default()).unwrap()
    };
    for sensor in ["cie1931", "canon_eos_5d_mkiv"] {
        let film = format!("\"string sensor\" \"{sensor}\" \"float iso\" 200");
        assert_eq!(open("1.25", &film).scene.film.scale, 0.5, "{sensor}");
    }

    // Cameras assume daylight of 6500 K as white unless told otherwise
    let balance = |parameters: &str| film_of(parameters).balance;
    assert_eq!(balance("\"string sensor\" \"canon_eos_m\""), white_balance(6500.0));
    assert_eq!(balance("\"string sensor\" \"canon_eos_m\" \"float whitebalance\" 4000"), white_balance(4000.0));
    assert_eq!(balance("\"string sensor\" \"cie1931\""), None);
    let warnings = open("2", "\"string sensor\" \"canon_eos_m\"").warnings.to_string();
    assert!(warnings.contains("sensor `canon_eos_m` has the colours of cie1931"), "{warnings}");
}

#[test]
fn sensors_that_pbrt_does_not_know_are_errors_with_the_names_of_those_that_it_knows() {
    let error = load("\"string sensor\" \"canon_eos_100d_mkII\"").err().unwrap();
    for part in ["unknown sensor `canon_eos_100d_mkII`", "film.pbrt:3:", "canon_eos_100d"] {
        assert!(error.contains(part), "{error}");
    }
    let error = load("\"string sensor\" \"eye\"").err().unwrap();
    assert!(error.contains("cie1931") && error.contains("sony_ilce_7rm3"), "{error}");
}
