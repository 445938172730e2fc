//! Metadata of image files: everything beside the pixels.

use std::path::PathBuf;

/// Why an image cannot be read or written.
#[derive(Debug, thiserror::Error)]
pub enum ImageError {
    /// OpenImageIO itself cannot be used.
    #[error("OpenImageIO cannot be loaded: {0}")]
    Library(String),
    /// A colour transform that OpenColorIO does not have.
    #[error("OpenColorIO: {0}")]
    Color(String),
    /// There is no such file.
    #[error("{}: no such file", path.display())]
    NotFound {
        /// The file.
        path: PathBuf,
    },
    /// It is no image, a damaged one, or of a kind that is not supported.
    #[error("{}: {reason}", path.display())]
    Unreadable {
        /// The file.
        path: PathBuf,
        /// What is wrong with it.
        reason: String,
    },
    /// It needs more memory than allowed.
    #[error("{}: {reason}", path.display())]
    TooLarge {
        /// The file.
        path: PathBuf,
        /// The sizes.
        reason: String,
    },
    /// It cannot be written.
    #[error("cannot write {}: {reason}", path.display())]
    Write {
        /// The file.
        path: PathBuf,
        /// Why.
        reason: String,
    },
}

/// What reading may cost.
#[derive(Clone, Copy, Debug)]
pub struct ReadLimits {
    /// Largest decoded image (bytes of f32).
    pub max_bytes: u64,
    /// Largest ratio of the decoded image to the file: a header of a few bytes can claim any size.
    pub max_expansion: u64,
    /// Images up to this size (bytes of f32) may expand as they like.
    pub free_bytes: u64,
}

impl Default for ReadLimits {
    fn default() -> Self {
        ReadLimits { max_bytes: 8 << 30, max_expansion: 4000, free_bytes: 64 << 20 }
    }
}

impl ReadLimits {
    /// The largest decoded image of a file of `file_bytes`.
    pub(super) fn bytes_for(&self, file_bytes: u64) -> u64 {
        file_bytes.saturating_mul(self.max_expansion).max(self.free_bytes).min(self.max_bytes)
    }
}

/// Where the pixels of a part lie in the full image.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Window {
    /// Column and row of the first pixel of the data.
    pub origin: [i32; 2],
    /// Column and row of the first pixel of the full image.
    pub full_origin: [i32; 2],
    /// Columns and rows of the full image.
    pub full_size: [usize; 2],
}

/// What the header says of a part.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct PartHeader {
    /// The part's name; empty if it has none.
    pub name: String,
    /// Names of its channels.
    pub channels: Vec<String>,
    /// Width and height of its pixels.
    pub size: [usize; 2],
}
