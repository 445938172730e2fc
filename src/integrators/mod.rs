//! Light transport: from camera rays to radiance.

mod diffuse;
pub mod irradiance_cache;
pub mod path;
pub mod photon_map;
mod segment;
mod wavefront;

pub use irradiance_cache::{CacheIntegrator, IrradianceCache};
pub use path::{PathIntegrator, PathStats};
pub use photon_map::PhotonMapIntegrator;
