//! What can be wrong with the files of parts.

use std::io;
use std::path::{Path, PathBuf};

/// Why parts cannot be read, merged or continued.
#[derive(Debug, thiserror::Error)]
pub enum PartError {
    /// A file cannot be read or written.
    #[error("{}: {cause}", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// Why. No source of the error, whose text has it already.
        cause: io::Error,
    },
    /// A file is something else, or of another version.
    #[error("{}: {reason}", path.display())]
    Foreign {
        /// The file.
        path: PathBuf,
        /// What it is.
        reason: String,
    },
    /// A file is cut off, or was changed.
    #[error("{} is damaged: {reason}", path.display())]
    Damaged {
        /// The file.
        path: PathBuf,
        /// What is wrong.
        reason: String,
    },
    /// The stored sums do not fit the scene and settings.
    #[error("the stored sums belong to other settings: {0}")]
    Sums(&'static str),
    /// Parts do not belong together, or not all are there.
    #[error("{0}")]
    Parts(String),
}

impl PartError {
    pub(super) fn io(path: &Path, cause: io::Error) -> Self {
        PartError::Io { path: path.to_owned(), cause }
    }

    pub(super) fn foreign(path: &Path, reason: &str) -> Self {
        PartError::Foreign { path: path.to_owned(), reason: reason.to_owned() }
    }

    pub(super) fn damaged(path: &Path, reason: &str) -> Self {
        PartError::Damaged { path: path.to_owned(), reason: reason.to_owned() }
    }
}
