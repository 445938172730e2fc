//! The content of a PLY file.

use lumiris_numbers::math::{DVec3, Vec2, Vec3};

/// Vertices and faces.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct PlyMesh {
    /// Vertex positions relative to `origin`, all finite; there is capacity for one more.
    pub positions: Vec<Vec3>,
    /// An origin near the vertices, which is subtracted before numbers of double precision are rounded.
    pub origin: DVec3,
    /// Normals as written, one per vertex, or empty.
    pub normals: Vec<Vec3>,
    /// Texture coordinates, one per vertex, or empty.
    pub uvs: Vec<Vec2>,
    /// Faces of three vertices, fans of larger ones, and strips; indices are in range.
    pub triangles: Vec<[u32; 3]>,
    /// Faces of four vertices in circular order, as in the file; indices are in range. A bilinear patch p00, p10, p01,
    /// p11 has the corners 0, 1, 3, 2.
    pub quads: Vec<[u32; 4]>,
    /// Numbers of the faces (`face_indices`) of the triangles, or empty.
    pub triangle_numbers: Vec<u32>,
    /// Numbers of the faces of the quads, or empty.
    pub quad_numbers: Vec<u32>,
    /// Irregularities of the file.
    pub warnings: Vec<String>,
}

/// The size of a mesh, by the header of its file.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct PlySize {
    /// Bytes of positions, normals, texture coordinates and indices in memory.
    pub bytes: u64,
    /// Number of triangles; of faces, if the file does not tell their corners.
    pub triangles: u64,
}
