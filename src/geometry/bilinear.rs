//! Meshes of bilinear patches.

use crate::math::{Bounds3, Vec2, Vec3};

/// Indexed bilinear patches; p(u, v) blends corners p00, p10, p01, p11 in this order (pbrt's `bilinearmesh`).
#[derive(Clone, Debug, Default)]
pub struct BilinearMesh {
    /// Vertex positions.
    pub positions: Vec<Vec3>,
    /// Four vertex indices per patch: p00, p10, p01, p11; all in range.
    pub indices: Vec<[u32; 4]>,
    /// Unit shading normals per vertex, or empty.
    pub normals: Vec<Vec3>,
    /// Texture coordinates per vertex, or empty.
    pub uvs: Vec<Vec2>,
    /// True if the geometric normal is the reverse of ∂p/∂u × ∂p/∂v.
    pub flip_normal: bool,
}

impl BilinearMesh {
    /// Number of patches.
    #[inline]
    pub fn patch_count(&self) -> usize {
        self.indices.len()
    }

    /// Bounds of all vertices that patches use; a patch lies in the hull of its corners.
    pub fn bounds(&self) -> Bounds3 {
        Bounds3::from_points(self.indices.iter().flatten().map(|&v| self.positions[v as usize]))
    }
}
