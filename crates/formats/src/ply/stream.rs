//! A reader with a buffer of fixed size.

use super::error::{Place, PlyError};
use std::io::{self, Read};

/// Size of the buffer (bytes): fits the second-level cache.
const BUFFER: usize = 1 << 18;
/// Maximum number of bytes per request.
pub(super) const MAX_FILL: usize = 4096;
/// Maximum expansion factor of deflate, which bounds the content of a gzip file.
const MAX_INFLATION: u64 = 1032;
/// Maximum plausible expansion of a mesh: no memory is reserved in advance for more.
const USUAL_INFLATION: u64 = 16;
/// Maximum number of bytes after the mesh that are decompressed to reach the checksum.
const MAX_TAIL: usize = 1 << 24;

/// A buffered reader with an upper bound of the remaining bytes.
pub(super) struct Stream<'a> {
    reader: &'a mut dyn Read,
    buffer: Vec<u8>,
    start: usize,
    end: usize,
    /// Upper bound of the unread bytes of the reader.
    unread: u64,
    /// Offset of the buffer in the file.
    origin: u64,
    /// Number of bytes for which memory may be reserved before they are read.
    trusted: u64,
    /// Line of the next byte, if the file is a text.
    pub line: u64,
    /// End of lines: LF, or CR if the file has CR only.
    pub newline: u8,
}

impl<'a> Stream<'a> {
    /// Reads at most `limit` bytes from `reader`.
    pub(super) fn new(reader: &'a mut dyn Read, limit: u64) -> Self {
        let size = (limit.min(BUFFER as u64) as usize).max(MAX_FILL);
        let buffer = vec![0; size];
        Stream { reader, buffer, start: 0, end: 0, unread: limit, origin: 0, trusted: limit, line: 1, newline: b'\n' }
    }

    /// Reads from a decoder of `size` bytes of deflate data.
    pub(super) fn inflated(reader: &'a mut dyn Read, size: u64) -> Self {
        let trusted = size.saturating_mul(USUAL_INFLATION);
        Stream { trusted, ..Stream::new(reader, size.saturating_mul(MAX_INFLATION)) }
    }

    /// Upper bound of the remaining bytes.
    pub(super) fn remaining_limit(&self) -> u64 {
        self.unread + (self.end - self.start) as u64
    }

    /// Number of items, out of `count` with at least `size` bytes each, for which memory may be reserved in advance.
    pub(super) fn trusted_items(&self, count: u64, size: u64) -> usize {
        let bytes = self.trusted.min(self.remaining_limit());
        // The blank after the last number of a text may be missing.
        usize::try_from(count.min((bytes + 1) / size.max(1))).unwrap_or(usize::MAX)
    }

    /// Offset of the next byte.
    pub(super) fn offset(&self) -> u64 {
        self.origin + self.start as u64
    }

    /// Makes at least `wanted` bytes available, if they exist, and returns all available bytes. `wanted` must not
    /// exceed [`MAX_FILL`].
    #[inline]
    pub(super) fn fill(&mut self, wanted: usize) -> Result<&[u8], PlyError> {
        if self.end - self.start < wanted {
            self.refill(wanted)?;
        }
        Ok(&self.buffer[self.start..self.end])
    }

    /// Makes `count` bytes available, or fails with the name of the incomplete element.
    #[inline]
    pub(super) fn require(&mut self, count: usize, element: &str) -> Result<&[u8], PlyError> {
        if self.end - self.start < count {
            self.refill(count)?;
            if self.end - self.start < count {
                let place = Place::Byte(self.origin + self.end as u64);
                return Err(PlyError::Truncated { place, element: element.to_owned() });
            }
        }
        Ok(&self.buffer[self.start..self.end])
    }

    /// Consumes the first `count` available bytes.
    #[inline]
    pub(super) fn consume(&mut self, count: usize) {
        self.start = (self.start + count).min(self.end);
    }

    /// Consumes `count` bytes.
    pub(super) fn skip(&mut self, mut count: u64, element: &str) -> Result<(), PlyError> {
        while count > 0 {
            let available = self.require(1, element)?.len() as u64;
            let step = available.min(count);
            self.consume(step as usize);
            count -= step;
        }
        Ok(())
    }

    /// Reads to the end, so that a decoder verifies its checksum.
    pub(super) fn drain(&mut self) -> Result<(), PlyError> {
        let mut drained = 0;
        while drained < MAX_TAIL {
            let available = self.fill(1)?.len();
            if available == 0 {
                break;
            }
            self.consume(available);
            drained += available;
        }
        Ok(())
    }

    #[cold]
    fn refill(&mut self, wanted: usize) -> Result<(), PlyError> {
        self.buffer.copy_within(self.start..self.end, 0);
        self.origin += self.start as u64;
        self.end -= self.start;
        self.start = 0;
        while self.end < wanted.min(self.buffer.len()) && self.unread > 0 {
            let space = ((self.buffer.len() - self.end) as u64).min(self.unread) as usize;
            match self.reader.read(&mut self.buffer[self.end..self.end + space]) {
                Ok(0) => self.unread = 0,
                Ok(n) => {
                    self.end += n;
                    self.unread -= n as u64;
                }
                Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
                Err(error) => return Err(error.into()),
            }
        }
        Ok(())
    }
}
