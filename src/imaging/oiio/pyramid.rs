//! Files with a whole pyramid, such as the `.tx` files of texture converters.

use super::read::{Input, read_failure, usual_encoding};
use crate::imaging::ColorEncoding;
use crate::imaging::color_layers::ColorLayer;
use crate::imaging::file::{ImageError, ReadLimits};
use openimageio_sys as sys;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};

/// Maximum pixels of a tile: headers of damaged files can claim more, and OpenImageIO would allocate them.
const MAX_TILE: u64 = 1 << 22;

/// A file open for reading, with all levels of its image down to one pixel. Each level has half the size of the
/// previous one, rounded down.
pub struct FilePyramid {
    /// Locked, because one thread at a time may read.
    input: Mutex<Input>,
    path: PathBuf,
    sizes: Vec<[usize; 2]>,
    layer: ColorLayer,
    channels: u64,
    encoding: ColorEncoding,
    is_bytes: bool,
    chromaticities: Option<String>,
}

impl std::fmt::Debug for FilePyramid {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("FilePyramid").field("path", &self.path).field("sizes", &self.sizes).finish_non_exhaustive()
    }
}

impl FilePyramid {
    /// Opens a file without reading pixels. Returns `None` if the image does not have all levels.
    pub fn open(path: &Path) -> Result<Option<Self>, ImageError> {
        let mut input = Input::open(path, 0)?;
        let layer = input.choose_colors(path)?;
        let failed = |failure| read_failure(path, failure);
        let spec = input.spec().map_err(failed)?;
        let Some(sizes) = all_levels(&input) else { return Ok(None) };
        Ok(Some(FilePyramid {
            path: path.to_owned(),
            sizes,
            layer,
            channels: u64::try_from(spec.nchannels).unwrap_or(0),
            encoding: usual_encoding(&spec),
            is_bytes: spec.format == sys::OIIO_FORMAT_U8,
            chromaticities: input.metadata(spec.attributes).remove("chromaticities"),
            input: Mutex::new(input),
        }))
    }

    /// The file.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Columns and rows of each level, the full image first.
    pub fn sizes(&self) -> &[[usize; 2]] {
        &self.sizes
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

    /// True if all values are multiples of 1/255 in 0..1.
    pub fn is_bytes(&self) -> bool {
        self.is_bytes
    }

    /// Some channels of all pixels of a level, interleaved, top row first.
    pub fn level(&self, level: usize, channels: &[usize]) -> Result<Vec<f32>, ImageError> {
        let size = self.sizes[level];
        let bytes = size.iter().fold(4 * self.channels, |bytes, &n| bytes.saturating_mul(n as u64));
        let limit = ReadLimits::default().bytes_for(self.path.metadata().map_or(0, |m| m.len()));
        if bytes > limit {
            let [width, height] = size;
            let reason = format!(
                "the header says {width} x {height} pixels, more than the limit of {limit} bytes (damaged file?)"
            );
            return Err(ImageError::TooLarge { path: self.path.clone(), reason });
        }
        self.region(level, [0; 2], size, channels)
    }

    /// The same for a region of `size` columns and rows from `origin` on, which must lie inside the level.
    pub fn region(
        &self,
        level: usize,
        origin: [usize; 2],
        size: [usize; 2],
        channels: &[usize],
    ) -> Result<Vec<f32>, ImageError> {
        // Sizes fit into an i32, because they come from one
        let int = |n: usize| i32::try_from(n).unwrap_or(i32::MAX);
        let begin = channels.iter().copied().min().unwrap_or(0);
        let end = channels.iter().copied().max().unwrap_or(0) + 1;
        let input = self.input.lock().unwrap_or_else(PoisonError::into_inner);
        let pixels = input
            .region(int(level), origin.map(int), size.map(int), [begin, end].map(int))
            .map_err(|failure| read_failure(&self.path, failure))?;
        drop(input);
        if channels.iter().copied().eq(begin..end) {
            return Ok(pixels);
        }
        let of_pixel = |pixel: &[f32]| channels.iter().map(|&c| pixel[c - begin]).collect::<Vec<_>>();
        Ok(pixels.chunks_exact(end - begin).flat_map(of_pixel).collect())
    }
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
