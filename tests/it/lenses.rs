//! Cameras with lenses: images, and errors in their files.

use lumiris::imaging::oiio::{Part, write_image};
use lumiris::import::cache::FileCache;
use lumiris::import::{LoadOptions, Loaded, load_text};
use lumiris::render::output::channels;
use lumiris::render::{RenderSettings, render};
use lumiris::scene::AccelKind;
use std::f64::consts::PI;
use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;

fn demo() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/demo")
}

fn load(folder: &Path, camera: &str, world: &str) -> Result<Loaded, String> {
    let text = format!(
        "LookAt 1 2 3  1 2 4  0 1 0\nCamera {camera}\n\
         Film \"rgb\" \"integer xresolution\" 60 \"integer yresolution\" 40 \"float diagonal\" 43.2666\n\
         PixelFilter \"box\" \"float xradius\" 0.5 \"float yradius\" 0.5\n\
         Integrator \"path\" \"integer maxdepth\" 0\nWorldBegin\n{world}"
    );
    load_text(&text, "lens.pbrt", folder, &LoadOptions::default(), &FileCache::default()).map_err(|d| d.to_string())
}

/// The red channel of each pixel.
fn image(camera: &str, world: &str) -> Vec<f64> {
    let job = load(&demo(), camera, world).unwrap().job(AccelKind::Embree, None).unwrap();
    let settings = RenderSettings { spp: 256, with_features: false, with_replicas: false, ..RenderSettings::default() };
    let rendering = render(&job, &settings, &AtomicBool::new(false), &|_| ()).unwrap();
    channels(&rendering.film, &[], None).data.chunks_exact(3).map(|p| f64::from(p[0])).collect()
}

const SKY: &str = "LightSource \"infinite\" \"rgb L\" [ 1 1 1 ]\n";

#[test]
fn a_distant_square_is_where_a_pinhole_sees_it() {
    // Above the axis, and to its left
    let square = "AreaLightSource \"diffuse\" \"rgb L\" [ 1 1 1 ]\nMaterial \"diffuse\"\n\
                  Shape \"bilinearmesh\" \"point3 P\" [ 0 22.5 203  -40 22.5 203  0 42.5 203  -40 42.5 203 ]\n";
    let stop = "\"float aperturediameter\" 1 \"float focusdistance\" 200";
    let lens = format!("\"realistic\" \"string lensfile\" \"double-gauss.dat\" {stop}");
    let (seen, sky) = (image(&lens, square), image(&lens, SKY));
    // The field of view of 24 mm at the focal length
    let fov = 2.0 * (12.0_f64 / 50.0).atan().to_degrees();
    let pinhole = image(&format!("\"perspective\" \"float fov\" {fov}"), square);
    let moments = |of: &dyn Fn(usize) -> f64| {
        let sum = |f: &dyn Fn(usize) -> f64| (0..2400).map(|i| of(i) * f(i)).sum::<f64>();
        let all = sum(&|_| 1.0);
        [all, sum(&|i| (i % 60) as f64) / all, sum(&|i| (i / 60) as f64) / all]
    };
    let (a, b) = (moments(&|i| seen[i] / sky[i]), moments(&|i| pinhole[i]));
    assert!(b[0] > 100.0 && (a[0] / b[0] - 1.0).abs() < 0.04, "{a:?} {b:?}");
    assert!((a[1] - b[1]).abs() < 0.5 && (a[2] - b[2]).abs() < 0.5, "{a:?} {b:?}");
}

#[test]
fn an_even_sky_gives_the_irradiance_of_the_stop() {
    let sky = image("\"realistic\" \"string lensfile\" \"double-gauss.dat\" \"float aperturediameter\" 8.55", SKY);
    // f/4: half of the diameter for f/2
    let [middle, corner] = [sky[20 * 60 + 30], sky[0]];
    assert!((middle / (PI / 64.0) - 1.0).abs() < 0.1, "{middle}");
    // Without a diameter, the aperture stop is 1 mm wide, as in pbrt-v4
    let narrow = image("\"realistic\" \"string lensfile\" \"double-gauss.dat\"", SKY)[20 * 60 + 30];
    assert!((middle / narrow / 8.55_f64.powi(2) - 1.0).abs() < 0.05, "{middle} {narrow}");
    // Darker towards the corners: cos⁴θ for 43.27/2 mm at 50 mm, and vignetting
    let cos4 = (1.0 + (21.6_f64 / 50.0).powi(2)).powi(-2);
    assert!(corner / middle < cos4 * 1.1 && corner / middle > 0.3 * cos4, "{corner} {middle}");
}

#[test]
fn wrong_lenses_are_errors_with_a_place() {
    // Files
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("odd.dat"), "1 2 1.5 3\n4 5 # rest\n").unwrap();
    std::fs::write(folder.path().join("word.dat"), "1 2 1.5x 3\n").unwrap();
    std::fs::write(folder.path().join("good.dat"), std::fs::read(demo().join("double-gauss.dat")).unwrap()).unwrap();
    let grey = Part::linear(2, 2, vec!["Y".to_owned()], vec![0.0, 1.0, 1.0, 0.5]);
    write_image(&folder.path().join("stop.exr"), &[grey]).unwrap();
    let try_load =
        |rest: &str| load(folder.path(), &format!("\"realistic\" {rest}"), SKY).map(|l| l.warnings.to_string());

    // Errors
    for (rest, expected) in [
        ("", "needs `string lensfile`"),
        ("\"string lensfile\" \"gone.dat\"", "gone.dat"),
        ("\"string lensfile\" \"odd.dat\"", "four numbers for each surface"),
        ("\"string lensfile\" \"word.dat\"", "`1.5x` is no number"),
        ("\"string lensfile\" \"good.dat\" \"float focusdistance\" 0.05", "focus"),
        ("\"string lensfile\" \"good.dat\" \"string aperture\" \"stra\"", "did you mean `star`"),
        ("\"string lensfile\" \"good.dat\" \"string aperture\" \"gone.png\"", "gone.png"),
        ("\"string lensfile\" \"good.dat\" \"float aperturediameter\" -1", "must be positive"),
    ] {
        let error = try_load(rest).unwrap_err();
        assert!(error.contains(expected) && error.contains("lens.pbrt:2:"), "{rest}: {error}");
    }

    // Warnings
    let wide = "\"string lensfile\" \"good.dat\" \"float aperturediameter\" 90 \"string aperture\" \"stop.exr\"";
    assert!(try_load(wide).unwrap().contains("17.1 mm at most"));
}
