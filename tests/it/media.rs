//! Participating media: known answers, every estimator and medium, bits, and what is refused.
//!
//! A scene is a text with the answer of every pixel. Images of different seeds are independent; t-tests have a level of
//! 10⁻⁵ for each channel, and must have the power to find the bias that they name (1.7 times that in `make test`, which renders
//! half of the images).

use crate::path_reuse::image_of_seed;
use crate::same_light::assert_same_light;
use lumiris::film::{Film, PixelSums};
use lumiris::import::cache::FileCache;
use lumiris::import::{LoadOptions, load_text};
use lumiris::integrators::reuse;
use lumiris::lights::LightCtx;
use lumiris::media::Medium;
use lumiris::planning::{Preparation, prepare};
use lumiris::render::{RenderSettings, render};
use lumiris::scene::{AccelKind, RenderJob};
use lumiris::settings::{EstimatorKind, IntegratorKind, IntegratorSettings, Proposals, Target};
use lumiris_formats::spectra::Y_INTEGRAL;
use lumiris_numbers::math::Vec3;
use lumiris_test_support::power::by_power;
use lumiris_test_support::significance::{critical_t, detectable_deviation};
use std::path::Path;
use std::sync::atomic::AtomicBool;

/// Level of the test of a channel.
const LEVEL: f64 = 1e-5;

/// Images of a test.
fn images() -> u32 {
    by_power(32, 16)
}

/// |t| beyond which a mean is rejected.
pub(crate) fn limit() -> f64 {
    critical_t(LEVEL, u64::from(images() - 1))
}

/// Whether a relative bias of `detects` is found with a probability of 0.99 where the mean has the standard error `relative`.
pub(crate) fn has_power(relative: f64, detects: f64) -> bool {
    detectable_deviation(LEVEL, 0.99, u64::from(images() - 1)) * relative < by_power(detects, 1.7 * detects)
}

/// A camera at `from` that looks along −z through a rectangle so small that all its rays are the same.
pub(crate) fn camera(from: &str, outside: &str, depth: u32) -> String {
    format!(
        r#"Translate {from} Scale -1 1 -1
        MediumInterface "" "{outside}" Camera "orthographic" "float screenwindow" [ -0.0005 0.0005 -0.0005 0.0005 ]
        MediumInterface "" ""
        Film "rgb" "integer xresolution" 4 "integer yresolution" 4 "string filename" "media.exr"
        PixelFilter "box" "float xradius" 0.5 "float yradius" 0.5
        Integrator "volpath" "integer maxdepth" {depth}
        WorldBegin
        "#
    )
}

pub(crate) fn job(text: &str, accel: AccelKind) -> RenderJob {
    let loaded = load_text(text, "media", Path::new("."), &LoadOptions::default(), &FileCache::default());
    loaded.map_err(|d| d.to_string()).unwrap().job(accel, None).unwrap()
}

fn film(job: &RenderJob, settings: RenderSettings) -> Film {
    render(job, &settings, &AtomicBool::new(false), &|_| ()).unwrap().film
}

/// Means and standard errors of the channels.
pub(crate) type Answer = ([f64; 3], [f64; 3]);

/// Those over images.
pub(crate) fn means(job: &mut RenderJob, spp: u32) -> Answer {
    let image = |seed| {
        job.change(|s| s.sampling.seed = seed);
        let film = film(job, RenderSettings { spp, ..RenderSettings::default() });
        let pixels: Vec<[f64; 3]> = film.pixels().iter().map(PixelSums::mean).collect();
        [0, 1, 2].map(|c| pixels.iter().map(|p| p[c]).sum::<f64>() / pixels.len() as f64)
    };
    let n = f64::from(images());
    let images: Vec<[f64; 3]> = (0..images()).map(image).collect();
    let mean = [0, 1, 2].map(|c| images.iter().map(|i| i[c]).sum::<f64>() / n);
    let variance = |c: usize| images.iter().map(|i| (i[c] - mean[c]).powi(2)).sum::<f64>() / (n - 1.0) / n;
    (mean, [0, 1, 2].map(|c| variance(c).sqrt()))
}

/// The mean of every channel is the answer, and a relative bias of `detects` would be found with a probability above 0.99.
#[track_caller]
pub(crate) fn assert_answer(job: &mut RenderJob, spp: u32, answer: [f64; 3], detects: f64, what: &str) {
    let (mean, error) = means(job, spp);
    for c in 0..3 {
        // Rounding of f32, where there is no noise
        let error = error[c] + 3e-5 * answer[c];
        let text = format!("{what}: channel {c} is {} ± {error}, not {}", mean[c], answer[c]);
        assert!((mean[c] - answer[c]).abs() < limit() * error, "{text}");
        assert!(has_power(error / answer[c].max(1e-3), detects), "too much noise: {text}");
    }
}

