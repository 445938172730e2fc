//! Moving cameras, motion within instances, and nested instances: different descriptions of the same scene give the
//! same image.

use lumiris::import::cache::FileCache;
use lumiris::import::{LoadOptions, Loaded, load_text};
use lumiris::render::output::channels;
use lumiris::render::{RenderSettings, render};
use lumiris::scene::AccelKind;
use std::fmt::Write;
use std::path::Path;
use std::sync::atomic::AtomicBool;

/// Light that does not depend on the position.
const WORLD: &str = "WorldBegin\nLightSource \"distant\" \"point3 from\" [ 0 0 -1 ] \"point3 to\" [ 0 0 0 ]\n";

fn load(text: &str) -> Result<Loaded, String> {
    load_text(text, "motion.pbrt", Path::new("."), &LoadOptions::default(), &FileCache::default())
        .map_err(|d| d.to_string())
}

/// Radiance of 24 × 24 pixels. The text `camera` precedes the camera, which faces along z.
fn image(camera: &str, world: &str, accel: AccelKind) -> Vec<f32> {
    let text = format!(
        "{camera}\nLookAt 0 0 -4  0 0 0  0 1 0\nCamera \"perspective\" \"float fov\" 40\n\
         Film \"rgb\" \"integer xresolution\" 24 \"integer yresolution\" 24\n\
         PixelFilter \"box\" \"float xradius\" 0.5 \"float yradius\" 0.5\n\
         Integrator \"path\" \"integer maxdepth\" 1\n{WORLD}{world}"
    );
    let job = load(&text).unwrap().job(accel, None).unwrap();
    let settings = RenderSettings { spp: 64, with_features: false, with_replicas: false, ..RenderSettings::default() };
    let rendering = render(&job, &settings, &AtomicBool::new(false), &|_| ()).unwrap();
    channels(&rendering.film, &[], None).data
}

/// The fraction of values that differ by more than rounding can cause away from edges.
fn fraction_of_others(a: &[f32], b: &[f32]) -> f64 {
    assert_eq!(a.len(), b.len());
    let differs = a.iter().zip(b).filter(|(a, b)| (*a - *b).abs() > 1e-3 * (a.abs() + b.abs()));
    differs.count() as f64 / a.len() as f64
}

const TRACERS: [AccelKind; 2] = [AccelKind::Embree, AccelKind::Bvh];
const SHAPE: &str = "Shape \"trianglemesh\" \"point3 P\" [ -0.7 -0.5 0  0.8 -0.4 0.1  0.1 0.6 -0.2 ]\n";

#[test]
fn a_camera_that_moves_sees_what_one_at_rest_sees_of_a_world_that_moves() {
    for motion in ["Translate 0.4 0.2 0", "Translate 0 0 1", "Rotate 70 0 0 1"] {
        for accel in TRACERS {
            // The transformation of a camera maps the world to the camera
            let moving = format!("ActiveTransform EndTime {motion} ActiveTransform All");
            let of_camera = image(&moving, SHAPE, accel);
            let of_world = image("", &format!("{moving}\n{SHAPE}"), accel);
            let still = image("", SHAPE, accel);
            let (same, other) = (fraction_of_others(&of_camera, &of_world), fraction_of_others(&of_camera, &still));
            assert!(same < 0.02 && other > 0.05, "{motion} {accel:?}: {same} {other}");
        }
    }
}

#[test]
fn the_shutter_opens_for_cameras_as_for_shapes() {
    let camera = |motion: &str, open: &str| {
        format!("TransformTimes 1 3\nActiveTransform EndTime {motion} ActiveTransform All\n{open}")
    };
    let text = |camera: &str, shutter: &str| {
        format!(
            "{camera}\nCamera \"orthographic\" {shutter}\nFilm \"rgb\" \"integer xresolution\" 8 \"integer yresolution\" 8\n\
             {WORLD}{SHAPE}"
        )
    };
    let job = |text: &str| load(text).unwrap().job(AccelKind::Bvh, None).unwrap();
    let shutter = "\"float shutteropen\" 1.5 \"float shutterclose\" 2";
    let moving = job(&text(&camera("Translate -4 0 0", ""), shutter));
    let o = |u| moving.world.scene.camera.ray(lumiris_numbers::math::Vec2::splat(4.0), [0.5; 2], u).ray.o.x;
    assert!((o(0.0) - 1.0).abs() < 1e-5 && (o(1.0) - 2.0).abs() < 1e-5, "{} {}", o(0.0), o(1.0));
}

