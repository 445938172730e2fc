//! Loads glTF files.

use super::assemble::Assembly;
use super::messages::Messages;
use crate::import::cache::FileCache;
use crate::import::fingerprint::SceneFiles;
use crate::import::{LoadOptions, Loaded};
use crate::settings::{Given, Settings};
use lumiris_formats::diagnostic::{Diagnostics, Report};
use lumiris_formats::gltf::Document;
use lumiris_formats::source::SourceMap;
use std::path::Path;

/// Extensions that a file may require. Missing support of a material extension in this list is also a warning.
const KNOWN: &[&str] = &[
    "EXT_mesh_gpu_instancing",
    "KHR_lights_punctual",
    "KHR_materials_anisotropy",
    "KHR_materials_clearcoat",
    "KHR_materials_diffuse_transmission",
    "KHR_materials_dispersion",
    "KHR_materials_emissive_strength",
    "KHR_materials_ior",
    "KHR_materials_iridescence",
    "KHR_materials_pbrSpecularGlossiness",
    "KHR_materials_sheen",
    "KHR_materials_specular",
    "KHR_materials_transmission",
    "KHR_materials_unlit",
    "KHR_materials_variants",
    "KHR_materials_volume",
    "KHR_mesh_quantization",
    "KHR_node_visibility",
    "KHR_texture_transform",
];

/// Loads a .gltf or .glb file.
///
/// Returns `Err` with all errors and warnings.
pub fn load(path: &Path, options: &LoadOptions, files: &FileCache) -> Result<Loaded, Box<Report>> {
    let (mut sources, mut diagnostics) = (SourceMap::new(), Diagnostics::new());
    if options.camera.is_some() && options.camera_auto {
        diagnostics.error_without_place("--camera and --camera-auto ask for two cameras");
    }
    let Ok(file) = sources.read(path) else {
        diagnostics.missing_file(path, "cannot be opened", None);
        return Err(Box::new(diagnostics.finish(&sources)));
    };

    // Parse, and assemble the scene
    let bytes = sources.shared_bytes(file);
    let mut messages = Messages::new(&mut diagnostics, file, &bytes);
    let folder = path.parent().unwrap_or(Path::new(""));
    let mut others = Vec::new();
    let scene = match Document::parse(&bytes, folder, KNOWN) {
        Ok(document) => {
            for place in document.root().key("extensionsUsed").items() {
                if place.text().is_some_and(|name| !KNOWN.contains(&name)) {
                    messages.warning(&place, &format!("{} is not rendered", place.text().unwrap_or_default()));
                }
            }
            others.clone_from(&document.files);
            messages.unread(&document.unread);
            Assembly::new(&document, options).and_then(|assembly| assembly.scene(files, &mut others, &mut messages))
        }
        Err(errors) => {
            errors.iter().for_each(|error| messages.error(error));
            Ok(None)
        }
    };
    let scene = scene.unwrap_or_else(|error| {
        messages.error(&error);
        None
    });

    // Report
    let failed = diagnostics.has_errors();
    let scene_files = SceneFiles::new(&sources, others);
    let report = diagnostics.finish(&sources);
    match scene {
        Some(scene) if !failed => Ok(Loaded {
            scene,
            settings: Settings::default(),
            given: Given::default(),
            warnings: report,
            files: scene_files,
        }),
        _ => Err(Box::new(report)),
    }
}
