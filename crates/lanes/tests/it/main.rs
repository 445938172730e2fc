//! Tests of the kernels at every level. They are outside the crate, so that kernels are compiled once.
#![allow(clippy::unwrap_used)]

mod area;
mod connections;
mod environment;
mod hilbert;
mod kernels;
mod lane;
mod light;
mod light_tree;
mod ris_weights;
mod sampler;
mod sums;
mod support;
mod triangle_points;
mod triangles;
mod two_techniques;
mod vertex;
