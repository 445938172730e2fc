//! The last vertices of paths, for the MIS weights of emitters that their BSDF samples hit.

use super::path_state::PathState;
use crate::direct::{Techniques, Vertices};
use crate::lights::LightCtx;
use lumiris_numbers::estimators::heuristics::Technique;
use lumiris_numbers::math::Rgb;

/// BSDF sampling at the last vertex, for its MIS weight against light sampling there.
#[derive(Clone, Copy, Debug)]
pub(super) struct BsdfTechnique {
    /// The row of the last vertex; [`Self::NO_ROW`] if no light was sampled there.
    pub(super) row: u32,
    /// Density of the direction; `None` for a specular lobe, which no other technique samples.
    pub(super) pdf: Option<f32>,
    /// Throughput beyond the first surface; `None` if roulette ends the path there.
    pub(super) survivor: Option<Rgb>,
}

impl BsdfTechnique {
    /// Stands for a point where no light was sampled.
    pub(super) const NO_ROW: u32 = u32::MAX;
}

/// The last vertices of the paths of a batch, and the direct-light techniques used there.
pub(super) struct LastVertices<'a, 'w> {
    pub(super) vertices: &'a Vertices<'w>,
    pub(super) techniques: Option<Techniques>,
}

impl LastVertices<'_, '_> {
    /// The point at which light was sampled last.
    #[inline]
    pub(super) fn ctx(&self, path: &PathState) -> LightCtx {
        match path.technique {
            Some(technique) if technique.row != BsdfTechnique::NO_ROW => {
                self.vertices.surface.lit_points().get(technique.row as usize)
            }
            _ => LightCtx::at(path.ray.o),
        }
    }

    /// MIS weight of an emitter hit by the BSDF sample of a path; light sampling has the density `p_light`.
    #[inline]
    pub(super) fn weight(&self, path: &PathState, p_light: impl FnOnce(&LightCtx) -> f32) -> f32 {
        let Some(techniques) = &self.techniques else { return 1.0 };
        path.technique.and_then(|technique| technique.pdf).map_or(1.0, |p| {
            let light = Technique { n: techniques.light_samples(), p: p_light(&self.ctx(path)) };
            techniques.heuristic.weight(Technique { n: 1.0, p }, light)
        })
    }
}
