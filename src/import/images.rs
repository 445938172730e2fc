//! Image files as scenes ask for them, and how they are read.

use crate::imaging::oiio::{self, ImageError, ReadLimits};
use crate::imaging::{ColorChannels, ColorEncoding, Filter, Image, MipMap, Wrap};
use crate::textures::Udim;
use lumiris_numbers::math::Rgb;
use std::path::{Path, PathBuf};

/// Linear texels, rows from the top, and the size of the image.
pub type RgbImage = (Vec<Rgb>, [usize; 2]);

/// How the numbers of an image mean light.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ImageEncoding {
    /// sRGB for integers, linear for floats.
    Auto,
    /// sRGB curve.
    Srgb,
    /// As they are.
    Linear,
    /// A power.
    Gamma(f32),
}

/// Which channels of an image are read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ImageChannels {
    /// Colour or grey.
    Color,
    /// Opacity; 1 where there is none.
    Alpha,
}

/// An image as textures ask for it.
#[derive(Clone, Debug, PartialEq)]
pub struct ImageRequest {
    /// File.
    pub path: PathBuf,
    /// The part of it.
    pub channels: ImageChannels,
    /// Meaning of its numbers.
    pub encoding: ImageEncoding,
    /// Outside of 0..1.
    pub wrap: Wrap,
    /// Between texels.
    pub filter: Filter,
}

/// What stands for the number of a tile in the name of an image file.
pub const UDIM: &str = "<UDIM>";

/// The tiles of a path whose file name has [`UDIM`], in the order of their numbers; those that are there.
pub fn tiles(path: &Path) -> Vec<(u32, PathBuf)> {
    let name = path.file_name().and_then(|name| name.to_str()).unwrap_or_default();
    let Some((before, after)) = name.split_once(UDIM) else { return Vec::new() };
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let entries = std::fs::read_dir(folder).into_iter().flatten().flatten();
    let number = |name: &str| {
        let digits = name.strip_prefix(before)?.strip_suffix(after)?;
        let is_number = digits.len() == 4 && digits.bytes().all(|b| b.is_ascii_digit());
        digits.parse().ok().filter(|&number| is_number && Udim::is_number(number))
    };
    let tile = |entry: std::fs::DirEntry| Some((number(entry.file_name().to_str()?)?, entry.path()));
    let mut tiles: Vec<(u32, PathBuf)> = entries.filter_map(tile).collect();
    tiles.sort();
    tiles
}

/// Reads an image as textures ask for it.
pub fn load_map(request: &ImageRequest) -> Result<MipMap, ImageError> {
    let read = oiio::read_image(&request.path, &ReadLimits::default())?;
    if request.channels == ImageChannels::Alpha {
        return Ok(alpha_map(&read.image, request));
    }
    let encoding = match request.encoding {
        // Floats are light already, whatever the scene says: pbrt-v4 decodes integers only.
        _ if read.encoding == ColorEncoding::Linear => ColorEncoding::Linear,
        ImageEncoding::Auto => read.encoding,
        ImageEncoding::Srgb => ColorEncoding::Srgb,
        ImageEncoding::Linear => ColorEncoding::Linear,
        ImageEncoding::Gamma(gamma) => ColorEncoding::Gamma(gamma),
    };
    Ok(MipMap::new(&read.image, request.wrap, request.filter, encoding))
}

/// The opacity of an image, which is stored linear.
fn alpha_map(image: &Image, request: &ImageRequest) -> MipMap {
    let Some(position) = image.channel("A") else {
        return MipMap::constant(1.0, request.wrap, request.filter);
    };
    let data = image.data.iter().skip(position).step_by(image.channels.len()).copied().collect();
    let (width, height) = (image.width, image.height);
    let alpha = Image { width, height, channels: vec!["Y".to_owned()], data };
    MipMap::new(&alpha, request.wrap, request.filter, ColorEncoding::Linear)
}

/// Reads an image as linear RGB, rows from the top, with its size.
pub fn load_rgb(path: &Path) -> Result<RgbImage, ImageError> {
    let read = oiio::read_image(path, &ReadLimits::default())?;
    let image = &read.image;
    let channels = match image.color_channels() {
        Some(ColorChannels::Rgb(rgb)) => rgb,
        Some(ColorChannels::Grey(y)) => [y; 3],
        None => return Err(ImageError::Unreadable { path: path.to_owned(), reason: "has no channels".to_owned() }),
    };
    let pixels = image.data.chunks_exact(image.channels.len());
    let texels = pixels.map(|p| Rgb::from_array(channels.map(|c| read.encoding.to_linear(p[c]))));
    Ok((texels.collect(), [image.width, image.height]))
}
