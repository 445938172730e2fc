//! The photon-map integrator: known answers, agreement with `path`, convergence of the progressive form, bit-identical
//! images, and scenes without light.

use super::irradiance_cache::{ROOM, rendering, squares, world_of};
use lumiris::render::output::{Aov, channels};
use lumiris::render::{RenderSettings, render};
use lumiris::scene::RenderJob;
use lumiris::settings::{IntegratorKind, PhotonMapSettings, PhotonStorage, ProgressiveSettings, Settings};
use lumiris_numbers::estimators::stats::{Welford, sidak, t_test};
use lumiris_test_support::power::by_power;
use std::sync::atomic::AtomicBool;

/// The inside of a sphere that emits and reflects: the radiance is L/(1 − ρ) everywhere.
const FURNACE: &str = r#"
Camera "perspective" "float fov" [ 60 ]
Film "rgb" "integer xresolution" [ 8 ] "integer yresolution" [ 8 ]
PixelFilter "box"
Integrator "path" "integer maxdepth" [ 48 ]
WorldBegin
AreaLightSource "diffuse" "rgb L" [ 1 1 1 ]
Material "diffuse" "rgb reflectance" [ 0.5 0.25 0.75 ]
ReverseOrientation
Shape "sphere" "float radius" [ 2 ]
"#;

fn with_photons(s: &mut Settings, change: impl FnOnce(&mut PhotonMapSettings)) {
    s.integrator.kind = IntegratorKind::PhotonMap;
    s.integrator.photons.photons = by_power(30_000, 10_000);
    change(&mut s.integrator.photons);
}

fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len() as f64
}

#[test]
fn a_furnace_has_its_known_radiance() {
    // Under uniform irradiance on nearly flat surfaces, a density estimate is unbiased. Means over seeds; the tolerance
    // of 0.2 % covers the curvature within the disk of the photons.
    let forms: [fn(&mut PhotonMapSettings); 5] = [
        |_| (),
        |p| p.gather = 0,
        |p| p.storage = PhotonStorage::Floor(0.05),
        |p| p.progressive = Some(ProgressiveSettings::default()),
        |p| (p.guide, p.caustic_ratio) = (0.5, 1.0),
    ];
    let significance = sidak(1e-3, forms.len() * 3);
    for (i, form) in forms.into_iter().enumerate() {
        let mut job = world_of(FURNACE, |s| with_photons(s, form));
        let mut means = [Welford::new(); 3];
        for seed in 0..6 {
            job.change(|s| s.sampling.seed = seed);
            let film = rendering(&job, RenderSettings { spp: 2, ..Default::default() }).film;
            for (c, mean) in means.iter_mut().enumerate() {
                mean.add(film.pixels().iter().map(|p| p.mean()[c]).sum::<f64>() / film.len() as f64);
            }
        }
        for (measured, albedo) in means.iter().zip([0.5, 0.25, 0.75]) {
            let answer = 1.0 / (1.0 - albedo);
            let near = (measured.mean() / answer - 1.0).abs() < 2e-3;
            assert!(near || t_test(measured, answer).p_value > significance, "form {i}: {measured:?}, not {answer}");
        }
    }
}

#[test]
fn a_room_of_all_materials_agrees_with_path_tracing() {
    // Light counted twice or lost at a coat, in a mirror or through glass amounts to 4 % and more. The density of
    // photons in corners and below the glass sphere deviates by less.
    let path = world_of(ROOM, |s| s.integrator.samples = Some(4));
    let reference =
        squares(&rendering(&path, RenderSettings { spp: by_power(512, 192), ..Default::default() }).film, 8);
    for storage in [PhotonStorage::All, PhotonStorage::Floor(0.1)] {
        let job = world_of(ROOM, |s| {
            s.integrator.samples = Some(4);
            with_photons(s, |p| (p.photons, p.storage) = (by_power(200_000, 80_000), storage));
        });
        let image = squares(&rendering(&job, RenderSettings { spp: by_power(32, 12), ..Default::default() }).film, 8);
        let ratio = mean(&image) / mean(&reference);
        assert!((ratio - 1.0).abs() < by_power(0.015, 0.018), "{storage:?}: mean {ratio}");
        for (i, (a, b)) in image.iter().zip(&reference).enumerate() {
            assert!((a / b - 1.0).abs() < by_power(0.06, 0.07), "{storage:?}: square {i} has {a}, not {b}");
        }
    }
}

