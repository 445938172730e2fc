//! The state machine of the format: directives change the graphics state, or add objects with that state to the scene.

use super::lights::AreaLightDesc;
use super::materials::MaterialUse;
use super::options::Options;
use super::shapes::{InstanceDesc, ObjectDesc, ShapeDesc};
use super::textures::TextureNames;
use super::transform::{Ctm, affine, matrix_of};
use crate::import::LoadOptions;
use crate::import::resources::Resources;
use crate::lights::Light;
use crate::materials::MaterialEntry;
use crate::textures::TextureSet;
use lumiris_formats::color_space::ColorSpace;
use lumiris_formats::diagnostic::{Diagnostics, did_you_mean};
use lumiris_formats::pbrt::directive::{ActiveTimes, AttributeTarget, Directive, DirectiveKind, Name};
use lumiris_formats::pbrt::params::{Param, ParamSet};
use lumiris_formats::pbrt::parser::Visitor;
use lumiris_formats::source::{SourceMap, Span};
use lumiris_numbers::math::Affine3A;
use std::collections::HashMap;
use std::path::PathBuf;

/// What a block saves and restores.
#[derive(Clone)]
pub struct GraphicsState {
    /// Current transformation.
    pub ctm: Ctm,
    /// Times that transform directives change.
    active: ActiveTimes,
    /// `ReverseOrientation`.
    pub reverse_orientation: bool,
    /// Current material.
    pub material: MaterialUse,
    /// Current area light.
    pub area_light: Option<AreaLightDesc>,
    /// Colour space of `rgb` parameters.
    pub color_space: ColorSpace,
    /// Default parameters by `Attribute`.
    defaults: Defaults,
}

#[derive(Clone, Default)]
struct Defaults {
    shape: Vec<Param>,
    light: Vec<Param>,
    material: Vec<Param>,
    medium: Vec<Param>,
    texture: Vec<Param>,
}

impl Defaults {
    fn of(&mut self, target: AttributeTarget) -> &mut Vec<Param> {
        match target {
            AttributeTarget::Shape => &mut self.shape,
            AttributeTarget::Light => &mut self.light,
            AttributeTarget::Material => &mut self.material,
            AttributeTarget::Medium => &mut self.medium,
            AttributeTarget::Texture => &mut self.texture,
        }
    }
}

/// The scene while its file is read.
pub struct Builder<'a> {
    /// Folder that file names are relative to.
    pub folder: PathBuf,
    /// What the caller overrides.
    pub load_options: &'a LoadOptions,
    /// Current state.
    pub state: GraphicsState,
    stack: Vec<GraphicsState>,
    coordinate_systems: HashMap<String, Ctm>,
    /// Camera, film, sampler, integrator.
    pub options: Options,
    /// Textures so far.
    pub textures: TextureSet,
    /// Names of textures.
    pub texture_names: TextureNames,
    /// Materials so far.
    pub materials: Vec<MaterialEntry>,
    /// Named materials.
    pub named_materials: HashMap<String, u32>,
    /// Lights that are no surfaces.
    pub lights: Vec<Light>,
    /// Environment maps that wait for their image.
    pub environments: Vec<super::lights::EnvironmentDesc>,
    /// Images that area lights emit.
    pub emission_images: Vec<PathBuf>,
    /// Shapes that wait for their files.
    pub shapes: Vec<ShapeDesc>,
    /// Objects by name.
    pub objects: Vec<ObjectDesc>,
    object_names: HashMap<String, usize>,
    /// The object being defined.
    pub current_object: Option<usize>,
    /// Placements of objects.
    pub instances: Vec<InstanceDesc>,
    /// Images to be read.
    pub resources: Resources,
}

