//! Data compressed by Blosc 1 with LZ4, as in NanoVDB files.
//!
//! A chunk has a header of 16 bytes, the offsets of its blocks, and the blocks. A block is a single LZ4 stream, or one
//! per byte of a number. Each stream begins with its compressed size and is uncompressed if this equals its full size.
//! With shuffling, the first bytes of all numbers of the block are contiguous, then the second bytes, and so on.

use super::bytes::Bytes;
use super::error::NanoError;
use std::io::Read;

const HEAD: usize = 16;
/// Bits of the flags.
const SHUFFLE: u8 = 1;
const PLAIN: u8 = 2;
const BIT_SHUFFLE: u8 = 4;
const ONE_STREAM: u8 = 16;
/// A block has a single stream if numbers have more bytes than this, or if there are fewer numbers than this.
const MAX_STREAMS: usize = 16;
const MIN_NUMBERS: usize = 128;
/// Names of compressors, by the upper three bits of the flags.
const COMPRESSORS: [&str; 5] = ["blosclz", "LZ4", "snappy", "zlib", "zstd"];

/// Reads chunks, each preceded by its size (8 bytes), up to `size` bytes of content.
pub(super) fn read_chunks(reader: &mut impl Read, size: u64) -> Result<Vec<u8>, NanoError> {
    let mut out = Vec::new();
    while (out.len() as u64) < size {
        let mut length = [0; 8];
        reader.read_exact(&mut length)?;
        let length = u64::from_le_bytes(length);
        let mut chunk = Vec::new();
        reader.by_ref().take(length).read_to_end(&mut chunk)?;
        if chunk.len() as u64 != length {
            return Err(NanoError::damaged("it ends too early"));
        }
        let before = out.len();
        decompress(&chunk, size - before as u64, &mut out)?;
        if out.len() == before {
            return Err(NanoError::damaged("it has an empty chunk"));
        }
    }
    Ok(out)
}

/// Appends the content of a chunk, at most `most` bytes, to `out`.
fn decompress(chunk: &[u8], most: u64, out: &mut Vec<u8>) -> Result<(), NanoError> {
    let bytes = Bytes(chunk);
    let head = bytes.slice(0, HEAD)?;
    let (flags, width) = (head[2], usize::from(head[3]).max(1));
    let (size, block_size) = (bytes.u32(4)? as usize, bytes.u32(8)? as usize);
    if size as u64 > most || (block_size == 0 && size > 0) {
        return Err(NanoError::damaged(format!("a chunk of {size} bytes in blocks of {block_size}")));
    }
    if flags & PLAIN != 0 {
        out.extend_from_slice(bytes.slice(HEAD as u64, size)?);
        return Ok(());
    }
    let compressor = usize::from(flags >> 5);
    if compressor != 1 {
        let name = COMPRESSORS.get(compressor).copied().unwrap_or("another compressor");
        return Err(NanoError::Codec(format!("Blosc with {name}")));
    }
    if flags & BIT_SHUFFLE != 0 {
        return Err(NanoError::Codec("Blosc with shuffled bits".to_owned()));
    }
    let mut block = Vec::new();
    for i in 0..size.div_ceil(block_size.max(1)) {
        let content = block_size.min(size - i * block_size);
        let is_split =
            flags & ONE_STREAM == 0 && width <= MAX_STREAMS && content / width >= MIN_NUMBERS && content == block_size;
        let streams = if is_split { width } else { 1 };
        block.clear();
        let mut at = u64::from(bytes.u32((HEAD + 4 * i) as u64)?);
        for _ in 0..streams {
            let stored = bytes.u32(at)? as usize;
            let stream = bytes.slice(at + 4, stored)?;
            at += 4 + stored as u64;
            let wanted = content / streams;
            if stored == wanted {
                block.extend_from_slice(stream);
            } else {
                lz4(stream, wanted, &mut block).ok_or_else(|| NanoError::damaged("its LZ4 data"))?;
            }
        }
        if block.len() != content {
            return Err(NanoError::damaged("a block of another size"));
        }
        if flags & SHUFFLE != 0 && width > 1 { unshuffle(&block, width, out) } else { out.extend_from_slice(&block) }
    }
    Ok(())
}

/// Reverses the shuffling of the bytes of numbers; bytes of an incomplete number are unchanged.
fn unshuffle(block: &[u8], width: usize, out: &mut Vec<u8>) {
    let count = block.len() / width;
    for i in 0..count {
        out.extend((0..width).map(|byte| block[byte * count + i]));
    }
    out.extend_from_slice(&block[count * width..]);
}

/// Appends the `size` bytes of an LZ4 block to `out`; `None` if the block is invalid.
fn lz4(mut from: &[u8], size: usize, out: &mut Vec<u8>) -> Option<()> {
    let end = out.len() + size;
    let start = out.len();
    loop {
        let (&token, rest) = from.split_first()?;
        from = rest;

        // Literal bytes
        let count = length(usize::from(token >> 4), &mut from)?;
        let (literals, rest) = from.split_at_checked(count)?;
        if count > end - out.len() {
            return None;
        }
        out.extend_from_slice(literals);
        from = rest;
        if from.is_empty() {
            return (out.len() == end).then_some(());
        }

        // Copy of earlier output, which may overlap itself
        let (distance, rest) = from.split_at_checked(2)?;
        let distance = usize::from(u16::from_le_bytes([distance[0], distance[1]]));
        from = rest;
        let count = length(usize::from(token & 15), &mut from)?.checked_add(4)?;
        if distance == 0 || distance > out.len() - start || count > end - out.len() {
            return None;
        }
        for _ in 0..count {
            out.push(out[out.len() - distance]);
        }
    }
}

/// A length of four bits, with its extension if all four are set.
fn length(first: usize, from: &mut &[u8]) -> Option<usize> {
    let mut sum = first;
    let mut goes_on = first == 15;
    while goes_on {
        let (&more, rest) = from.split_first()?;
        *from = rest;
        sum = sum.checked_add(usize::from(more))?;
        goes_on = more == 255;
    }
    Some(sum)
}
