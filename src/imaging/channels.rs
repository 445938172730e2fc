//! Channels of images: layers by their names, and positions of the colours. `render/output.rs` names and fills the
//! channels of a rendered image, and `render/cryptomatte.rs` those of ids.

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

/// Positions of the colour channels of an [`Image`](super::Image).
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
}
