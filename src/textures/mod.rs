//! Textures: float and RGB functions of a surface point. All textures of a scene live in one [`TextureSet`].

use crate::math::{Vec2, Vec3};

/// Index into [`TextureSet::floats`].
pub type FloatTextureId = u32;
/// Index into [`TextureSet::rgbs`].
pub type RgbTextureId = u32;

/// Where a texture is looked up.
#[derive(Clone, Copy, Debug)]
pub struct TextureContext {
    /// Texture coordinates.
    pub uv: Vec2,
    /// Width of the filter in uv, per axis: the extent of a pixel's footprint on the surface. 0 is a point lookup.
    pub uv_width: Vec2,
    /// World-space point.
    pub p: Vec3,
    /// World-space geometric normal.
    pub n: Vec3,
}
