//! Textures: float and RGB functions of a surface point. All textures of a scene are stored in one [`TextureSet`].
//!
//! Textures are trees. Their nodes refer to earlier nodes by index, so no tree can contain itself. Roots that an
//! importer reserves are copies, to which no node refers. Semantics are pbrt-v4's. Checkerboards are point sampled: the
//! pixel integrates over their edges.
//!
//! * [`mapping`]: texture coordinates; `procedural`: noise, marble, dots; [`udim`]: tiled images
//! * [`crate::imaging::mipmap`], [`crate::imaging::face_map`]: image lookups

pub mod mapping;
mod procedural;
pub mod udim;

pub use crate::imaging::{Filter, Wrap};
pub use mapping::{CheckerboardMapping, Mapping2d};
pub use procedural::{Bilerp, Dots, Marble, NoiseKind, NoiseTexture, Octaves};
pub use udim::{Udim, UdimId};

use crate::imaging::tiles::TileStore;
use crate::imaging::{FaceMap, MipMap};
use lumiris_numbers::math::{DVec3, Rgb, Vec2, Vec3};
use std::sync::Arc;

/// Index into [`TextureSet::floats`].
pub type FloatTextureId = u32;
/// Index into [`TextureSet::rgbs`].
pub type RgbTextureId = u32;
/// Index into [`TextureSet::images`].
pub type ImageId = u32;
/// Index into [`TextureSet::face_maps`].
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

/// Lookup of an image.
#[derive(Clone, Copy, Debug)]
pub struct ImageTexture {
    /// The image. With `udim`, the first tile.
    pub image: ImageId,
    /// Tiles that replace the image.
    pub udim: Option<UdimId>,
    /// Mapping to image coordinates; (0, 0) is the lower left.
    pub mapping: Mapping2d,
    /// Factor of the values.
    pub scale: f32,
    /// True for max(0, 1 − scaled value).
    pub invert: bool,
}

/// Lookup of the texture of a face by the texture coordinates.
#[derive(Clone, Copy, Debug)]
pub struct FaceTexture {
    /// Textures of the faces.
    pub map: FaceMapId,
    /// Factor of the values.
    pub scale: f32,
}

/// A float texture.
#[derive(Clone, Copy, Debug)]
pub enum FloatTexture {
    /// A constant.
    Constant(f32),
    /// An image; the mean of its channels.
    Image(ImageTexture),
    /// One channel (0 to 2) of an image.
    Channel(ImageTexture, usize),
    /// The texture of the face; the mean of its channels.
    Faces(FaceTexture),
    /// Opacity of the vertices.
    VertexOpacity,
    /// 1 where the texture is at least the threshold, else 0.
    Threshold {
        /// Value.
        tex: FloatTextureId,
        /// Threshold.
        threshold: f32,
    },
    /// tex·scale.
    Scale {
        /// Value.
        tex: FloatTextureId,
        /// Factor.
        scale: FloatTextureId,
    },
    /// tex1·(1 − amount) + tex2·amount.
    Mix {
        /// Value at amount 0.
        tex1: FloatTextureId,
        /// Value at amount 1.
        tex2: FloatTextureId,
        /// Amount.
        amount: FloatTextureId,
    },
    /// tex1·|n·direction| + tex2·(1 − |n·direction|).
    DirectionMix {
        /// Value where the normal is parallel to the direction.
        tex1: FloatTextureId,
        /// Value where the normal is perpendicular to it.
        tex2: FloatTextureId,
        /// Unit direction in world space.
        direction: Vec3,
    },
    /// tex1 in even cells, tex2 in odd ones.
    Checkerboard {
        /// Cells.
        mapping: CheckerboardMapping,
        /// Value of even cells.
        tex1: FloatTextureId,
        /// Value of odd cells.
        tex2: FloatTextureId,
    },
    /// Noise.
    Noise(NoiseTexture),
    /// tex1 inside dots, tex2 between them.
    Dots {
        /// Dots.
        dots: Dots,
        /// Value inside.
        tex1: FloatTextureId,
        /// Value outside.
        tex2: FloatTextureId,
    },
    /// Bilinear interpolation between corners.
    Bilerp(Bilerp<f32>),
}

