//! Image files of a scene: each is requested once, and all are read in parallel.

use super::cache::{FileCache, TexturePlan};
use super::images::ImageRequest;
use crate::imaging::MipMap;
use crate::imaging::oiio::ImageError;
use crate::textures::ImageId;
use lumiris_formats::diagnostic::Diagnostics;
use lumiris_formats::source::Span;
use rayon::prelude::*;
use std::collections::HashMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// All images that a scene asks for.
#[derive(Debug, Default)]
pub struct Resources {
    requests: Vec<(ImageRequest, Span)>,
    by_path: HashMap<PathBuf, Vec<ImageId>>,
}

impl Resources {
    /// The id that the image will have; equal requests share one.
    pub fn image(&mut self, request: ImageRequest, span: Span) -> ImageId {
        let ids = self.by_path.entry(request.path.clone()).or_default();
        if let Some(&id) = ids.iter().find(|&&id| self.requests[id as usize].0 == request) {
            return id;
        }
        let id = self.requests.len() as ImageId;
        ids.push(id);
        self.requests.push((request, span));
        id
    }

    /// The files, in the order of the images.
    pub fn paths(&self) -> impl Iterator<Item = &Path> {
        self.requests.iter().map(|(request, _)| request.path.as_path())
    }

    /// Reads all images, in the order of their ids; errors go to `d`.
    pub fn load(&self, files: &FileCache, d: &mut Diagnostics) -> Vec<Arc<MipMap>> {
        let plan = files.plan_textures(self.requests.iter().map(|(request, _)| request)).unwrap_or_else(|error| {
            d.error_without_place(format!("there is no temporary file for tiles of textures: {error}"));
            TexturePlan::default()
        });
        let requests = self.requests.par_iter().enumerate();
        let loaded: Vec<_> = requests.map(|(i, (request, _))| files.planned_map(&plan, i, request)).collect();
        let mut maps = Vec::with_capacity(loaded.len());
        for (result, (request, span)) in loaded.into_iter().zip(&self.requests) {
            match result {
                Ok(map) => maps.push(map),
                Err(error) => report(&error, &request.path, *span, d),
            }
        }
        maps
    }
}

/// An image that cannot be read: one of the missing files, or an error of its own.
pub fn report(error: &ImageError, path: &Path, span: Span, d: &mut Diagnostics) {
    match error {
        ImageError::NotFound { .. } => d.missing_file(path, "no such file", Some(span)),
        other => {
            d.error(span, other.to_string());
        }
    }
}
