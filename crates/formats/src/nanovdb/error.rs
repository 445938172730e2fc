//! Errors of NanoVDB files.

use std::io;
use std::path::PathBuf;

/// Reasons why a grid is not read.
#[derive(Debug, thiserror::Error)]
pub enum NanoError {
    /// Reading failed.
    #[error("{}{source}", if path.as_os_str().is_empty() { String::new() } else { format!("{}: ", path.display()) })]
    Io {
        /// The file; empty if bytes were given.
        path: PathBuf,
        /// The reason.
        source: io::Error,
    },
    /// It is not a NanoVDB file.
    #[error("is not a NanoVDB file{0}")]
    Format(&'static str),
    /// Its version is not supported.
    #[error("has version {major}.{minor} of NanoVDB, of which 32.x is read: convert it anew")]
    Version {
        /// Major version.
        major: u32,
        /// Minor version.
        minor: u32,
    },
    /// Its compression is not supported.
    #[error("is compressed by {0}, which is not read: convert it without, or with zip")]
    Codec(String),
    /// It has no grid with the name.
    #[error("has no grid `{name}`: {}", if found.is_empty() { "it has no grids".to_owned() } else { format!("its grids are {}", found.join(", ")) })]
    NoGrid {
        /// The name.
        name: String,
        /// Names of the existing grids.
        found: Vec<String>,
    },
    /// The value type of the grid is not supported.
    #[error("its grid `{name}` has values of the type {ty}: float, double, fp4, fp8, fp16 and fpn are read")]
    Values {
        /// The grid.
        name: String,
        /// Their type.
        ty: String,
    },
    /// It is damaged.
    #[error("is damaged: {0}")]
    Damaged(String),
}

impl NanoError {
    pub(super) fn damaged(message: impl Into<String>) -> Self {
        NanoError::Damaged(message.into())
    }

    pub(super) fn no_grid(name: &str, found: Vec<String>) -> Self {
        NanoError::NoGrid { name: name.to_owned(), found }
    }
}

impl From<io::Error> for NanoError {
    fn from(source: io::Error) -> Self {
        match source.kind() {
            io::ErrorKind::UnexpectedEof => NanoError::damaged("it ends too early"),
            _ => NanoError::Io { path: PathBuf::new(), source },
        }
    }
}
