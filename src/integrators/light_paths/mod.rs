//! Caustics by light paths [Arvo 1986; Veach 1997, §10.2], in addition to camera paths. Reading order: `guide` samples
//! the emission, `trace` traces light paths, `chain` has the MIS weights, `pilot` learns the guide, `image` stores the
//! contributions.
//!
//! Consider paths from the camera to any surface other than metal or glass, from there over metal and glass only, to an
//! emitting surface. A camera path hits the emitter by chance. A light path starts at the emitter, passes the same
//! metal and glass, and is connected to the camera. The two techniques are combined by the balance heuristic.
//!
//! The densities are compared at the ends of the path, since metal and glass preserve étendue (area times projected
//! solid angle). The density of the camera path is the density of camera samples at its first vertex, cos θ/w² with the
//! pixel width w, times the density of its next direction. The density of the light path is the density of its
//! emission. For rough metal or glass the densities differ slightly more, which the heuristic may neglect. The weights
//! depend only on quantities that both techniques know. So the weights of a path sum to one, for any direction sampled
//! and any number of light samples.
//!
//! Both techniques must meet the same surfaces. Textures and bumps are filtered by a footprint that depends on the
//! point alone ([`crate::scene::SurfaceInteraction::new`]). The classification as metal or glass is a property of the
//! material, textures included ([`crate::materials::MaterialSet::find_caustics`]). A mixture is sampled anew for each
//! direction, so a light path may both continue at it as at metal and be connected to the camera as at another surface.
//!
//! Camera paths keep the mirror reflection of a smooth coat at the first vertex, and the light of the last vertex that
//! the settings allow. The k-th sample of each pixel uses the k-th set of light paths, with `light_paths` paths per
//! pixel. So images depend only on scene, settings, seed, and samples.

mod chain;
mod guide;
mod image;
mod per_sample;
mod pilot;
mod trace;

pub(super) use chain::Chain;
pub(super) use guide::LightPathGuide;
pub(super) use image::LightImage;
pub use per_sample::per_sample;
pub use pilot::LightPilot;
