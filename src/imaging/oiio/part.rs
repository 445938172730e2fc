//! Images to write: pixels, metadata and storage.

use crate::imaging::file::TextEntries;
use openimageio_sys as sys;

/// Storage type of values.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Storage {
    /// 8-bit integers for 0..1.
    Bytes,
    /// 16-bit floats: 11 significant bits, up to 65504.
    Half,
    /// 32-bit floats.
    Float,
}

impl Storage {
    pub(super) fn format(self) -> i32 {
        match self {
            Storage::Bytes => sys::OIIO_FORMAT_U8,
            Storage::Half => sys::OIIO_FORMAT_HALF,
            Storage::Float => sys::OIIO_FORMAT_FLOAT,
        }
    }

    /// The storage type for values of a format; `Float` for other formats.
    pub(super) fn of_format(format: i32) -> Self {
        match format {
            sys::OIIO_FORMAT_U8 => Storage::Bytes,
            sys::OIIO_FORMAT_HALF => Storage::Half,
            _ => Storage::Float,
        }
    }
}

/// A value of metadata.
#[derive(Clone, Debug, PartialEq)]
pub enum MetaValue {
    /// Text.
    Text(String),
    /// An integer.
    Integer(i32),
    /// A number.
    Number(f32),
    /// A 4 × 4 matrix for row vectors, row by row.
    Matrix([f32; 16]),
}

/// An image to write: one part of a file.
#[derive(Clone, Debug)]
pub struct Part {
    pub(super) width: usize,
    pub(super) height: usize,
    pub(super) channels: Vec<String>,
    pub(super) data: Vec<f32>,
    pub(super) metadata: Vec<(String, MetaValue)>,
    /// Column and row of the first pixel in the full image.
    pub(super) origin: [usize; 2],
    /// Size of the full image.
    pub(super) full: [usize; 2],
    pub(super) storage: Storage,
    /// Storage of channels that differ from `storage`.
    pub(super) channel_storage: Vec<(usize, Storage)>,
    pub(super) name: Option<String>,
    pub(super) compression: Option<String>,
}

impl Part {
    /// Linear values, stored as f32. `data` is row-major from the top left, channels interleaved. It is empty if values
    /// are computed while the file is written.
    pub fn linear(width: usize, height: usize, channels: Vec<String>, data: Vec<f32>) -> Self {
        Part {
            width,
            height,
            channels,
            data,
            metadata: Vec::new(),
            origin: [0, 0],
            full: [width, height],
            storage: Storage::Float,
            channel_storage: Vec::new(),
            name: None,
            compression: None,
        }
    }

    /// Values for a display, 0..1, stored in 8 bits.
    pub fn display(width: usize, height: usize, channels: Vec<String>, data: Vec<f32>) -> Self {
        Part { storage: Storage::Bytes, ..Part::linear(width, height, channels, data) }
    }

    /// Adds text metadata.
    #[must_use]
    pub fn with_metadata(mut self, metadata: TextEntries) -> Self {
        self.metadata.extend(metadata.into_iter().map(|(name, value)| (name, MetaValue::Text(value))));
        self
    }

    /// Adds metadata.
    #[must_use]
    pub fn with_value(mut self, name: &str, value: MetaValue) -> Self {
        self.metadata.push((name.to_owned(), value));
        self
    }

    /// Names the part. Required in files of several parts.
    #[must_use]
    pub fn named(mut self, name: &str) -> Self {
        self.name = Some(name.to_owned());
        self
    }

    /// Sets the storage of all channels.
    #[must_use]
    pub fn stored_as(mut self, storage: Storage) -> Self {
        (self.storage, self.channel_storage) = (storage, Vec::new());
        self
    }

    /// Sets the storage of some channels (EXR only). Unknown names are ignored.
    #[must_use]
    pub fn channels_stored_as(mut self, names: &[&str], storage: Storage) -> Self {
        let found = self.channels.iter().enumerate().filter(|(_, name)| names.contains(&name.as_str()));
        self.channel_storage.extend(found.map(|(i, _)| (i, storage)));
        self
    }

    /// Sets the compression by its OpenImageIO name: `piz`, `dwaa:45`, `jpeg:90`. EXR files use `zip` by default.
    #[must_use]
    pub fn compressed_by(mut self, compression: &str) -> Self {
        self.compression = Some(compression.to_owned());
        self
    }

    /// Sets the position in a larger image.
    #[must_use]
    pub fn with_window(mut self, origin: [usize; 2], full: [usize; 2]) -> Self {
        (self.origin, self.full) = (origin, full);
        self
    }
}
