//! Estimator forms that fit coefficients to their own samples have a bias of O(1/N).

use super::Scene;
use super::power::{Budget, POWER, image_means, moments};
use super::rows::{BASE, Configuration};
use lumiris::settings::{EstimatorKind, OcvForm, OcvSettings, OptimalForm, SamplingTechnique};
use lumiris_numbers::estimators::stats::sidak;
use lumiris_test_support::significance::{detectable_deviation, is_beyond};

/// N, the number of samples per estimate.
const SAMPLES: u32 = 64;
const SCENES: [&str; 5] = ["half-environment", "hidden-rectangle", "many-points", "rectangle", "sphere"];
const BUDGET: Budget = Budget { edge: 4, images: 32 };

/// Each form with an upper bound of its relative bias over all scenes. Measured at N = 64, with errors up to 0.07 %:
/// −2.95 % (`sphere`), +0.31 % (`hidden-rectangle`), −1.74 % (`sphere`) and +0.01 %.
fn forms() -> [(Configuration, f64); 4] {
    let base = Configuration { samples: SAMPLES, ..BASE };
    let ocv = |form| Configuration { estimator: EstimatorKind::Ocv, ocv: OcvSettings { form, ..base.ocv }, ..base };
    let optimal = Configuration { estimator: EstimatorKind::OptimalMis, optimal_mis: OptimalForm::Direct, ..base };
    let correlated =
        |technique| Configuration { estimator: EstimatorKind::Correlated, correlated_technique: technique, ..base };
    [
        (ocv(OcvForm::Paper), 0.031),
        (optimal, 0.004),
        (correlated(SamplingTechnique::Bsdf), 0.022),
        (correlated(SamplingTechnique::Light), 0.002),
    ]
}

#[test]
fn forms_that_fit_their_own_samples_are_biased_by_little() {
    let significance = sidak(1e-3, SCENES.len() * forms().len());
    let mut faults = Vec::new();
    for scene in SCENES.map(Scene::named) {
        for (i, (c, limit)) in (0..).zip(forms()) {
            let images = image_means(&scene.path, &c, BUDGET, 1000 * i);
            let is_biased = |factor| {
                let mean = moments(&images, 0, factor);
                is_beyond(&mean, scene.answer[0], limit * scene.answer[0], significance)
            };
            let mean = moments(&images, 0, 1.0);
            let error = mean.standard_error() / scene.answer[0];
            let noticed = limit + detectable_deviation(significance, POWER, mean.count() - 1) * error;
            let found = format!(
                "{} {c}: {:+.3} % ± {:.3} %, limit {:.3} %, notices {:.3} %",
                scene.name,
                100.0 * (mean.mean() / scene.answer[0] - 1.0),
                100.0 * error,
                100.0 * limit,
                100.0 * noticed
            );
            // The factor may have the opposite sign of the bias
            let is_noticed = noticed < 2.0 * limit && is_biased(1.0 + 3.0 * limit) && is_biased(1.0 - 3.0 * limit);
            if is_biased(1.0) || !is_noticed {
                faults.push(found);
            }
        }
    }
    assert!(faults.is_empty(), "{}", faults.join("\n"));
}