/// An RGB texture.
#[derive(Clone, Copy, Debug)]
pub enum RgbTexture {
    /// A constant.
    Constant(Rgb),
    /// An image. One channel gives grey.
    Image(ImageTexture),
    /// The texture of the face.
    Faces(FaceTexture),
    /// Colour of the vertices.
    VertexColor,
    /// tex1·tex2.
    Product {
        /// First factor.
        tex1: RgbTextureId,
        /// Second factor.
        tex2: RgbTextureId,
    },
    /// tex·scale.
    Scale {
        /// Value.
        tex: RgbTextureId,
        /// Factor.
        scale: FloatTextureId,
    },
    /// tex1·(1 − amount) + tex2·amount.
    Mix {
        /// Value at amount 0.
        tex1: RgbTextureId,
        /// Value at amount 1.
        tex2: RgbTextureId,
        /// Amount.
        amount: FloatTextureId,
    },
    /// tex1·|n·direction| + tex2·(1 − |n·direction|).
    DirectionMix {
        /// Value where the normal is parallel to the direction.
        tex1: RgbTextureId,
        /// Value where the normal is perpendicular to it.
        tex2: RgbTextureId,
        /// Unit direction in world space.
        direction: Vec3,
    },
    /// tex1 in even cells, tex2 in odd ones.
    Checkerboard {
        /// Cells.
        mapping: CheckerboardMapping,
        /// Value of even cells.
        tex1: RgbTextureId,
        /// Value of odd cells.
        tex2: RgbTextureId,
    },
    /// Marble.
    Marble(Marble),
    /// tex1 inside dots, tex2 between them.
    Dots {
        /// Dots.
        dots: Dots,
        /// Value inside.
        tex1: RgbTextureId,
        /// Value outside.
        tex2: RgbTextureId,
    },
    /// Bilinear interpolation between corners.
    Bilerp(Bilerp<Rgb>),
}

/// All textures of a scene.
#[derive(Clone, Debug, Default)]
pub struct TextureSet {
    /// Float textures; add with [`Self::add_float`].
    pub floats: Vec<FloatTexture>,
    /// RGB textures; add with [`Self::add_rgb`].
    pub rgbs: Vec<RgbTexture>,
    /// Images.
    pub images: Vec<Arc<MipMap>>,
    /// Tiled images.
    pub udims: Vec<Udim>,
    /// Face textures.
    pub face_maps: Vec<Arc<FaceMap>>,
    /// Depth of the tree of each float texture.
    float_depths: Vec<u32>,
    /// Depth of the tree of each RGB texture.
    rgb_depths: Vec<u32>,
}

impl TextureSet {
    /// Adds a float texture. Panics if it refers to a texture that is not in the set yet. Its image may be added later,
    /// before the first lookup.
    pub fn add_float(&mut self, texture: FloatTexture) -> FloatTextureId {
        let children: &[FloatTextureId] = match &texture {
            FloatTexture::Constant(_) | FloatTexture::VertexOpacity => &[],
            // Images are added later: an importer reads all of them at once
            FloatTexture::Image(_) | FloatTexture::Channel(..) | FloatTexture::Faces(_) => &[],
            FloatTexture::Noise(_) | FloatTexture::Bilerp(_) => &[],
            FloatTexture::Threshold { tex, .. } => &[*tex],
            FloatTexture::Scale { tex, scale } => &[*tex, *scale],
            FloatTexture::Mix { tex1, tex2, amount } => &[*tex1, *tex2, *amount],
            FloatTexture::DirectionMix { tex1, tex2, .. }
            | FloatTexture::Checkerboard { tex1, tex2, .. }
            | FloatTexture::Dots { tex1, tex2, .. } => &[*tex1, *tex2],
        };
        let id = self.floats.len() as FloatTextureId;
        assert!(children.iter().all(|&c| c < id), "a texture refers to earlier ones only");
        let depths = children.iter().map(|&c| self.float_depths[c as usize]);
        self.float_depths.push(1 + depths.max().unwrap_or(0));
        self.floats.push(texture);
        id
    }

    /// Reserves a float texture that is defined later by [`Self::fill_float`]. No texture refers to it.
    pub fn reserve_float(&mut self) -> FloatTextureId {
        // Not a constant, in case it is queried before it is defined
        self.floats.push(FloatTexture::VertexOpacity);
        self.float_depths.push(1);
        (self.floats.len() - 1) as FloatTextureId
    }

    /// Defines a reserved texture as a copy of another one.
    pub fn fill_float(&mut self, reserved: FloatTextureId, texture: FloatTextureId) {
        self.floats[reserved as usize] = self.floats[texture as usize];
        self.float_depths[reserved as usize] = self.float_depths[texture as usize];
    }

