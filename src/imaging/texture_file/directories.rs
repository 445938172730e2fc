//! The directories of a texture file, by which other programs find the tiles [Adobe, TIFF 6.0; BigTIFF, 2007].

use super::layout::{DIRECTORIES, Layout};
use crate::imaging::tiles::TILE;
use std::collections::BTreeMap;

/// The value by which OpenImageIO and RenderMan know that further images are levels of the first.
const TEXTURE: &[u8; 14] = b"Plain Texture\0";

/// Values of a tag: their type and their bytes.
enum Values {
    Short(Vec<u16>),
    Long(u32),
    Long8(Vec<u64>),
    Text(&'static [u8]),
}

impl Values {
    fn encoded(&self) -> Encoded {
        let (kind, count, bytes) = match self {
            Values::Text(text) => (2, text.len(), text.to_vec()),
            Values::Short(values) => (3, values.len(), values.iter().flat_map(|v| v.to_le_bytes()).collect()),
            Values::Long(value) => (4, 1, value.to_le_bytes().to_vec()),
            Values::Long8(values) => (16, values.len(), values.iter().flat_map(|v| v.to_le_bytes()).collect()),
        };
        Encoded { kind, count, bytes }
    }
}

/// Number of a type, number of values, and their bytes.
struct Encoded {
    kind: u16,
    count: usize,
    bytes: Vec<u8>,
}

/// Directories of all levels, for the position [`DIRECTORIES`].
pub(super) fn directories(layout: &Layout) -> Vec<u8> {
    let mut bytes = Vec::new();
    for level in 0..layout.sizes.len() {
        let is_last = level + 1 == layout.sizes.len();
        append(&mut bytes, &tags(layout, level), is_last);
    }
    bytes
}

/// Tags of a level.
fn tags(layout: &Layout, level: usize) -> BTreeMap<u16, Values> {
    let Layout { channels, channel_bytes, .. } = *layout;
    let [width, height] = layout.sizes[level].map(|n| n as u32);
    let tiles: usize = layout.grid(level).iter().product();
    let first = layout.tiles_before(level);
    let of_channels = |value: usize| Values::Short(vec![value as u16; channels]);
    let (is_color, has_alpha) = (channels >= 3, channels % 2 == 0);
    // Opacity of floats is multiplied into the colours (1), as in EXR files, and that of bytes is not (2)
    let alpha = Values::Short(vec![if channel_bytes == 1 { 2 } else { 1 }]);
    let tags = [
        (254, Some(Values::Long(u32::from(level > 0)))), // a reduced image
        (256, Some(Values::Long(width))),
        (257, Some(Values::Long(height))),
        (258, Some(of_channels(8 * channel_bytes))), // bits
        (259, Some(Values::Short(vec![1]))),         // no compression
        (262, Some(Values::Short(vec![if is_color { 2 } else { 1 }]))), // RGB, or 0 is black
        (277, Some(Values::Short(vec![channels as u16]))),
        (284, Some(Values::Short(vec![1]))), // channels interleaved
        (322, Some(Values::Long(TILE as u32))),
        (323, Some(Values::Long(TILE as u32))),
        (324, Some(Values::Long8((first..first + tiles).map(|tile| layout.tile_at(tile)).collect()))),
        (325, Some(Values::Long8(vec![layout.tile_bytes() as u64; tiles]))),
        (338, has_alpha.then_some(alpha)),
        (339, Some(of_channels(if channel_bytes == 1 { 1 } else { 3 }))), // unsigned, or floats
        (33302, Some(Values::Text(TEXTURE))),
    ];
    tags.into_iter().filter_map(|(tag, values)| Some((tag, values?))).collect()
}

/// Appends a directory and the values that do not fit into its entries.
fn append(bytes: &mut Vec<u8>, tags: &BTreeMap<u16, Values>, is_last: bool) {
    let begin = DIRECTORIES as usize + bytes.len();
    let mut outside_at = begin + 8 + 20 * tags.len() + 8;
    let mut outside = Vec::new();
    bytes.extend((tags.len() as u64).to_le_bytes());
    for (tag, values) in tags {
        let Encoded { kind, count, bytes: mut data } = values.encoded();
        bytes.extend(tag.to_le_bytes());
        bytes.extend(kind.to_le_bytes());
        bytes.extend((count as u64).to_le_bytes());
        let is_inside = data.len() <= 8;
        data.resize(data.len().next_multiple_of(8), 0);
        if is_inside {
            bytes.extend(data);
        } else {
            bytes.extend((outside_at as u64).to_le_bytes());
            outside_at += data.len();
            outside.extend(data);
        }
    }
    bytes.extend(if is_last { 0 } else { outside_at as u64 }.to_le_bytes());
    bytes.extend(outside);
}
