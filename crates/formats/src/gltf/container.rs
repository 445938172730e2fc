//! The binary container: a header of 12 bytes, a JSON chunk, and at most one binary chunk that is used.

use super::place::GltfError;

const MAGIC: &[u8; 4] = b"glTF";
const JSON: u32 = 0x4e4f_534a;
const BIN: u32 = 0x004e_4942;

/// The chunks of a file.
#[derive(Clone, Copy, Debug)]
pub struct Chunks<'a> {
    /// The JSON.
    pub json: &'a [u8],
    /// The binary chunk.
    pub binary: Option<&'a [u8]>,
}

/// The chunks of a file; a file without the container's magic number is JSON.
pub fn chunks(file: &[u8]) -> Result<Chunks<'_>, GltfError> {
    if !file.starts_with(MAGIC) {
        return Ok(Chunks { json: file, binary: None });
    }
    let word = |at: usize| file.get(at..at + 4).and_then(|b| b.try_into().ok()).map(u32::from_le_bytes);
    let wrong = |at: usize, message: String| GltfError { place: format!("byte {at}"), message };
    let (Some(version), Some(length)) = (word(4), word(8)) else {
        let message = format!("the file ends after {} of the 12 bytes of its header", file.len());
        return Err(wrong(file.len(), message));
    };
    if version != 2 {
        return Err(wrong(4, format!("the container has version {version}, but only version 2 is read")));
    }
    let length = length as usize;
    if length > file.len() {
        return Err(wrong(8, format!("the file says that it has {length} bytes, but has {}", file.len())));
    }
    let (mut at, mut json, mut binary) = (12, None, None);
    while at < length {
        let (Some(size), Some(kind)) = (word(at), word(at + 4)) else {
            return Err(wrong(at, "the header of a chunk is cut off".to_owned()));
        };
        let end = (at + 8).checked_add(size as usize).filter(|&end| end <= length);
        let Some(end) = end else {
            return Err(wrong(at, format!("a chunk of {size} bytes does not end in the file")));
        };
        let content = &file[at + 8..end];
        match kind {
            JSON if json.is_none() => json = Some(content),
            BIN if binary.is_none() => binary = Some(content),
            _ => {}
        }
        at = end;
    }
    json.map(|json| Chunks { json, binary }).ok_or_else(|| wrong(12, "the container has no JSON".to_owned()))
}
