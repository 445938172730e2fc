//! Loads scene files of both formats.

use super::cache::FileCache;
use super::fingerprint::SceneFiles;
use super::gltf;
use super::load_options::LoadOptions;
use super::loaded::Loaded;
use super::pbrt::finish::Finished;
use super::pbrt::settings::GivenSetting;
use super::pbrt::state::Builder;
use crate::settings::Given;
use lumiris_formats::diagnostic::{Diagnostics, Report};
use lumiris_formats::pbrt::parser::{parse_file, parse_source};
use lumiris_formats::source::SourceMap;
use std::path::{Path, PathBuf};

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
        Some(Finished { scene, settings, given: found }) if !failed => {
            // Settings given in the file, with their positions
            let mut given = Given::default();
            for GivenSetting { setting, value, span } in found {
                let parameter = setting.parameters.first().unwrap_or(&setting.flag);
                given.add(setting, value, format!("{}: `{parameter}` {value}", sources.locate(span)));
            }
            Ok(Loaded { scene, settings, given, warnings: report, files: scene_files })
        }
        _ => Err(Box::new(report)),
    }
}
