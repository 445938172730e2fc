//! What photons tell of the visibility of lights, traced before the image where its settings ask for it
//! [Keller and Wald 2000, §3].

use crate::lights::VisibilityCache;
use crate::photons::{PhotonBudget, Tracing, trace_photons};
use crate::scene::RenderJob;

/// Photon paths for each light, and their least and greatest number.
const PER_LIGHT: u64 = 512;
const PATHS: [u64; 2] = [1 << 18, 1 << 23];
/// Share of the photon paths that all lights have evenly: a weak light next to a surface matters as a strong one far
/// away does.
const UNIFORM_FRACTION: f32 = 0.5;

/// Traces photons straight from lights, on all threads of the current pool, and lets them tell which lights are seen; with their number.
/// `None` for a scene that no photon arrives in: estimates do without.
pub fn build_visibility_cache(job: &RenderJob) -> Option<(VisibilityCache, usize)> {
    let lights = &job.lights;
    let fitting = (PER_LIGHT * lights.lights.len() as u64).clamp(PATHS[0], PATHS[1]);
    let paths = job.settings().integrator.photons.visibility_photons.map_or(fitting, u64::from);
    let tracing = Tracing {
        seed: job.settings().sampling.seed,
        max_depth: 0,
        max_global_depth: 0,
        floor: UNIFORM_FRACTION,
        ..Tracing::default()
    };
    let traced = trace_photons(job, &tracing, None, PhotonBudget::Paths(paths)).ok()?;
    let primary: Vec<_> =
        traced.global.iter().filter_map(|photon| Some((photon.p(), photon.n(), photon.light()?))).collect();
    (!primary.is_empty()).then(|| (VisibilityCache::adapted(&primary, lights.scene_radius), primary.len()))
}
