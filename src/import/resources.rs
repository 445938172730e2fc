//! Image files of a scene: each is requested once, and all are read in parallel.

use crate::imaging::oiio::ImageError;
use crate::imaging::oiio::{self, ReadLimits};
use crate::imaging::{ColorChannels, ColorEncoding, MipMap};
use crate::textures::{Filter, ImageId, Wrap};
use lumiris_formats::diagnostic::Diagnostics;
use lumiris_formats::source::Span;
use lumiris_numbers::math::Rgb;
use rayon::prelude::*;
use std::collections::HashMap;
use std::path::{Path, PathBuf};

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

/// An image as textures ask for it.
#[derive(Clone, Debug, PartialEq)]
pub struct ImageRequest {
    /// File.
    pub path: PathBuf,
    /// Meaning of its numbers.
    pub encoding: ImageEncoding,
    /// Outside of 0..1.
    pub wrap: Wrap,
    /// Between texels.
    pub filter: Filter,
}

/// All images that a scene asks for.
#[derive(Debug, Default)]
pub struct Resources {
    requests: Vec<(ImageRequest, Span)>,
    by_path: HashMap<PathBuf, Vec<ImageId>>,
}

impl Resources {
    /// The id that the image will have; equal requests share one.
    pub fn image(&mut self, request: ImageRequest, span: Span) -> ImageId {
        let ids = self.by_path.entry(request.path.clone()).or_default();
        if let Some(&id) = ids.iter().find(|&&id| self.requests[id as usize].0 == request) {
            return id;
        }
        let id = self.requests.len() as ImageId;
        ids.push(id);
        self.requests.push((request, span));
        id
    }

    /// The files, in the order of the images.
    pub fn paths(&self) -> impl Iterator<Item = &Path> {
        self.requests.iter().map(|(request, _)| request.path.as_path())
    }

    /// Reads all images, in the order of their ids; errors go to `d`.
    pub fn load(&self, d: &mut Diagnostics) -> Vec<MipMap> {
        let loaded: Vec<Result<MipMap, ImageError>> = self.requests.par_iter().map(|(r, _)| load_map(r)).collect();
        let mut maps = Vec::with_capacity(loaded.len());
        for (result, (request, span)) in loaded.into_iter().zip(&self.requests) {
            match result {
                Ok(map) => maps.push(map),
                Err(error) => report(&error, &request.path, *span, d),
            }
        }
        maps
    }
}

/// An image that cannot be read: one of the missing files, or an error of its own.
pub fn report(error: &ImageError, path: &Path, span: Span, d: &mut Diagnostics) {
    match error {
        ImageError::NotFound { .. } => d.missing_file(path, "no such file", Some(span)),
        other => {
            d.error(span, other.to_string());
        }
    }
}

fn load_map(request: &ImageRequest) -> Result<MipMap, ImageError> {
    let read = oiio::read_image(&request.path, &ReadLimits::default())?;
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

/// Reads an image as linear RGB, rows from the top, with its size.
pub fn load_rgb(path: &Path) -> Result<(Vec<Rgb>, [usize; 2]), ImageError> {
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
