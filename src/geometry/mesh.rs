//! Indexed triangle meshes.

use crate::math::{Bounds3, Vec2, Vec3};

/// Indexed triangles. Optional per-vertex arrays are empty if absent, else as long as the positions.
#[derive(Clone, Debug, Default)]
pub struct TriangleMesh {
    /// Vertex positions, with one more zero element at the end: Embree reads 16 bytes at each 12-byte vertex.
    padded_positions: Vec<Vec3>,
    /// Vertex indices, three per triangle; all in range.
    pub indices: Vec<[u32; 3]>,
    /// Unit shading normals.
    pub normals: Vec<Vec3>,
    /// Texture coordinates.
    pub uvs: Vec<Vec2>,
    /// Shading tangents.
    pub tangents: Vec<Vec3>,
    /// True if the geometric normal is the reverse of (p1 − p0) × (p2 − p0): pbrt's
    /// `ReverseOrientation` xor a mirroring transform.
    pub flip_normal: bool,
}

impl TriangleMesh {
    /// A mesh of positions and indices; `Err` with a message if an index is out of range.
    pub fn new(mut positions: Vec<Vec3>, indices: Vec<[u32; 3]>) -> Result<Self, String> {
        let count = positions.len();
        if let Some((i, t)) = indices.iter().enumerate().find(|(_, t)| t.iter().any(|&v| v as usize >= count)) {
            return Err(format!("triangle {i} refers to vertices {t:?}, but there are {count} vertices"));
        }
        positions.push(Vec3::ZERO);
        Ok(TriangleMesh { padded_positions: positions, indices, ..TriangleMesh::default() })
    }

    /// Vertex positions.
    #[inline]
    pub fn positions(&self) -> &[Vec3] {
        &self.padded_positions[..self.padded_positions.len().saturating_sub(1)]
    }

    /// Vertex positions followed by one element of padding.
    #[inline]
    pub fn padded_positions(&self) -> &[Vec3] {
        &self.padded_positions
    }

    /// Number of triangles.
    #[inline]
    pub fn triangle_count(&self) -> usize {
        self.indices.len()
    }

    /// The corners of triangle `i`.
    #[inline]
    pub fn triangle(&self, i: usize) -> [Vec3; 3] {
        self.indices[i].map(|v| self.padded_positions[v as usize])
    }

    /// Area of triangle `i`.
    pub fn area(&self, i: usize) -> f32 {
        let [a, b, c] = self.triangle(i);
        0.5 * (b - a).cross(c - a).length()
    }

    /// Bounds of all vertices that triangles use.
    pub fn bounds(&self) -> Bounds3 {
        Bounds3::from_points(self.indices.iter().flatten().map(|&v| self.padded_positions[v as usize]))
    }
}