impl<'a> Builder<'a> {
    /// An empty scene.
    pub fn new(folder: PathBuf, load_options: &'a LoadOptions) -> Self {
        let mut materials = Vec::new();
        let mut textures = TextureSet::default();
        let default_material = super::materials::default_material(&mut materials, &mut textures);
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
                defaults: Defaults::default(),
            },
            stack: Vec::new(),
            coordinate_systems: HashMap::new(),
            options: Options::default(),
            textures,
            texture_names: TextureNames::default(),
            materials,
            named_materials: HashMap::new(),
            lights: Vec::new(),
            environments: Vec::new(),
            emission_images: Vec::new(),
            shapes: Vec::new(),
            objects: Vec::new(),
            object_names: HashMap::new(),
            current_object: None,
            instances: Vec::new(),
            resources: Resources::default(),
        }
    }

    /// The current transformation of something that cannot move; a motion is reported and left out.
    pub fn still_transform(&self, what: &str, span: Span, diagnostics: &mut Diagnostics) -> Affine3A {
        if self.state.ctm.is_moving() {
            diagnostics.warning_once(span, format!("moving {what} are not rendered yet: it stays where it starts"));
        }
        affine(&self.state.ctm.start)
    }

    fn transform(&mut self, kind: &DirectiveKind, span: Span, diagnostics: &mut Diagnostics) {
        let matrix = match matrix_of(kind) {
            Some(Ok(matrix)) => matrix,
            Some(Err(reason)) => {
                diagnostics.error(span, reason);
                return;
            }
            None => return,
        };
        let sets = matches!(kind, DirectiveKind::Identity | DirectiveKind::Transform(_));
        let mut ctm = self.state.ctm;
        ctm.apply(self.state.active, |m| if sets { matrix } else { m * matrix });
        if ctm.is_invertible() {
            self.state.ctm = ctm;
        } else {
            diagnostics.error(span, "this transformation has no inverse");
        }
    }

    fn coordinate_system(&mut self, name: &Name, diagnostics: &mut Diagnostics) {
        match self.coordinate_systems.get(&name.text) {
            Some(ctm) => self.state.ctm = *ctm,
            None => {
                let message = format!("unknown coordinate system `{}`", name.text);
                let near =
                    did_you_mean(&name.text, self.coordinate_systems.keys().map(String::as_str)).map(str::to_owned);
                let diagnostic = diagnostics.error(name.span, message);
                if let Some(near) = near {
                    diagnostic.help(format!("did you mean `{near}`?"));
                }
            }
        }
    }

    fn world_begin(&mut self) {
        self.state.ctm = Ctm::IDENTITY;
        self.state.active = ActiveTimes::All;
        self.coordinate_systems.insert("world".to_owned(), Ctm::IDENTITY);
    }

    fn color_space(&mut self, name: &Name, diagnostics: &mut Diagnostics) {
        match ColorSpace::from_name(&name.text) {
            Some(space) => self.state.color_space = space,
            None => {
                let known = ColorSpace::NAMES.join(", ");
                diagnostics
                    .error(name.span, format!("unknown color space `{}`", name.text))
                    .help(format!("one of {known}"));
            }
        }
    }

    fn object_begin(&mut self, name: Name, diagnostics: &mut Diagnostics) {
        self.stack.push(self.state.clone());
        if let Some(&first) = self.object_names.get(&name.text) {
            let message = format!("object `{}` is defined twice", name.text);
            diagnostics.error(name.span, message).label(self.objects[first].span, "first defined here");
        }
        let index = self.objects.len();
        self.object_names.insert(name.text.clone(), index);
        self.objects.push(ObjectDesc { name: name.text, span: name.span });
        self.current_object = Some(index);
    }

    fn object_instance(&mut self, name: &Name, span: Span, diagnostics: &mut Diagnostics) {
        if self.current_object.is_some() {
            diagnostics.error(span, "an object cannot contain an instance");
            return;
        }
        let Some(&object) = self.object_names.get(&name.text) else {
            let message = format!("unknown object `{}`", name.text);
            let near = did_you_mean(&name.text, self.object_names.keys().map(String::as_str)).map(str::to_owned);
            let diagnostic = diagnostics.error(name.span, message);
            if let Some(near) = near {
                diagnostic.help(format!("did you mean `{near}`?"));
            }
            return;
        };
        self.instances.push(InstanceDesc { object, ctm: self.state.ctm });
    }

    fn pop(&mut self) {
        // The parser checks that blocks nest; an `End` that it let through has its `Begin` on the stack.
        if let Some(state) = self.stack.pop() {
            self.state = state;
        }
    }

    fn with_defaults(&mut self, target: AttributeTarget, params: &mut ParamSet) {
        params.inherit(self.state.defaults.of(target).iter());
    }
}

