//! The state after the directives so far: the graphics state, and the scene during parsing.

use super::descriptions::{
    AreaLightDesc, EnvironmentDesc, InstanceDesc, Interior, LateInstance, MaterialDesc, MaterialUse, MediumDesc,
    MediumNames, ObjectDesc, PendingMedium, ShapeDesc, TextureDesc,
};
use super::options::Options;
use super::texture_names::TextureNames;
use super::transform::{Ctm, affine};
use crate::import::LoadOptions;
use crate::import::face_maps::FaceMapRequest;
use crate::import::resources::{Requests, Resources};
use crate::lights::{Light, Portal};
use crate::materials::{Material, MaterialEntry, MaterialId};
use crate::textures::{FloatTextureId, RgbTexture, RgbTextureId, TextureSet};
use lumiris_formats::color_space::ColorSpace;
use lumiris_formats::diagnostic::Diagnostics;
use lumiris_formats::pbrt::directive::{ActiveTimes, AttributeTarget};
use lumiris_formats::pbrt::params::Param;
use lumiris_formats::source::Span;
use lumiris_numbers::math::origin::rebased;
use lumiris_numbers::math::{DAffine3, DVec3, Rgb};
use std::cell::RefCell;
use std::collections::{BTreeMap, HashMap};
use std::path::{Path, PathBuf};
use std::rc::Rc;
use std::sync::Arc;

/// The state that blocks save and restore.
#[derive(Clone)]
pub struct GraphicsState {
    /// Current transform.
    pub ctm: Ctm,
    /// Times that transform directives change.
    pub(super) active: ActiveTimes,
    /// `ReverseOrientation`.
    pub reverse_orientation: bool,
    /// Current material.
    pub material: MaterialUse,
    /// Current area light.
    pub area_light: Option<Arc<AreaLightDesc>>,
    /// Colour space of `rgb` parameters.
    pub color_space: ColorSpace,
    /// Media on the sides of shapes; the camera is in the outside one.
    pub media: Arc<MediumNames>,
    /// Default parameters by `Attribute`.
    pub(super) defaults: Defaults,
}

/// Default parameters by target, each name once; blocks share them copy-on-write.
#[derive(Clone, Default)]
pub(super) struct Defaults([Rc<Vec<Param>>; 5]);

impl Defaults {
    fn index(target: AttributeTarget) -> usize {
        match target {
            AttributeTarget::Shape => 0,
            AttributeTarget::Light => 1,
            AttributeTarget::Material => 2,
            AttributeTarget::Medium => 3,
            AttributeTarget::Texture => 4,
        }
    }

    /// The defaults of a target.
    pub(super) fn of(&self, target: AttributeTarget) -> &[Param] {
        &self.0[Self::index(target)]
    }

    /// Adds defaults for a target, replacing those with the same names.
    pub(super) fn add(&mut self, target: AttributeTarget, params: impl Iterator<Item = Param>) {
        let all = Rc::make_mut(&mut self.0[Self::index(target)]);
        for param in params {
            all.retain(|other| other.name != param.name);
            all.push(param);
        }
    }
}

/// The scene during parsing.
pub struct Builder<'a> {
    /// Folder of relative file names.
    pub folder: PathBuf,
    /// Options that override the file.
    pub load_options: &'a LoadOptions,
    /// Current state.
    pub state: GraphicsState,
    /// Saved states of open blocks.
    pub(super) stack: Vec<GraphicsState>,
    /// Transformations by name.
    pub(super) coordinate_systems: HashMap<String, Ctm>,
    /// Camera, film, sampler, integrator.
    pub options: Options,
    /// The point of world space that is the origin of rendered space: near the camera, determined at `WorldBegin`.
    pub origin: DVec3,
    /// Textures so far.
    pub textures: TextureSet,
    /// Names of float textures.
    pub(super) float_textures: TextureNames<FloatTextureId>,
    /// Names of textures of spectra.
    pub(super) rgb_textures: TextureNames<RgbTextureId>,
    /// Textures made at the end of the text.
    pub(super) pending_textures: Vec<TextureDesc>,
    /// Textures of shapes by name, with the source position of their first use: reserved until all are made.
    pub(super) late_textures: BTreeMap<String, (Span, FloatTextureId)>,
    /// Materials; placeholders until they are made.
    pub materials: Vec<MaterialEntry>,
    /// Materials made at the end of the text.
    pub(super) pending_materials: Vec<MaterialDesc>,
    /// Named materials, with the source positions of their definitions.
    pub named_materials: HashMap<String, (MaterialId, Span)>,
    /// Interiors of `subsurface` materials.
    pub(super) interiors: HashMap<MaterialId, Interior>,
    /// Media.
    pub media: Vec<MediumDesc>,
    /// Indices of media by name.
    pub(super) medium_names: HashMap<String, usize>,
    /// Media made at the end of the text, since they may be defined before the camera.
    pub(super) pending_media: Vec<PendingMedium>,
    /// Lights other than area lights.
    pub lights: Vec<Light>,
    /// Their groups.
    pub light_groups: Vec<Option<Arc<str>>>,
    /// Lights that need an image.
    pub environments: Vec<EnvironmentDesc>,
    /// Portals, with their source positions.
    pub portals: Vec<(Portal, Span)>,
    /// Emission images of area lights.
    pub emission_images: Vec<PathBuf>,
    /// Shapes, made after their files are read.
    pub shapes: Vec<ShapeDesc>,
    /// Objects by name.
    pub objects: Vec<ObjectDesc>,
    /// Indices of objects by name.
    pub(super) object_names: HashMap<String, usize>,
    /// The object being defined.
    pub current_object: Option<usize>,
    /// Instances of objects.
    pub instances: Vec<InstanceDesc>,
    /// Instances of objects that are not defined yet.
    pub(super) late_instances: Vec<LateInstance>,
    /// Image requests.
    pub resources: Resources,
    /// Requests for textures of faces.
    pub(super) face_maps: Requests<FaceMapRequest>,
    /// Requests for files of measured materials.
    pub(super) measured_files: Requests<PathBuf>,
    /// Files of spectra, already read.
    pub(super) spectrum_files: RefCell<Vec<PathBuf>>,
}

