//! Roulette and splitting by what a pilot found: known answers.

use crate::analytic_scenes::answer;
use lumiris::import::{LoadOptions, load};
use lumiris::render::{RenderSettings, render};
use lumiris::scene::AccelKind;
use lumiris::settings::{EstimatorKind, RouletteKind};
use lumiris_numbers::samplers::SamplerKind;
use lumiris_test_support::power::by_power;
use lumiris_test_support::significance::{critical_t, detectable_deviation};
use std::path::Path;
use std::sync::atomic::AtomicBool;

/// Furnaces, a box, and scenes with lights.
const SCENES: [&str; 5] =
    ["furnace-closed-4", "furnace-box-3", "furnace-diffuse-transmission", "furnace-glass", "half-environment"];
/// Level of the test of a channel: 10⁻³ for all together.
const LEVEL: f64 = 1e-5;

fn seeds() -> u32 {
    by_power(48, 16)
}

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
    (0..seeds()).map(mean).collect()
}

/// 5 scenes × 2 kinds × 3 estimators × 3 channels. A bias of 4 % is found with a probability of 0.99 (8.5 % in `make test`).
#[test]
fn known_answers_remain_with_roulette_and_splitting() {
    let freedom = u64::from(seeds() - 1);
    let limit = critical_t(LEVEL, freedom);
    let deviation = detectable_deviation(LEVEL, 0.99, freedom);
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
                    assert!((mean - answer[c]).abs() < limit * error, "{what}");
                    assert!(deviation * error < by_power(0.04, 0.085) * answer[c], "too much noise: {what}");
                }
            }
        }
    }
}
