//! Shapes as data, their exact intersection on the CPU, and the differential geometry of a hit.
//!
//! Reading order: [`mesh`], [`quadric`], [`bilinear`], [`hit`], [`set`].

pub mod bilinear;
pub mod hit;
pub mod mesh;
pub mod quadric;
pub mod set;

pub use bilinear::BilinearMesh;
pub use hit::SurfaceHit;
pub use mesh::TriangleMesh;
pub use quadric::{Quadric, QuadricKind};
pub use set::{Geometry, GeometryId, GeometrySet, Group, GroupId, Instance, Visibility};

/// A shape in the space of its group (world space for the root group).
#[derive(Clone, Debug)]
pub enum Shape {
    /// Indexed triangles.
    Mesh(TriangleMesh),
    /// Sphere, disk or cylinder, possibly partial.
    Quadric(Quadric),
    /// Indexed bilinear patches.
    Bilinear(BilinearMesh),
}

impl Shape {
    /// Bounds in the space of the group.
    pub fn bounds(&self) -> crate::math::Bounds3 {
        match self {
            Shape::Mesh(mesh) => mesh.bounds(),
            Shape::Quadric(quadric) => quadric.bounds(),
            Shape::Bilinear(mesh) => mesh.bounds(),
        }
    }
}
