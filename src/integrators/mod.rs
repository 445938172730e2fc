//! Light transport: from camera rays to radiance.

pub mod irradiance_cache;
pub mod path;

pub use irradiance_cache::{CacheIntegrator, IrradianceCache};
pub use path::{PathIntegrator, PathStats};
