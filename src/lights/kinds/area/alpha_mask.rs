//! Alpha textures of emitting surfaces.

use crate::geometry::{AlphaSource, GeometryId, GeometrySet, Shape, TriangleMesh};
use lumiris_numbers::math::{Vec2, Vec3};
use std::fmt;
use std::sync::Arc;

/// The alpha texture of an emitting geometry. A ray hits the surface with probability alpha and then receives all of
/// its radiance. Light samples therefore multiply the radiance by alpha, so that both techniques have the same
/// expectation.
#[derive(Clone)]
pub struct AlphaMask {
    /// All shapes.
    pub geometry: Arc<GeometrySet>,
    /// The emitting geometry, in world space.
    pub id: GeometryId,
    /// Its alpha texture.
    pub texture: u32,
    /// Evaluates alpha textures.
    pub source: Arc<dyn AlphaSource>,
}

impl fmt::Debug for AlphaMask {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("AlphaMask").field("id", &self.id).field("texture", &self.texture).finish_non_exhaustive()
    }
}

impl AlphaMask {
    /// The alpha texture of a geometry; `None` if it has none.
    pub fn of(geometry: &Arc<GeometrySet>, id: GeometryId, source: Arc<dyn AlphaSource>) -> Option<Arc<AlphaMask>> {
        let texture = geometry.geometries[id as usize].alpha?;
        Some(Arc::new(AlphaMask { geometry: Arc::clone(geometry), id, texture, source }))
    }

    /// Alpha, from 0 to 1, at the point `p` of a light with `count` primitives, the first of which is `first`. `uv`
    /// gives the texture coordinates at `p`; it is called for shapes other than triangle meshes.
    pub(super) fn alpha(&self, first: u32, count: u32, p: Vec3, uv: impl FnOnce() -> Vec2) -> f32 {
        let shape = &self.geometry.geometries[self.id as usize].shape;
        let PointOfMesh { primitive, uv: local } = match shape {
            Shape::Mesh(mesh) => triangle_at(mesh, first, count, p),
            _ => PointOfMesh { primitive: first, uv: [0.0; 2] },
        };
        let st = match shape {
            Shape::Mesh(_) => shape.texture_coordinates(primitive, local),
            _ => uv(),
        };
        let alpha = self.source.alpha(self.texture, st, &shape.vertex_values(primitive, local), p);
        if alpha.is_nan() { 0.0 } else { alpha.clamp(0.0, 1.0) }
    }
}

/// A point of a primitive.
struct PointOfMesh {
    primitive: u32,
    /// Weights of vertices 1 and 2 of a triangle.
    uv: [f32; 2],
}

/// The point `p` in the triangle that contains it, among `count` triangles from `first` on.
fn triangle_at(mesh: &TriangleMesh, first: u32, count: u32, p: Vec3) -> PointOfMesh {
    let weights = |i: u32| {
        let [a, b, c] = mesh.triangle(i as usize);
        // Least squares for p − a = b1·e1 + b2·e2
        let (e1, e2, d) = (b - a, c - a, p - a);
        let (aa, ab, bb) = (e1.dot(e1), e1.dot(e2), e2.dot(e2));
        let (x, y) = (d.dot(e1), d.dot(e2));
        let determinant = aa * bb - ab * ab;
        [(bb * x - ab * y) / determinant, (aa * y - ab * x) / determinant]
    };
    let inside = |[b1, b2]: [f32; 2]| b1.min(b2).min(1.0 - b1 - b2);
    let all = (first..first + count).map(|primitive| PointOfMesh { primitive, uv: weights(primitive) });
    let nearest = all.max_by(|a, b| inside(a.uv).total_cmp(&inside(b.uv)));
    nearest.unwrap_or(PointOfMesh { primitive: first, uv: [0.0; 2] })
}
