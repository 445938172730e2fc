//! Reading of image files.
#![allow(unsafe_code)]

use super::part::{MetaValue, Storage};
use super::radiance;
use super::shim::{Failure, api, c_path, call, text};
use crate::imaging::color_layers::{ColorLayer, choose};
use crate::imaging::file::{ImageError, PartHeader, ReadLimits, Window};
use crate::imaging::{ColorEncoding, Image};
use openimageio_sys as sys;
use std::collections::BTreeMap;
use std::path::Path;
use std::ptr;

/// An image as read from a file.
#[derive(Clone, Debug)]
pub struct ReadImage {
    /// The pixels, not decoded. Integers are scaled to 0..1.
    pub image: Image,
    /// The default encoding of the file type: sRGB for 8-bit and 16-bit integers, linear for everything else.
    pub encoding: ColorEncoding,
    /// Metadata by name, as text.
    pub metadata: BTreeMap<String, String>,
    /// Number of parts in the file.
    pub parts: usize,
    /// Position of the pixels in the full image.
    pub window: Window,
    /// True if the values are stored as 16-bit floats.
    pub is_half: bool,
}

/// A type that values are read as.
pub(super) trait Value: Copy + Default {
    /// Its `OIIO_FORMAT_…`.
    const FORMAT: i32;
}

impl Value for u8 {
    const FORMAT: i32 = sys::OIIO_FORMAT_U8;
}

impl Value for f32 {
    const FORMAT: i32 = sys::OIIO_FORMAT_FLOAT;
}

struct Channel {
    name: String,
    storage: Storage,
}

/// A file open for reading.
pub(in crate::imaging) struct Input {
    api: &'static sys::Api,
    handle: *mut sys::OiioInput,
    part: i32,
    /// Storage of a Radiance picture that has to be converted.
    stored: Option<radiance::Storage>,
}

// SAFETY: a handle may go from thread to thread, if one at a time uses it.
unsafe impl Send for Input {}

impl Input {
    pub(in crate::imaging) fn open(path: &Path, part: i32) -> Result<Self, ImageError> {
        let unreadable = |reason: String| ImageError::Unreadable { path: path.to_owned(), reason };
        match path.metadata() {
            Ok(metadata) if metadata.is_dir() => return Err(unreadable("is a folder".to_owned())),
            Ok(_) => {}
            Err(error) if error.kind() == std::io::ErrorKind::NotFound => {
                return Err(ImageError::NotFound { path: path.to_owned() });
            }
            Err(error) => return Err(unreadable(error.to_string())),
        }
        let api = api()?;
        let name = c_path(path).map_err(unreadable)?;
        let mut handle = ptr::null_mut();
        // SAFETY: the name ends in a zero byte, and `handle` is only written. Alpha stays unassociated: colours of
        // textures must not be multiplied by it in 8 bits.
        call(|e, n| unsafe { (api.input_open)(name.as_ptr(), 1, &mut handle, e, n) })
            .map_err(|failure| unreadable(failure.message))?;
        Ok(Input { api, handle, part, stored: radiance::Storage::of(path) })
    }

    /// Goes to the part with the image, and returns the image's colour channels. `path` is for messages.
    pub(super) fn choose_colors(&mut self, path: &Path) -> Result<ColorLayer, ImageError> {
        let headers = self.headers().map_err(|failure| read_failure(path, failure))?;
        let unreadable = |reason| ImageError::Unreadable { path: path.to_owned(), reason };
        let layer = choose(&headers, None).map_err(unreadable)?;
        self.part = i32::try_from(layer.part).unwrap_or(i32::MAX);
        Ok(layer)
    }

    /// A level of the part; `None` if it does not exist.
    pub(super) fn level(&self, level: i32) -> Option<sys::OiioLevel> {
        let mut found = sys::OiioLevel::default();
        // SAFETY: the handle is live until drop, here and below.
        call(|e, n| unsafe { (self.api.input_level)(self.handle, self.part, level, &mut found, e, n) }).ok()?;
        Some(found)
    }

    /// The values of a region of a level, `size` columns and rows from `origin` on, for a range of channels.
    pub(super) fn region<T: Value>(
        &self,
        level: i32,
        origin: [i32; 2],
        size: [i32; 2],
        channels: [i32; 2],
    ) -> Result<Vec<T>, Failure> {
        let counts = [size[0], size[1], channels[1] - channels[0]].map(|n| usize::try_from(n).unwrap_or(0));
        let mut values = vec![T::default(); counts.iter().product()];
        let ([x, y], [width, height], [begin, end]) = (origin, size, channels);
        let (read, out, count) = (self.api.input_read_region, values.as_mut_ptr().cast(), values.len() as u64);
        // SAFETY: as above; `out` holds `count` values of this format, and nothing is written unless this is the
        // requested number.
        call(|e, n| unsafe {
            read(self.handle, self.part, level, x, y, width, height, begin, end, T::FORMAT, out, count, e, n)
        })?;
        Ok(values)
    }

