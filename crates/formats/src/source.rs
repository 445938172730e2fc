//! The source texts of an import, and positions in them.

use crate::gzip;
use std::fmt;
use std::fs::File;
use std::io::{self, Read};
use std::path::Path;
use std::sync::{Arc, OnceLock};

/// Index of a file in a [`SourceMap`].
pub type FileId = u32;

/// A range of bytes in a file.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub struct Span {
    /// The file.
    pub file: FileId,
    /// First byte.
    pub start: u32,
    /// One past the last byte.
    pub end: u32,
}

impl Span {
    /// From the start of `self` to the end of `other`, if they are in the same file; else `self`.
    #[must_use]
    pub fn to(self, other: Span) -> Span {
        if self.file == other.file { Span { end: other.end.max(self.end), ..self } } else { self }
    }
}

/// A position for messages.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Location {
    /// Name of the file.
    pub name: String,
    /// Position in the file.
    pub position: Position,
}

/// A position in a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Position {
    /// In text; both count from 1.
    Text {
        /// Line.
        line: usize,
        /// Column, in characters.
        column: usize,
    },
    /// In a binary file, from 0.
    Byte(usize),
}

impl fmt::Display for Location {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.position {
            Position::Text { line, column } => write!(f, "{}:{line}:{column}", self.name),
            Position::Byte(byte) => write!(f, "{}, byte {byte}", self.name),
        }
    }
}

#[derive(Debug)]
struct SourceFile {
    name: String,
    bytes: Arc<Vec<u8>>,
    /// Line and column, from 0, of every byte at a multiple of [`STEP`], since a file with a single line may have many
    /// diagnostics.
    positions: OnceLock<Vec<TextPosition>>,
}

/// Distance of cached positions (bytes).
const STEP: usize = 4096;

/// Line and column, from 0; a column is a character.
#[derive(Clone, Copy, Debug, Default)]
struct TextPosition {
    line: usize,
    column: usize,
}

impl TextPosition {
    /// The position after some more bytes of text.
    fn after(self, bytes: &[u8]) -> Self {
        let rest = bytes.iter().rposition(|&b| b == b'\n').map_or(bytes, |i| &bytes[i + 1..]);
        let column = if rest.len() == bytes.len() { self.column } else { 0 };
        let starts_character = |b: &&u8| **b & 0xc0 != 0x80;
        TextPosition {
            line: self.line + bytes.iter().filter(|&&b| b == b'\n').count(),
            column: column + rest.iter().filter(starts_character).count(),
        }
    }
}

impl SourceFile {
    /// Position of a byte.
    fn position(&self, at: usize) -> TextPosition {
        let positions = self.positions.get_or_init(|| {
            let blocks = self.bytes.chunks_exact(STEP);
            let start = TextPosition::default();
            let next = |position: &mut TextPosition, block: &[u8]| {
                *position = position.after(block);
                Some(*position)
            };
            [start].into_iter().chain(blocks.scan(start, next)).collect()
        });
        let at = at.min(self.bytes.len());
        positions[at / STEP].after(&self.bytes[at / STEP * STEP..at])
    }
}

/// All texts of a run.
#[derive(Debug, Default)]
pub struct SourceMap {
    files: Vec<SourceFile>,
}

/// Number of bytes at the beginning of a file that determine whether it is text.
const HEAD: usize = 1024;

/// Maximum size of a text (bytes, after decompression): spans have 32 bits.
const MAX_BYTES: u64 = u32::MAX as u64 - 1;

impl SourceMap {
    /// No files.
    pub fn new() -> Self {
        SourceMap::default()
    }

    /// Adds a text under a name.
    pub fn add_text(&mut self, name: impl Into<String>, bytes: Vec<u8>) -> FileId {
        self.files.push(SourceFile { name: name.into(), bytes: Arc::new(bytes), positions: OnceLock::new() });
        (self.files.len() - 1) as FileId
    }

    /// Reads a file, decompressing gzip files of one or several members.
    pub fn read(&mut self, path: &Path) -> io::Result<FileId> {
        let bytes = read_maybe_gzip(path)?;
        Ok(self.add_text(path.display().to_string(), bytes))
    }

    /// The bytes of a file.
    pub fn bytes(&self, file: FileId) -> &[u8] {
        self.files.get(file as usize).map_or(&[], |f| &f.bytes)
    }

    /// The bytes of a file, shared.
    pub fn shared_bytes(&self, file: FileId) -> Arc<Vec<u8>> {
        self.files.get(file as usize).map_or_else(Default::default, |f| Arc::clone(&f.bytes))
    }

    /// The bytes of all files, in insertion order.
    pub fn texts(&self) -> impl Iterator<Item = &[u8]> {
        self.files.iter().map(|file| file.bytes.as_slice())
    }

