//! Ray tracing: one interface, and two implementations that check each other.
//!
//! * `ray_tracer`: the interface, and the order of hits at the same parameter ([`Hit::precedes`])
//! * [`embree`]: the fast tracer
//! * [`bvh`]: the pure-Rust reference
//! * [`alpha`]: alpha masks of both
//!
//! Rays come in structure-of-arrays batches. The results of a batch do not depend on its division into packets.

pub mod alpha;
pub mod bvh;
pub mod embree;
mod ray_tracer;
#[cfg(test)]
mod scenes_for_tests;

pub use alpha::AlphaTest;
pub use bvh::Bvh;
pub use ray_tracer::{Accel, AccelStats, Coherence, Hit, RayBatch};
