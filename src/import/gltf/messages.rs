//! Errors and warnings about a glTF file.

use lumiris_formats::diagnostic::Diagnostics;
use lumiris_formats::gltf::document::Unread;
use lumiris_formats::gltf::{GltfError, Place, locate, locate_members};
use lumiris_formats::source::{FileId, Span};
use std::collections::{BTreeSet, HashMap};
use std::ops::Range;

/// Messages about one file.
pub(super) struct Messages<'d> {
    pub diagnostics: &'d mut Diagnostics,
    file: FileId,
    bytes: &'d [u8],
    /// Source positions of the names of images and buffers, computed on first use.
    named: HashMap<&'static str, Vec<Span>>,
    warned: BTreeSet<String>,
}

impl<'d> Messages<'d> {
    pub(super) fn new(diagnostics: &'d mut Diagnostics, file: FileId, bytes: &'d [u8]) -> Self {
        Messages { diagnostics, file, bytes, named: HashMap::new(), warned: BTreeSet::new() }
    }

    fn span_of(&self, place: &str) -> Span {
        let Range { start, end } = locate(self.bytes, place);
        Span { file: self.file, start: start as u32, end: end as u32 }
    }

    /// Source position of the file name of an element of `images` or `buffers`.
    pub(super) fn file_span(&mut self, array: &'static str, index: usize) -> Span {
        let (file, bytes) = (self.file, self.bytes);
        let span = |Range { start, end }| Span { file, start: start as u32, end: end as u32 };
        let all = || locate_members(bytes, array, "uri").into_iter().map(span).collect();
        let spans = self.named.entry(array).or_insert_with(all);
        spans.get(index).copied().unwrap_or(Span { file, start: 0, end: 0 })
    }

    pub(super) fn error(&mut self, error: &GltfError) {
        self.diagnostics.error(self.span_of(&error.place), error.to_string());
    }

    /// Reports unreadable buffers: missing files are one error, together with missing images.
    pub(super) fn unread(&mut self, buffers: &[Unread]) {
        for buffer in buffers {
            match buffer {
                Unread::File { buffer, path, reason } => {
                    let span = self.file_span("buffers", *buffer);
                    self.diagnostics.missing_file(path, reason, Some(span));
                }
                Unread::Content(error) => self.error(error),
            }
        }
    }

    /// Reports a warning at its first position only.
    pub(super) fn warning(&mut self, place: &Place<'_>, message: &str) {
        if self.warned.insert(message.to_owned()) {
            let path = place.path();
            let span = self.span_of(&path);
            self.diagnostics.warning(span, message).remark(path);
        }
    }
}
