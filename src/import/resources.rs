//! Requests for the files of a scene, each once. All images are read in parallel.

use super::cache::{FileCache, TexturePlan};
use super::images::ImageRequest;
use super::memory::MemoryAccount;
use crate::imaging::MipMap;
use crate::imaging::oiio::ImageError;
use crate::textures::ImageId;
use lumiris_formats::diagnostic::Diagnostics;
use lumiris_formats::source::Span;
use rayon::prelude::*;
use std::collections::HashMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Advice for a scene that does not fit into memory.
pub const MEMORY_HELP: &str = "`--memory-limit SIZE|off` sets another limit, --texture-memory a limit of textures";

/// A request for a file, and the source position of its first use.
#[derive(Debug)]
pub struct Request<R> {
    /// The file, and how it is read.
    pub file: R,
    /// Source position.
    pub span: Span,
}

/// Requests for files, each once, in the order of first use.
#[derive(Debug)]
pub struct Requests<R> {
    list: Vec<Request<R>>,
    by_path: HashMap<PathBuf, Vec<u32>>,
}

impl<R> Default for Requests<R> {
    fn default() -> Self {
        Requests { list: Vec::new(), by_path: HashMap::new() }
    }
}

impl<R: PartialEq> Requests<R> {
    /// The index of a request for the file `path`; equal requests share one. `span` is its source position.
    pub fn index(&mut self, path: &Path, file: R, span: Span) -> u32 {
        let indices = self.by_path.entry(path.to_owned()).or_default();
        if let Some(&index) = indices.iter().find(|&&index| self.list[index as usize].file == file) {
            return index;
        }
        let index = self.list.len() as u32;
        indices.push(index);
        self.list.push(Request { file, span });
        index
    }

    /// All requests.
    pub fn list(&self) -> &[Request<R>] {
        &self.list
    }
}

/// All images of a scene.
#[derive(Debug, Default)]
pub struct Resources {
    requests: Requests<ImageRequest>,
}

impl Resources {
    /// The future id of the image; equal requests share one.
    pub fn image(&mut self, request: ImageRequest, span: Span) -> ImageId {
        let path = request.path.clone();
        self.requests.index(&path, request, span)
    }

    /// The files, in the order of the images.
    pub fn paths(&self) -> impl Iterator<Item = &Path> {
        self.requests.list().iter().map(|request| request.file.path.as_path())
    }

    /// Reads all images, in the order of their ids; errors go to `d`. `None` if the scene does not fit into memory
    /// together with what `account` has.
    pub fn load(&self, files: &FileCache, mut account: MemoryAccount, d: &mut Diagnostics) -> Option<Vec<Arc<MipMap>>> {
        // Predict the memory before anything is read
        let requests = self.requests.list();
        let wanted: Vec<&ImageRequest> = requests.iter().map(|request| &request.file).collect();
        let plan = files.plan_textures(&wanted, &mut account).unwrap_or_else(|error| {
            d.error_without_place(format!("there is no temporary file for tiles of textures: {error}"));
            TexturePlan::default()
        });
        if let Some(refusal) = files.refusal(&account) {
            d.error_without_place(refusal).help(MEMORY_HELP);
            return None;
        }

        // Read in parallel, and report in the order of the scene
        let numbered = requests.par_iter().enumerate();
        let loaded: Vec<_> = numbered.map(|(i, request)| files.planned_map(&plan, i, &request.file)).collect();
        for warning in files.take_texture_warnings() {
            d.warning_without_place(warning);
        }
        let mut maps = Vec::with_capacity(loaded.len());
        for (result, Request { file, span }) in loaded.into_iter().zip(requests) {
            match result {
                Ok(map) => maps.push(map),
                Err(error) => report(&error, &file.path, *span, d),
            }
        }
        Some(maps)
    }
}

/// Reports an unreadable image: among the missing files, or as an error of its own.
pub fn report(error: &ImageError, path: &Path, span: Span, d: &mut Diagnostics) {
    match error {
        ImageError::NotFound { .. } => d.missing_file(path, "no such file", Some(span)),
        other => {
            d.error(span, other.to_string());
        }
    }
}
