//! Errors of part files and checkpoints.

use std::io;
use std::path::{Path, PathBuf};

/// Reason why parts cannot be read, merged or resumed.
#[derive(Debug, thiserror::Error)]
pub enum PartError {
    /// A file cannot be read or written.
    #[error("{}: {cause}", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// The cause. Not declared as the source of the error, because the text includes it.
        cause: io::Error,
    },
    /// A file has another format or version.
    #[error("{}: {reason}", path.display())]
    Foreign {
        /// The file.
        path: PathBuf,
        /// The actual content.
        reason: String,
    },
    /// A file is truncated or was modified.
    #[error("{} is damaged: {reason}", path.display())]
    Damaged {
        /// The file.
        path: PathBuf,
        /// The defect.
        reason: String,
    },
    /// The stored sums do not match the scene and settings.
    #[error("the stored sums belong to other settings: {0}")]
    Sums(&'static str),
    /// Parts do not belong together, or some are missing.
    #[error("{0}")]
    Parts(String),
}

impl PartError {
    pub(in crate::render) fn io(path: &Path, cause: io::Error) -> Self {
        PartError::Io { path: path.to_owned(), cause }
    }

    pub(super) fn foreign(path: &Path, reason: &str) -> Self {
        PartError::Foreign { path: path.to_owned(), reason: reason.to_owned() }
    }

    pub(super) fn damaged(path: &Path, reason: &str) -> Self {
        PartError::Damaged { path: path.to_owned(), reason: reason.to_owned() }
    }
}