    fn parts(&self) -> Result<usize, Failure> {
        let mut count = 0;
        // SAFETY: the handle is live until drop, here and below.
        call(|e, n| unsafe { (self.api.input_subimages)(self.handle, &mut count, e, n) })?;
        Ok(usize::try_from(count).unwrap_or(0))
    }

    pub(super) fn spec(&self) -> Result<sys::OiioSpec, Failure> {
        let mut spec = sys::OiioSpec::default();
        // SAFETY: as above.
        call(|e, n| unsafe { (self.api.input_spec)(self.handle, self.part, &mut spec, e, n) })?;
        if self.stored.is_some_and(|stored| stored.is_by_columns) {
            std::mem::swap(&mut spec.width, &mut spec.height);
            std::mem::swap(&mut spec.full_width, &mut spec.full_height);
        }
        Ok(spec)
    }

    /// The name of the file format: `openexr`, `png`, …
    pub(super) fn format_name(&self) -> String {
        // SAFETY: the handle is live, and the name is copied.
        text(unsafe { (self.api.input_format_name)(self.handle) })
    }

    fn channel(&self, index: i32) -> Result<Channel, Failure> {
        let (mut name, mut format) = (ptr::null(), 0);
        // SAFETY: as above; the name is copied while the handle is live.
        call(|e, n| unsafe { (self.api.input_channel)(self.handle, self.part, index, &mut name, &mut format, e, n) })?;
        Ok(Channel { name: text(name), storage: Storage::of_format(format) })
    }

    pub(super) fn channels(&self, count: i32) -> Result<Vec<String>, Failure> {
        (0..count).map(|i| self.channel(i).map(|channel| channel.name)).collect()
    }

    /// Storage types of the channels of the part.
    pub(in crate::imaging) fn storage(&self) -> Result<Vec<Storage>, Failure> {
        (0..self.spec()?.nchannels).map(|i| self.channel(i).map(|channel| channel.storage)).collect()
    }

    /// The headers of all parts.
    fn headers(&mut self) -> Result<Vec<PartHeader>, Failure> {
        let first = self.part;
        let mut headers = Vec::new();
        for part in 0..self.parts()? {
            self.part = i32::try_from(part).unwrap_or(i32::MAX);
            let spec = self.spec()?;
            let channels = self.channels(spec.nchannels)?;
            let name = self.metadata(spec.attributes).remove("oiio:subimagename").unwrap_or_default();
            let size = [spec.width, spec.height].map(|n| usize::try_from(n).unwrap_or(0));
            headers.push(PartHeader { name, channels, size });
        }
        self.part = first;
        Ok(headers)
    }

