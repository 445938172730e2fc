//! The pure-Rust bounding volume hierarchy, the reference for the Embree tracer.
//!
//! There are two levels: a tree per group, and one over the root's primitives and the instances (`hierarchy`). A binary
//! tree is built by the surface-area heuristic (`build`), collapsed to eight-wide nodes with leaves of four triangles
//! or eight spans of curves (`tree`, `curve_block`), and traversed one ray at a time (`walk`). Triangles are watertight;
//! curves, quadrics and bilinear patches use the exact intersections of [`crate::geometry`].
//!
//! The Embree tracer uses the hierarchy for curves.
//!
//! Results do not depend on the traversal order: [`Hit::precedes`](super::Hit::precedes) decides among hits with equal
//! t. Primitives and instances with NaN or infinite coordinates are excluded.

mod build;
mod curve_block;
mod hierarchy;
mod tree;
mod walk;

pub use hierarchy::Bvh;