/// Means with their standard errors are those of all, weighted by what is known of each; a relative difference of `detects`
/// would be found with a probability above 0.99.
#[track_caller]
pub(crate) fn assert_they_agree(answers: &[(String, Answer)], detects: f64) {
    for c in 0..3 {
        let weight = |error: &[f64; 3]| 1.0 / error[c].powi(2);
        let sum: f64 = answers.iter().map(|(_, (_, error))| weight(error)).sum();
        let mean = answers.iter().map(|(_, (mean, error))| mean[c] * weight(error)).sum::<f64>() / sum;
        for (what, (found, error)) in answers {
            let text = format!("{what}: channel {c} is {} ± {}, others {mean}", found[c], error[c]);
            assert!((found[c] - mean).abs() < limit() * error[c], "{text}");
            assert!(has_power(error[c] / mean, detects), "too much noise: {text}");
        }
    }
}

/// All settings that know media.
pub(crate) fn estimators() -> Vec<(String, IntegratorSettings)> {
    let base = |estimator, samples: u32| IntegratorSettings { estimator, samples: Some(samples), ..Default::default() };
    let mut all: Vec<(String, IntegratorSettings)> = Vec::new();
    for (kind, samples) in [
        (EstimatorKind::Mis, 1),
        (EstimatorKind::Mis, 2),
        (EstimatorKind::Mis, 5),
        (EstimatorKind::Mc, 2),
        (EstimatorKind::Contributing, 2),
    ] {
        all.push((format!("{kind:?} {samples}"), base(kind, samples)));
    }
    for target in [Target::Fgl, Target::Visibility, Target::VisibilityControl] {
        let mut ris = base(EstimatorKind::Ris, 2);
        (ris.ris.proposals, ris.ris.target) = (Proposals::Fixed(8), target);
        all.push((format!("ris {target:?}"), ris));
    }
    all
}

/// Estimator, numbers of samples and target of `settings`.
pub(crate) fn choose(job: &mut RenderJob, settings: &IntegratorSettings) {
    job.change(|s| {
        (s.integrator.estimator, s.integrator.samples) = (settings.estimator, settings.samples);
        s.integrator.ris = settings.ris;
        s.integrator.path_reuse = None;
    });
}

/// A medium in a box, or of which a box or a sphere is cut out.
pub(crate) const BOX: &str = r#"Shape "trianglemesh" "point3 P" [-1 -1 -1  1 -1 -1  1 1 -1  -1 1 -1  -1 -1 1  1 -1 1  1 1 1  -1 1 1]
    "integer indices" [0 2 1 0 3 2  4 5 6 4 6 7  0 1 5 0 5 4  3 7 6 3 6 2  0 4 7 0 7 3  1 2 6 1 6 5]"#;

/// Values of a grid of 4 × 4 × 4 samples that are far from constant.
fn grid(channels: usize, scale: f32) -> String {
    let value = |i: usize| scale * (0.05 + ((i * 37 + 11) % 23) as f32 / 23.0);
    (0..64 * channels).map(|i| format!("{:.4} ", value(i))).collect()
}