#[test]
fn more_passes_bring_a_progressive_map_nearer_to_the_truth() {
    let path = world_of(ROOM, |s| s.integrator.samples = Some(4));
    let reference =
        squares(&rendering(&path, RenderSettings { spp: by_power(1024, 384), ..Default::default() }).film, 4);
    let job = world_of(ROOM, |s| {
        with_photons(s, |p| (p.photons, p.gather, p.progressive) = (2_000, 0, Some(ProgressiveSettings::default())));
    });
    let error = |spp| {
        let image = squares(&rendering(&job, RenderSettings { spp, ..Default::default() }).film, 4);
        let square = |(a, b): (&f64, &f64)| (a - b) * (a - b);
        (image.iter().zip(&reference).map(square).sum::<f64>() / image.len() as f64).sqrt()
    };
    // Slope −1/2 would be a factor of 5.7 at 32 times the photons; −1/4 is the minimum accepted
    let (few, many) = (error(4), error(128));
    assert!(many < few / 2.4, "{few} with 4 passes, {many} with 128");
}

#[test]
fn maps_without_photons_are_no_light_and_no_error() {
    // A sixth of the light falls on the only wall, so many maps of one photon are empty. A single wall has direct light
    // only
    const WALL: &str = "Camera \"perspective\" \"float fov\" [ 60 ]\n\
        Film \"rgb\" \"integer xresolution\" [ 8 ] \"integer yresolution\" [ 8 ]\nWorldBegin\n\
        LightSource \"point\" \"rgb I\" [ 3 3 3 ]\nShape \"trianglemesh\"\n\
        \"point3 P\" [ -1 -1 1  1 -1 1  1 1 1  -1 1 1 ] \"integer indices\" [ 0 1 2 0 2 3 ]\n";
    let mean = |job: &RenderJob| {
        let film = rendering(job, RenderSettings { spp: 16, ..Default::default() }).film;
        film.pixels().iter().map(|p| p.mean()[1]).sum::<f64>() / film.len() as f64
    };
    let path = mean(&world_of(WALL, |_| ()));
    let progressive = ProgressiveSettings { radius: Some(0.5), ..Default::default() };
    for progressive in [None, Some(progressive)] {
        let job = world_of(WALL, |s| with_photons(s, |p| (p.photons, p.progressive) = (1, progressive)));
        let photons = mean(&job);
        assert!((photons / path - 1.0).abs() < 1e-5 && path > 0.1, "{progressive:?}: {photons}, not {path}");
    }
}

#[test]
fn threads_tiles_and_packets_do_not_change_a_bit() {
    let bits = |job: &RenderJob, settings: RenderSettings| {
        let film = rendering(job, RenderSettings { spp: 2, ..settings }).film;
        channels(&film, &Aov::ALL, None).data.iter().map(|v| v.to_bits()).collect::<Vec<_>>()
    };
    for progressive in [None, Some(ProgressiveSettings::default())] {
        let job = world_of(ROOM, |s| {
            with_photons(s, |p| {
                (p.photons, p.progressive, p.storage) = (5_000, progressive, PhotonStorage::Floor(0.1));
            });
        });
        let reference = bits(&job, RenderSettings { threads: Some(1), ..Default::default() });
        for (threads, tile_size) in [(3, 7), (2, 64)] {
            let other = bits(&job, RenderSettings { threads: Some(threads), tile_size, ..Default::default() });
            assert!(reference == other, "{threads} threads, tiles of {tile_size}, {progressive:?}");
        }
    }
}

#[test]
fn without_photons_there_is_a_message_and_no_image() {
    let error = |text: &str, change: fn(&mut PhotonMapSettings)| {
        let job = world_of(text, |s| with_photons(s, change));
        let rendering = render(&job, &RenderSettings::default(), &AtomicBool::new(false), &|_| ());
        rendering.err().map(|e| e.to_string()).unwrap_or_default()
    };
    let dark = ROOM.replace("[ 12 10 8 ]", "[ 0 0 0 ]");
    let no_light = ROOM.replace("AreaLightSource \"diffuse\" \"rgb L\" [ 12 10 8 ]", "");
    let away = "Camera \"perspective\"\nWorldBegin\nLightSource \"point\"\nTranslate 0 0 -9\nShape \"sphere\"\n";
    let none: fn(&mut PhotonMapSettings) = |_| ();
    assert!(error(&no_light, none).contains("no light"), "{}", error(&no_light, none));
    assert!(error(&dark, none).contains("emit nothing"), "{}", error(&dark, none));
    assert!(error(ROOM, |p| p.photons = 0).contains("requested is zero"));
    assert!(error(ROOM, |p| p.memory = 100_000).contains("more than"));
    let importance: fn(&mut PhotonMapSettings) = |p| p.storage = PhotonStorage::Floor(0.1);
    assert!(error(away, importance).contains("camera sees no"), "{}", error(away, importance));
}
