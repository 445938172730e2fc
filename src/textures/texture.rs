//! Float and RGB textures: the nodes of their trees.

use super::context::{FaceMapId, ImageId};
use super::mapping::{CheckerboardMapping, Mapping2d};
use super::procedural::{Bilerp, Dots, Marble, NoiseTexture};
use super::udim::UdimId;
use lumiris_numbers::math::{Rgb, Vec3};

/// Index into [`TextureSet::floats`](super::TextureSet::floats).
pub type FloatTextureId = u32;
/// Index into [`TextureSet::rgbs`](super::TextureSet::rgbs).
pub type RgbTextureId = u32;

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

impl FloatTexture {
    /// The textures that it refers to.
    pub(super) fn children(&self) -> Vec<FloatTextureId> {
        match *self {
            FloatTexture::Constant(_) | FloatTexture::VertexOpacity => vec![],
            FloatTexture::Image(_) | FloatTexture::Channel(..) | FloatTexture::Faces(_) => vec![],
            FloatTexture::Noise(_) | FloatTexture::Bilerp(_) => vec![],
            FloatTexture::Threshold { tex, .. } => vec![tex],
            FloatTexture::Scale { tex, scale } => vec![tex, scale],
            FloatTexture::Mix { tex1, tex2, amount } => vec![tex1, tex2, amount],
            FloatTexture::DirectionMix { tex1, tex2, .. }
            | FloatTexture::Checkerboard { tex1, tex2, .. }
            | FloatTexture::Dots { tex1, tex2, .. } => vec![tex1, tex2],
        }
    }
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

impl RgbTexture {
    /// The textures that it refers to.
    pub(super) fn children(&self) -> (Vec<RgbTextureId>, Option<FloatTextureId>) {
        match *self {
            RgbTexture::Constant(_) | RgbTexture::VertexColor => (vec![], None),
            RgbTexture::Image(_) | RgbTexture::Faces(_) => (vec![], None),
            RgbTexture::Marble(_) | RgbTexture::Bilerp(_) => (vec![], None),
            RgbTexture::Product { tex1, tex2 } => (vec![tex1, tex2], None),
            RgbTexture::Scale { tex, scale } => (vec![tex], Some(scale)),
            RgbTexture::Mix { tex1, tex2, amount } => (vec![tex1, tex2], Some(amount)),
            RgbTexture::DirectionMix { tex1, tex2, .. }
            | RgbTexture::Checkerboard { tex1, tex2, .. }
            | RgbTexture::Dots { tex1, tex2, .. } => (vec![tex1, tex2], None),
        }
    }
}
