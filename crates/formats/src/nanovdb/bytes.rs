//! Bounds-checked numbers at offsets.

use super::error::NanoError;

/// The bytes of a grid.
#[derive(Clone, Copy, Debug)]
pub(super) struct Bytes<'a>(pub &'a [u8]);

impl<'a> Bytes<'a> {
    /// `count` bytes from an offset.
    pub(super) fn slice(self, at: u64, count: usize) -> Result<&'a [u8], NanoError> {
        let start = usize::try_from(at).ok();
        let found = start.and_then(|start| self.0.get(start..start.checked_add(count)?));
        found.ok_or_else(|| {
            let len = self.0.len();
            NanoError::damaged(format!("{count} bytes are expected at byte {at} of a grid of {len}"))
        })
    }

    fn array<const N: usize>(self, at: u64) -> Result<[u8; N], NanoError> {
        let mut array = [0; N];
        array.copy_from_slice(self.slice(at, N)?);
        Ok(array)
    }

    pub(super) fn u16(self, at: u64) -> Result<u16, NanoError> {
        self.array(at).map(u16::from_le_bytes)
    }

    pub(super) fn u32(self, at: u64) -> Result<u32, NanoError> {
        self.array(at).map(u32::from_le_bytes)
    }

    pub(super) fn i32(self, at: u64) -> Result<i32, NanoError> {
        self.array(at).map(i32::from_le_bytes)
    }

    pub(super) fn u64(self, at: u64) -> Result<u64, NanoError> {
        self.array(at).map(u64::from_le_bytes)
    }

    pub(super) fn i64(self, at: u64) -> Result<i64, NanoError> {
        self.array(at).map(i64::from_le_bytes)
    }

    pub(super) fn f32(self, at: u64) -> Result<f32, NanoError> {
        self.array(at).map(f32::from_le_bytes)
    }

    pub(super) fn f64(self, at: u64) -> Result<f64, NanoError> {
        self.array(at).map(f64::from_le_bytes)
    }

    /// Three f64 numbers.
    pub(super) fn triple(self, at: u64) -> Result<[f64; 3], NanoError> {
        Ok([self.f64(at)?, self.f64(at + 8)?, self.f64(at + 16)?])
    }

    /// Three indices.
    pub(super) fn index(self, at: u64) -> Result<[i32; 3], NanoError> {
        Ok([self.i32(at)?, self.i32(at + 4)?, self.i32(at + 8)?])
    }

    /// A zero-terminated text.
    pub(super) fn text(self, at: u64, most: usize) -> Result<String, NanoError> {
        let bytes = self.slice(at, most)?;
        let end = bytes.iter().position(|&b| b == 0).unwrap_or(most);
        Ok(String::from_utf8_lossy(&bytes[..end]).into_owned())
    }
}