    /// Metadata of the part with types that [`MetaValue`] supports.
    pub(in crate::imaging) fn values(&self) -> Result<Vec<(String, MetaValue)>, Failure> {
        let value = |a: &sys::OiioAttribute| {
            let bytes: &[u8] = if a.data.is_null() {
                &[]
            } else {
                // SAFETY: the shim guarantees `bytes` bytes at `data`; they are copied while the handle is live.
                unsafe { std::slice::from_raw_parts(a.data.cast(), a.bytes) }
            };
            let words: Vec<[u8; 4]> = bytes.as_chunks().0.to_vec();
            match (text(a.r#type).as_str(), &words[..]) {
                ("string", _) => Some(MetaValue::Text(text(a.value))),
                ("int", [word]) => Some(MetaValue::Integer(i32::from_ne_bytes(*word))),
                ("float", [word]) => Some(MetaValue::Number(f32::from_ne_bytes(*word))),
                ("matrix", words) => {
                    let rows: Vec<f32> = words.iter().map(|word| f32::from_ne_bytes(*word)).collect();
                    rows.try_into().ok().map(MetaValue::Matrix)
                }
                _ => None,
            }
        };
        let entries =
            (0..self.spec()?.attributes).filter_map(|i| self.attribute(i, |a| Some((text(a.name), value(a)?))));
        Ok(entries.collect())
    }

    pub(super) fn metadata(&self, count: i32) -> BTreeMap<String, String> {
        let entry = |index| self.attribute(index, |a| Some((text(a.name), text(a.value))));
        (0..count).filter_map(entry).collect()
    }

    /// Calls `read` with a metadata entry.
    fn attribute<T>(&self, index: i32, read: impl FnOnce(&sys::OiioAttribute) -> Option<T>) -> Option<T> {
        let mut a = sys::OiioAttribute {
            name: ptr::null(),
            r#type: ptr::null(),
            value: ptr::null(),
            data: ptr::null(),
            bytes: 0,
        };
        // SAFETY: as above; `read` copies its values while the handle is live.
        call(|e, n| unsafe { (self.api.input_attribute)(self.handle, self.part, index, &mut a, e, n) }).ok()?;
        read(&a)
    }

    /// `Err` unless the header asks for an image of at most `max_bytes` of f32.
    pub(super) fn check_size(&self, max_bytes: u64) -> Result<(), Failure> {
        let mut count = 0;
        // SAFETY: as above.
        call(|e, n| unsafe { (self.api.input_value_count)(self.handle, self.part, max_bytes, &mut count, e, n) })
    }

    /// The values of a range of channels of all pixels.
    pub(super) fn pixels(&self, channels: [i32; 2], max_bytes: u64) -> Result<Vec<f32>, Failure> {
        self.check_size(max_bytes)?;
        let sys::OiioSpec { width, height, .. } = self.spec()?;
        let Some(stored) = self.stored else { return self.region(0, [0; 2], [width, height], channels) };
        let size = if stored.is_by_columns { [height, width] } else { [width, height] };
        let pixels = self.region(0, [0; 2], size, [0, 3])?;
        let [begin, end] = channels.map(|c| usize::try_from(c).unwrap_or(0));
        Ok(stored.arranged(&pixels, size.map(|n| usize::try_from(n).unwrap_or(0)), begin..end))
    }
}

impl Drop for Input {
    fn drop(&mut self) {
        // SAFETY: the handle is live and closed once.
        unsafe { (self.api.input_close)(self.handle) };
    }
}

/// Reads the first part of an image.
pub fn read_image(path: &Path, limits: &ReadLimits) -> Result<ReadImage, ImageError> {
    read_part(path, 0, limits)
}

/// Reads a part of an image; the first is 0.
pub fn read_part(path: &Path, part: usize, limits: &ReadLimits) -> Result<ReadImage, ImageError> {
    read(&Input::open(path, i32::try_from(part).unwrap_or(i32::MAX))?, path, part, limits)
}

/// Reads the part at which the file is open.
fn read(input: &Input, path: &Path, part: usize, limits: &ReadLimits) -> Result<ReadImage, ImageError> {
    let failed = |failure| read_failure(path, failure);
    let parts = input.parts().map_err(failed)?;
    if part >= parts {
        let message = format!("has {parts} parts, none of number {part}");
        return Err(failed(Failure { code: sys::OIIO_INVALID_ARGUMENT, message }));
    }
    let spec = input.spec().map_err(failed)?;
    let data = input.pixels([0, spec.nchannels], limits.bytes_for(path)).map_err(failed)?;
    let channels = input.channels(spec.nchannels).map_err(failed)?;
    let metadata = input.metadata(spec.attributes);
    let encoding = usual_encoding(&spec);
    // The shim checked the header against the pixels: the sizes are positive
    let image = Image { width: spec.width as usize, height: spec.height as usize, channels, data };
    let size = |n: i32| usize::try_from(n).unwrap_or(0);
    let window = Window {
        origin: [spec.x, spec.y],
        full_origin: [spec.full_x, spec.full_y],
        full_size: [size(spec.full_width), size(spec.full_height)],
    };
    Ok(ReadImage { image, encoding, metadata, parts, window, is_half: spec.format == sys::OIIO_FORMAT_HALF })
}

/// The default encoding of a file: sRGB for 8-bit and 16-bit integers, linear for everything else.
pub(super) fn usual_encoding(spec: &sys::OiioSpec) -> ColorEncoding {
    let is_integer = matches!(spec.format, sys::OIIO_FORMAT_U8 | sys::OIIO_FORMAT_U16);
    if is_integer { ColorEncoding::Srgb } else { ColorEncoding::Linear }
}

/// Reads the metadata of the first part of an image as text, without pixels.
pub fn read_metadata(path: &Path) -> Result<BTreeMap<String, String>, ImageError> {
    let input = Input::open(path, 0)?;
    let spec = input.spec().map_err(|failure| read_failure(path, failure))?;
    Ok(input.metadata(spec.attributes))
}

/// Reads the headers of all parts of an image, without pixels.
pub fn read_headers(path: &Path) -> Result<Vec<PartHeader>, ImageError> {
    Input::open(path, 0)?.headers().map_err(|failure| read_failure(path, failure))
}

/// The error of a failed read.
pub(in crate::imaging) fn read_failure(path: &Path, failure: Failure) -> ImageError {
    let (path, reason) = (path.to_owned(), failure.message);
    match failure.code {
        sys::OIIO_TOO_LARGE => ImageError::TooLarge { path, reason },
        _ => ImageError::Unreadable { path, reason },
    }
}