impl<'a> Builder<'a> {
    /// An empty scene.
    pub fn new(folder: PathBuf, load_options: &'a LoadOptions) -> Self {
        // The default material comes first
        let mut materials = Vec::new();
        let mut textures = TextureSet::default();
        let default_material = default_material(&mut materials, &mut textures);
        Builder {
            folder,
            load_options,
            state: GraphicsState {
                ctm: Ctm::IDENTITY,
                active: ActiveTimes::All,
                reverse_orientation: false,
                material: MaterialUse::Id(default_material),
                area_light: None,
                color_space: ColorSpace::Srgb,
                media: Arc::default(),
                defaults: Defaults::default(),
            },
            stack: Vec::new(),
            coordinate_systems: HashMap::new(),
            options: Options::default(),
            origin: DVec3::ZERO,
            textures,
            float_textures: TextureNames::new("float"),
            rgb_textures: TextureNames::new("spectrum"),
            pending_textures: Vec::new(),
            late_textures: BTreeMap::new(),
            materials,
            pending_materials: Vec::new(),
            named_materials: HashMap::new(),
            interiors: HashMap::new(),
            media: Vec::new(),
            medium_names: HashMap::new(),
            pending_media: Vec::new(),
            lights: Vec::new(),
            light_groups: Vec::new(),
            environments: Vec::new(),
            portals: Vec::new(),
            emission_images: Vec::new(),
            shapes: Vec::new(),
            objects: Vec::new(),
            object_names: HashMap::new(),
            current_object: None,
            instances: Vec::new(),
            late_instances: Vec::new(),
            resources: Resources::default(),
            face_maps: Requests::default(),
            measured_files: Requests::default(),
            spectrum_files: RefCell::default(),
        }
    }

    /// The files named in the text: spectra, measured materials, textures of faces, meshes, volumes and images.
    pub fn files(&self) -> Vec<PathBuf> {
        let mut files = self.spectrum_files.borrow().clone();
        files.extend(self.measured_files.list().iter().map(|request| request.file.clone()));
        files.extend(self.face_maps.list().iter().map(|request| request.file.path.clone()));
        files.extend(self.shapes.iter().filter_map(|shape| Some(shape.source.file()?.to_owned())));
        files.extend(self.media.iter().filter_map(|m| Some(m.volume.as_ref()?.path.clone())));
        files.extend(self.environments.iter().map(|e| e.path.clone()));
        files.extend(self.emission_images.iter().cloned());
        files.extend(self.resources.paths().map(Path::to_path_buf));
        files.extend(self.options.camera_files());
        files
    }

    /// True if the current transform has an inverse, which `what` requires; reports an error otherwise.
    pub fn has_inverse(&self, what: &str, span: Span, diagnostics: &mut Diagnostics) -> bool {
        let has = self.state.ctm.is_invertible();
        if !has {
            let message = format!("{what} cannot be flattened: the current transformation has no inverse");
            diagnostics.error(span, message).help("meshes, patches and disks can be flattened, by `Scale 1 1 0`");
        }
        has
    }

    /// The current transform to rendered space, for something that cannot move; a motion is reported and ignored.
    pub fn still_transform(&self, what: &str, span: Span, diagnostics: &mut Diagnostics) -> DAffine3 {
        if self.state.ctm.is_moving() {
            diagnostics.warning_once(span, format!("moving {what} are not rendered: it stays where it starts"));
        }
        rebased(&affine(&self.state.ctm.start), self.origin, DVec3::ZERO)
    }
}

/// The default material of shapes: pbrt's diffuse with reflectance 0.5.
fn default_material(materials: &mut Vec<MaterialEntry>, textures: &mut TextureSet) -> MaterialId {
    let reflectance = textures.add_rgb(RgbTexture::Constant(Rgb::splat(0.5)));
    let material = Material::Diffuse { reflectance };
    let name = "default".to_owned();
    materials.push(MaterialEntry { name, material, normal_map: None, displacement: None, dispersion: None });
    (materials.len() - 1) as MaterialId
}
