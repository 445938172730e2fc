//! Results of intersections, and the differential geometry of a hit.

use glam::DVec3;
use lumiris_numbers::math::transform::transform_normal;
use lumiris_numbers::math::{Affine3A, Frame, Vec2, Vec3, gamma};

/// Intersection of a ray with one shape.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LocalHit {
    /// Ray parameter.
    pub t: f32,
    /// Parametric position, as the shape defines it.
    pub uv: [f32; 2],
}

/// Optional values of a mesh besides the texture coordinates: interpolated vertex values, and the face number.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct VertexValues {
    /// Second texture coordinates; zero if there are none.
    pub uv1: Vec2,
    /// Linear colour and opacity; 1 if there are none.
    pub color: [f32; 4],
    /// Face number, for textures per face; 0 if the mesh has none.
    pub face: u32,
}

impl Default for VertexValues {
    fn default() -> Self {
        VertexValues { uv1: Vec2::ZERO, color: [1.0; 4], face: 0 }
    }
}

/// Values of alpha textures.
pub trait AlphaSource: Send + Sync {
    /// Value of float texture `texture` at the texture coordinates `uv` of the world-space point `p`; `vertex` holds
    /// the interpolated vertex values.
    fn alpha(&self, texture: u32, uv: Vec2, vertex: &VertexValues, p: Vec3) -> f32;
}

/// A point on a surface, for materials and lights. In world space unless documented otherwise.
#[derive(Clone, Copy, Debug)]
pub struct SurfaceHit {
    /// The point, refined onto the surface.
    pub p: Vec3,
    /// Bound of the rounding error of `p` per axis.
    pub p_error: Vec3,
    /// Geometric normal, unit, oriented by the shape (the emitting side of an area light), not flipped to the viewer.
    pub n: Vec3,
    /// Shading normal, unit, in the hemisphere of `n`.
    pub ns: Vec3,
    /// ∂p/∂u of the surface.
    pub dpdu: Vec3,
    /// ∂p/∂v of the surface.
    pub dpdv: Vec3,
    /// ∂p/∂u for shading (tangent), not yet orthogonal to `ns`.
    pub dpdus: Vec3,
    /// A vector on the side of the second axis of tangent space (bitangent), not yet orthogonal to `ns` and `dpdus`.
    pub dpdvs: Vec3,
    /// Texture coordinates.
    pub uv: Vec2,
    /// Other interpolated vertex values.
    pub vertex: VertexValues,
}

impl SurfaceHit {
    /// A point without a surface: normals and derivatives are zero.
    pub fn in_space(p: Vec3) -> Self {
        let zero = Vec3::ZERO;
        SurfaceHit {
            p,
            p_error: zero,
            n: zero,
            ns: zero,
            dpdu: zero,
            dpdv: zero,
            dpdus: zero,
            dpdvs: zero,
            uv: Vec2::ZERO,
            vertex: VertexValues::default(),
        }
    }

    /// Transforms the hit of a shape to world space. The error bound includes the rounding of the point and of the
    /// ray's transform to the group's space and back.
    #[must_use]
    pub fn transformed(&self, world_from_group: &Affine3A) -> SurfaceHit {
        let p = round(world_from_group.as_daffine3().transform_point3(self.p.as_dvec3()));

        // Error bound
        let group_from_world = world_from_group.inverse();
        let inbound = abs_linear(&group_from_world, p.abs()) + Vec3::from(group_from_world.translation).abs();
        let p_error =
            abs_linear(world_from_group, self.p_error * (1.0 + gamma(3)) + inbound * gamma(10)) + p.abs() * gamma(2);
        let n = transform_normal(world_from_group, self.n);
        SurfaceHit {
            p,
            p_error,
            n,
            ns: face_forward(transform_normal(world_from_group, self.ns), n),
            dpdu: world_from_group.transform_vector3(self.dpdu),
            dpdv: world_from_group.transform_vector3(self.dpdv),
            dpdus: world_from_group.transform_vector3(self.dpdus),
            dpdvs: world_from_group.transform_vector3(self.dpdvs),
            uv: self.uv,
            vertex: self.vertex,
        }
    }
}

/// `v`, flipped to the hemisphere of `n`.
#[inline]
pub(super) fn face_forward(v: Vec3, n: Vec3) -> Vec3 {
    if v.dot(n) < 0.0 { -v } else { v }
}

/// Rounds to the nearest f32.
#[inline]
pub(super) fn round(p: DVec3) -> Vec3 {
    p.as_vec3()
}

/// `u` and `v` if they are linearly independent, else the tangents of some frame about `n`.
#[inline]
pub(super) fn spanning(u: Vec3, v: Vec3, n: Vec3) -> [Vec3; 2] {
    let area_squared = u.as_dvec3().cross(v.as_dvec3()).length_squared();
    if area_squared > 0.0 && u.is_finite() && v.is_finite() {
        return [u, v];
    }
    tangents(n)
}

/// The tangents of some frame about `n`.
pub(super) fn tangents(n: Vec3) -> [Vec3; 2] {
    let frame = Frame::from_z(n);
    [frame.x, frame.y]
}

/// |M|·v with the absolute values of the linear part, for error bounds.
#[inline]
fn abs_linear(m: &Affine3A, v: Vec3) -> Vec3 {
    let m = &m.matrix3;
    Vec3::from(m.x_axis.abs() * v.x + m.y_axis.abs() * v.y + m.z_axis.abs() * v.z)
}
