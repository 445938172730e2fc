//! Inputs of a texture lookup, and indices of images.

use lumiris_numbers::math::{DVec3, Vec2, Vec3};

/// Index into [`TextureSet::images`](super::TextureSet::images).
pub type ImageId = u32;
/// Index into [`TextureSet::face_maps`](super::TextureSet::face_maps).
pub type FaceMapId = u32;

/// Inputs of a texture lookup.
#[derive(Clone, Copy, Debug)]
pub struct TextureContext {
    /// Texture coordinates.
    pub uv: Vec2,
    /// Filter width in uv, per axis: the extent of the texture footprint of a camera sample. 0 is a point lookup.
    pub uv_width: Vec2,
    /// Second texture coordinates.
    pub uv1: Vec2,
    /// Linear colour and opacity of the vertices.
    pub color: [f32; 4],
    /// Index of the face in the mesh.
    pub face: u32,
    /// World-space point. f64, as in mappings: the origin of a texture may be far from the scene.
    pub p: DVec3,
    /// World-space geometric normal.
    pub n: Vec3,
}

impl TextureContext {
    /// A lookup filtered over the whole image.
    pub fn whole() -> Self {
        let (uv, p, n) = (Vec2::splat(0.5), DVec3::ZERO, Vec3::Z);
        TextureContext { uv, uv_width: Vec2::splat(1e3), uv1: uv, color: [1.0; 4], face: 0, p, n }
    }
}
