//! What photons tell of the visibility of lights, traced before the picture where its settings ask for it
//! [Keller and Wald 2000, §3].

use crate::lights::LightHints;
use crate::photons::{Tracing, Want, trace_photons};
use crate::scene::RenderJob;

/// Trajectories for each light, and their least and greatest number.
const PER_LIGHT: u64 = 512;
const TRAJECTORIES: [u64; 2] = [1 << 18, 1 << 23];
/// Share of the trajectories that all lights have evenly: a weak light next to a surface matters as a strong one far away does.
const EVEN_SHARE: f32 = 0.5;

/// Traces photons straight from lights, on all threads of the current pool, and lets them tell which lights are seen; with their number.
/// `None` for a scene that no photon arrives in: estimates do without.
pub fn light_hints(job: &RenderJob) -> Option<(LightHints, usize)> {
    let lights = &job.lights;
    let fitting = (PER_LIGHT * lights.lights.len() as u64).clamp(TRAJECTORIES[0], TRAJECTORIES[1]);
    let trajectories = job.settings().integrator.photons.light_photons.map_or(fitting, u64::from);
    let tracing = Tracing {
        seed: job.settings().sampling.seed,
        max_depth: 0,
        max_global_depth: 0,
        floor: EVEN_SHARE,
        ..Tracing::default()
    };
    let traced = trace_photons(job, &tracing, None, Want::Trajectories(trajectories)).ok()?;
    let primary: Vec<_> =
        traced.global.iter().filter_map(|photon| Some((photon.p(), photon.n(), photon.light()?))).collect();
    (!primary.is_empty()).then(|| (LightHints::adapted(&primary, lights.scene_radius), primary.len()))
}
