//! The smallest sample counts, with every estimator.

use crate::path_reuse::{film, mean_of};
use lumiris::import::{LoadOptions, load};
use lumiris::render::RenderSettings;
use lumiris::scene::AccelKind;
use lumiris::settings::{EstimatorKind, OcvForm, OptimalForm};
use std::path::Path;
use strum::VariantNames;

/// The mean of the image is the same with one sample per vertex, within 4 standard errors.
#[test]
fn one_sample_at_a_vertex_is_enough_for_every_estimator() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/analytic/half-environment.pbrt");
    let options = LoadOptions { resolution: Some([8, 8]), ..LoadOptions::default() };
    let loaded = load(&path, &options).map_err(|d| d.to_string()).unwrap();
    let mut job = loaded.job(AccelKind::Embree, None).unwrap();
    let mut answers = Vec::new();
    // Without biased estimators
    let is_kept = |kind: &&&str| !["ocv", "correlated"].contains(kind);
    let kinds = EstimatorKind::VARIANTS.iter().filter(is_kept).map(|kind| (*kind, OcvForm::Pixels));
    let forms = [OcvForm::Pixels, OcvForm::Progressive].map(|form| ("ocv", form));
    for (kind, form) in kinds.chain(forms) {
        job.change(|s| {
            (s.integrator.estimator, s.integrator.ocv.form) = (kind.parse().unwrap(), form);
            (s.integrator.samples, s.integrator.later_samples) = (Some(1), Some(1));
            s.integrator.optimal_mis = OptimalForm::Progressive;
        });
        let images = (0..16).map(|seed| {
            job.change(|s| s.sampling.seed = seed);
            let film = film(&job, RenderSettings { spp: 8, ..RenderSettings::default() });
            film.pixels().iter().flat_map(|p| p.mean()).sum::<f64>()
        });
        answers.push((format!("{kind} {form:?}"), mean_of(images.collect::<Vec<_>>().into_iter())));
    }
    let (first, rest) = answers.split_first().unwrap();
    for (what, (mean, variance)) in rest {
        let error = (variance + first.1.1).sqrt();
        assert!((mean - first.1.0).abs() < 4.0 * error + 1e-4 * mean, "{what}: {mean}, {first:?} ± {error}");
    }
}
