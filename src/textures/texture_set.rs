//! All textures of a scene, and their values.

use super::context::{ImageId, TextureContext};
use super::texture::{FaceTexture, FloatTexture, FloatTextureId, ImageTexture, RgbTexture, RgbTextureId};
use super::udim::Udim;
use crate::imaging::tiles::TileStore;
use crate::imaging::{FaceMap, MipMap};
use lumiris_numbers::math::{Rgb, Vec2};
use std::sync::Arc;

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
        // Images are added later: an importer reads all of them at once
        let children = texture.children();
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
        let (children, weight) = texture.children();

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
        self.image_at(texture, ctx).map_or(Rgb::BLACK, |(image, st)| image.lookup(st, texture.mapping.width(ctx)))
    }

    /// Requests the texels of images at a point, which are looked up soon.
    pub fn prefetch(&self, textures: &[ImageTexture], ctx: &TextureContext) {
        for texture in textures {
            if let Some((image, st)) = self.image_at(texture, ctx) {
                image.prefetch(st, texture.mapping.width(ctx));
            }
        }
    }

    /// The image and its coordinates at a point; `None` where there is no tile.
    #[inline]
    fn image_at(&self, texture: &ImageTexture, ctx: &TextureContext) -> Option<(&MipMap, Vec2)> {
        let st = texture.mapping.st(ctx);
        let (image, st) = match texture.udim {
            Some(udim) => (self.udims[udim as usize].tile(st)?, Udim::within_tile(st)),
            None => (texture.image, self.images[texture.image as usize].within_periods(st)),
        };
        // Images have t downwards
        Some((&self.images[image as usize], Vec2::new(st.x, 1.0 - st.y)))
    }

    /// Appends the images in the tree of a float texture.
    pub fn images_of_float(&self, id: FloatTextureId, images: &mut Vec<ImageTexture>) {
        let texture = &self.floats[id as usize];
        if let FloatTexture::Image(image) | FloatTexture::Channel(image, _) = texture {
            images.push(*image);
        }
        texture.children().into_iter().for_each(|child| self.images_of_float(child, images));
    }

    /// Appends the images in the tree of an RGB texture.
    pub fn images_of_rgb(&self, id: RgbTextureId, images: &mut Vec<ImageTexture>) {
        let texture = &self.rgbs[id as usize];
        if let RgbTexture::Image(image) = texture {
            images.push(*image);
        }
        let (children, weight) = texture.children();
        children.into_iter().for_each(|child| self.images_of_rgb(child, images));
        weight.into_iter().for_each(|weight| self.images_of_float(weight, images));
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
#[path = "texture_set_tests.rs"]
mod tests;