impl Visitor for Builder<'_> {
    fn directive(&mut self, directive: Directive, _sources: &SourceMap, diagnostics: &mut Diagnostics) {
        use DirectiveKind as D;
        let Directive { kind, span, mut params } = directive;
        match kind {
            D::Identity
            | D::Translate(_)
            | D::Scale(_)
            | D::Rotate(_)
            | D::LookAt(_)
            | D::Transform(_)
            | D::ConcatTransform(_) => self.transform(&kind, span, diagnostics),
            D::CoordinateSystem(name) => {
                self.coordinate_systems.insert(name.text, self.state.ctm);
            }
            D::CoordSysTransform(name) => self.coordinate_system(&name, diagnostics),
            D::ActiveTransform(active) => self.state.active = active,
            D::TransformTimes(times) => self.options.transform_times(times, span, diagnostics),
            D::TransformBegin | D::AttributeBegin => self.stack.push(self.state.clone()),
            D::TransformEnd => {
                if let Some(saved) = self.stack.pop() {
                    (self.state.ctm, self.state.active) = (saved.ctm, saved.active);
                }
            }
            D::AttributeEnd => self.pop(),
            D::Attribute(target) => {
                let list = self.state.defaults.of(target);
                list.extend(params.iter().cloned());
            }
            D::Option => self.options.option(&params, diagnostics),
            D::ColorSpace(name) => self.color_space(&name, diagnostics),
            D::Camera(name) => {
                self.coordinate_systems.insert("camera".to_owned(), self.state.ctm.inverse());
                self.options.camera(name, params, self.state.ctm);
            }
            D::Film(name) => self.options.film(name, params),
            D::Sampler(name) => self.options.sampler(name, params),
            D::Integrator(name) => self.options.integrator(name, params),
            D::PixelFilter(name) => self.options.pixel_filter(name, params),
            // How the ray tracer is built is not the scene's business here.
            D::Accelerator(_) => {}
            D::MakeNamedMedium(name) => {
                self.with_defaults(AttributeTarget::Medium, &mut params);
                super::options::medium(&name, &params, diagnostics);
            }
            D::MediumInterface { inside, outside } => {
                if !inside.text.is_empty() || !outside.text.is_empty() {
                    diagnostics.warning_once(span, "participating media are not rendered yet: light passes freely");
                }
            }
            D::WorldBegin => self.world_begin(),
            D::WorldEnd => {}
            D::ReverseOrientation => self.state.reverse_orientation = !self.state.reverse_orientation,
            D::Material(name) => {
                self.with_defaults(AttributeTarget::Material, &mut params);
                self.material(&name, &params, diagnostics);
            }
            D::MakeNamedMaterial(name) => {
                self.with_defaults(AttributeTarget::Material, &mut params);
                self.make_named_material(name, &params, diagnostics);
            }
            D::NamedMaterial(name) => self.state.material = MaterialUse::Named(name),
            D::Texture { name, value, class } => {
                self.with_defaults(AttributeTarget::Texture, &mut params);
                self.texture(name, &value, &class, &params, diagnostics);
            }
            D::LightSource(name) => {
                self.with_defaults(AttributeTarget::Light, &mut params);
                self.light(&name, &params, diagnostics);
            }
            D::AreaLightSource(name) => {
                self.with_defaults(AttributeTarget::Light, &mut params);
                self.state.area_light = self.area_light(&name, &params, diagnostics);
            }
            D::Shape(name) => {
                self.with_defaults(AttributeTarget::Shape, &mut params);
                self.shape(&name, params, diagnostics);
            }
            D::ObjectBegin(name) => self.object_begin(name, diagnostics),
            D::ObjectEnd => {
                self.current_object = None;
                self.pop();
            }
            D::ObjectInstance(name) => self.object_instance(&name, span, diagnostics),
        }
    }
}
