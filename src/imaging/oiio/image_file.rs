//! Image files open for textures: one level, or a whole pyramid as in the `.tx` files of texture converters.

use super::read::{Input, Value, read_failure, usual_encoding};
use crate::imaging::ColorEncoding;
use crate::imaging::color_layers::ColorLayer;
use crate::imaging::file::{ImageError, ReadLimits};
use openimageio_sys as sys;
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, MutexGuard, PoisonError};

/// Maximum pixels of a tile: headers of damaged files can claim more, and OpenImageIO would allocate them.
const MAX_TILE: u64 = 1 << 22;

/// Formats whose files are decoded row by row; others are decoded as a whole.
const BY_ROWS: [&str; 7] = ["bmp", "hdr", "jpeg", "openexr", "png", "pnm", "tiff"];
/// Rows that are decoded together.
const ROWS: usize = 256;

/// Values of channels, interleaved, top row first.
#[derive(Clone, Debug)]
pub enum Values {
    /// As stored by files of 8 bits.
    Bytes(Vec<u8>),
    /// Of all other files. Integers are scaled to 0..1.
    Floats(Vec<f32>),
}

impl Values {
    /// True if channel `channel` of `count` is 1 in all pixels, or more.
    pub fn is_one(&self, channel: usize, count: usize) -> bool {
        match self {
            Values::Bytes(v) => v.iter().skip(channel).step_by(count).all(|&v| v == u8::MAX),
            Values::Floats(v) => v.iter().skip(channel).step_by(count).all(|&v| v >= 1.0),
        }
    }

    /// The channels `kept` of `count`.
    pub fn of_channels(self, kept: &[usize], count: usize) -> Self {
        match self {
            Values::Bytes(v) => Values::Bytes(of_channels(v, kept, 0..count)),
            Values::Floats(v) => Values::Floats(of_channels(v, kept, 0..count)),
        }
    }
}

/// The channels `kept` of values of the adjacent channels `read`.
fn of_channels<T: Copy>(values: Vec<T>, kept: &[usize], read: Range<usize>) -> Vec<T> {
    if kept.iter().copied().eq(read.clone()) {
        return values;
    }
    let mut chosen = Vec::with_capacity(values.len() / read.len() * kept.len());
    for pixel in values.chunks_exact(read.len()) {
        chosen.extend(kept.iter().map(|&c| pixel[c - read.start]));
    }
    chosen
}

/// The adjacent channels that contain `channels`.
fn around(channels: &[usize]) -> Range<usize> {
    let begin = channels.iter().copied().min().unwrap_or(0);
    begin..channels.iter().copied().max().unwrap_or(0) + 1
}

/// A file open for reading, with the image at level 0. If it has further levels, each has half the size of the previous
/// one, rounded down, and the last has one pixel.
pub struct ImageFile {
    /// Locked, because one thread at a time may read.
    input: Mutex<Input>,
    path: PathBuf,
    sizes: Vec<[usize; 2]>,
    layer: ColorLayer,
    encoding: ColorEncoding,
    is_bytes: bool,
    chromaticities: Option<String>,
    decoding: u64,
}

impl std::fmt::Debug for ImageFile {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("ImageFile").field("path", &self.path).field("sizes", &self.sizes).finish_non_exhaustive()
    }
}

impl ImageFile {
    /// Opens a file without reading pixels.
    pub fn open(path: &Path) -> Result<Self, ImageError> {
        let mut input = Input::open(path, 0)?;
        let layer = input.choose_colors(path)?;
        let spec = input.spec().map_err(|failure| read_failure(path, failure))?;
        let [width, height, channels] =
            [spec.width, spec.height, spec.nchannels].map(|n| usize::try_from(n).unwrap_or(0));
        let rows = if BY_ROWS.contains(&input.format_name().as_str()) { height.min(ROWS) } else { height };
        Ok(ImageFile {
            path: path.to_owned(),
            sizes: all_levels(&input).unwrap_or_else(|| vec![[width, height]]),
            layer,
            encoding: usual_encoding(&spec),
            is_bytes: spec.format == sys::OIIO_FORMAT_U8,
            chromaticities: input.metadata(spec.attributes).remove("chromaticities"),
            decoding: [width, rows, channels, bytes_of(spec.format)].iter().fold(1, |n, &m| n.saturating_mul(m as u64)),
            input: Mutex::new(input),
        })
    }

    /// The file.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Columns and rows of each level, the full image first.
    pub fn sizes(&self) -> &[[usize; 2]] {
        &self.sizes
    }

