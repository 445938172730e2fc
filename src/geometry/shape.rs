//! A shape of any kind.

use super::bilinear::BilinearMesh;
use super::curve::CurveSet;
use super::hit::{LocalHit, SurfaceHit, VertexValues};
use super::mesh::TriangleMesh;
use super::quadric::Quadric;
use lumiris_numbers::math::{Bounds3, Ray, Vec2, Vec3};

/// A shape in the space of its group (world space for the root group).
#[derive(Clone, Debug)]
pub enum Shape {
    /// Indexed triangles.
    Mesh(TriangleMesh),
    /// Sphere, disk or cylinder, possibly partial.
    Quadric(Quadric),
    /// Indexed bilinear patches.
    Bilinear(BilinearMesh),
    /// Bézier curves with a width.
    Curves(CurveSet),
}

impl Shape {
    /// Bounds in the space of the group.
    pub fn bounds(&self) -> Bounds3 {
        match self {
            Shape::Mesh(mesh) => mesh.bounds(),
            Shape::Quadric(quadric) => quadric.bounds(),
            Shape::Bilinear(mesh) => mesh.bounds(),
            Shape::Curves(curves) => curves.bounds(),
        }
    }

    /// The first hit of `primitive`, which must not be a triangle, in (0, t_max) for which `accepts` is true. Its
    /// arguments are the hit and its index, 0 or 1, among the intersections of the ray's line with the primitive.
    #[inline]
    pub fn intersect(&self, primitive: u32, ray: &Ray, accepts: impl Fn(&LocalHit, usize) -> bool) -> Option<LocalHit> {
        match self {
            Shape::Quadric(quadric) => quadric.intersect_where(ray, accepts),
            Shape::Bilinear(mesh) => mesh.intersect_patch_where(primitive as usize, ray, accepts),
            Shape::Curves(curves) => curves.intersect(primitive as usize, ray).filter(|hit| accepts(hit, 0)),
            Shape::Mesh(_) => None,
        }
    }

    /// The surface at the parametric position `uv` of `primitive`, in the space of the group. Curves depend on the
    /// direction `d` of the ray.
    pub fn surface_hit(&self, primitive: u32, uv: [f32; 2], d: Vec3) -> SurfaceHit {
        match self {
            Shape::Mesh(mesh) => mesh.surface_hit(primitive as usize, uv),
            Shape::Quadric(quadric) => quadric.surface_hit(uv),
            Shape::Bilinear(mesh) => mesh.surface_hit(primitive as usize, uv),
            Shape::Curves(curves) => curves.surface_hit(primitive as usize, uv, d),
        }
    }

    /// Vertex values at the parametric position `uv` of `primitive`.
    pub fn vertex_values(&self, primitive: u32, uv: [f32; 2]) -> VertexValues {
        match self {
            Shape::Mesh(mesh) => mesh.vertex_values_at(primitive as usize, uv),
            Shape::Bilinear(mesh) => mesh.vertex_values_of(primitive as usize),
            Shape::Quadric(_) | Shape::Curves(_) => VertexValues::default(),
        }
    }

    /// Texture coordinates at the parametric position `uv` of `primitive`.
    pub fn texture_coordinates(&self, primitive: u32, uv: [f32; 2]) -> Vec2 {
        match self {
            Shape::Mesh(mesh) => mesh.texture_coordinates_at(primitive as usize, uv),
            Shape::Quadric(_) | Shape::Curves(_) => Vec2::from(uv),
            Shape::Bilinear(mesh) => mesh.texture_coordinates_at(primitive as usize, uv),
        }
    }
}
