//! Images: pixels with named channels, encodings, pyramids for filtered lookups, and error metrics.
//!
//! * Values: `image`, `channels`, [`color`], [`view_transform`], [`heat`]
//! * Files: [`mod@file`], [`color_layers`], [`oiio`], [`file_parts`]
//! * Lookups: [`mipmap`] (levels, and their choice by the width of a filter), `texels`, [`face_map`]; texels outside
//!   memory: [`tiles`], [`texture_file`], `file_tiles`
//! * Denoising and comparison: [`oidn`], [`metrics`], [`compare`]

mod channels;
pub mod color;
pub mod color_layers;
pub mod compare;
pub mod face_map;
pub mod file;
pub mod file_parts;
mod file_tiles;
pub mod heat;
mod image;
pub mod metrics;
pub mod mipmap;
pub mod oidn;
pub mod oiio;
mod texels;
pub mod texture_file;
pub mod tiles;
pub mod view_transform;

pub use channels::{ColorChannels, IMAGE_LAYER, Layer, layers};
pub use color::ColorEncoding;
pub use face_map::FaceMap;
pub use file::TextEntries;
pub use image::Image;
pub use mipmap::{AxisWrap, Filter, Lookup, MipMap, Wrap};
pub use view_transform::ViewTransform;
