//! `Texture "ptex"`.

use super::checks::{FilePlace, file_name, readable};
use super::state::Builder;
use crate::imaging::{ColorEncoding, FaceMap};
use crate::import::cache::FileCache;
use crate::import::face_maps::FaceMapRequest;
use crate::import::images::ImageEncoding;
use crate::import::resources::Request;
use crate::textures::FaceTexture;
use lumiris_formats::diagnostic::Diagnostics;
use lumiris_formats::names::file_in;
use lumiris_formats::pbrt::params::ParamSet;
use lumiris_formats::ptex::PtexError;
use rayon::prelude::*;
use std::sync::Arc;

/// Default encoding, as in pbrt-v4, for all types of values.
const USUAL: ColorEncoding = ColorEncoding::Gamma(2.2);

impl Builder<'_> {
    /// `string filename`; each file is read once, together with the meshes.
    pub(super) fn face_texture(&mut self, p: &ParamSet, d: &mut Diagnostics) -> Option<FaceTexture> {
        let encoding = match self.encoding(p, d) {
            ImageEncoding::Auto => USUAL,
            ImageEncoding::Srgb => ColorEncoding::Srgb,
            ImageEncoding::Linear => ColorEncoding::Linear,
            ImageEncoding::Gamma(gamma) => ColorEncoding::Gamma(gamma),
        };
        let scale = p.float("scale", d).unwrap_or(1.0);
        let Some(name) = file_name(p, "filename", d) else {
            d.error(p.span, "a texture `ptex` needs a `string filename`");
            return None;
        };
        let path = file_in(&self.folder, name);
        let request = FaceMapRequest { path: path.clone(), encoding };
        Some(FaceTexture { map: self.face_maps.index(&path, request, p.span_of("filename")), scale })
    }
}

/// The content of a file, or its error.
pub(super) type Loaded = Result<Arc<FaceMap>, PtexError>;

/// Reads all files.
pub(super) fn load(wanted: &[Request<FaceMapRequest>], files: &FileCache) -> Vec<Loaded> {
    wanted.par_iter().map(|request| files.face_map(&request.file)).collect()
}

/// The textures in the order of their files; reports unreadable ones.
pub(super) fn check(loaded: Vec<Loaded>, wanted: &[Request<FaceMapRequest>], d: &mut Diagnostics) -> Vec<Arc<FaceMap>> {
    let places = wanted.iter().map(|request| FilePlace { path: &request.file.path, span: request.span });
    readable(loaded, places, d, |error| match error {
        PtexError::Unreadable { reason, .. } => Some(reason.to_string()),
        PtexError::Wrong { .. } => None,
    })
}