    /// True if the file has all levels of a pyramid.
    pub fn has_levels(&self) -> bool {
        self.sizes.len() > 1
    }

    /// The colour channels.
    pub fn layer(&self) -> &ColorLayer {
        &self.layer
    }

    /// The default encoding of the file type.
    pub fn encoding(&self) -> ColorEncoding {
        self.encoding
    }

    /// Colour space given in the file: x and y of red, green, blue and white.
    pub fn chromaticities(&self) -> Option<&str> {
        self.chromaticities.as_deref()
    }

    /// True if values are read as bytes.
    pub fn is_bytes(&self) -> bool {
        self.is_bytes
    }

    /// Number of pixels of the image.
    pub fn pixels(&self) -> u64 {
        self.sizes[0].iter().fold(1, |n, &m| n.saturating_mul(m as u64))
    }

    /// Bytes that decoding takes beside the values.
    pub fn decoding_bytes(&self) -> u64 {
        self.decoding
    }

    fn input(&self) -> MutexGuard<'_, Input> {
        self.input.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Some channels of all pixels of the image as floats, interleaved, top row first.
    pub fn floats(&self, channels: &[usize]) -> Result<Vec<f32>, ImageError> {
        let read = around(channels);
        let limit = ReadLimits::default().bytes_for(&self.path);
        let pixels = self.input().pixels([read.start, read.end].map(int), limit);
        Ok(of_channels(pixels.map_err(|failure| read_failure(&self.path, failure))?, channels, read))
    }

    /// Some channels of all pixels of a level.
    pub fn level(&self, level: usize, channels: &[usize]) -> Result<Values, ImageError> {
        if level == 0 && !self.is_bytes {
            return self.floats(channels).map(Values::Floats);
        }
        if level == 0 {
            let checked = self.input().check_size(ReadLimits::default().bytes_for(&self.path));
            checked.map_err(|failure| read_failure(&self.path, failure))?;
        }
        self.region(level, [0; 2], self.sizes[level], channels)
    }

    /// Some channels of a region of `size` columns and rows from `origin` on, which must lie inside the level.
    pub fn region(
        &self,
        level: usize,
        origin: [usize; 2],
        size: [usize; 2],
        channels: &[usize],
    ) -> Result<Values, ImageError> {
        if self.is_bytes {
            self.read(level, [origin, size], channels).map(Values::Bytes)
        } else {
            self.read(level, [origin, size], channels).map(Values::Floats)
        }
    }

    fn read<T: Value>(&self, level: usize, region: [[usize; 2]; 2], channels: &[usize]) -> Result<Vec<T>, ImageError> {
        let ([origin, size], read) = (region.map(|pair| pair.map(int)), around(channels));
        let values = self.input().region(int(level), origin, size, [read.start, read.end].map(int));
        Ok(of_channels(values.map_err(|failure| read_failure(&self.path, failure))?, channels, read))
    }
}

/// Bytes of a value in a file, at most 4.
fn bytes_of(format: i32) -> usize {
    match format {
        sys::OIIO_FORMAT_U8 | sys::OIIO_FORMAT_I8 => 1,
        sys::OIIO_FORMAT_U16 | sys::OIIO_FORMAT_I16 | sys::OIIO_FORMAT_HALF => 2,
        _ => 4,
    }
}

/// Sizes fit into an i32, because they come from one.
fn int(n: usize) -> i32 {
    i32::try_from(n).unwrap_or(i32::MAX)
}

/// Sizes of the levels. `None` if there is only one, or some are missing.
fn all_levels(input: &Input) -> Option<Vec<[usize; 2]>> {
    let size = |level: usize| {
        let sys::OiioLevel { width, height, tile_width, tile_height } = input.level(i32::try_from(level).ok()?)?;
        let [width, height] = [width, height].map(|n| usize::try_from(n).unwrap_or(0));
        let tile = [tile_width, tile_height].map(|n| u64::try_from(n).unwrap_or(0));
        (tile[0] * tile[1] <= MAX_TILE).then_some([width, height])
    };
    let mut sizes = vec![size(0)?];
    while let Some([width, height]) = sizes.last().copied().filter(|s| *s != [1, 1]) {
        let next = size(sizes.len())?;
        if next != [(width / 2).max(1), (height / 2).max(1)] {
            return None;
        }
        sizes.push(next);
    }
    (sizes.len() > 1).then_some(sizes)
}
