//! Irradiance caching [Ward et al. 1988]: irradiance of diffuse surfaces is interpolated between records.
//!
//! Irradiance has two parts, E = E_sources + E_indirect [Fan et al. 2006, §5.1]. Records hold either E_indirect
//! ([`Cached::Indirect`](crate::settings::Cached); direct light is estimated at every hit) or both
//! ([`Cached::All`](crate::settings::Cached)). They are computed at points visible to the camera, before rendering
//! ([`build`]), and do not change afterwards.
//!
//! Camera paths take the light reflected by Lambertian lobes from the records, and continue with the other lobes
//! (`diffuse.rs`).
//!
//! Biased: irradiance is interpolated, and the base below a coat is treated as Lambertian. The bounces of a record's
//! light are counted from the record, not counting mirrors before. Records of different shutter times are not
//! distinguished. Without interpolation, the result equals the integrator `path`.
//!
//! Reading order: [`gradients`], [`record`], [`octree`], [`cache`], [`gather`], `build`, `cache_integrator`.

mod build;
pub mod cache;
mod cache_integrator;
pub mod gather;
pub mod gradients;
pub mod octree;
pub mod record;

pub use cache::IrradianceCache;
pub use cache_integrator::CacheIntegrator;
pub use record::Record;
