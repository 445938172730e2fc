//! Errors of Ptex files.

use std::path::PathBuf;

/// Errors of Ptex files.
#[derive(Debug, thiserror::Error)]
pub enum PtexError {
    /// Error of the operating system.
    #[error("{reason}")]
    Unreadable {
        /// The file.
        path: PathBuf,
        /// Its reason.
        reason: std::io::Error,
    },
    /// It is not a Ptex file, or not a supported one.
    #[error("{}: byte {byte}: {message}", path.display())]
    Wrong {
        /// The file; empty for bytes.
        path: PathBuf,
        /// Offset from the beginning of the file.
        byte: usize,
        /// One sentence without a full stop.
        message: String,
    },
}

impl PtexError {
    pub(super) fn wrong(byte: usize, message: impl Into<String>) -> Self {
        PtexError::Wrong { path: PathBuf::new(), byte, message: message.into() }
    }
}