/// One medium of each kind, with `scattering` and `absorption` as factors of its coefficients.
fn media(scattering: f32, absorption: f32, more: &str) -> Vec<(&'static str, String)> {
    let (s, a) = (scattering, absorption);
    let colors =
        format!(r#""rgb sigma_s" [{} {} {}] "rgb sigma_a" [{} {} {}]"#, s, 0.5 * s, 0.15 * s, 0.2 * a, 0.6 * a, a);
    // The box is between the inner samples: further out, a grid fades, and so does what it emits
    let place = r#""point3 p0" [-4 -4 -4] "point3 p1" [4 4 4] "integer nx" 4 "integer ny" 4 "integer nz" 4"#;
    vec![
        ("homogeneous", format!(r#""string type" "homogeneous" {colors} "float g" 0.4 {more}"#)),
        (
            "uniformgrid",
            format!(
                r#""string type" "uniformgrid" {colors} "float density" [{}] {place} "float g" -0.3 {more}"#,
                grid(1, 2.0)
            ),
        ),
        (
            "rgbgrid",
            format!(
                r#""string type" "rgbgrid" "rgb sigma_s" [{}] "rgb sigma_a" [{}] {place} {}"#,
                grid(3, 1.5 * s),
                grid(3, 0.8 * a),
                if more.is_empty() {
                    String::new()
                } else {
                    // Not scaled to a luminance, as in pbrt-v4
                    format!(r#""rgb Le" [{}] "float Lescale" {}"#, "1 1 1 ".repeat(64), 1.0 / Y_INTEGRAL)
                }
            ),
        ),
    ]
}

fn cloud(scattering: f32, absorption: f32) -> String {
    format!(
        r#""string type" "cloud" "point3 p0" [-1 -1 -1] "point3 p1" [1 1 1] "float density" 2 "float frequency" 3
        "rgb sigma_s" [{scattering} {} {}] "rgb sigma_a" [{absorption} {absorption} 0]"#,
        0.5 * scattering,
        0.2 * scattering
    )
}

/// A medium in a box, in even light of radiance 1 from everywhere.
fn in_even_light(medium: &str) -> RenderJob {
    let text = camera("0.3 0.2 3", "", 60)
        + &format!(
            r#"MakeNamedMedium "fog" {medium} LightSource "infinite" "rgb L" [1 1 1]
            Material "interface" MediumInterface "fog" "" {BOX}"#
        );
    job(&text, AccelKind::Embree)
}

/// In even light, what only scatters is not seen: an environment of radiance 1 around a box of albedo 1, whatever the medium,
/// phase function and estimator.
#[test]
fn a_medium_that_only_scatters_is_invisible_in_even_light() {
    let mut all = media(1.2, 0.0, "");
    all.push(("cloud", cloud(1.5, 0.0)));
    for (name, medium) in all {
        let mut job = in_even_light(&medium);
        for (estimator, settings) in estimators() {
            choose(&mut job, &settings);
            assert_answer(&mut job, 48, [1.0; 3], 0.13, &format!("{name}, {estimator}"));
        }
    }
}

/// The same where it absorbs as much as it emits: L_e = 1 is the radiance of everything.
#[test]
fn a_medium_in_equilibrium_with_its_surroundings_is_invisible() {
    for (name, medium) in media(0.8, 1.0, r#""rgb Le" [1 1 1]"#) {
        let mut job = in_even_light(&medium);
        for (estimator, settings) in estimators() {
            choose(&mut job, &settings);
            assert_answer(&mut job, 48, [1.0; 3], 0.13, &format!("{name}, {estimator}"));
        }
    }
}

/// Beer's law: T = exp(−σ d) of light behind a box of the thickness 2, exactly where the medium is homogeneous. In a grid, the
/// density falls to one half of the outermost sample at the walls.
#[test]
fn what_only_absorbs_weakens_light_by_the_law_of_beer() {
    let sigma = [0.3_f64, 0.9, 1.7];
    let slab = |medium: &str| {
        camera("0 0 3", "", 3)
            + &format!(
                r#"MakeNamedMedium "ink" {medium} LightSource "infinite" "rgb L" [2 2 2]
                Material "interface" MediumInterface "ink" "" {BOX}"#
            )
    };
    let colors = r#""rgb sigma_a" [0.3 0.9 1.7] "rgb sigma_s" [0 0 0]"#;
    let mut homogeneous = job(&slab(&format!(r#""string type" "homogeneous" {colors}"#)), AccelKind::Embree);
    assert_answer(&mut homogeneous, 1, sigma.map(|s| 2.0 * (-2.0 * s).exp()), 0.01, "homogeneous");
    let bounds = r#""point3 p0" [-1 -1 -1] "point3 p1" [1 1 1]"#;
    // The mean of 1 − |z|/2 over −1 < z < 1 is 3/4
    let mut one =
        job(&slab(&format!(r#""string type" "uniformgrid" {colors} "float density" 1 {bounds}"#)), AccelKind::Embree);
    assert_answer(&mut one, 64, sigma.map(|s| 2.0 * (-1.5 * s).exp()), 0.1, "a grid of one sample");
    // Densities 1 and 3 along z: means of 3/4 and 9/4 over the outer quarters, and of 2 between
    let two = format!(r#""string type" "uniformgrid" {colors} "float density" [1 3] "integer nz" 2 {bounds}"#);
    let mut two = job(&slab(&two), AccelKind::Embree);
    assert_answer(&mut two, 64, sigma.map(|s| 2.0 * (-3.5 * s).exp()), 0.4, "a grid of two samples");
    // The medium moves with the transformation where it is defined
    let moved = r#"AttributeBegin Translate 0 0 0.5 Rotate 90 0 0 1 Scale 2 2 0.25
        MakeNamedMedium "ink" "string type" "uniformgrid" "rgb sigma_a" [0.3 0.9 1.7] "rgb sigma_s" [0 0 0] "float density" 1
        "point3 p0" [-1 -1 -1] "point3 p1" [1 1 1] AttributeEnd"#;
    let text = camera("0 0 3", "", 3)
        + &format!(r#"{moved} LightSource "infinite" "rgb L" [2 2 2] Material "" MediumInterface "ink" "" {BOX}"#);
    assert_answer(
        &mut job(&text, AccelKind::Embree),
        64,
        sigma.map(|s| 2.0 * (-0.5 * 0.75 * s).exp()),
        0.05,
        "a moved grid",
    );
}

/// A point light beside the line of sight, in fog that goes on for ever, before a black wall: single scattering is
/// ∫ σ_s p I/r² exp(−σ_t (t + r)) dt, by quadrature.
#[test]
fn single_scattering_of_a_point_light_is_that_of_quadrature() {
    let (sigma_s, sigma_a, g, depth, beside) = ([0.5_f64, 0.2, 0.05], [0.1_f64, 0.3, 0.0], 0.35_f64, 4.0_f64, 0.7_f64);
    let answer: [f64; 3] = std::array::from_fn(|c| {
        let n = 200_000;
        let step = depth / f64::from(n);
        let sum: f64 = (0..n)
            .map(|i| {
                // The camera is at z = 2, the light at z = 0
                let t = (f64::from(i) + 0.5) * step;
                let (z, r2) = (2.0 - t, beside * beside + (2.0 - t).powi(2));
                let r = r2.sqrt();
                // Between the directions to the viewer, +z, and to the light
                let cos = -z / r;
                let p = (1.0 - g * g) / (4.0 * std::f64::consts::PI * (1.0 + g * g + 2.0 * g * cos).powf(1.5));
                sigma_s[c] * p * 5.0 / r2 * (-(sigma_s[c] + sigma_a[c]) * (t + r)).exp()
            })
            .sum();
        sum * step
    });
    let wall = r#"Material "diffuse" "rgb reflectance" [0 0 0]
        Shape "trianglemesh" "point3 P" [-9 -9 -2  9 -9 -2  9 9 -2  -9 9 -2] "integer indices" [0 1 2 0 2 3]"#;
    let text = |medium: &str| {
        let camera =
            camera("0 0 2", "fog", 1).replace("Translate", &format!("MakeNamedMedium \"fog\" {medium}\nTranslate"));
        camera
            + &format!(r#"LightSource "point" "rgb I" [5 5 5] "point3 from" [0.7 0 0] MediumInterface "" "fog" {wall}"#)
    };
    let colors = r#""rgb sigma_s" [0.5 0.2 0.05] "rgb sigma_a" [0.1 0.3 0] "float g" 0.35"#;
    let homogeneous = format!(r#""string type" "homogeneous" {colors}"#);
    // A grid whose density is 1 wherever the light goes
    let grid = format!(
        r#""string type" "uniformgrid" {colors} "float density" [{}] "integer nx" 4 "integer ny" 4 "integer nz" 4
        "point3 p0" [-40 -40 -40] "point3 p1" [40 40 40]"#,
        "1 ".repeat(64)
    );
    for (name, medium) in [("homogeneous", homogeneous), ("uniformgrid", grid)] {
        for accel in [AccelKind::Embree, AccelKind::Bvh] {
            let mut job = job(&text(&medium), accel);
            for (estimator, settings) in estimators() {
                choose(&mut job, &settings);
                assert_answer(&mut job, 48, answer, 0.25, &format!("{name}, {estimator}, {accel:?}"));
            }
        }
    }
}

/// A ray along the axis of a glass ball that absorbs, in even light: R + (1 − R)² T/(1 − R T), R = 0.04. The ball stands in
/// fog of its own, which is of a box.
#[test]
fn coloured_glass_absorbs_along_every_inner_reflection() {
    let sigma = [0.2_f64, 0.7, 1.5];
    let glass = |outside: &str| {
        format!(
            r#"MakeNamedMedium "green" "rgb sigma_a" [0.2 0.7 1.5] "rgb sigma_s" [0 0 0] LightSource "infinite" "rgb L" [1 1 1]
            AttributeBegin MediumInterface "green" "{outside}" Material "dielectric" Shape "sphere" "float radius" 0.5 AttributeEnd"#
        )
    };
    let through = sigma.map(|s| {
        let (r, t) = (0.04, (-s).exp());
        r + (1.0 - r) * (1.0 - r) * t / (1.0 - r * t)
    });
    let mut ball = job(&(camera("0 0 3", "", 40) + &glass("")), AccelKind::Embree);
    assert_answer(&mut ball, 256, through, 0.05, "a ball");
    // Nested in grey fog, which takes exp(−0.5 · 0.3) on either side
    let text = camera("0 0 3", "", 40)
        + r#"MakeNamedMedium "grey" "rgb sigma_a" [0.3 0.3 0.3] "rgb sigma_s" [0 0 0]"#
        + &glass("grey")
        + &format!(r#" Material "interface" MediumInterface "grey" "" {BOX}"#);
    let fog = (-0.5_f64 * 0.3 * 2.0).exp();
    assert_answer(&mut job(&text, AccelKind::Embree), 256, through.map(|l| l * fog), 0.05, "a ball in fog");
    // The same by an instance, turned over by a mirror
    let instance =
        text.replace("AttributeBegin MediumInterface", r#"ObjectBegin "ball" AttributeBegin MediumInterface"#);
    let instance = instance.replace(
        "0.5 AttributeEnd",
        r#"0.25 AttributeEnd ObjectEnd AttributeBegin Scale 2 2 -2 ObjectInstance "ball" AttributeEnd"#,
    );
    assert_answer(&mut job(&instance, AccelKind::Embree), 256, through.map(|l| l * fog), 0.05, "an instance");
}

/// Area lights, one at infinity and a glowing medium in fog before a wall.
fn fog(depth: u32) -> String {
    camera("0.1 0.2 3", "", depth)
        + &format!(
            r#"MakeNamedMedium "fog" "rgb sigma_s" [0.4 0.3 0.2] "rgb sigma_a" [0.05 0.1 0.2] "rgb Le" [0.5 0.2 0.1] "float g" 0.5
                LightSource "infinite" "rgb L" [0.2 0.3 0.4] LightSource "distant" "rgb L" [0.3 0.3 0.3] "point3 from" [1 2 3]
                AttributeBegin Material "interface" MediumInterface "fog" "" {BOX} AttributeEnd
                MediumInterface "fog" "fog"
                AttributeBegin Material "coateddiffuse" "rgb reflectance" [0.6 0.5 0.4] "float roughness" 0.3
                Shape "trianglemesh" "point3 P" [-0.9 -0.9 -0.8  0.9 -0.9 -0.8  0.9 0.9 -0.8  -0.9 0.9 -0.8] "integer indices" [0 1 2 0 2 3]
                AttributeEnd
                AttributeBegin AreaLightSource "diffuse" "rgb L" [6 5 4] "bool twosided" true Translate -0.4 0.6 0.3 Material "diffuse"
                Shape "sphere" "float radius" 0.1 AttributeEnd
                AttributeBegin AreaLightSource "diffuse" "rgb L" [2 5 7] Material "diffuse" Shape "trianglemesh"
                "point3 P" [0.5 -0.5 0  0.9 -0.5 0.1  0.7 -0.2 0] "integer indices" [0 1 2] AttributeEnd"#
        )
}

/// Light of area lights, of one at infinity and of a glowing medium in fog before a wall, by every estimator and both ray
/// tracers: nobody knows the answer, but all agree on it. What glows beyond the last vertex counts.
#[test]
fn estimators_and_ray_tracers_agree_in_fog_with_surfaces() {
    for depth in [1, 4] {
        let mut answers = Vec::new();
        for accel in [AccelKind::Embree, AccelKind::Bvh] {
            let mut job = job(&fog(depth), accel);
            for (estimator, settings) in estimators() {
                choose(&mut job, &settings);
                answers.push((format!("{estimator}, {accel:?}, {depth} bounces"), means(&mut job, 24)));
            }
        }
        assert_they_agree(&answers, 0.25);
    }
}

/// The same to half a percent: every estimator beside `mis` with two samples.
#[test]
#[ignore = "of `make test-power` only"]
fn estimators_agree_in_fog_to_half_a_percent() {
    let text = fog(4);
    let image = |settings: &IntegratorSettings| {
        let mut job = job(&text, AccelKind::Embree);
        choose(&mut job, settings);
        image_of_seed(job, None, 256)
    };
    let all = estimators();
    let (_, plain) = &all[1];
    for (name, settings) in &all {
        assert_same_light(&format!("media: fog, {name}"), image(plain), image(settings));
    }
}

/// Where media lie behind glass only, shadow segments never come into one: `mis` has its columns, and pixels share paths. A
/// wall behind a ball of coloured glass, in a corner of white walls.
#[test]
fn behind_glass_alone_media_leave_shadow_segments_and_shared_paths_as_they_are() {
    let text = |sigma: &str| {
        camera("0.1 0.1 3", "", 6)
            + &format!(
                r#"MakeNamedMedium "green" "rgb sigma_a" [{sigma}] "rgb sigma_s" [0 0 0]
                AttributeBegin MediumInterface "green" "" Material "dielectric" Shape "sphere" "float radius" 0.5 AttributeEnd
                Material "diffuse" "rgb reflectance" [0.8 0.8 0.8]
                Shape "trianglemesh" "point3 P" [-2 -2 -1  2 -2 -1  2 2 -1  -2 2 -1] "integer indices" [0 1 2 0 2 3]
                Shape "trianglemesh" "point3 P" [-2 -2 -1  2 -2 -1  2 -2 4  -2 -2 4] "integer indices" [0 1 2 0 2 3]
                AttributeBegin MediumInterface "green" "green" Shape "sphere" "float radius" 0.1 AttributeEnd
                AreaLightSource "diffuse" "rgb L" [5 5 5] "bool twosided" true
                Shape "trianglemesh" "point3 P" [-1 2 -0.5  1 2 -0.5  1 2 1.5  -1 2 1.5] "integer indices" [0 1 2 0 2 3]"#
            )
    };
    let mut job = job(&text("0.2 0.5 1"), AccelKind::Embree);
    assert_eq!(reuse::obstacle(&job), None);
    let mut answers = Vec::new();
    for (estimator, samples, edge) in
        [(EstimatorKind::Ris, 2, 1), (EstimatorKind::Mis, 2, 1), (EstimatorKind::Mis, 4, 1), (EstimatorKind::Mis, 2, 4)]
    {
        job.change(|s| {
            (s.integrator.estimator, s.integrator.samples) = (estimator, Some(samples));
            (s.integrator.path_reuse, s.integrator.ris.proposals) = (Some(edge), Proposals::Fixed(8));
        });
        answers.push((format!("{estimator:?} {samples}, blocks of {edge}"), means(&mut job, 256)));
    }
    assert_they_agree(&answers, 0.1);
}

/// A sheet before a lamp, half of which is nothing and the other half black, lets half of the light through, without a medium
/// as well: L = ρ/π · I/d² · 1/2.
#[test]
fn surfaces_that_rays_may_pass_let_light_through_where_there_are_no_media() {
    for depth in [1, 4] {
        let text = camera("0 0 1", "", depth)
            + r#"LightSource "point" "rgb I" [ 1 2 4 ] "point3 from" [ 0 0 2 ]
            Material "diffuse" "rgb reflectance" [ 0.5 0.5 0.5 ]
            Shape "bilinearmesh" "point3 P" [ -9 -9 0  9 -9 0  -9 9 0  9 9 0 ]
            MakeNamedMaterial "nothing" "string type" "interface"
            MakeNamedMaterial "black" "string type" "diffuse" "rgb reflectance" [ 0 0 0 ]
            Material "mix" "string materials" [ "nothing" "black" ] "float amount" 0.5
            Shape "bilinearmesh" "point3 P" [ -9 -9 1.5  9 -9 1.5  -9 9 1.5  9 9 1.5 ]"#;
        let mut job = job(&text, AccelKind::Embree);
        assert!(job.world.scene.media.is_empty() && reuse::obstacle(&job).is_some());
        let answer = [1.0, 2.0, 4.0].map(|i| 0.5 / std::f64::consts::PI * i / 4.0 * 0.5);
        for (name, settings) in estimators() {
            choose(&mut job, &settings);
            assert_answer(&mut job, 64, answer, 0.2, &format!("{name}, {depth} bounces"));
        }
        job.change(|s| (s.integrator.estimator, s.integrator.samples) = (EstimatorKind::Ocv, Some(4)));
        assert_answer(&mut job, 64, answer, 0.2, &format!("ocv, {depth} bounces"));
        job.change(|s| (s.integrator.estimator, s.integrator.ris.target) = (EstimatorKind::Ris, Target::Gv));
        let refused = render(&job, &RenderSettings::default(), &AtomicBool::new(false), &|_| ());
        assert!(refused.err().is_some_and(|error| error.to_string().contains("interface")));
    }
}

/// Beyond the last vertex, too, a medium glows: before a wall of reflectance ρ in what absorbs and emits, without end,
/// L = L_e (1 − T) + T ρ L_e.
#[test]
fn what_glows_beyond_the_last_vertex_lights_it() {
    let camera = camera("0 0 2", "fire", 1).replace(
        "Translate",
        "MakeNamedMedium \"fire\" \"rgb sigma_a\" [0.3 0.6 1] \"rgb sigma_s\" [0 0 0] \"rgb Le\" [2 1 0.5]\nTranslate",
    );
    let text = camera
        + r#"MediumInterface "" "fire" Material "diffuse" "rgb reflectance" [0.5 0.5 0.8]
        Shape "trianglemesh" "point3 P" [-90 -90 0  90 -90 0  90 90 0  -90 90 0] "integer indices" [0 1 2 0 2 3]"#;
    let le = [2.0, 1.0, 0.5];
    let (sigma, rho) = ([0.3_f64, 0.6, 1.0], [0.5, 0.5, 0.8]);
    let answer = std::array::from_fn(|c| {
        let t = (-2.0 * sigma[c]).exp();
        le[c] * (1.0 - t) + t * rho[c] * le[c]
    });
    let mut job = job(&text, AccelKind::Embree);
    for (estimator, settings) in estimators() {
        choose(&mut job, &settings);
        assert_answer(&mut job, 2, answer, 0.01, &estimator);
    }
}

/// A wall beside what glows, of which the boundary lets half be seen: L = ρ/π ∫ σ_a L_e cos θ/r² dV over that half, where next to nothing
/// is absorbed. Light samples find it, and so do paths alone.
#[test]
fn light_samples_find_what_glows_where_it_is_and_not_beyond_its_boundary() {
    let place = r#""point3 p0" [0.5 -0.5 -0.9] "point3 p1" [1.3 0.3 0.1] "integer nx" 4 "integer ny" 4 "integer nz" 4"#;
    let (low, high) = (Vec3::new(0.5, -0.5, -0.9), Vec3::new(0.9, 0.3, 0.1));
    let boundary = r#"Shape "trianglemesh" "point3 P" [0.5 -0.5 -0.9  0.9 -0.5 -0.9  0.9 0.3 -0.9  0.5 0.3 -0.9
        0.5 -0.5 0.1  0.9 -0.5 0.1  0.9 0.3 0.1  0.5 0.3 0.1]
        "integer indices" [0 2 1 0 3 2  4 5 6 4 6 7  0 1 5 0 5 4  3 7 6 3 6 2  0 4 7 0 7 3  1 2 6 1 6 5]"#;
    let text = camera("0.1 0.2 3", "", 1)
        + &format!(
            r#"MakeNamedMedium "fire" "string type" "uniformgrid" "rgb sigma_a" [0.002 0.001 0.003] "rgb sigma_s" [0 0 0] {place}
            "float density" [{}] "rgb Le" [300 200 100]
            AttributeBegin Material "interface" MediumInterface "fire" "" {boundary} AttributeEnd
            Material "diffuse" "rgb reflectance" [0.5 0.4 0.8]
            Shape "trianglemesh" "point3 P" [-9 -9 -1  9 -9 -1  9 9 -1  -9 9 -1] "integer indices" [0 1 2 0 2 3]"#,
            grid(1, 2.0)
        );
    let mut job = job(&text, AccelKind::Embree);
    let Medium::Heterogeneous(fire) = job.world.scene.media.media[0].clone() else { panic!("no grid") };
    let at = Vec3::new(0.1, -0.2, -1.0);
    // By the rule of midpoints, in the unit cube, of which the boundary holds the lower half along x
    let (steps, mut irradiance) = (64, [0.0_f64; 3]);
    for i in 0..steps * steps * steps / 2 {
        let place = [i % (steps / 2), i / (steps / 2) % steps, i / (steps * steps / 2)];
        let unit = Vec3::from(place.map(|x| (x as f32 + 0.5) / steps as f32));
        let p = fire.world_point(unit);
        assert!(p.cmpge(low).all() && p.cmple(high).all());
        let (r2, cos) = ((p - at).length_squared(), (p - at).normalize().z);
        let volume = fire.volume() / (steps * steps * steps) as f32;
        let glow = fire.glow(unit).to_array();
        (0..3).for_each(|c| irradiance[c] += f64::from(glow[c] * cos / r2 * volume));
    }
    let rho = [0.5, 0.4, 0.8];
    let answer = [0, 1, 2].map(|c| rho[c] / std::f64::consts::PI * irradiance[c]);
    for (name, settings) in estimators() {
        choose(&mut job, &settings);
        let looks = settings.estimator == EstimatorKind::Mis && settings.samples > Some(1);
        let ctx = LightCtx::on(at, Vec3::Z);
        assert_eq!(job.lights.sampler.sample(&ctx, 0.5).is_some(), looks, "{name}");
        assert_answer(&mut job, 128, answer, if looks { 0.03 } else { 0.4 }, &name);
    }
}

/// Smoke that glows and scatters, before a wall and around a glossy ball, with a lamp and a sky: nobody knows the answer, but all
/// estimators agree on it.
#[test]
fn estimators_agree_where_smoke_glows() {
    for depth in [1, 4] {
        let text = camera("0.1 0.2 3", "", depth)
            + &format!(
                r#"MakeNamedMedium "smoke" {} LightSource "infinite" "rgb L" [0.2 0.3 0.4]
                AttributeBegin Material "interface" MediumInterface "smoke" "" {BOX} AttributeEnd
                AttributeBegin MediumInterface "smoke" "smoke" Material "coateddiffuse" "rgb reflectance" [0.6 0.5 0.4] "float roughness" 0.3
                Translate 0.2 0 -0.2 Shape "sphere" "float radius" 0.4 AttributeEnd
                AreaLightSource "diffuse" "rgb L" [2 5 7] Material "diffuse" Shape "trianglemesh"
                "point3 P" [1.5 -0.5 0  1.9 -0.5 0.1  1.7 -0.2 0] "integer indices" [0 1 2]"#,
                media(0.6, 0.8, r#""rgb Le" [3 2 1]"#)[1].1
            );
        let mut job = job(&text, AccelKind::Embree);
        let mut answers = Vec::new();
        for (name, settings) in estimators() {
            choose(&mut job, &settings);
            answers.push((format!("{name}, {depth} bounces"), means(&mut job, 32)));
        }
        assert_they_agree(&answers, 0.25);
    }
}

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
    // Paths are not shared, and say so
    job.change(|s| (s.integrator.kind, s.integrator.path_reuse) = (IntegratorKind::Path, Some(4)));
    assert!(reuse::obstacle(&job).unwrap().contains("media"));
    let plan = prepare(&mut job, &Preparation::on(None)).unwrap();
    assert!(plan.warnings.iter().any(|w| w.contains("media")), "{:?}", plan.warnings);
}

/// `auto` chooses among what knows media, and its image has the answer.
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
    // 8192 samples of a standard deviation below 1
    assert!((mean - 1.0).abs() < 0.06, "{mean}");
}

/// Where media glow, `auto` chooses among what finds them by light samples.
#[test]
fn auto_has_light_samples_of_what_glows() {
    for (depth, edge) in [(1, 16), (5, 16)] {
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
        let mut job = job(&text, AccelKind::Embree);
        job.change(|s| {
            (s.integrator.estimator, s.sampling.spp) = (EstimatorKind::Auto, 512);
            s.integrator.kind = if depth == 1 { IntegratorKind::Direct } else { IntegratorKind::Path };
        });
        let plan = prepare(&mut job, &Preparation::on(None)).unwrap();
        assert!(job.lights.find_glows(), "{depth} bounces, {edge} pixels: {:?}", plan.chosen);
    }
}

/// What a scene file says wrong is named with its place.
#[test]
fn faults_in_media_are_reported_with_their_places() {
    let report = |medium: &str| {
        let text = format!("WorldBegin\nMakeNamedMedium \"m\" {medium}");
        let loaded = load_text(&text, "media", Path::new("."), &LoadOptions::default(), &FileCache::default());
        loaded.map(|_| ()).unwrap_err().to_string()
    };
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

/// Which media a scene has, and what of it is left out.
#[test]
fn media_that_nothing_refers_to_leave_a_scene_as_it_is() {
    let unused = camera("0 0 3", "", 3)
        + &format!(
            r#"MakeNamedMedium "fog" LightSource "infinite" "rgb L" [1 1 1] MediumInterface "fog" "fog" Material "interface" {BOX}"#
        );
    let job = job(&unused, AccelKind::Embree);
    assert!(job.world.scene.media.is_empty() && job.world.scene.surfaces.is_empty());
}

/// Features are those of the first surface behind media, also where every path ends before it.
#[test]
fn features_are_those_of_the_first_surface_behind_media() {
    let text = camera("0 0 3", "", 3)
        + &format!(
            r#"MakeNamedMedium "fog" "rgb sigma_s" [9 9 9] "rgb sigma_a" [0 0 0] LightSource "infinite" "rgb L" [1 1 1]
            Material "interface" MediumInterface "fog" "" {BOX} MediumInterface "" ""
            Material "diffuse" "rgb reflectance" [0.2 0.4 0.6]
            Shape "trianglemesh" "point3 P" [-9 -9 -2  9 -9 -2  9 9 -2  -9 9 -2] "integer indices" [0 1 2 0 2 3]"#
        );
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
