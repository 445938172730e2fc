//! Shapes as data, their exact intersection on the CPU, and the differential geometry of hits.
//!
//! Reading order: [`hit`], [`triangle`], [`mesh`], [`quadric`], [`bilinear`], [`curve`], [`loop_subdiv`],
//! [`displacement`], [`shape`] (all kinds), [`clusters`], [`set`].

pub mod bilinear;
pub mod clusters;
pub mod curve;
pub mod displacement;
pub mod hit;
pub mod loop_subdiv;
pub mod mesh;
pub mod quadric;
#[cfg(test)]
pub(crate) mod reference_for_tests;
pub mod set;
pub mod shape;
pub mod triangle;

pub use bilinear::BilinearMesh;
pub use clusters::{ClusterId, ClusterInstance, Clusters, GroupId, Member};
pub use curve::{Curve, CurveKind, CurveSet};
pub use displacement::DisplacedMesh;
pub use hit::{AlphaSource, LocalHit, SurfaceHit, VertexValues};
pub use loop_subdiv::loop_subdivide;
pub use mesh::TriangleMesh;
pub use quadric::{Quadric, QuadricKind};
pub use set::{Geometry, GeometryId, GeometrySet, Group, Instance, NO_INSTANCE, PrimitiveCounts, Visibility};
pub use shape::Shape;
