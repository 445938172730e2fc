//! The kernels at every level; outside the crate, so that they are compiled once.
#![allow(clippy::unwrap_used)]

mod area;
mod bsdf;
mod combine;
mod connections;
mod curve;
mod environment;
mod lane;
mod light;
mod light_choice;
mod sampler;
mod sums;
mod support;
mod triangles;
mod two_techniques;
mod vertex;
