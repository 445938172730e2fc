//! `Material "measured"`: its files, and a plane of it under uniform light.

use lumiris::bsdfs::{Bsdf, Measured, MeasuredTables};
use lumiris::film::PixelSums;
use lumiris::import::cache::FileCache;
use lumiris::import::{LoadOptions, Loaded, load_text};
use lumiris::render::{RenderSettings, render};
use lumiris::scene::AccelKind;
use lumiris::settings::{EstimatorKind, IntegratorKind};
use lumiris_formats::bsdf_file::read_bsdf;
use lumiris_numbers::math::{Rgb, Vec3};
use std::f32::consts::{PI, TAU};
use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;

fn demo() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/demo")
}

/// A plane z = 0 of the material, from a direction with x = 0, under uniform white light.
fn load(folder: &Path, material: &str) -> Result<Loaded, String> {
    let text = format!(
        r#"LookAt 0 1.5 2  0 0 0  0 0 1
        Camera "orthographic" "float screenwindow" [ -0.1 0.1 -0.1 0.1 ]
        Film "rgb" "integer xresolution" 4 "integer yresolution" 4
        WorldBegin
        LightSource "infinite" "rgb L" [1 1 1]
        Material {material}
        Shape "trianglemesh" "point3 P" [ -5 -5 0  5 -5 0  5 5 0  -5 5 0 ] "integer indices" [ 0 1 2 0 2 3 ]"#
    );
    load_text(&text, "plane.pbrt", folder, &LoadOptions::default(), &FileCache::default()).map_err(|d| d.to_string())
}

/// ∫ f cos θi over the upper hemisphere.
fn albedo(bsdf: &Bsdf<'_>, wo: Vec3) -> Rgb {
    const POLAR: u32 = 400;
    const AZIMUTH: u32 = 800;
    let mut sum = [0.0_f64; 3];
    for i in 0..POLAR * AZIMUTH {
        let theta = ((i / AZIMUTH) as f32 + 0.5) / POLAR as f32 * 0.5 * PI;
        let phi = ((i % AZIMUTH) as f32 + 0.5) / AZIMUTH as f32 * TAU;
        let wi = Vec3::new(theta.sin() * phi.cos(), theta.sin() * phi.sin(), theta.cos());
        let value = bsdf.f(wo, wi) * (wi.z * theta.sin());
        sum.iter_mut().zip(value.to_array()).for_each(|(sum, v)| *sum += f64::from(v));
    }
    let cell = f64::from(0.5 * PI * TAU) / f64::from(POLAR * AZIMUTH);
    Rgb::from_array(sum.map(|s| (s * cell) as f32))
}

#[test]
fn a_plane_under_even_light_shows_the_albedo() {
    let tables = MeasuredTables::new(read_bsdf(&demo().join("measured.bsdf")).unwrap()).unwrap();
    let expected = albedo(&Bsdf::Measured(Measured { tables: &tables }), Vec3::new(0.0, 0.6, 0.8));
    assert!(expected.max_component() < 1.0 && expected.r > 1.3 * expected.b, "{expected:?}");
    // `mc` samples only the light, which is everywhere
    for (kind, estimator, bound) in [
        (IntegratorKind::Direct, EstimatorKind::Mis, 0.01),
        (IntegratorKind::Direct, EstimatorKind::Ris, 0.01),
        (IntegratorKind::Path, EstimatorKind::Mc, 0.03),
    ] {
        let loaded = load(&demo(), r#""measured" "string filename" "measured.bsdf""#).unwrap();
        let mut job = loaded.job(AccelKind::Embree, None).unwrap();
        job.change(|s| (s.integrator.kind, s.integrator.estimator) = (kind, estimator));
        let settings = RenderSettings { spp: 2048, ..RenderSettings::default() };
        let film = render(&job, &settings, &AtomicBool::new(false), &|_| ()).unwrap().film;
        let pixels: Vec<[f64; 3]> = film.pixels().iter().map(PixelSums::mean).collect();
        for c in 0..3 {
            let mean = pixels.iter().map(|p| p[c]).sum::<f64>() / pixels.len() as f64;
            let relative = mean / f64::from(expected[c]) - 1.0;
            assert!(relative.abs() < bound, "{estimator:?}: {mean} {expected:?}");
        }
    }
}

#[test]
fn both_sides_reflect() {
    let tables = MeasuredTables::new(read_bsdf(&demo().join("measured.bsdf")).unwrap()).unwrap();
    let bsdf = Bsdf::Measured(Measured { tables: &tables });
    let (wo, wi) = (Vec3::new(0.0, 0.6, 0.8), Vec3::new(0.48, -0.36, 0.8));
    assert_eq!(bsdf.f(wo, wi), bsdf.f(-wo, -wi));
    assert!(!bsdf.f(wo, wi).is_black() && bsdf.f(wo, -wi).is_black());
}

#[test]
fn files_that_are_missing_or_wrong_are_errors_with_their_place() {
    let folder = tempfile::tempdir().unwrap();
    let bytes = std::fs::read(demo().join("measured.bsdf")).unwrap();
    std::fs::write(folder.path().join("cut.bsdf"), &bytes[..bytes.len() - 9]).unwrap();
    std::fs::write(folder.path().join("text.bsdf"), "no tables").unwrap();
    let error = |name: &str| {
        let material = format!(r#""measured" "string filename" "{name}""#);
        load(folder.path(), &material).err().unwrap()
    };
    let missing = error("none.bsdf");
    assert!(missing.contains("none.bsdf") && missing.contains("plane.pbrt:6:"), "{missing}");
    let cut = error("cut.bsdf");
    assert!(cut.contains("cut.bsdf: byte") && cut.contains("does not end in the file"), "{cut}");
    let text = error("text.bsdf");
    assert!(text.contains("does not begin with `tensor_file`") && text.contains("plane.pbrt:6:"), "{text}");
    let none = load(folder.path(), r#""measured""#).err().unwrap();
    assert!(none.contains("needs a `string filename`"), "{none}");
}
