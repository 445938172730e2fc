//! The pure-Rust bounding volume hierarchy, the reference for the Embree tracer.
//!
//! There are two levels: a tree per group, and one over the root's primitives and the instances (`hierarchy`). A binary
//! tree is built by the surface-area heuristic (`build`), collapsed to eight-wide nodes with leaves of four triangles
//! (`tree`), and traversed one ray at a time (`walk`). Triangles are watertight; quadrics and bilinear patches use the
//! exact intersections of [`crate::geometry`].
//!
//! Results do not depend on the traversal order: [`Hit::precedes`](super::Hit::precedes) decides among hits with equal
//! t. Primitives and instances with NaN or infinite coordinates are excluded.

mod build;
mod hierarchy;
mod tree;
mod walk;

pub use hierarchy::Bvh;
