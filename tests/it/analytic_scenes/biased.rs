//! Forms that fit their coefficients to the samples they are applied to: biased by O(1/N).

use super::Scene;
use super::power::{Budget, moments, picture_means};
use super::rows::{BASE, Configuration};
use lumiris::scene::{CorrelatedForm, CorrelatedSettings, EstimatorKind, OcvSettings, OptimalForm, SamplingTechnique};
use lumiris_numbers::estimators::ocv::Form;

/// With `samples` in each estimate.
fn forms(samples: u32) -> [Configuration; 5] {
    let base = Configuration { samples, ..BASE };
    let ocv = |form| Configuration { estimator: EstimatorKind::Ocv, ocv: OcvSettings { form, ..base.ocv }, ..base };
    let optimal = Configuration { estimator: EstimatorKind::OptimalMis, optimal_mis: OptimalForm::Direct, ..base };
    let correlated = |technique| Configuration {
        estimator: EstimatorKind::Correlated,
        correlated: CorrelatedSettings { form: CorrelatedForm::Combined, technique },
        ..base
    };
    let [bsdf, light] = [SamplingTechnique::Bsdf, SamplingTechnique::Light].map(correlated);
    [ocv(Form::Paper), ocv(Form::Regression), optimal, bsdf, light]
}

#[test]
#[ignore = "explore"]
fn explore_biased() {
    let level = 1e-5;
    for name in ["rectangle", "hidden-rectangle", "many-points", "half-environment", "sphere"] {
        let scene = Scene::named(name);
        for samples in [8, 16, 64] {
            for c in forms(samples) {
                let start = std::time::Instant::now();
                let pictures = picture_means(&scene.path, &c, Budget { edge: 8, pictures: 32 }, 5);
                let m = moments(&pictures, 0, 1.0);
                let a = scene.answer[0];
                println!(
                    "{name} {c}: bias {:+.4} % ± {:.4} t {:.2} {level}",
                    100.0 * (m.mean() / a - 1.0),
                    100.0 * m.standard_error() / a,
                    start.elapsed().as_secs_f64()
                );
            }
        }
    }
}
