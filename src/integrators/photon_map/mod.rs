//! Photon mapping [Jensen 1996] with the extensions of [Keller and Wald 2000].
//!
//! Direct light is estimated at every vertex by any estimator. Specular and glossy lobes are followed by paths
//! (`diffuse.rs`). The remaining light at Lambertian lobes comes from photons: from the caustic map, if the light was
//! last scattered by another lobe, otherwise from a final gather, whose rays look up the maps at Lambertian surfaces.
//! Each light path counts once, since its last scattering before the vertex was either Lambertian (final gather) or not
//! (caustic map).
//!
//! If a gather ray is shorter than the search radius at its end, density estimation is inaccurate near the corner
//! between the two surfaces. The ray then continues as a path, with direct light and another ray.
//!
//! Biased by density estimation, and because the base below a coat is treated as Lambertian. With `progressive`,
//! density estimation is consistent. Bounces are counted from the vertex that looks up the maps, not counting mirrors
//! before.
//!
//! Reading order: [`maps`], `boundary`, [`gather_guide`], `lookups`, `photon_map_integrator`.

mod boundary;
pub mod gather_guide;
mod lookups;
pub mod maps;
mod photon_map_integrator;

pub use maps::{MapMaker, PhotonMaps};
pub use photon_map_integrator::PhotonMapIntegrator;
