//! Ray tracing by Embree, 3.13 or 4.x.
//!
//! Reading order: `error`, `device` (errors, memory), `scene` (geometries, instances), `world` (ids, exact hits),
//! `exact` (exact hits of a block of rays), `context` (state of the callbacks of a query), `callbacks` (first hits,
//! alpha masks, quadrics, patches, curves), `kernels` (functions of both API versions), `embree_accel` (the tracer, and
//! why its results do not depend on packets), `query` (batches), [`bare`] (Embree alone, for comparison).

pub mod bare;
mod callbacks;
mod context;
mod device;
mod embree_accel;
mod error;
mod exact_hits;
mod kernels;
mod query;
mod scene;
mod world;

pub use embree_accel::{EmbreeAccel, EmbreeOptions};
pub use error::{EmbreeError, ErrorCode};
