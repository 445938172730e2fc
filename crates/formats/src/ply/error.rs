//! Errors of PLY files, and their positions.

use std::path::PathBuf;
use std::{fmt, io};

/// A position in a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Place {
    /// Line of a text, from 1.
    Line(u64),
    /// Offset from the start (bytes), after decompression.
    Byte(u64),
}

impl fmt::Display for Place {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Place::Line(line) => write!(f, "line {line}"),
            Place::Byte(byte) => write!(f, "byte {byte}"),
        }
    }
}

/// Errors of PLY files.
#[derive(Debug, thiserror::Error)]
pub enum PlyError {
    /// Reading or decompression failed.
    #[error("{}{source}", if path.as_os_str().is_empty() { String::new() } else { format!("{}: ", path.display()) })]
    Io {
        /// The file; empty if bytes were given.
        path: PathBuf,
        /// The reason.
        source: io::Error,
    },
    /// The header is invalid, or does not describe a mesh.
    #[error("line {line} of the header: {message}")]
    Header {
        /// Line, from 1.
        line: u64,
        /// The error.
        message: String,
    },
    /// The header declares more than the file can hold.
    #[error(
        "{count} of `{element}` are announced, which takes at least {needed} bytes, but at most {available} follow the \
         header"
    )]
    Counts {
        /// Name of the element.
        element: String,
        /// Number of its rows.
        count: u64,
        /// Minimum size of this element and the elements before it (bytes).
        needed: u64,
        /// Maximum size of the data after the header (bytes).
        available: u64,
    },
    /// The file ends too early.
    #[error("the file ends at {place}, inside `{element}`")]
    Truncated {
        /// Position of the end, or of a list that does not fit.
        place: Place,
        /// The element that is incomplete.
        element: String,
    },
    /// A word of an ASCII file is not a number of the expected kind.
    #[error("{place}: `{word}` in `{element}`, where {expected} is expected")]
    Number {
        /// Its position.
        place: Place,
        /// The word.
        word: String,
        /// Its element.
        element: String,
        /// The expected kind.
        expected: &'static str,
    },
    /// A list has a negative length.
    #[error("{place}: a list of {length} items in `{element}`")]
    ListLength {
        /// Position of the list.
        place: Place,
        /// Its length.
        length: i64,
        /// Its element.
        element: String,
    },
    /// A face refers to a vertex that does not exist.
    #[error("{place}: face {face} refers to vertex {index}, but there are {vertices} vertices")]
    IndexOutOfRange {
        /// Position of the index, or of the face.
        place: Place,
        /// The face, from 0; of strips, the strip.
        face: u64,
        /// The index; −1 if it is not an integer.
        index: i64,
        /// Number of vertices.
        vertices: u64,
    },
}

impl PlyError {
    pub(super) fn header(line: u64, message: impl Into<String>) -> Self {
        PlyError::Header { line, message: message.into() }
    }
}

impl From<io::Error> for PlyError {
    fn from(source: io::Error) -> Self {
        PlyError::Io { path: PathBuf::new(), source }
    }
}
