//! Photon maps [Jensen 1996], whose photons are stored by visual importance [Keller and Wald 2000].
//!
//! ```text
//! camera ─importons─▶ p(x) ──┐
//! lights ─random walks─▶ arrivals ─store with probability p(x), or q·p(x)─▶ caustic and global photons ─tree─▶ maps
//! ```
//!
//! Photons lie on surfaces whose BSDF has a Lambertian part ([`crate::bsdfs::Bsdf::lambertian`]), and record their last
//! scattering event ([`Origin`]): none (straight from a light), a Lambertian lobe, or another lobe. The last kind are
//! caustic photons, whether the light before that event was direct or indirect.
//!
//! `integrators/photon_map/maps.rs` and `planning/visibility_cache.rs` call [`trace_photons`].
//!
//! Reading order: [`photon`], `tree`, [`map`]; [`light_distribution`], `path_stream`, `walk`; [`importance`],
//! [`trace`]; [`error`].

pub mod error;
pub mod importance;
pub mod light_distribution;
pub mod map;
#[cfg(test)]
mod map_tests;
pub(crate) mod path_stream;
pub mod photon;
pub mod trace;
mod tree;
mod walk;

pub use error::PhotonError;
pub use importance::{Importance, ImportanceSettings, LowImportance, importons, trace_importons};
pub use light_distribution::LightDistribution;
pub use map::{GatherPoint, GatherScratch, PhotonMap, Search};
pub use photon::{Origin, Photon};
pub use trace::{PhotonBudget, Traced, Tracing, path_count, trace_photons};
