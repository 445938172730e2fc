//! Builds the visibility cache before rendering, where the settings ask for it [Keller and Wald 2000, §3].

use crate::lights::VisibilityCache;
use crate::photons::{PhotonBudget, Tracing, trace_photons};
use crate::scene::RenderJob;

/// Photon paths per light, and the minimum and maximum number of them all.
const PER_LIGHT: u64 = 512;
const PATHS: [u64; 2] = [1 << 18, 1 << 23];
/// Fraction of the photon paths distributed evenly over the lights: a weak light next to a surface matters as much as a
/// strong one far away.
const UNIFORM_FRACTION: f32 = 0.5;

/// Traces photons straight from lights on all threads of the current pool, and builds the cache from them; returned
/// with their number. `None` if no photon arrives at a surface: estimates then do without a cache.
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
