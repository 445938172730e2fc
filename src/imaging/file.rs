//! Errors, limits and headers of image files.

use std::path::{Path, PathBuf};

/// Reason why an image cannot be read or written.
#[derive(Debug, thiserror::Error)]
pub enum ImageError {
    /// OpenImageIO cannot be loaded.
    #[error("OpenImageIO cannot be loaded: {0}")]
    Library(String),
    /// OpenColorIO does not have the colour transform.
    #[error("OpenColorIO: {0}")]
    Color(String),
    /// The file does not exist.
    #[error("{}: no such file", path.display())]
    NotFound {
        /// The file.
        path: PathBuf,
    },
    /// The file is not an image, is damaged, or has an unsupported format.
    #[error("{}: {reason}", path.display())]
    Unreadable {
        /// The file.
        path: PathBuf,
        /// The cause.
        reason: String,
    },
    /// The image needs more memory than allowed.
    #[error("{}: {reason}", path.display())]
    TooLarge {
        /// The file.
        path: PathBuf,
        /// The sizes.
        reason: String,
    },
    /// The file cannot be written.
    #[error("cannot write {}: {reason}", path.display())]
    Write {
        /// The file.
        path: PathBuf,
        /// The cause.
        reason: String,
    },
}

/// Texts with names, such as metadata.
pub type TextEntries = Vec<(String, String)>;

/// Limits for reading an image.
#[derive(Clone, Copy, Debug)]
pub struct ReadLimits {
    /// Largest decoded image (bytes of f32).
    pub max_bytes: u64,
    /// Maximum ratio of the decoded image to the file: a header of a few bytes can claim any size.
    pub max_expansion: u64,
    /// Images up to this size (bytes of f32) are exempt from `max_expansion`.
    pub free_bytes: u64,
}

impl Default for ReadLimits {
    fn default() -> Self {
        ReadLimits { max_bytes: 8 << 30, max_expansion: 4000, free_bytes: 64 << 20 }
    }
}

impl ReadLimits {
    /// Maximum size of the decoded image of a file.
    pub(super) fn bytes_for(&self, path: &Path) -> u64 {
        let file_bytes = path.metadata().map_or(0, |metadata| metadata.len());
        file_bytes.saturating_mul(self.max_expansion).max(self.free_bytes).min(self.max_bytes)
    }
}

/// Position of the pixels of a part in the full image.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Window {
    /// Column and row of the first pixel of the data.
    pub origin: [i32; 2],
    /// Column and row of the first pixel of the full image.
    pub full_origin: [i32; 2],
    /// Columns and rows of the full image.
    pub full_size: [usize; 2],
}

/// Header of a part.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct PartHeader {
    /// The name of the part; empty if it has none.
    pub name: String,
    /// Names of its channels.
    pub channels: Vec<String>,
    /// Width and height of its pixels.
    pub size: [usize; 2],
}
