//! The differential geometry of a hit.

use crate::math::{Vec2, Vec3};

/// A point on a surface as materials and lights see it. World space.
#[derive(Clone, Copy, Debug)]
pub struct SurfaceHit {
    /// The point, refined onto the surface.
    pub p: Vec3,
    /// Bound of the rounding error of `p` per axis.
    pub p_error: Vec3,
    /// Geometric normal, unit, oriented by the shape (the emitting side of an area light), not to the viewer.
    pub n: Vec3,
    /// Shading normal, unit, in the hemisphere of `n`.
    pub ns: Vec3,
    /// ∂p/∂u of the surface.
    pub dpdu: Vec3,
    /// ∂p/∂v of the surface.
    pub dpdv: Vec3,
    /// ∂p/∂u for shading (tangent), not yet orthogonal to `ns`.
    pub dpdus: Vec3,
    /// Texture coordinates.
    pub uv: Vec2,
}