    /// Adds an RGB texture. Panics if it refers to a texture that is not in the set yet. Its image may be added later,
    /// before the first lookup.
    pub fn add_rgb(&mut self, texture: RgbTexture) -> RgbTextureId {
        // References to other textures
        let (children, weight): (&[RgbTextureId], Option<FloatTextureId>) = match &texture {
            RgbTexture::Constant(_) | RgbTexture::VertexColor => (&[], None),
            RgbTexture::Image(_) | RgbTexture::Faces(_) => (&[], None),
            RgbTexture::Marble(_) | RgbTexture::Bilerp(_) => (&[], None),
            RgbTexture::Product { tex1, tex2 } => (&[*tex1, *tex2], None),
            RgbTexture::Scale { tex, scale } => (&[*tex], Some(*scale)),
            RgbTexture::Mix { tex1, tex2, amount } => (&[*tex1, *tex2], Some(*amount)),
            RgbTexture::DirectionMix { tex1, tex2, .. }
            | RgbTexture::Checkerboard { tex1, tex2, .. }
            | RgbTexture::Dots { tex1, tex2, .. } => (&[*tex1, *tex2], None),
        };

        // All of them must be earlier
        let id = self.rgbs.len() as RgbTextureId;
        let known = children.iter().all(|&c| c < id) && weight.is_none_or(|w| (w as usize) < self.floats.len());
        assert!(known, "a texture refers to earlier ones only");

        // Append the texture with its depth
        let weight = weight.map(|w| self.float_depths[w as usize]);
        let depths = children.iter().map(|&c| self.rgb_depths[c as usize]).chain(weight);
        self.rgb_depths.push(1 + depths.max().unwrap_or(0));
        self.rgbs.push(texture);
        id
    }

    /// Depth of the tree of a float texture, and of the recursion that evaluates it.
    pub fn float_depth(&self, id: FloatTextureId) -> u32 {
        self.float_depths[id as usize]
    }

    /// Depth of the tree of an RGB texture.
    pub fn rgb_depth(&self, id: RgbTextureId) -> u32 {
        self.rgb_depths[id as usize]
    }

    /// The store of texels that do not fit into memory. All images of a scene share it.
    pub fn store(&self) -> Option<&TileStore> {
        self.images.iter().find_map(|image| image.store()).map(|store| &**store)
    }

    /// Memory of all images and face textures without tiles (bytes).
    pub fn bytes(&self) -> u64 {
        let images: usize = self.images.iter().map(|image| image.bytes()).sum();
        let faces: usize = self.face_maps.iter().map(|map| map.bytes()).sum();
        (images + faces) as u64
    }

    /// Adds an image.
    pub fn add_image(&mut self, image: MipMap) -> ImageId {
        self.images.push(Arc::new(image));
        (self.images.len() - 1) as ImageId
    }

    /// The value of a float texture; `None` if it is not a constant.
    pub fn constant_float(&self, id: FloatTextureId) -> Option<f32> {
        match self.floats[id as usize] {
            FloatTexture::Constant(v) => Some(v),
            FloatTexture::Image(_)
            | FloatTexture::Channel(..)
            | FloatTexture::Faces(_)
            | FloatTexture::VertexOpacity
            | FloatTexture::Threshold { .. }
            | FloatTexture::Scale { .. }
            | FloatTexture::Mix { .. }
            | FloatTexture::DirectionMix { .. }
            | FloatTexture::Noise(_)
            | FloatTexture::Dots { .. }
            | FloatTexture::Bilerp(_)
            | FloatTexture::Checkerboard { .. } => None,
        }
    }

    /// The value of an RGB texture; `None` if it is not a constant.
    pub fn constant_rgb(&self, id: RgbTextureId) -> Option<Rgb> {
        match self.rgbs[id as usize] {
            RgbTexture::Constant(v) => Some(v),
            RgbTexture::Image(_)
            | RgbTexture::Faces(_)
            | RgbTexture::VertexColor
            | RgbTexture::Product { .. }
            | RgbTexture::Scale { .. }
            | RgbTexture::Mix { .. }
            | RgbTexture::DirectionMix { .. }
            | RgbTexture::Marble(_)
            | RgbTexture::Dots { .. }
            | RgbTexture::Bilerp(_)
            | RgbTexture::Checkerboard { .. } => None,
        }
    }

