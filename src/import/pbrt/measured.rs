//! `Material "measured"`.

use super::checks::{FilePlace, file_name, readable};
use super::state::Builder;
use crate::bsdfs::MeasuredTables;
use crate::import::cache::FileCache;
use crate::import::measured::MeasuredError;
use crate::import::resources::Request;
use crate::materials::Material;
use lumiris_formats::bsdf_file::BsdfFileError;
use lumiris_formats::diagnostic::Diagnostics;
use lumiris_formats::names::file_in;
use lumiris_formats::pbrt::directive::Name;
use lumiris_formats::pbrt::params::ParamSet;
use rayon::prelude::*;
use std::path::PathBuf;
use std::sync::Arc;

impl Builder<'_> {
    /// `string filename`; each file is read once, together with the meshes.
    pub(super) fn measured(&mut self, place: &Name, p: &ParamSet, d: &mut Diagnostics) -> Material {
        let Some(name) = file_name(p, "filename", d) else {
            d.error(place.span, "material `measured` needs a `string filename`")
                .help("a file `.bsdf` of the RGL material database, or of the same form");
            return Material::Interface;
        };
        let path = file_in(&self.folder, name);
        Material::Measured { tables: self.measured_files.index(&path, path.clone(), p.span_of("filename")) }
    }
}

/// The content of a file, or its error.
pub(super) type Loaded = Result<Arc<MeasuredTables>, MeasuredError>;

/// Reads all files.
pub(super) fn load(wanted: &[Request<PathBuf>], files: &FileCache) -> Vec<Loaded> {
    wanted.par_iter().map(|request| files.measured(&request.file)).collect()
}

/// The tables in the order of their files; reports unreadable ones.
pub(super) fn check(loaded: Vec<Loaded>, wanted: &[Request<PathBuf>], d: &mut Diagnostics) -> Vec<Arc<MeasuredTables>> {
    let places = wanted.iter().map(|request| FilePlace { path: &request.file, span: request.span });
    readable(loaded, places, d, |error| match error {
        MeasuredError::File(BsdfFileError::Unreadable { reason, .. }) => Some(reason.to_string()),
        MeasuredError::File(BsdfFileError::Wrong { .. }) | MeasuredError::Tables(_) => None,
    })
}