    /// The name of a file.
    pub fn name(&self, file: FileId) -> &str {
        self.files.get(file as usize).map_or("?", |f| &f.name)
    }

    /// True for a file that is not text: it begins with control characters, or is a binary glTF container.
    pub fn is_binary(&self, file: FileId) -> bool {
        let bytes = self.bytes(file);
        let is_control = |b: &u8| *b < b' ' && !b.is_ascii_whitespace();
        bytes.starts_with(b"glTF") || bytes[..bytes.len().min(HEAD)].iter().any(is_control)
    }

    /// Position of the start of a span.
    pub fn locate(&self, span: Span) -> Location {
        let name = self.name(span.file).to_owned();
        if self.is_binary(span.file) {
            return Location { name, position: Position::Byte(span.start as usize) };
        }
        let file = self.files.get(span.file as usize);
        let TextPosition { line, column } = file.map(|file| file.position(span.start as usize)).unwrap_or_default();
        Location { name, position: Position::Text { line: line + 1, column: column + 1 } }
    }
}

/// Opens a file. Opening a pipe would block, and reading a folder gives an unclear message: both are errors.
pub(crate) fn open_regular(path: &Path) -> io::Result<File> {
    if !std::fs::metadata(path)?.is_file() {
        return Err(io::Error::new(io::ErrorKind::InvalidInput, "is not a regular file"));
    }
    File::open(path)
}

/// Reads a whole file of at most [`MAX_BYTES`], decompressing gzip.
fn read_maybe_gzip(path: &Path) -> io::Result<Vec<u8>> {
    let file = File::open(path)?;
    let metadata = file.metadata()?;
    if metadata.is_dir() {
        return Err(io::Error::new(io::ErrorKind::InvalidInput, "is a folder"));
    }
    let length = metadata.len();
    read_bytes(file, length.min(MAX_BYTES) as usize)
}

/// Reads at most [`MAX_BYTES`], about as many as `expected`, decompressing gzip.
pub fn read_bytes(input: impl Read, expected: usize) -> io::Result<Vec<u8>> {
    let mut bytes = Vec::with_capacity(expected);
    input.take(MAX_BYTES + 1).read_to_end(&mut bytes)?;
    if bytes.starts_with(&gzip::MAGIC) {
        let mut text = Vec::new();
        gzip::Members::new(bytes.as_slice()).take(MAX_BYTES + 1).read_to_end(&mut text)?;
        bytes = text;
    }
    let too_large = || io::Error::new(io::ErrorKind::InvalidData, "larger than 4 GiB");
    if bytes.len() as u64 > MAX_BYTES { Err(too_large()) } else { Ok(bytes) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::Write;

    #[test]
    fn positions_are_those_of_counting_from_the_start() {
        let text: String = (0..3000).map(|i| ["é", "\n", "ab c", "\u{1f4a1}\t"][i * i % 7 % 4]).collect();
        let long = text.clone() + &"ß".repeat(9000) + &text;
        let mut sources = SourceMap::new();
        let file = sources.add_text("a", long.clone().into_bytes());
        for start in
            (0..=long.len()).step_by(37).chain([STEP, 2 * STEP, long.len()]).filter(|&i| long.is_char_boundary(i))
        {
            let before = &long[..start];
            let (line, column) =
                (before.split('\n').count(), before.split('\n').next_back().unwrap().chars().count() + 1);
            let found = sources.locate(Span { file, start: start as u32, end: start as u32 });
            assert_eq!(found.position, Position::Text { line, column }, "byte {start}");
        }
    }

    #[test]
    fn gzip_files_are_read_as_their_content() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.pbrt.gz");
        let mut encoder = flate2::write::GzEncoder::new(File::create(&path).unwrap(), flate2::Compression::fast());
        encoder.write_all(b"WorldBegin\n# \xc3\xa4 b").unwrap();
        encoder.finish().unwrap();
        let mut sources = SourceMap::new();
        let file = sources.read(&path).unwrap();
        assert_eq!(sources.bytes(file), b"WorldBegin\n# \xc3\xa4 b");
        let place = sources.locate(Span { file, start: 16, end: 17 });
        assert_eq!(place.position, Position::Text { line: 2, column: 5 });
        // Two members, as `bgzip` and `cat a.gz b.gz` write them; also from standard input
        let compressed = std::fs::read(&path).unwrap();
        let twice = compressed.repeat(2);
        std::fs::write(&path, &twice).unwrap();
        let (file, stream) = (sources.read(&path).unwrap(), read_bytes(twice.as_slice(), 0).unwrap());
        assert_eq!(sources.bytes(file), b"WorldBegin\n# \xc3\xa4 bWorldBegin\n# \xc3\xa4 b");
        assert_eq!(sources.bytes(file), stream);
        std::fs::write(&path, [0x1f, 0x8b, 8, 0, 1, 2]).unwrap();
        assert!(sources.read(&path).is_err());
    }
}
