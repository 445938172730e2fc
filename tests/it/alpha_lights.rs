//! Area lights with alpha textures: the emitted light is in proportion to the visible part, with every technique.

use lumiris::import::cache::FileCache;
use lumiris::import::{LoadOptions, load_text};
use lumiris::render::{RenderSettings, render};
use lumiris::scene::AccelKind;
use lumiris::settings::EstimatorKind;
use std::path::Path;
use std::sync::atomic::AtomicBool;

/// A glossy floor below a light of 1 × 1 at z = 1. The camera sees one point of the floor.
const FLOOR: &str = r#"
LookAt 0.3 0.4 0.5  0.3 0.4 0  0 1 0
Camera "orthographic" "float screenwindow" [ -0.001 0.001 -0.001 0.001 ]
Film "rgb" "integer xresolution" 8 "integer yresolution" 8
Sampler "zsobol" "integer pixelsamples" 64
Integrator "path" "integer maxdepth" 1
WorldBegin
Material "diffuse"
Shape "bilinearmesh" "point3 P" [ -9 -9 0  9 -9 0  -9 9 0  9 9 0 ]
Texture "half" "float" "checkerboard" "float uscale" 2 "float vscale" 0.5 "float tex1" 0 "float tex2" 1
AreaLightSource "diffuse" "rgb L" [ 1 2 4 ] "bool twosided" true
"#;
const TRIANGLES: &str = r#"Shape "trianglemesh" "point3 P" [ -0.5 -0.5 1  0.5 -0.5 1  0.5 0.5 1  -0.5 0.5 1 ]
    "point2 uv" [ 0 0  1 0  1 1  0 1 ] "integer indices" [ 0 1 2 0 2 3 ]"#;
/// The half where the texture is 1.
const HALF: &str = r#"Shape "trianglemesh" "point3 P" [ 0 -0.5 1  0.5 -0.5 1  0.5 0.5 1  0 0.5 1 ]
    "integer indices" [ 0 1 2 0 2 3 ]"#;
/// Not a rectangle, so each triangle is a light. The first is in x > 0.
const KITE: &str = r#"Shape "trianglemesh" "point3 P" [ 0 -0.5 1  0.7 0 1  0 0.5 1  -0.4 0 1 ]
    "point2 uv" [ 0.5 0  1 0.5  0.5 1  0 0.5 ] "integer indices" [ 0 1 2 0 2 3 ]"#;
const HALF_KITE: &str = r#"Shape "trianglemesh" "point3 P" [ 0 -0.5 1  0.7 0 1  0 0.5 1 ] "integer indices" [ 0 1 2 ]"#;
const PATCH: &str = r#"Shape "bilinearmesh" "point3 P" [ -0.5 -0.5 1  0.5 -0.5 1  -0.5 0.5 1  0.5 0.5 1 ]"#;
const SPHERE: &str = "Translate 0 0 1 Shape \"sphere\" \"float radius\" 0.5";

fn mean(light: &str, estimator: EstimatorKind) -> f64 {
    let load = LoadOptions::default();
    let text = format!("{FLOOR}{light}");
    let loaded = load_text(&text, "floor.pbrt", Path::new("."), &load, &FileCache::default());
    let mut job = loaded.map_err(|d| d.to_string()).unwrap().job(AccelKind::Bvh, None).unwrap();
    job.change(|s| (s.integrator.estimator, s.integrator.samples) = (estimator, Some(8)));
    let settings = RenderSettings { spp: 64, ..RenderSettings::default() };
    let rendering = render(&job, &settings, &AtomicBool::new(false), &|_| ()).unwrap();
    let values = lumiris::render::output::channels(&rendering.film, &[], None).data;
    values.iter().map(|&v| f64::from(v)).sum::<f64>() / values.len() as f64
}

#[test]
fn a_light_shines_as_much_as_is_seen_of_it() {
    use EstimatorKind::{Contributing, Mc, Mis, Ocv, Ris};
    let with = |shape: &str, alpha: &str| format!("{shape} {alpha}");
    let cut = "\"texture alpha\" \"half\"";
    let cases = [
        (with(TRIANGLES, "\"float alpha\" 0.3"), TRIANGLES, 0.3),
        (with(SPHERE, "\"float alpha\" 0.3"), SPHERE, 0.3),
        // A light with alpha 0 everywhere emits but is invisible, as in pbrt-v4
        (with(TRIANGLES, "\"float alpha\" 0"), TRIANGLES, 1.0),
        (with(TRIANGLES, cut), HALF, 1.0),
        (with(KITE, cut), HALF_KITE, 1.0),
        (with(PATCH, cut), HALF, 1.0),
    ];
    for (light, whole, part) in cases {
        let expected = part * mean(whole, Mis);
        for estimator in [Mc, Mis, Ris, Ocv, Contributing] {
            let found = mean(&light, estimator);
            // With `mc`, a tenth of 32,768 samples hit the light, and half of these the opaque part
            let tolerance = if estimator == Mc { 0.08 } else { 0.02 };
            assert!((found / expected - 1.0).abs() < tolerance, "{light} {estimator:?}: {found} for {expected}");
        }
    }
}