    /// Value of a float texture.
    pub fn float(&self, id: FloatTextureId, ctx: &TextureContext) -> f32 {
        match &self.floats[id as usize] {
            // Leaves
            FloatTexture::Constant(v) => *v,
            FloatTexture::Image(image) => {
                let v = self.image_value(image, ctx).average() * image.scale;
                if image.invert { (1.0 - v).max(0.0) } else { v }
            }
            FloatTexture::Channel(image, channel) => self.image_value(image, ctx)[*channel] * image.scale,
            FloatTexture::Faces(faces) => self.face_value(faces, ctx).average(),
            FloatTexture::VertexOpacity => ctx.color[3],
            FloatTexture::Threshold { tex, threshold } => f32::from(u8::from(self.float(*tex, ctx) >= *threshold)),
            // A factor of 0 skips the other texture
            FloatTexture::Scale { tex, scale } => {
                let scale = self.float(*scale, ctx);
                if scale == 0.0 { 0.0 } else { self.float(*tex, ctx) * scale }
            }
            // Textures without weight are skipped
            FloatTexture::Mix { tex1, tex2, amount } => {
                let amount = self.float(*amount, ctx);
                blend(amount, 0.0, || self.float(*tex1, ctx), || self.float(*tex2, ctx))
            }
            FloatTexture::DirectionMix { tex1, tex2, direction } => {
                let across = 1.0 - ctx.n.dot(*direction).abs();
                blend(across, 0.0, || self.float(*tex1, ctx), || self.float(*tex2, ctx))
            }
            FloatTexture::Checkerboard { mapping, tex1, tex2 } => {
                self.float(if mapping.is_even(ctx) { *tex1 } else { *tex2 }, ctx)
            }
            // Procedural textures
            FloatTexture::Noise(noise) => noise.value(ctx),
            FloatTexture::Dots { dots, tex1, tex2 } => self.float(if dots.is_inside(ctx) { *tex1 } else { *tex2 }, ctx),
            FloatTexture::Bilerp(bilerp) => bilerp.value(ctx),
        }
    }

    /// Value of an RGB texture.
    pub fn rgb(&self, id: RgbTextureId, ctx: &TextureContext) -> Rgb {
        match &self.rgbs[id as usize] {
            // Leaves
            RgbTexture::Constant(v) => *v,
            RgbTexture::Image(image) => {
                let v = self.image_value(image, ctx) * image.scale;
                (if image.invert { Rgb::WHITE - v } else { v }).map(|c| c.max(0.0))
            }
            RgbTexture::Faces(faces) => self.face_value(faces, ctx).map(|c| c.max(0.0)),
            RgbTexture::VertexColor => Rgb::new(ctx.color[0], ctx.color[1], ctx.color[2]),
            RgbTexture::Product { tex1, tex2 } => self.rgb(*tex1, ctx) * self.rgb(*tex2, ctx),
            // A factor of 0 skips the other texture
            RgbTexture::Scale { tex, scale } => {
                let scale = self.float(*scale, ctx);
                if scale == 0.0 { Rgb::BLACK } else { self.rgb(*tex, ctx) * scale }
            }
            // Textures without weight are skipped
            RgbTexture::Mix { tex1, tex2, amount } => {
                let amount = self.float(*amount, ctx);
                blend(amount, Rgb::BLACK, || self.rgb(*tex1, ctx), || self.rgb(*tex2, ctx))
            }
            RgbTexture::DirectionMix { tex1, tex2, direction } => {
                let across = 1.0 - ctx.n.dot(*direction).abs();
                blend(across, Rgb::BLACK, || self.rgb(*tex1, ctx), || self.rgb(*tex2, ctx))
            }
            RgbTexture::Checkerboard { mapping, tex1, tex2 } => {
                self.rgb(if mapping.is_even(ctx) { *tex1 } else { *tex2 }, ctx)
            }
            // Procedural textures
            RgbTexture::Marble(marble) => marble.color(ctx),
            RgbTexture::Dots { dots, tex1, tex2 } => self.rgb(if dots.is_inside(ctx) { *tex1 } else { *tex2 }, ctx),
            RgbTexture::Bilerp(bilerp) => bilerp.value(ctx).map(|c| c.max(0.0)),
        }
    }

    /// Value of an image at a point; black where there is no tile.
    pub fn image_value(&self, texture: &ImageTexture, ctx: &TextureContext) -> Rgb {
        let (st, width) = texture.mapping.map(ctx);
        let (image, st) = match texture.udim {
            Some(udim) => match self.udims[udim as usize].tile(st) {
                Some(tile) => tile,
                None => return Rgb::BLACK,
            },
            None => (texture.image, self.images[texture.image as usize].within_periods(st)),
        };
        // Images have t downwards
        self.images[image as usize].lookup(Vec2::new(st.x, 1.0 - st.y), width)
    }

    /// Value of the face texture at a point.
    fn face_value(&self, texture: &FaceTexture, ctx: &TextureContext) -> Rgb {
        self.face_maps[texture.map as usize].value(ctx.face, ctx.uv, ctx.uv_width) * texture.scale
    }
}

/// `a·(1 − amount) + b·amount`. A value without weight is not evaluated.
fn blend<T>(amount: f32, zero: T, a: impl Fn() -> T, b: impl Fn() -> T) -> T
where
    T: Copy + std::ops::Add<Output = T> + std::ops::Mul<f32, Output = T>,
{
    let a = if amount == 1.0 { zero } else { a() * (1.0 - amount) };
    let b = if amount == 0.0 { zero } else { b() * amount };
    a + b
}

#[cfg(test)]
mod tests;
