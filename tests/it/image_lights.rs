//! Goniometric and projection lights: known answers, in the frames of pbrt-v4, and errors with their positions.

use lumiris::imaging::oiio::{Part, write_image};
use lumiris::import::cache::FileCache;
use lumiris::import::{LoadOptions, load_text};
use lumiris::render::{RenderSettings, render};
use lumiris::scene::{AccelKind, RenderJob};
use lumiris::settings::EstimatorKind;
use std::f64::consts::PI;
use std::path::Path;
use std::sync::atomic::AtomicBool;

/// A floor of reflectance 0.5 in z = 0. The camera sees its point (0.3, 0.4).
const FLOOR: &str = r#"
LookAt 0.3 0.4 1  0.3 0.4 0  0 1 0
Camera "orthographic" "float screenwindow" [ -0.001 0.001 -0.001 0.001 ]
Film "rgb" "integer xresolution" 2 "integer yresolution" 2
Sampler "independent" "integer pixelsamples" 2
Integrator "path" "integer maxdepth" 1
WorldBegin
Material "diffuse" "rgb reflectance" [ 0.5 0.5 0.5 ]
Shape "trianglemesh" "point3 P" [ -9 -9 0  9 -9 0  9 9 0  -9 9 0 ] "integer indices" [ 0 1 2 0 2 3 ]
Translate 0 0 3
"#;

/// Radiance of the floor for an intensity of the light at (0, 0, 3).
fn radiance(intensity: f64) -> f64 {
    let squared = 0.25 + 9.0;
    0.5 / PI * intensity * (3.0 / f64::sqrt(squared)) / squared
}

/// A folder with images of two rows and of one row.
fn folder() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    let names = || ["R", "G", "B"].map(str::to_owned).to_vec();
    let pixels = |values: &[f32]| values.iter().flat_map(|&v| [v, v, v]).collect::<Vec<f32>>();
    let square = Part::linear(2, 2, names(), pixels(&[4.0, 8.0, 16.0, 32.0]));
    write_image(&folder.path().join("square.exr"), &[square]).unwrap();
    let wide = Part::linear(2, 1, names(), pixels(&[4.0, 8.0]));
    write_image(&folder.path().join("wide.exr"), &[wide]).unwrap();
    folder
}

fn job(folder: &Path, light: &str, accel: AccelKind) -> Result<RenderJob, String> {
    let text = format!("{FLOOR}{light}");
    let loaded = load_text(&text, "floor.pbrt", folder, &LoadOptions::default(), &FileCache::default());
    Ok(loaded.map_err(|d| d.to_string())?.job(accel, None).unwrap())
}

fn mean(job: &RenderJob) -> f64 {
    let rendering = render(job, &RenderSettings::default(), &AtomicBool::new(false), &|_| ()).unwrap();
    let values = lumiris::render::output::channels(&rendering.film, &[], None).data;
    values.iter().map(|&v| f64::from(v)).sum::<f64>() / values.len() as f64
}

#[test]
fn points_get_the_light_of_their_texel() {
    let folder = folder();
    // The first row is at the largest y of the light; the rotation about x reverses y
    let slide = |rest: &str| format!("Rotate 180 1 0 0\nLightSource \"projection\" \"string filename\" {rest}");
    let tan = f64::tan(PI / 6.0);
    // The sum of the intensity of all texels times their solid angles, which are equal
    let solid_angle = 4.0 * f64::atan(tan * tan / f64::sqrt(1.0 + 2.0 * tan * tan));
    let sphere = |rest: &str| format!("LightSource \"goniometric\" \"string filename\" {rest}");
    let cases = [
        (slide("\"square.exr\" \"float fov\" 60"), 32.0),
        (slide("\"square.exr\" \"float fov\" 60 \"float scale\" 0.25"), 8.0),
        (slide("\"square.exr\" \"float fov\" 60 \"float power\" 10"), 32.0 * 10.0 / (15.0 * solid_angle)),
        // The narrower side has the field of view: 0.4/3 is inside, but not inside half of it
        (slide("\"wide.exr\" \"float fov\" 20"), 8.0),
        (slide("\"wide.exr\" \"float fov\" 10"), 0.0),
        // z of the image is y of the light
        (sphere("\"square.exr\" \"rgb I\" [ 2 2 2 ]"), 16.0),
        (sphere("\"square.exr\" \"rgb I\" [ 1 1 1 ] \"float power\" 30"), 8.0 * 30.0 / (15.0 * 4.0 * PI)),
    ];
    for (light, intensity) in cases {
        for accel in [AccelKind::Embree, AccelKind::Bvh] {
            let mut job = job(folder.path(), &light, accel).unwrap();
            for estimator in [EstimatorKind::Mc, EstimatorKind::Mis, EstimatorKind::Ris, EstimatorKind::Contributing] {
                job.change(|s| s.integrator.estimator = estimator);
                let (found, expected) = (mean(&job), radiance(intensity));
                assert!((found - expected).abs() <= 2e-4 * expected, "{light}, {estimator:?}: {found} {expected}");
            }
        }
    }
}

#[test]
fn what_is_wrong_with_a_light_is_said_with_its_place() {
    let folder = folder();
    let line = FLOOR.lines().count() + 1;
    for (light, message, column) in [
        ("LightSource \"goniometric\" \"string filename\" \"wide.exr\"", "is square (an equal-area map), not 2×1", 27),
        ("LightSource \"goniometric\" \"rgb I\" [ 1 1 1 ]", "needs `filename`", 1),
        ("LightSource \"projection\" \"string filename\" \"square.exr\" \"float fov\" 180", "fov must be above 0", 57),
        ("LightSource \"projection\" \"string filename\" \"missing.exr\"", "missing.exr", 0),
        ("LightSource \"projection\" \"string filename\" \"square.exr\" \"float fow\" 30", "fow", 57),
    ] {
        let error = job(folder.path(), light, AccelKind::Bvh).err().unwrap();
        assert!(error.contains(message), "{light}: {error}");
        let place = if column > 0 { format!("floor.pbrt:{line}:{column}") } else { format!("floor.pbrt:{line}") };
        assert!(error.contains(&place), "{light}: {error}");
    }
}
