//! Bytes of a reader, seen through a buffer of fixed size.

use super::PlyError;
use std::io::{self, Read};

/// Size of the buffer (bytes): fits the second-level cache.
const BUFFER: usize = 1 << 18;

/// A buffered reader that knows a bound of what is still to come.
pub struct Stream<R> {
    reader: R,
    buffer: Vec<u8>,
    start: usize,
    end: usize,
    /// Upper bound of the bytes that the reader still has.
    unread: u64,
}

impl<R: Read> Stream<R> {
    /// Reads from `reader`, which yields at most `limit` bytes; what it yields beyond is not seen.
    pub fn new(reader: R, limit: u64) -> Self {
        let size = (limit.min(BUFFER as u64) as usize).max(4096);
        Stream { reader, buffer: vec![0; size], start: 0, end: 0, unread: limit }
    }

    /// Upper bound of the bytes that are still to come.
    pub fn remaining_limit(&self) -> u64 {
        self.unread + (self.end - self.start) as u64
    }

    /// Makes at least `wanted` bytes available if there are so many, and returns all that are available.
    /// `wanted` must not exceed 4096.
    #[inline]
    pub fn fill(&mut self, wanted: usize) -> Result<&[u8], PlyError> {
        if self.end - self.start < wanted {
            self.refill(wanted)?;
        }
        Ok(&self.buffer[self.start..self.end])
    }

    /// Makes `count` bytes available, or fails with a message that names the missing thing.
    #[inline]
    pub fn require(&mut self, count: usize, what: &str) -> Result<&[u8], PlyError> {
        let available = self.fill(count)?;
        if available.len() < count {
            return Err(PlyError::format(format!("file ends inside {what}")));
        }
        Ok(available)
    }

    /// Drops the first `count` available bytes.
    #[inline]
    pub fn consume(&mut self, count: usize) {
        self.start = (self.start + count).min(self.end);
    }

    /// Drops `count` bytes.
    pub fn skip(&mut self, mut count: u64, what: &str) -> Result<(), PlyError> {
        while count > 0 {
            let available = self.require(1, what)?.len() as u64;
            let step = available.min(count);
            self.consume(step as usize);
            count -= step;
        }
        Ok(())
    }

    #[cold]
    fn refill(&mut self, wanted: usize) -> Result<(), PlyError> {
        self.buffer.copy_within(self.start..self.end, 0);
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
