//! A document: its validated JSON, and its buffers.

use super::container::{Chunks, chunks};
use super::json::Json;
use super::place::{GltfError, Place};
use super::schema;
use crate::names::file_in;
use base64::engine::{DecodePaddingMode, GeneralPurpose, GeneralPurposeConfig};
use base64::{Engine, alphabet};
use std::path::{Path, PathBuf};

/// A document with its buffers.
#[derive(Debug)]
pub struct Document {
    json: Json,
    /// The buffers; `None` for unreadable ones.
    buffers: Vec<Option<Vec<u8>>>,
    /// Files that hold buffers.
    pub files: Vec<PathBuf>,
    /// Errors of unreadable buffers. With any error, only images are accessible.
    pub unread: Vec<Unread>,
    folder: PathBuf,
}

/// Error of an unreadable buffer.
#[derive(Clone, Debug)]
pub enum Unread {
    /// Its file is unreadable.
    File {
        /// Index of the buffer.
        buffer: usize,
        /// The file.
        path: PathBuf,
        /// The reason.
        reason: String,
    },
    /// Its content is inconsistent with the document.
    Content(GltfError),
}

/// Base64 of data URIs, with or without padding.
const BASE64: GeneralPurpose = GeneralPurpose::new(
    &alphabet::STANDARD,
    GeneralPurposeConfig::new().with_decode_padding_mode(DecodePaddingMode::Indifferent),
);

/// Bytes of a data URI; `None` for other URIs.
fn data_uri(uri: &str) -> Option<Result<Vec<u8>, String>> {
    let (kind, data) = uri.strip_prefix("data:")?.split_once(',').unwrap_or_default();
    if !kind.ends_with(";base64") {
        return Some(Err("the data URI is not in base64".to_owned()));
    }
    Some(BASE64.decode(data.trim_end()).map_err(|e| e.to_string()))
}

/// The decoded file name of a URI.
fn percent_decoded(uri: &str) -> String {
    let (bytes, mut out, mut i) = (uri.as_bytes(), Vec::new(), 0);
    while i < bytes.len() {
        let hex = bytes.get(i + 1..i + 3).filter(|_| bytes[i] == b'%').and_then(|h| std::str::from_utf8(h).ok());
        match hex.and_then(|h| u8::from_str_radix(h, 16).ok()) {
            Some(byte) => {
                out.push(byte);
                i += 3;
            }
            None => {
                out.push(bytes[i]);
                i += 1;
            }
        }
    }
    String::from_utf8_lossy(&out).into_owned()
}

/// Location of the content of an image or a buffer.
#[derive(Clone, Debug)]
pub enum Content {
    /// A file.
    File(PathBuf),
    /// Embedded in the document.
    Bytes(Vec<u8>),
    /// In an unreadable buffer, see [`Document::unread`].
    Unread,
}

impl Document {
    /// Parses a file in `folder`, and reads its buffers; unreadable ones are in `unread`.
    ///
    /// Returns all errors of the schema.
    pub fn parse(file: &[u8], folder: &Path, required: &[&str]) -> Result<Document, Vec<GltfError>> {
        let Chunks { json: text, binary } = chunks(file).map_err(|e| vec![e])?;
        let text = text.strip_prefix(b"\xef\xbb\xbf").unwrap_or(text);
        let json = Json::parse(text).map_err(|e| vec![syntax_error(file, text, &e)])?;
        check_asset(&json, required)?;
        let errors = schema::errors(&Place::root(&json));
        if !errors.is_empty() {
            return Err(errors);
        }
        let (buffers, files, unread) = (Vec::new(), Vec::new(), Vec::new());
        let mut document = Document { json, buffers, files, unread, folder: folder.to_owned() };
        document.read_buffers(binary);
        Ok(document)
    }

