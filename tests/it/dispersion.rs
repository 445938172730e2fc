//! Dispersion: known answers from integrals over the wavelength, and agreement of estimators and tracers.
//!
//! t-tests over 32 images of different seeds, at a level of 10⁻⁵ for each channel; each test states the bias that it
//! detects.

use crate::media::{BOX, assert_answer, assert_they_agree, choose, estimators, job, means};
use lumiris::bsdfs::fresnel::fr_dielectric;
use lumiris::imaging::oiio::{Part, write_image};
use lumiris::import::cache::FileCache;
use lumiris::import::{LoadOptions, load_text};
use lumiris::integrators::exclusions::{Feature, allows};
use lumiris::lights::{EnvironmentFilter, EnvironmentMap, EnvironmentMapping};
use lumiris::materials::Dispersion;
use lumiris::scene::{AccelKind, RenderJob};
use lumiris_formats::spectra::{Spectrum, WHITE_RANGE, white_responses};
use lumiris_numbers::math::{Rgb, Vec3};
use std::path::Path;

/// Indices that differ by a third, far more than any glass's.
const ETA: &str = r#""spectrum eta" [ 380 1.8  720 1.2 ]"#;

/// All rays are the same: downwards at 45°.
fn camera(depth: u32) -> String {
    format!(
        r#"LookAt -1 0 1  0 0 0  0 0 1
        Camera "orthographic" "float screenwindow" [ -0.0001 0.0001 -0.0001 0.0001 ]
        Film "rgb" "integer xresolution" 4 "integer yresolution" 4
        PixelFilter "box" "float xradius" 0.5 "float yradius" 0.5
        Integrator "path" "integer maxdepth" {depth} "float rrthreshold" 0
        WorldBegin
        LightSource "infinite" "string filename" "sky.exr"
        Material "dielectric" {ETA} "float roughness" 0
        "#
    )
}

/// A horizontal pane whose normal points up or down.
fn pane(z: f32, is_up: bool) -> String {
    let indices = if is_up { "0 1 2 0 2 3" } else { "0 2 1 0 3 2" };
    format!(
        r#"Shape "trianglemesh" "point3 P" [-90 -90 {z} 90 -90 {z} 90 90 {z} -90 90 {z}] "integer indices" [{indices}]
        "#
    )
}

const SIZE: usize = 32;

/// A sky with different texels everywhere.
fn sky() -> Vec<Rgb> {
    let value = |i: usize| ((i * 7919 + 13) % 101) as f32 / 50.0;
    (0..SIZE * SIZE).map(|i| Rgb::new(value(i), value(i + 5), value(3 * i + 1))).collect()
}

fn load(folder: &Path, text: &str) -> RenderJob {
    let loaded = load_text(text, "glass.pbrt", folder, &LoadOptions::default(), &FileCache::default());
    loaded.map_err(|d| d.to_string()).unwrap().job(AccelKind::Embree, None).unwrap()
}

/// ∫ of the responses times `of` over the index of refraction.
fn over_wavelengths(of: impl Fn(f32) -> Rgb) -> [f64; 3] {
    let eta = Dispersion::new(&Spectrum::from_pairs(&[380.0, 1.8, 720.0, 1.2]).unwrap()).unwrap();
    let mut sum = [0.0; 3];
    for (lambda, response) in WHITE_RANGE.zip(white_responses()) {
        // A response is valid within half a nm of its wavelength
        for i in 0..32 {
            let value = of(eta.eta(lambda as f32 + (i as f32 + 0.5) / 32.0 - 0.5));
            (0..3).for_each(|c| sum[c] += f64::from(response[c] * value[c]) / 32.0);
        }
    }
    sum
}

#[test]
fn a_path_is_bent_by_its_wavelength_and_keeps_it() {
    let folder = tempfile::tempdir().unwrap();
    let names = ["R", "G", "B"].map(str::to_owned).to_vec();
    let pixels = sky().iter().flat_map(|c| c.to_array()).collect();
    write_image(&folder.path().join("sky.exr"), &[Part::linear(SIZE, SIZE, names, pixels)]).unwrap();
    let map = EnvironmentMap::new(sky(), [SIZE; 2], EnvironmentMapping::EqualArea, EnvironmentFilter::Nearest).unwrap();
    let sin = 0.5_f32.sqrt();
    let (up, down) = (map.le(Vec3::new(sin, 0.0, sin)), map.le(Vec3::new(sin, 0.0, -sin)));

    // One surface: every wavelength has its direction of refraction
    let mut one = load(folder.path(), &(camera(4) + &pane(0.0, true)));
    let answer = over_wavelengths(|eta| {
        let (r, x) = (fr_dielectric(sin, eta), sin / eta);
        up * r + map.le(Vec3::new(x, 0.0, -(1.0 - x * x).sqrt())) * ((1.0 - r) / (eta * eta))
    });
    assert_answer(&mut one, 1024, answer, 0.05, "a surface");

    // A sheet: transmitted light has the direction of incidence
    let mut sheet = load(folder.path(), &(camera(64) + &pane(0.0, true) + &pane(-1.0, false)));
    let answer = over_wavelengths(|eta| {
        let r = fr_dielectric(sin, eta);
        up * (2.0 * r / (1.0 + r)) + down * ((1.0 - r) / (1.0 + r))
    });
    assert_answer(&mut sheet, 1024, answer, 0.05, "a sheet");
}

/// Rough glass in the light of a lamp and of the sky: the answer is unknown, but all estimators agree on it.
#[test]
fn estimators_and_tracers_agree_on_rough_dispersive_glass() {
    // Scene
    let text = format!(
        r#"LookAt 2 1.5 2.4  0 0 0  0 1 0
        Camera "orthographic" "float screenwindow" [ -0.001 0.001 -0.001 0.001 ]
        Film "rgb" "integer xresolution" 4 "integer yresolution" 4
        Integrator "path" "integer maxdepth" 6
        WorldBegin
        LightSource "infinite" "rgb L" [ 0.5 0.6 0.8 ]
        AttributeBegin AreaLightSource "diffuse" "rgb L" [4 3 2] Translate 0 2.5 -1 Shape "sphere" "float radius" 0.8 AttributeEnd
        Material "dielectric" "spectrum eta" "glass-SF11" "float roughness" 0.3
        {BOX}"#
    );

    // Estimators
    let mut glass = job(&text, AccelKind::Embree);
    assert!(!allows(&glass, Feature::Sharing));
    let mut answers = Vec::new();
    for (estimator, settings) in estimators() {
        choose(&mut glass, &settings);
        answers.push((estimator, means(&mut glass, 128)));
    }
    assert_they_agree(&answers, 0.25);

    // Tracers
    let both = [AccelKind::Embree, AccelKind::Bvh].map(|accel| means(&mut job(&text, accel), 4));
    assert_eq!(both[0], both[1]);
}

#[test]
fn a_ball_of_glass_is_invisible_in_even_light() {
    let text = r#"LookAt 0.3 0.2 3  0.3 0.2 0  0 1 0
        Camera "orthographic" "float screenwindow" [ -0.001 0.001 -0.001 0.001 ]
        Film "rgb" "integer xresolution" 4 "integer yresolution" 4
        Integrator "path" "integer maxdepth" 64 "float rrthreshold" 0
        WorldBegin
        LightSource "infinite" "rgb L" [ 1 1 1 ]
        Material "dielectric" "spectrum eta" "glass-LASF9" Shape "sphere" "float radius" 1"#;
    assert_answer(&mut job(text, AccelKind::Embree), 256, [1.0; 3], 0.05, "a ball");
}
