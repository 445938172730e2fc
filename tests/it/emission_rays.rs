//! Additional emission rays: camera rays that measure only the emission. They change no mean, and lower the noise at
//! the edges of lights.

use crate::path_reuse::image_of_seed;
use crate::same_light::assert_same_light;
use lumiris::film::Film;
use lumiris::import::cache::FileCache;
use lumiris::import::{LoadOptions, load_text};
use lumiris::integrators::exclusions::{Feature, allows};
use lumiris::planning::{Preparation, prepare};
use lumiris::render::{RenderSettings, render};
use lumiris::scene::{AccelKind, PixelSamples, RenderJob};
use lumiris::settings::{Allocation, EstimatorKind, IntegratorKind};
use lumiris_numbers::estimators::stats::Welford;
use lumiris_numbers::math::luminance;
use std::path::Path;
use std::sync::atomic::AtomicBool;

/// Edge of the images (pixels).
const EDGE: u32 = 12;

/// The camera sees a lamp directly, through glass and in a mirror, in front of a sky of two lights.
const CAMERA: &str = r#"
LookAt 0 1 -5  0 0.8 0  0 1 0  Camera "perspective" "float fov" 40
Film "rgb" "integer xresolution" 12 "integer yresolution" 12
WorldBegin
"#;
const LAMP: &str = r#"
LightSource "infinite" "rgb L" [0.2 0.4 0.8]
LightSource "infinite" "rgb L" [0.3 0.1 0.1]
AttributeBegin AreaLightSource "diffuse" "rgb L" [9 7 5] Material "diffuse" "rgb reflectance" [0 0 0]
Shape "trianglemesh" "integer indices" [0 2 1 0 3 2] "point3 P" [-1.3 1.2 1 0.7 1.5 1 0.6 2.2 1 -1.4 1.9 1] AttributeEnd
"#;
const SURFACES: &str = r#"
Material "diffuse" "rgb reflectance" [0.6 0.6 0.5]
Shape "trianglemesh" "integer indices" [0 1 2 0 2 3] "point3 P" [-4 0 -4 4 0 -4 4 0 4 -4 0 4]
Material "conductor" "float roughness" 0
AttributeBegin Translate 1 0.6 0.5 Shape "sphere" "float radius" 0.6 AttributeEnd
"#;
const GLASS: &str = r#"
Material "dielectric"
AttributeBegin Translate -0.6 0.9 -0.6 Shape "sphere" "float radius" 0.5 AttributeEnd
"#;
/// Mist around the camera.
const MIST: &str = r#"
MakeNamedMedium "mist" "string type" "homogeneous" "rgb sigma_a" [0.02 0.03 0.04] "rgb sigma_s" [0.08 0.08 0.08]
MediumInterface "" "mist"
"#;
/// A glowing cloud.
const CLOUD: &str = r#"
MakeNamedMedium "glow" "string type" "uniformgrid" "integer nx" 2 "integer ny" 2 "integer nz" 2
  "float density" [1 0 2 1 0.5 1 1 3] "rgb sigma_a" [0.6 0.6 0.6] "rgb sigma_s" [0.5 0.5 0.5]
  "float Lescale" [2 2 2 2 2 2 2 2] "rgb Le" [1 0.6 0.2] "point3 p0" [-1.6 0.2 0] "point3 p1" [-0.6 1.2 1]
AttributeBegin MediumInterface "glow" "mist" Material "interface"
Shape "trianglemesh" "integer indices" [0 2 1 1 2 3 4 5 6 5 7 6 0 1 4 1 5 4 2 6 3 3 6 7 0 4 2 2 4 6 1 3 5 3 7 5]
"point3 P" [-1.6 0.2 0 -0.6 0.2 0 -1.6 1.2 0 -0.6 1.2 0 -1.6 0.2 1 -0.6 0.2 1 -1.6 1.2 1 -0.6 1.2 1] AttributeEnd
"#;

fn job_of(text: &str, resolution: Option<[u32; 2]>) -> RenderJob {
    let options = LoadOptions { resolution, ..LoadOptions::default() };
    let loaded = load_text(text, "emission rays", Path::new("."), &options, &FileCache::default());
    loaded.map_err(|d| d.to_string()).unwrap().job(AccelKind::Embree, None).unwrap()
}

fn job(parts: &[&str]) -> RenderJob {
    job_of(&parts.concat(), None)
}

fn film(job: &RenderJob, spp: u32) -> Film {
    let settings = RenderSettings { spp, with_replicas: true, ..RenderSettings::default() };
    render(job, &settings, &AtomicBool::new(false), &|_| ()).unwrap().film
}

/// The same sample count everywhere, with different numbers of emission rays per pixel.
fn split(spp: u32, emission_rays: &[u8]) -> PixelSamples {
    let bounds = lumiris::film::PixelBounds { x0: 0, x1: EDGE, y0: 0, y1: EDGE };
    let pixels = (EDGE * EDGE) as usize;
    PixelSamples {
        bounds,
        spp,
        counts: vec![spp; pixels],
        emission_rays: (0..pixels).map(|i| emission_rays[i % emission_rays.len()]).collect(),
    }
}

