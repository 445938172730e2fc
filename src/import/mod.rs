//! From scene files to scenes: the semantics of pbrt's directives ([`pbrt`]) and of glTF ([`gltf`]). They name images,
//! meshes, textures of faces, volumes and measured materials ([`resources`], [`images`], [`face_maps`], [`volumes`],
//! [`measured`]), which the scenes of an animation share ([`cache`]). A [`fingerprint`] identifies a scene.
//!
//! The files themselves are parsed by the crate `lumiris_formats`. User input never panics: problems are collected,
//! with their source locations, in [`Diagnostics`].

pub mod cache;
pub mod face_maps;
pub mod fingerprint;
pub mod gltf;
pub mod images;
pub mod measured;
pub mod pbrt;
pub mod resources;
pub mod volumes;

use crate::accel::embree::EmbreeError;
use crate::scene::{AccelKind, RenderJob, Scene, World};
use crate::settings::{Given, Settings};
use cache::FileCache;
use fingerprint::SceneFiles;
use gltf::LightUnits;
use lumiris_formats::diagnostic::{Diagnostics, Report};
use lumiris_formats::pbrt::parser::{parse_file, parse_source};
use lumiris_formats::source::SourceMap;
use pbrt::state::Builder;
use std::path::{Path, PathBuf};

/// Options that override a scene file.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct LoadOptions {
    /// Size of the image (width, height).
    pub resolution: Option<[u32; 2]>,
    /// Crop window x0, x1, y0, y1 in fractions of the image.
    pub crop: Option<[f32; 4]>,
    /// Image of the environment of a glTF scene.
    pub environment: Option<PathBuf>,
    /// Name or index of the scene of a glTF file; by default the default scene of the file, or the first.
    pub scene: Option<String>,
    /// Name or index of the camera of a glTF scene; by default the first.
    pub camera: Option<String>,
    /// True for the automatic camera in a glTF scene, even if it has cameras.
    pub camera_auto: bool,
    /// Units of the punctual lights of a glTF scene.
    pub light_units: Option<LightUnits>,
    /// The time (s) at which animations of a glTF scene are evaluated; by default they are not.
    pub time: Option<f32>,
}

impl LoadOptions {
    /// The first given option that is for glTF scenes only.
    pub fn of_gltf(&self) -> Option<&'static str> {
        let options = [
            ("--environment", self.environment.is_some()),
            ("--scene-in-file", self.scene.is_some()),
            ("--camera", self.camera.is_some()),
            ("--camera-auto", self.camera_auto),
            ("--light-units", self.light_units.is_some()),
            ("--time-in-scene", self.time.is_some()),
        ];
        options.into_iter().find_map(|(option, is_given)| is_given.then_some(option))
    }
}

/// A scene, its settings, and warnings.
#[derive(Debug)]
pub struct Loaded {
    /// The scene.
    pub scene: Scene,
    /// The file's settings.
    pub settings: Settings,
    /// Settings given in the file.
    pub given: Given,
    /// Warnings.
    pub warnings: Report,
    /// The files of the scene.
    pub files: SceneFiles,
}

impl Loaded {
    /// Builds the ray tracers, and prepares the data for the settings; see [`World::new`].
    pub fn job(self, kind: AccelKind, packet_width: Option<u32>) -> Result<RenderJob, EmbreeError> {
        Ok(RenderJob::new(World::new(self.scene, kind, packet_width)?, self.settings))
    }
}

/// True if the name has the extension of a glTF file.
pub fn is_gltf(path: &Path) -> bool {
    path.extension().is_some_and(|e| e.eq_ignore_ascii_case("gltf") || e.eq_ignore_ascii_case("glb"))
}

/// Loads a scene file.
///
/// Returns `Err` with all errors and warnings.
pub fn load(path: &Path, options: &LoadOptions) -> Result<Loaded, Box<Report>> {
    load_with(path, options, &FileCache::default())
}

/// Loads a scene file, with meshes and images from the cache `files`.
pub fn load_with(path: &Path, options: &LoadOptions, files: &FileCache) -> Result<Loaded, Box<Report>> {
    if is_gltf(path) {
        return gltf::load(path, options, files);
    }
    let folder = path.parent().map(Path::to_path_buf).unwrap_or_default();
    load_parsed(folder, options, files, |sources, diagnostics, builder| {
        parse_file(path, sources, diagnostics, builder);
    })
}

/// Loads a scene from its text. File names are relative to `folder`. Messages call the scene `name`.
pub fn load_text(
    text: &str,
    name: &str,
    folder: &Path,
    options: &LoadOptions,
    files: &FileCache,
) -> Result<Loaded, Box<Report>> {
    load_parsed(folder.to_path_buf(), options, files, |sources, diagnostics, builder| {
        let file = sources.add_text(name, text.as_bytes().to_vec());
        parse_source(file, &folder.join(name), sources, diagnostics, builder);
    })
}

/// Builds the scene from the result of `parse`.
fn load_parsed(
    folder: PathBuf,
    options: &LoadOptions,
    files: &FileCache,
    parse: impl FnOnce(&mut SourceMap, &mut Diagnostics, &mut Builder<'_>),
) -> Result<Loaded, Box<Report>> {
    let mut sources = SourceMap::new();
    let mut diagnostics = Diagnostics::new();
    let mut builder = Builder::new(folder, options);

    // Parse, and resolve names
    parse(&mut sources, &mut diagnostics, &mut builder);
    builder.resolve(&mut diagnostics);
    if let Some(option) = options.of_gltf() {
        let message = format!(
            "{option} is for glTF scenes: environment, camera, lights and time of a pbrt scene are in its file"
        );
        diagnostics.error_without_place(message);
    }

    // Finish the scene
    let scene_files = SceneFiles::new(&sources, builder.files());
    let finished = builder.finish(files, &mut diagnostics);
    let failed = diagnostics.has_errors();
    let report = diagnostics.finish(&sources);
    match finished {
        Some((scene, settings, placed)) if !failed => {
            // Settings given in the file, with their positions
            let mut given = Given::default();
            for (row, value, span) in placed {
                let parameter = row.parameters.first().unwrap_or(&row.flag);
                given.add(row, value, format!("{}: `{parameter}` {value}", sources.locate(span)));
            }
            Ok(Loaded { scene, settings, given, warnings: report, files: scene_files })
        }
        _ => Err(Box::new(report)),
    }
}