#[test]
fn objects_within_objects_are_the_shapes_that_they_hold() {
    // The same shapes: instanced, and listed one by one
    let moving = "ActiveTransform EndTime Translate 0 0.3 0 Rotate 40 0 0 1 ActiveTransform All";
    let places = ["Translate 0.4 0 0", "Translate -0.5 0.2 0.3 Rotate 30 0 0 1"];
    let outer = ["Scale 0.5 0.5 0.5", "Translate 0 0.5 0 Rotate -20 0 1 0"];
    let (mut flat, mut pair, mut nested) = (String::new(), String::new(), String::new());
    for place in places {
        writeln!(pair, "AttributeBegin {place} ObjectInstance \"one\" AttributeEnd").unwrap();
    }
    for o in outer {
        writeln!(nested, "AttributeBegin {o} ObjectInstance \"pair\" AttributeEnd").unwrap();
        writeln!(flat, "AttributeBegin {o} {moving} {SHAPE} AttributeEnd").unwrap();
        for place in places {
            writeln!(flat, "AttributeBegin {o} {place} {SHAPE} AttributeEnd").unwrap();
        }
    }
    let world = format!(
        "ObjectBegin \"one\" {SHAPE} ObjectEnd\nObjectBegin \"pair\" {pair} {moving} {SHAPE} ObjectEnd\n{nested}"
    );

    // Both images agree with either ray tracer
    for accel in TRACERS {
        let others = fraction_of_others(&image("", &world, accel), &image("", &flat, accel));
        assert!(others < 0.02, "{accel:?}: {others}");
    }
    let images = TRACERS.map(|accel| image("", &world, accel));
    assert!(images[0] == images[1] && images[0].iter().any(|x| *x > 0.0), "Embree and the BVH have the same bits");
}

#[test]
fn many_instances_of_objects_within_objects_are_clusters_with_the_same_image() {
    // 300 places of 300 instances, nested and listed one by one
    let matrix = |i: usize, scale: f64| {
        let angle = i as f64 * 2.4;
        let [x, y, z] =
            [angle.cos() * (i as f64).sqrt(), angle.sin() * (i as f64).sqrt(), (i % 7) as f64].map(|p| p * 0.07);
        format!("[ {scale} 0 0 0  0 {scale} 0 0  0 0 {scale} 0  {x} {y} {z} 1 ]")
    };
    let (mut flat, mut row, mut nested) = (String::new(), String::new(), String::new());
    for i in 0..300 {
        writeln!(row, "Transform {} ObjectInstance \"one\"", matrix(i, 0.1)).unwrap();
        writeln!(nested, "Transform {} ObjectInstance \"row\"", matrix(i, 0.1)).unwrap();
        for k in 0..300 {
            let (outer, inner) = (matrix(i, 0.1), matrix(k, 0.1));
            writeln!(flat, "Transform {outer} ConcatTransform {inner} ObjectInstance \"one\"").unwrap();
        }
    }
    let one = format!("ObjectBegin \"one\" {SHAPE} ObjectEnd\n");
    let nested = format!("{one}ObjectBegin \"row\" {row} ObjectEnd\n{nested}");
    let geometry = load(&format!("{WORLD}{nested}")).unwrap().scene.geometry;
    assert_eq!((geometry.instances.len(), geometry.clusters.instance_count()), (0, 90_000));

    let images = TRACERS.map(|accel| image("", &nested, accel));
    assert!(images[0].iter().filter(|x| **x > 0.0).count() > 100);
    let flat = image("", &format!("{one}{flat}"), AccelKind::Embree);
    let others = [&images[1], &flat].map(|other| fraction_of_others(&images[0], other));
    assert!(others.iter().all(|others| *others < 0.02), "{others:?}");
}

#[test]
fn objects_that_hold_themselves_or_too_much_are_errors() {
    let of = |world: &str| load(&format!("{WORLD}{world}")).map(|_| ()).unwrap_err();
    let error = of("ObjectBegin \"a\"\nObjectInstance \"a\"\nObjectEnd");
    assert!(error.contains("cannot contain itself") && error.contains("motion.pbrt:4:"), "{error}");
    let mut text = format!("ObjectBegin \"0\" {SHAPE} ObjectEnd\n");
    for level in 1..=32 {
        let inner = format!("ObjectInstance \"{}\" ", level - 1);
        writeln!(text, "ObjectBegin \"{level}\" {inner}{inner} ObjectEnd").unwrap();
    }
    let error = of(&format!("{text}ObjectInstance \"32\""));
    let mut deep = format!("ObjectBegin \"0\" {SHAPE} ObjectEnd\n");
    for level in 1..=30_000 {
        writeln!(deep, "ObjectBegin \"{level}\" ObjectInstance \"{}\" ObjectEnd", level - 1).unwrap();
    }
    let loaded = load(&format!("{WORLD}{deep}ObjectInstance \"30000\"")).unwrap();
    assert_eq!(loaded.scene.geometry.instances.len(), 1);
    assert!(error.contains("8589934591 instances; at most 2147483648"), "{error}");
}