    /// The root.
    pub fn root(&self) -> Place<'_> {
        Place::root(&self.json)
    }

    /// The location of an image.
    pub fn content(&self, place: &Place<'_>) -> Result<Content, GltfError> {
        if let Some(view) = place.key("bufferView").index() {
            let buffer = self.root().key("bufferViews").item(view).key("buffer").index();
            if buffer.and_then(|buffer| self.buffers.get(buffer)).is_some_and(Option::is_none) {
                return Ok(Content::Unread);
            }
            return Ok(Content::Bytes(self.view(view)?.to_vec()));
        }
        self.uri_content(place)
    }

    /// The content of a URI.
    fn uri_content(&self, place: &Place<'_>) -> Result<Content, GltfError> {
        let uri = place.key("uri").text().ok_or_else(|| place.error("has neither a URI nor a buffer view"))?;
        match data_uri(uri) {
            Some(bytes) => bytes.map(Content::Bytes).map_err(|message| place.key("uri").error(message)),
            None => Ok(Content::File(file_in(&self.folder, &percent_decoded(uri)))),
        }
    }

    fn read_buffers(&mut self, binary: Option<&[u8]>) {
        for index in 0..self.root().key("buffers").len() {
            let content = self.buffer_content(index, binary.filter(|_| index == 0));
            if let Ok(Content::File(path)) = &content {
                self.files.push(path.clone());
            }
            let read = content.map_err(Unread::Content).and_then(|content| self.read_buffer(index, content));
            self.buffers.push(read.map_err(|unread| self.unread.push(unread)).ok());
        }
    }

    /// The location of a buffer, which may be the binary chunk.
    fn buffer_content(&self, index: usize, binary: Option<&[u8]>) -> Result<Content, GltfError> {
        let place = self.root().key("buffers").item(index);
        if place.key("uri").exists() {
            return self.uri_content(&place);
        }
        // A placeholder is an error only if it is used
        Ok(binary.map_or(Content::Unread, |bytes| Content::Bytes(bytes.to_vec())))
    }

    /// The bytes of a buffer.
    fn read_buffer(&self, index: usize, content: Content) -> Result<Vec<u8>, Unread> {
        let place = self.root().key("buffers").item(index);
        match content {
            Content::Bytes(bytes) => checked(bytes, &place),
            Content::File(path) => match std::fs::read(&path) {
                Ok(bytes) => checked(bytes, &place),
                Err(error) => {
                    let is_missing = error.kind() == std::io::ErrorKind::NotFound;
                    let reason = if is_missing { "no such file".to_owned() } else { error.to_string() };
                    Err(Unread::File { buffer: index, path, reason })
                }
            },
            Content::Unread => Ok(Vec::new()),
        }
    }

    /// The bytes of a buffer view.
    pub fn view(&self, index: usize) -> Result<&[u8], GltfError> {
        let place = self.root().key("bufferViews").item(index);
        let (buffer, length) = (place.key("buffer").index(), place.key("byteLength").index());
        let (Some(buffer), Some(length)) = (buffer, length) else { return Err(place.error("is not there")) };
        let offset = place.key("byteOffset").index().unwrap_or(0);
        let bytes = self.buffers.get(buffer).and_then(Option::as_deref).unwrap_or_default();
        offset.checked_add(length).and_then(|end| bytes.get(offset..end)).ok_or_else(|| {
            let message = format!("{length} bytes from byte {offset} on are not in the buffer of {}", bytes.len());
            place.error(message)
        })
    }
}

/// The bytes of a buffer, if their number matches the document.
fn checked(bytes: Vec<u8>, place: &Place<'_>) -> Result<Vec<u8>, Unread> {
    let length = place.key("byteLength").index().unwrap_or(0);
    if bytes.len() < length {
        let message = format!("the buffer has {} of its {length} bytes", bytes.len());
        return Err(Unread::Content(place.key("byteLength").error(message)));
    }
    Ok(bytes)
}

/// An error about invalid JSON, with its position in the file.
fn syntax_error(file: &[u8], text: &[u8], e: &serde_json::Error) -> GltfError {
    let lines = text.split_inclusive(|&b| b == b'\n').take(e.line().saturating_sub(1));
    let start = text.as_ptr() as usize - file.as_ptr() as usize;
    let at = start + lines.map(<[u8]>::len).sum::<usize>() + e.column().saturating_sub(1);
    let message = e.to_string();
    let message = message.rsplit_once(" at line").map_or(message.as_str(), |(message, _)| message);
    GltfError { place: format!("byte {at}"), message: format!("no JSON: {message}") }
}

/// Checks the version and the required extensions.
fn check_asset(json: &Json, known: &[&str]) -> Result<(), Vec<GltfError>> {
    let root = Place::root(json);
    let version = root.key("asset").key("version");
    match version.text() {
        Some(text) if text.starts_with("2.") => {}
        Some(text) => return Err(vec![version.error(format!("glTF {text} is not read, only 2.x"))]),
        None => return Err(vec![version.error("is missing")]),
    }
    let required = root.key("extensionsRequired").items();
    let unknown = required.filter(|p| p.text().is_some_and(|name| !known.contains(&name)));
    let errors: Vec<GltfError> = unknown
        .map(|place| {
            place.error(format!("the file needs the extension {}, which is not read", place.text().unwrap_or("")))
        })
        .collect();
    if errors.is_empty() { Ok(()) } else { Err(errors) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn data_uris_may_lack_their_padding() {
        let decoded = |uri: &str| data_uri(uri).unwrap();
        for uri in ["data:;base64,AAECAw==", "data:;base64,AAECAw", "data:image/png;base64,AAECAw=="] {
            assert_eq!(decoded(uri), Ok(vec![0, 1, 2, 3]), "{uri}");
        }
        assert!(decoded("data:;base64,AAEC*w").is_err() && decoded("data:;base64,AAECA").is_err());
        assert!(decoded("data:text/plain,AAEC").is_err() && data_uri("a.bin").is_none());
    }
}
