//! gzip files: concatenated members, as `bgzip`, `pigz` and `cat a.gz b.gz` write them.

use flate2::bufread::GzDecoder;
use std::io::{self, BufRead, Read};

/// The first bytes of a gzip file.
pub(crate) const MAGIC: [u8; 2] = [0x1f, 0x8b];

/// The content of all members. As in gzip itself, zeros after the last one are padding; anything else there is an
/// error.
pub(crate) struct Members<R> {
    /// `None` at the end.
    decoder: Option<GzDecoder<R>>,
}

impl<R: BufRead> Members<R> {
    /// Reads from the start of a gzip file.
    pub(crate) fn new(reader: R) -> Self {
        Members { decoder: Some(GzDecoder::new(reader)) }
    }
}

impl<R: BufRead> Read for Members<R> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        while let Some(decoder) = &mut self.decoder {
            let count = decoder.read(buffer)?;
            if count > 0 || buffer.is_empty() {
                return Ok(count);
            }
            self.decoder = next_member(self.decoder.take().map(GzDecoder::into_inner))?.map(GzDecoder::new);
        }
        Ok(0)
    }
}

/// The reader at the next member; `None` at the end.
fn next_member<R: BufRead>(reader: Option<R>) -> io::Result<Option<R>> {
    let Some(mut reader) = reader else { return Ok(None) };
    loop {
        let bytes = reader.fill_buf()?;
        let zeros = bytes.iter().take_while(|&&byte| byte == 0).count();
        match bytes.get(zeros) {
            None if bytes.is_empty() => return Ok(None),
            None => reader.consume(zeros),
            Some(&byte) if byte == MAGIC[0] && zeros == 0 => return Ok(Some(reader)),
            Some(_) => {
                return Err(io::Error::new(io::ErrorKind::InvalidData, "bytes that are no gzip follow its data"));
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use flate2::{Compression, write::GzEncoder};
    use std::io::{BufReader, Write};

    fn member(text: &[u8]) -> Vec<u8> {
        let mut encoder = GzEncoder::new(Vec::new(), Compression::fast());
        encoder.write_all(text).unwrap();
        encoder.finish().unwrap()
    }

    /// The content, read through a buffer that ends at arbitrary positions.
    fn content(file: &[u8]) -> io::Result<Vec<u8>> {
        let mut content = Vec::new();
        Members::new(BufReader::with_capacity(7, file)).read_to_end(&mut content).map(|_| content)
    }

    #[test]
    fn all_members_are_read_and_zeros_behind_them_are_padding() {
        let [a, b, none] = [&b"first "[..], b"second", b""].map(member);
        let zeros = vec![0; 1000];
        assert_eq!(content(&[&a[..], &b, &none].concat()).unwrap(), b"first second");
        assert_eq!(content(&[&none[..], &a, &none, &b, &zeros].concat()).unwrap(), b"first second");
        for wrong in [&b"tail"[..], b"\0\0tail", &b[..b.len() - 1], &b[..5], &MAGIC] {
            assert!(content(&[&a[..], wrong].concat()).is_err(), "{wrong:?}");
        }
        let mut damaged = [&a[..], &b].concat();
        let checksum = damaged.len() - 8;
        damaged[checksum] ^= 1;
        assert!(content(&damaged).is_err());
    }
}
