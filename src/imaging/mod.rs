//! Images: pixels with named channels, encodings, pyramids for filtered lookups, and error metrics.
//!
//! * Values: [`color`], [`view_transform`], [`heat`]
//! * Files: [`mod@file`], [`color_layers`], [`oiio`], [`file_parts`]
//! * Lookups: [`mipmap`], `level`, [`face_map`]; texels outside memory: [`tiles`], `file_tiles`
//! * Denoising and comparison: [`oidn`], [`metrics`], [`compare`]

pub mod color;
pub mod color_layers;
pub mod compare;
pub mod face_map;
pub mod file;
pub mod file_parts;
mod file_tiles;
pub mod heat;
mod level;
pub mod metrics;
pub mod mipmap;
pub mod oidn;
pub mod oiio;
pub mod tiles;
pub mod view_transform;

pub use color::ColorEncoding;
pub use face_map::FaceMap;
pub use mipmap::{AxisWrap, Filter, MipMap, Wrap};
pub use view_transform::ViewTransform;

/// Pixels with named channels.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Image {
    /// Columns.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// Names of the channels, in the order of `data`.
    pub channels: Vec<String>,
    /// Values, row-major from the top left, channels interleaved.
    pub data: Vec<f32>,
}

impl Image {
    /// An image of zeros.
    pub fn new(width: usize, height: usize, channels: &[&str]) -> Self {
        let channels: Vec<String> = channels.iter().map(|&c| c.to_owned()).collect();
        Image { width, height, data: vec![0.0; width * height * channels.len()], channels }
    }

    /// Position of the channel called `name`.
    pub fn channel(&self, name: &str) -> Option<usize> {
        self.channels.iter().position(|c| c == name)
    }

    /// Value of channel `c` at column `x` and row `y` from the top. Panics outside the image.
    #[inline]
    pub fn get(&self, x: usize, y: usize, c: usize) -> f32 {
        self.data[(y * self.width + x) * self.channels.len() + c]
    }

    /// Sets a value. Panics outside the image.
    #[inline]
    pub fn set(&mut self, x: usize, y: usize, c: usize, value: f32) {
        let i = (y * self.width + x) * self.channels.len() + c;
        self.data[i] = value;
    }

    /// The colour channels, as selected by [`color_layers::choose`]. `None` if there are no channels, or several
    /// candidates.
    pub fn color_channels(&self) -> Option<ColorChannels> {
        let header = file::PartHeader { name: String::new(), channels: self.channels.clone(), size: [0; 2] };
        color_layers::choose(&[header], None).ok().map(|layer| layer.channels)
    }
}

/// Adjacent channels with a common name.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Layer {
    /// The channel names before the last dot, the whole name of a single channel, or [`IMAGE_LAYER`].
    pub name: String,
    /// Positions of the channels.
    pub channels: std::ops::Range<usize>,
}

/// Name of the layer with the channels `R G B`: the image itself.
pub const IMAGE_LAYER: &str = "beauty";

/// Groups channels by layer, in file order.
pub fn layers<S: AsRef<str>>(channels: &[S]) -> Vec<Layer> {
    let mut layers: Vec<Layer> = Vec::new();
    for (index, channel) in channels.iter().enumerate() {
        let name = match channel.as_ref() {
            "R" | "G" | "B" | "A" => IMAGE_LAYER,
            other => other.rsplit_once('.').map_or(other, |(name, _)| name),
        };
        match layers.last_mut() {
            Some(layer) if layer.name == name => layer.channels.end = index + 1,
            _ => layers.push(Layer { name: name.to_owned(), channels: index..index + 1 }),
        }
    }
    layers
}

/// Positions of the colour channels of an [`Image`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ColorChannels {
    /// One channel.
    Grey(usize),
    /// Three channels.
    Rgb([usize; 3]),
}

impl ColorChannels {
    /// The positions as a slice of one or three.
    pub fn as_slice(&self) -> &[usize] {
        match self {
            ColorChannels::Grey(y) => std::slice::from_ref(y),
            ColorChannels::Rgb(rgb) => rgb,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn layers_are_what_precedes_the_last_dot() {
        let names = ["R", "G", "B", "A", "depth.Z", "samples", "View.Combined.R", "View.Combined.G", "View.Mist.Z"];
        let found: Vec<_> = layers(&names).into_iter().map(|l| (l.name, l.channels)).collect();
        let expected =
            [("beauty", 0..4), ("depth", 4..5), ("samples", 5..6), ("View.Combined", 6..8), ("View.Mist", 8..9)];
        assert_eq!(found, expected.map(|(name, channels)| (name.to_owned(), channels)));
    }

    #[test]
    fn channels_are_found_by_name_whatever_their_order() {
        let mut image = Image::new(2, 1, &["A", "b", "G", "R"]);
        image.set(1, 0, 3, 0.5);
        assert_eq!(image.color_channels(), Some(ColorChannels::Rgb([3, 2, 1])));
        assert_eq!(image.channel("A"), Some(0));
        assert_eq!(image.channel("Z"), None);
        assert_eq!(image.get(1, 0, 3), 0.5);
        assert_eq!(image.get(0, 0, 3), 0.0);
        assert_eq!(Image::new(1, 1, &["A", "Y"]).color_channels(), Some(ColorChannels::Grey(1)));
        assert_eq!(Image::new(1, 1, &["Z"]).color_channels(), Some(ColorChannels::Grey(0)));
        assert_eq!(Image::new(1, 1, &[]).color_channels(), None);
    }
}
