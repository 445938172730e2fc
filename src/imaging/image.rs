//! Images in memory.

use super::channels::ColorChannels;
use super::color_layers;
use super::file::PartHeader;

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
        let header = PartHeader { name: String::new(), channels: self.channels.clone(), size: [0; 2] };
        color_layers::choose(&[header], None).ok().map(|layer| layer.channels)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

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
