//! Ray tracing by Embree, 3.13 or 4.x.
//!
//! Reading order: `error`, `device` (errors, memory), `scene` (geometries, instances), `scene_ids` (ids, exact hits),
//! `exact_hits` (exact hits of a block of rays), `context` (state of the callbacks of a query), `callbacks` (first
//! hits, alpha masks, quadrics, patches), `clusters` (instances of instances), `calls` (functions of both API
//! versions), `embree_accel` (the tracer, and why its results do not depend on packets), `query` (batches), [`bare`]
//! (Embree alone, for comparison).

pub mod bare;
mod callbacks;
mod calls;
mod clusters;
mod context;
mod device;
mod embree_accel;
mod error;
mod exact_hits;
mod query;
mod scene;
mod scene_ids;

pub use embree_accel::{EmbreeAccel, EmbreeOptions};
pub use error::{EmbreeError, ErrorCode};
