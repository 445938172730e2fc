//! Estimators and statistics over numbers: slices in, numbers out; no scene, ray or sampler.

pub mod stats;
