//! Caustics by light paths [Arvo 1986; Veach 1997, §10.2], beside the camera paths.
//!
//! Let a path go from the camera to any surface but metal or glass, from there over metal or glass only, and end at an
//! emitting surface. A camera path must hit that emitter by chance. A light path begins there, goes over the same metal and
//! glass, and is then seen by the camera wherever that may be. Both find the path, and share it by the balance heuristic.
//!
//! The densities are compared at the ends: what passes through metal and glass keeps its area times projected solid angle
//! (étendue), so the density of the camera path is that of camera samples at its first vertex, cos θ/w², where a pixel is w
//! wide, times that of the direction which it goes on by; and the density of the light path is that of its emission. Of rough
//! metal or glass the densities differ a little more, which the heuristic may leave out. Weights depend on nothing that only
//! one of both knows: those of a path sum to one, whatever was drawn, and how many light samples there are.
//!
//! Both must meet the same surfaces. Textures and bumps are filtered by a footprint that depends on the point alone
//! ([`crate::scene::SurfaceInteraction::new`]). Which materials count as metal and glass is a property of the material,
//! textures and all ([`crate::materials::MaterialSet::find_caustics`]). Where a mixture is drawn anew for each direction, a
//! light path may both go on as over metal and be seen as on another surface.
//!
//! Camera paths keep what a smooth coat at the first vertex mirrors, and the light of the last vertex that the settings
//! allow. The k-th sample of each pixel has the k-th set of light paths, as many as `light_paths` says for each pixel. So
//! images depend on nothing but scene, settings, seed, and samples.

mod chain;
mod guide;
mod image;
mod pilot;
mod trace;

pub(super) use chain::Chain;
pub(super) use guide::Guide;
pub(super) use image::LightImage;
pub use pilot::LightPilot;
pub use trace::LightPathStats;

use super::features::{self, Feature};
use crate::scene::RenderJob;

/// Light paths per camera sample; 0 where there are none.
pub fn per_sample(job: &RenderJob) -> f32 {
    let wanted = job.settings().integrator.light_paths.unwrap_or(0.0);
    if wanted > 0.0 && features::allows(job, Feature::LightPaths) { wanted } else { 0.0 }
}
