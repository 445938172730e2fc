//! Participating media: known answers, every estimator and medium, bit-identical images, and errors.
//!
//! A scene is a text with one answer for all pixels. Images of different seeds are independent. t-tests have a level of
//! 10⁻⁵ for each channel, and must have the power to detect the bias that they state (1.7 times that in `make test`,
//! which renders half of the images).

mod agreement;
mod known_answers;
mod settings;

use lumiris::film::{Film, PixelSums};
use lumiris::import::cache::FileCache;
use lumiris::import::{LoadOptions, load_text};
use lumiris::render::{RenderSettings, render};
use lumiris::scene::{AccelKind, RenderJob};
use lumiris::settings::{EstimatorKind, IntegratorSettings, Proposals, Target};
use lumiris_formats::spectra::Y_INTEGRAL;
use lumiris_test_support::power::by_power;
use lumiris_test_support::significance::{critical_t, detectable_deviation};
use std::path::Path;
use std::sync::atomic::AtomicBool;

/// Significance level of the test of a channel.
const LEVEL: f64 = 1e-5;

/// Number of images per test.
fn images() -> u32 {
    by_power(32, 16)
}

/// |t| beyond which a mean is rejected.
pub(crate) fn limit() -> f64 {
    critical_t(LEVEL, u64::from(images() - 1))
}

/// True if a relative bias of `detects` is detected with a probability of 0.99 for a mean with the relative standard
/// error `relative`.
pub(crate) fn has_power(relative: f64, detects: f64) -> bool {
    detectable_deviation(LEVEL, 0.99, u64::from(images() - 1)) * relative < by_power(detects, 1.7 * detects)
}

/// A camera at `from` that looks along −z through a rectangle so small that all rays are the same.
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

/// Means and standard errors over images.
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

/// The mean of every channel is the answer. A relative bias of `detects` would be detected with a probability above
/// 0.99.
#[track_caller]
pub(crate) fn assert_answer(job: &mut RenderJob, spp: u32, answer: [f64; 3], detects: f64, what: &str) {
    let (mean, error) = means(job, spp);
    for c in 0..3 {
        // Rounding error of f32, for images without noise
        let error = error[c] + 3e-5 * answer[c];
        let text = format!("{what}: channel {c} is {} ± {error}, not {}", mean[c], answer[c]);
        assert!((mean[c] - answer[c]).abs() < limit() * error, "{text}");
        assert!(has_power(error / answer[c].max(1e-3), detects), "too much noise: {text}");
    }
}

/// All means agree with their common mean, weighted by inverse variances. A relative difference of `detects` would be
/// detected with a probability above 0.99.
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

/// All estimators and settings that support media.
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

/// Sets the estimator, sample counts and target of `settings`.
pub(crate) fn choose(job: &mut RenderJob, settings: &IntegratorSettings) {
    job.change(|s| {
        (s.integrator.estimator, s.integrator.samples) = (settings.estimator, settings.samples);
        s.integrator.ris = settings.ris;
        s.integrator.path_reuse = None;
    });
}

/// A box for media, or around a hole in the form of a box or a sphere.
pub(crate) const BOX: &str = r#"Shape "trianglemesh" "point3 P" [-1 -1 -1  1 -1 -1  1 1 -1  -1 1 -1  -1 -1 1  1 -1 1  1 1 1  -1 1 1]
    "integer indices" [0 2 1 0 3 2  4 5 6 4 6 7  0 1 5 0 5 4  3 7 6 3 6 2  0 4 7 0 7 3  1 2 6 1 6 5]"#;

/// Values of a grid of 4 × 4 × 4 samples, far from constant.
fn grid(channels: usize, scale: f32) -> String {
    let value = |i: usize| scale * (0.05 + ((i * 37 + 11) % 23) as f32 / 23.0);
    (0..64 * channels).map(|i| format!("{:.4} ", value(i))).collect()
}

/// One medium of each kind, with `scattering` and `absorption` as factors of its coefficients.
fn media(scattering: f32, absorption: f32, more: &str) -> Vec<(&'static str, String)> {
    let (s, a) = (scattering, absorption);
    let colors =
        format!(r#""rgb sigma_s" [{} {} {}] "rgb sigma_a" [{} {} {}]"#, s, 0.5 * s, 0.15 * s, 0.2 * a, 0.6 * a, a);
    // The box is between the inner samples: further out, the density and emission of a grid fade
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

/// A medium in a box, in uniform light of radiance 1 from everywhere.
fn in_even_light(medium: &str) -> RenderJob {
    let text = camera("0.3 0.2 3", "", 60)
        + &format!(
            r#"MakeNamedMedium "fog" {medium} LightSource "infinite" "rgb L" [1 1 1]
            Material "interface" MediumInterface "fog" "" {BOX}"#
        );
    job(&text, AccelKind::Embree)
}
