//! Roulette and splitting by what a pilot found: known answers.

use crate::analytic_scenes::answer;
use lumiris::import::{LoadOptions, load};
use lumiris::render::{RenderSettings, render};
use lumiris::scene::AccelKind;
use lumiris::settings::{EstimatorKind, RouletteKind};
use lumiris_numbers::samplers::SamplerKind;
use std::path::Path;
use std::sync::atomic::AtomicBool;

/// Furnaces, a box, and scenes with lights.
const SCENES: [&str; 5] =
    ["furnace-closed-4", "furnace-box-3", "furnace-diffuse-transmission", "furnace-glass", "half-environment"];
const SEEDS: u32 = 48;
/// Level of the tests of all rows together.
const LEVEL_QUANTILE: f64 = 4.9;

/// Means of images of different seeds, which are independent.
fn means(scene: &str, kind: RouletteKind, estimator: EstimatorKind) -> Vec<[f64; 3]> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/analytic").join(scene).with_extension("pbrt");
    let options = LoadOptions { resolution: Some([8; 2]), ..LoadOptions::default() };
    let mut loaded = load(&path, &options).map_err(|d| d.to_string()).unwrap();
    (loaded.settings.integrator.roulette, loaded.settings.integrator.estimator) = (kind, estimator);
    loaded.settings.sampling.sampler = SamplerKind::SobolBlueNoise;
    let mut job = loaded.job(AccelKind::Embree, None).unwrap();
    let mean = |seed| {
        job.change(|s| s.sampling.seed = seed);
        let settings = RenderSettings { spp: 8, ..RenderSettings::default() };
        let film = render(&job, &settings, &AtomicBool::new(false), &|_| ()).unwrap().film;
        let sum = film.pixels().iter().map(|p| p.mean()).fold([0.0; 3], |a, b| [a[0] + b[0], a[1] + b[1], a[2] + b[2]]);
        sum.map(|s| s / film.len() as f64)
    };
    (0..SEEDS).map(mean).collect()
}

/// 5 scenes × 2 kinds × 3 estimators × 3 channels: with 47 degrees of freedom a t of 4.9 has a level of 10⁻⁵, so all
/// together 10⁻³. A bias of 8 standard errors, which is at most 4 %, is found with a probability above 0.99.
#[test]
fn known_answers_remain_with_roulette_and_splitting() {
    for scene in SCENES {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/analytic").join(scene).with_extension("pbrt");
        let answer = answer(&path);
        for kind in [RouletteKind::Efficiency, RouletteKind::Adjoint] {
            for estimator in [EstimatorKind::Mis, EstimatorKind::Ris, EstimatorKind::Mc] {
                let means = means(scene, kind, estimator);
                for c in 0..3 {
                    let n = means.len() as f64;
                    let mean = means.iter().map(|m| m[c]).sum::<f64>() / n;
                    let variance = means.iter().map(|m| (m[c] - mean).powi(2)).sum::<f64>() / (n - 1.0);
                    // Rounding, where there is no noise
                    let error = (variance / n).sqrt() + 1e-6 * answer[c];
                    let what = format!("{scene} {kind:?} {estimator:?}: {mean} ± {error}, not {}", answer[c]);
                    assert!((mean - answer[c]).abs() < LEVEL_QUANTILE * error, "{what}");
                    assert!(8.0 * error < 0.04 * answer[c], "too much noise: {what}");
                }
            }
        }
    }
}
