//! glTF 2.0 scenes. For emissive surfaces, 1 cd/m² is a radiance of 1; [`LightUnits`] defines the units of punctual
//! lights. Single-sided surfaces are rendered from both sides.
//!
//! Reading order: [`choice`], [`textures`], [`materials`], [`animation`], [`nodes`], [`vertices`], [`pose`],
//! [`meshes`], [`extent`], [`view`],
//! [`assemble`].

mod animation;
mod assemble;
mod choice;
mod extent;
mod materials;
mod meshes;
mod nodes;
mod pose;
mod textures;
mod vertices;
mod view;

use super::cache::FileCache;
use super::fingerprint::SceneFiles;
use super::{LoadOptions, Loaded};
use crate::settings::{Given, Settings};
use assemble::Assembly;
use lumiris_formats::diagnostic::{Diagnostics, Report};
use lumiris_formats::gltf::document::Unread;
use lumiris_formats::gltf::{Document, GltfError, Place, locate, locate_members};
use lumiris_formats::source::{FileId, SourceMap, Span};
use std::collections::{BTreeSet, HashMap};
use std::ops::Range;
use std::path::Path;
use strum::{EnumString, IntoStaticStr, VariantNames};

/// Luminous flux of 1 W at 555 nm (lm/W), the divisor of light units.
pub const LUMENS_PER_WATT: f32 = 683.0;

/// Units of punctual lights, relative to an emission of 1.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, EnumString, IntoStaticStr, VariantNames)]
#[strum(serialize_all = "kebab-case")]
pub enum LightUnits {
    /// Divided by [`LUMENS_PER_WATT`]: W/sr and W/m², as in Blender's export of candela and lux.
    #[default]
    Watt,
    /// Taken as they are: emission is in cd/m², as in the specification, or nothing has units.
    Candela,
}

impl LightUnits {
    /// The intensity of 1 cd, and the irradiance of 1 lx.
    fn per_candela(self) -> f32 {
        match self {
            LightUnits::Watt => 1.0 / LUMENS_PER_WATT,
            LightUnits::Candela => 1.0,
        }
    }
}

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

/// Messages about one file.
struct Messages<'d> {
    diagnostics: &'d mut Diagnostics,
    file: FileId,
    bytes: &'d [u8],
    /// Source positions of the names of images and buffers, computed on first use.
    named: HashMap<&'static str, Vec<Span>>,
    warned: BTreeSet<String>,
}

impl Messages<'_> {
    fn span_of(&self, place: &str) -> Span {
        let Range { start, end } = locate(self.bytes, place);
        Span { file: self.file, start: start as u32, end: end as u32 }
    }

    /// Source position of the file name of an element of `images` or `buffers`.
    fn file_span(&mut self, array: &'static str, index: usize) -> Span {
        let (file, bytes) = (self.file, self.bytes);
        let span = |Range { start, end }| Span { file, start: start as u32, end: end as u32 };
        let all = || locate_members(bytes, array, "uri").into_iter().map(span).collect();
        let spans = self.named.entry(array).or_insert_with(all);
        spans.get(index).copied().unwrap_or(Span { file, start: 0, end: 0 })
    }

    fn error(&mut self, error: &GltfError) {
        self.diagnostics.error(self.span_of(&error.place), error.to_string());
    }

    /// Reports unreadable buffers: missing files are one error, together with missing images.
    fn unread(&mut self, buffers: &[Unread]) {
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
    fn warning(&mut self, place: &Place<'_>, message: &str) {
        if self.warned.insert(message.to_owned()) {
            let path = place.path();
            let span = self.span_of(&path);
            self.diagnostics.warning(span, message).remark(path);
        }
    }
}

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
    let mut messages =
        Messages { diagnostics: &mut diagnostics, file, bytes: &bytes, named: HashMap::new(), warned: BTreeSet::new() };
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
