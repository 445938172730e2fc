//! The vertices of a batch of paths, in columns. Row k of every column is vertex k.
//!
//! Rows form runs of equal work (`Run`). The first rows have their own [`SurfaceBsdf`](crate::materials::SurfaceBsdf),
//! sorted by the kernel that evaluates them. All other rows are one run of Lambertian surfaces, with their reflectance
//! in columns. The data of a vertex go straight into the columns, except for the points of meshes in world space: their
//! corners are collected, and one kernel computes all of these points at the end ([`Vertices::finish`]).
//!
//! Reading order: `vertex_data` (vertices without a row), `surface` (their points), `vertex_columns` (rows),
//! `scattering` (values and samples of the BSDFs of all rows).

mod scattering;
mod surface;
mod vertex_columns;
mod vertex_data;

pub use scattering::BsdfSamples;
pub use surface::Surface;
pub use vertex_columns::Vertices;
pub use vertex_data::VertexData;