/// Compares different numbers of emission rays per pixel with none: in air and mist, with a lens and motion, for every
/// estimator that supports them, in direct light, with separate and shared paths, and with light paths.
#[test]
fn emission_rays_change_no_mean() {
    const SPP: u32 = 16;
    use EstimatorKind::{Contributing, Mis, Ris};
    type Change = fn(&mut RenderJob);
    let path: Change = |job| job.change(|s| s.integrator.kind = IntegratorKind::Path);
    let shared: Change = |job| {
        job.change(|s| (s.integrator.kind, s.integrator.path_reuse) = (IntegratorKind::Path, Some(3)));
    };
    let caustics: Change = |job| {
        job.change(|s| (s.integrator.kind, s.integrator.light_paths) = (IntegratorKind::Path, Some(0.5)));
    };
    let direct: Change = |job| job.change(|s| s.integrator.kind = IntegratorKind::Direct);
    let in_air = || job(&[CAMERA, LAMP, SURFACES, GLASS]);
    // A lens, motion, and film colours
    let moving = || {
        let camera = CAMERA
            .replace(
                "\"float fov\" 40",
                "\"float fov\" 40 \"float lensradius\" 0.1 \"float focaldistance\" 4 \"float shutterclose\" 1",
            )
            .replace("LookAt", "ActiveTransform EndTime Translate 0.3 0 0 ActiveTransform All LookAt");
        let sensor = camera.replace(
            "\"integer yresolution\" 12",
            "\"integer yresolution\" 12 \"float whitebalance\" 4000 \"string sensor\" \"cie1931\"",
        );
        job(&[&sensor, LAMP, SURFACES])
    };
    let in_mist = || job(&[MIST, CAMERA, LAMP, SURFACES, CLOUD]);
    let cases: [(&str, &dyn Fn() -> RenderJob, EstimatorKind, Change); 10] = [
        ("a lens and motion, direct, mis", &moving, Mis, direct),
        ("direct, mis", &in_air, Mis, direct),
        ("direct, ris", &in_air, Ris, direct),
        ("direct, contributing", &in_air, Contributing, direct),
        ("paths, mis", &in_air, Mis, path),
        ("shared paths", &in_air, Mis, shared),
        ("light paths", &in_air, Mis, caustics),
        ("paths in mist, mis", &in_mist, Mis, path),
        ("paths in mist, ris", &in_mist, Ris, path),
        ("direct in mist, mis", &in_mist, Mis, direct),
    ];
    for (name, scene, estimator, change) in cases {
        let image = |emission_rays: &'static [u8]| {
            let mut job = scene();
            change(&mut job);
            job.change(|s| s.integrator.estimator = estimator);
            let settings = &job.settings().integrator;
            assert!(settings.path_reuse.is_none() || allows(&job, Feature::Sharing));
            assert!(settings.light_paths.is_none() || allows(&job, Feature::LightPaths));
            image_of_seed(job, Some(split(SPP, emission_rays)), SPP)
        };
        assert_same_light(&format!("emission rays: {name}"), image(&[1]), image(&[5, 1, 2, 24]));
    }
}

#[test]
fn emission_rays_lower_the_noise_of_visible_lights_and_images_state_what_is_left() {
    let mut job = job(&[CAMERA, LAMP]);
    job.change(|s| (s.integrator.kind, s.integrator.estimator) = (IntegratorKind::Direct, EstimatorKind::Mis));
    // The variance between images, and the stated variance
    let mut variances = |emission_rays: u8| {
        job.pixel_samples = Some(split(16, &[emission_rays]));
        let mut of_pixels = vec![Welford::default(); (EDGE * EDGE) as usize];
        let mut stated = Welford::default();
        for seed in 0..48 {
            job.change(|s| s.sampling.seed = seed);
            let film = film(&job, 16);
            of_pixels.iter_mut().zip(film.pixels()).for_each(|(sum, p)| sum.add(luminance(p.mean())));
            stated.add(film.variances().iter().flatten().sum::<f64>());
        }
        let sum = of_pixels.iter().map(Welford::variance).sum::<f64>();
        (sum, stated.mean())
    };
    let ((one, stated_of_one), (many, stated_of_many)) = (variances(1), variances(16));
    assert!(many < 0.25 * one, "{many} {one}");
    let (fall, stated) = (many / one, stated_of_many / stated_of_one);
    assert!((0.5..2.0).contains(&(stated / fall)), "{fall}, and by the images {stated}");
}

#[test]
fn adaptive_images_have_more_emission_rays_at_the_edges_of_lights() {
    let mut job = job_of(&[CAMERA, LAMP, SURFACES].concat(), Some([64, 64]));
    job.change(|s| {
        (s.integrator.kind, s.integrator.estimator) = (IntegratorKind::Direct, EstimatorKind::Mis);
        (s.sampling.allocation, s.sampling.spp, s.integrator.samples) = (Allocation::Adaptive, 64, Some(16));
    });
    prepare(&mut job, &Preparation::on(Some(2))).unwrap();
    let emission_rays = job.pixel_samples.clone().expect("numbers that differ").emission_rays;
    // Pixels partly covered by the lamp, without the light of other surfaces
    job.change(|s| s.integrator.max_depth = 0);
    job.pixel_samples = None;
    let seen: Vec<f64> = film(&job, 1024).pixels().iter().map(|p| luminance(p.mean())).collect();
    let is_edge = |v: f64| v > 1.5 && v < 6.0;
    let mean = |of: &dyn Fn(f64) -> bool| {
        let chosen = seen.iter().zip(&emission_rays).filter(|(v, _)| of(**v)).map(|(_, &n)| f64::from(n));
        let all: Vec<f64> = chosen.collect();
        assert!(all.len() > 5, "{}", all.len());
        all.iter().sum::<f64>() / all.len() as f64
    };
    let (edges, inside) = (mean(&is_edge), mean(&|v| v > 7.1));
    assert!(edges > 4.0 && inside < 0.5 * edges, "{edges} {inside}");
}
