//! Completes the settings that stay open until the scene is loaded.
//!
//! * [`plan`]: the entry point [`prepare`], and the record of the choices; [`preparation`]: its parameters and errors.
//! * `rule`, [`facts`]: chooses the estimator for `auto` from facts of the scene.
//! * [`processor_time`]: the clock of statistics.
//! * [`allocation`], `allocation_counts`, `noise_target`, `probe`: pilots for the camera samples of each pixel.
//! * [`proposals`], [`visibility_cache`]: proposals of `ris` per pixel; the cache of contributing lights.
//! * `constants`: all constants of these, with the measurements that they follow from.
//!
//! The results are a function of scene, settings and seed: work is counted, not timed.

pub mod allocation;
mod allocation_counts;
mod constants;
pub mod facts;
mod noise_target;
pub mod plan;
pub mod preparation;
mod probe;
pub mod processor_time;
pub mod proposals;
mod rule;
pub mod visibility_cache;

pub use plan::{Plan, has_pilot, prepare};
pub use preparation::{PlanError, Preparation};
