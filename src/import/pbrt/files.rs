//! The files of a scene, read in parallel.

use super::state::Builder;
use super::{measured, ptex};
use crate::imaging::MipMap;
use crate::imaging::oiio::ImageError;
use crate::import::cache::FileCache;
use crate::import::face_maps::FaceMapRequest;
use crate::import::images::RgbImage;
use crate::import::memory::MemoryAccount;
use crate::import::resources::{Request, Resources};
use crate::lights::EmissionImage;
use lumiris_formats::diagnostic::Diagnostics;
use lumiris_formats::ply::{PlyError, PlyMesh};
use rayon::prelude::*;
use std::collections::{BTreeSet, HashMap};
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// The images and tables that a scene needs.
pub(super) struct ImageFiles<'a> {
    environments: Vec<&'a Path>,
    /// Images of area lights, each once.
    emission: BTreeSet<&'a Path>,
    textures: &'a Resources,
    face_maps: &'a [Request<FaceMapRequest>],
    measured: &'a [Request<PathBuf>],
}

/// Their contents.
pub(super) struct Images {
    /// By light with an image.
    pub environments: Vec<Result<Arc<RgbImage>, ImageError>>,
    pub emission: Vec<EmissionFile>,
    pub textures: Vec<Arc<MipMap>>,
    pub face_maps: Vec<ptex::Loaded>,
    pub measured: Vec<measured::Loaded>,
}

/// An image of area lights.
pub(super) struct EmissionFile {
    pub path: PathBuf,
    pub image: Result<EmissionImage, EmissionError>,
}

/// An error of an image of area lights.
pub(super) enum EmissionError {
    Image(ImageError),
    Size(String),
}

impl<'a> ImageFiles<'a> {
    /// The files that directives name.
    pub(super) fn of(builder: &'a Builder<'_>) -> Self {
        ImageFiles {
            environments: builder.environments.iter().map(|e| e.path.as_path()).collect(),
            emission: builder.emission_images.iter().map(PathBuf::as_path).collect(),
            textures: &builder.resources,
            face_maps: builder.face_maps.list(),
            measured: builder.measured_files.list(),
        }
    }

    /// Reads them; `None` if the scene does not fit into memory together with what `account` has.
    pub(super) fn read(&self, files: &FileCache, account: MemoryAccount, d: &mut Diagnostics) -> Option<Images> {
        let textures = self.textures.load(files, account, d)?;
        let emission = self.emission.par_iter().map(|path| EmissionFile::read(path, files)).collect();
        let face_maps = ptex::load(self.face_maps, files);
        let measured = measured::load(self.measured, files);
        let environments = self.environments.par_iter().map(|path| files.rgb(path)).collect();
        Some(Images { environments, emission, textures, face_maps, measured })
    }
}

impl EmissionFile {
    fn read(path: &Path, files: &FileCache) -> Self {
        let image = files.rgb(path).map_err(EmissionError::Image).and_then(|image| {
            let RgbImage { texels, size } = Arc::unwrap_or_clone(image);
            EmissionImage::new(size[0], size[1], texels).map_err(EmissionError::Size)
        });
        EmissionFile { path: path.to_owned(), image }
    }
}

/// The meshes of PLY files.
pub(super) struct Meshes<'a> {
    files: &'a FileCache,
    /// Meshes that were read in advance, since several shapes may use them.
    by_path: HashMap<PathBuf, Arc<PlyMesh>>,
}

impl<'a> Meshes<'a> {
    /// If meshes are cached for other scenes, reads each of `paths` once. Otherwise a mesh is transformed as soon as it
    /// has been read, so that there is one copy.
    pub(super) fn new<'p>(files: &'a FileCache, paths: impl Iterator<Item = &'p Path>) -> Self {
        let paths: BTreeSet<&'p Path> = paths.filter(|_| files.keeps()).collect();
        // Shapes report their unreadable files
        let read = |path: &'p Path| files.mesh(path).ok().map(|mesh| (path.to_owned(), mesh));
        Meshes { files, by_path: paths.into_par_iter().filter_map(read).collect() }
    }

    /// The mesh of a file.
    pub(super) fn mesh(&self, path: &Path) -> Result<Arc<PlyMesh>, PlyError> {
        self.by_path.get(path).map_or_else(|| self.files.mesh(path), |mesh| Ok(Arc::clone(mesh)))
    }
}
