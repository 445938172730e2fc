//! From candidates to contributions: what each estimator makes of f and the densities.

use super::propose::{Candidates, Drawn};
use crate::estimators::mc;
use crate::estimators::mis::{Heuristic, Technique};
use crate::math::Rgb;
use crate::scene::{EstimatorKind, IntegratorSettings};

/// `out[i]` becomes the contribution of candidate `i` if its segment is free; zeros need no segment.
pub fn contributions(settings: &IntegratorSettings, candidates: &Candidates, out: &mut Vec<Rgb>) {
    out.clear();
    out.extend(candidates.records.iter().map(|c| {
        let light = Technique { n: c.n_light, p: c.p_light };
        let bsdf = Technique { n: c.n_bsdf, p: c.p_bsdf };
        c.f * weight(settings.estimator, settings.heuristic(), c.drawn, light, bsdf)
    }));
}

/// The factor w/(n·p) of a candidate.
fn weight(kind: EstimatorKind, heuristic: Heuristic, drawn: Drawn, light: Technique, bsdf: Technique) -> f32 {
    match (drawn, kind) {
        // A delta can only be drawn by its own technique.
        (Drawn::DeltaLight, _) => mc::weight(light.n, light.p),
        (Drawn::DeltaBsdf, _) => mc::weight(bsdf.n, bsdf.p),
        (Drawn::Light, EstimatorKind::Mc) => mc::weight(light.n, light.p),
        (Drawn::Bsdf, EstimatorKind::Mc) => 0.0,
        (Drawn::Light, EstimatorKind::Mis | EstimatorKind::Ris) => {
            heuristic.weight(light, bsdf) * mc::weight(light.n, light.p)
        }
        (Drawn::Bsdf, EstimatorKind::Mis | EstimatorKind::Ris) => {
            heuristic.weight(bsdf, light) * mc::weight(bsdf.n, bsdf.p)
        }
    }
}
