//! From candidates to contributions where all are traced: the contributions that `mc`, `mis` and the estimators based
//! on them compute from f and the densities.

use super::propose::{Candidates, Drawn};
use crate::settings::{EstimatorKind, IntegratorSettings};
use lumiris_numbers::estimators::mc;
use lumiris_numbers::math::Rgb;

/// `out[i]` becomes the contribution of candidate `i` if its segment is unoccluded; zero contributions need no segment.
pub fn contributions(settings: &IntegratorSettings, candidates: &Candidates, out: &mut Vec<Rgb>) {
    let heuristic = settings.heuristic();
    out.clear();
    out.extend(candidates.records.iter().map(|c| {
        c.f * match (settings.estimator, c.drawn) {
            (EstimatorKind::Mc | EstimatorKind::Contributing, Drawn::Light) => mc::weight(c.n_light, c.p_light),
            (EstimatorKind::Mc | EstimatorKind::Contributing, Drawn::Bsdf) => 0.0,
            (EstimatorKind::Correlated, Drawn::Light | Drawn::DeltaLight) => mc::weight(c.n_light, c.p_light),
            (EstimatorKind::Correlated, Drawn::Bsdf | Drawn::DeltaBsdf) => mc::weight(c.n_bsdf, c.p_bsdf),
            _ => c.factor(heuristic),
        }
    }));
}
