//! The state machine of the format: directives change the graphics state, or add objects with that state to the scene.

use super::descriptions::{InstanceDesc, LateInstance, MaterialUse, MediumNames, ObjectDesc, Pending};
use super::options::CameraDirective;
use super::state::Builder;
use super::transform::{Ctm, matrix_of};
use lumiris_formats::color_space::ColorSpace;
use lumiris_formats::diagnostic::Diagnostics;
use lumiris_formats::pbrt::directive::{ActiveTimes, AttributeTarget, Directive, DirectiveKind, Name};
use lumiris_formats::pbrt::params::ParamSet;
use lumiris_formats::pbrt::parser::Visitor;
use lumiris_formats::source::{SourceMap, Span};
use std::sync::Arc;

impl Visitor for Builder<'_> {
    fn directive(&mut self, directive: Directive, _sources: &SourceMap, diagnostics: &mut Diagnostics) {
        use DirectiveKind as D;
        let Directive { kind, span, mut params } = directive;
        if let Some(target) = target_of(&kind) {
            params.inherit(self.state.defaults.of(target));
        }
        match kind {
            D::Identity
            | D::Translate(_)
            | D::Scale(_)
            | D::Rotate(_)
            | D::LookAt(_)
            | D::Transform(_)
            | D::ConcatTransform(_) => self.transform(&kind, span, diagnostics),
            D::CoordinateSystem(name) => {
                self.coordinate_systems.insert(name.text, self.state.ctm.clone());
            }
            D::CoordSysTransform(name) => self.coordinate_system(&name, diagnostics),
            D::ActiveTransform(active) => self.state.active = active,
            D::TransformTimes(times) => self.options.transform_times(times, span, diagnostics),
            D::AttributeBegin => self.stack.push(self.state.clone()),
            D::AttributeEnd => self.pop(),
            D::Attribute(target) => self.state.defaults.add(target, params.in_color_space(self.state.color_space)),
            D::Option { name, value } => self.options.option(&name, &value, diagnostics),
            D::ColorSpace(name) => self.color_space(&name, diagnostics),
            D::Camera(name) => self.camera(name, params, span, diagnostics),
            D::Film(name) => self.film(name, params, diagnostics),
            D::Sampler(name) => self.options.sampler(name, params),
            D::Integrator(name) => self.options.integrator(name, params),
            D::PixelFilter(name) => self.options.pixel_filter(name, params),
            // The ray tracer is not configured by the scene.
            D::Accelerator(_) => {}
            D::MakeNamedMedium(name) => self.make_named_medium(name, params, diagnostics),
            D::MediumInterface { inside, outside } => self.medium_interface(inside, outside),
            D::WorldBegin => self.world_begin(),
            D::WorldEnd => {}
            D::ReverseOrientation => self.state.reverse_orientation = !self.state.reverse_orientation,
            D::Material(name) => self.material(name, params),
            D::MakeNamedMaterial(name) => self.make_named_material(name, params, diagnostics),
            D::NamedMaterial(name) => self.state.material = MaterialUse::Named(Arc::new(name)),
            D::Texture { name, value, class } => self.texture(name, &value, class, params, diagnostics),
            D::LightSource(name) => self.light(&name, &params, diagnostics),
            D::AreaLightSource(name) => {
                self.state.area_light = self.area_light(&name, &params, diagnostics).map(Arc::new);
            }
            D::Shape(name) => self.shape(&name, params, diagnostics),
            D::ObjectBegin(name) => self.object_begin(name, diagnostics),
            D::ObjectEnd => self.object_end(),
            D::ObjectInstance(name) => self.object_instance(name, span, diagnostics),
        }
    }
}

impl Builder<'_> {
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
        let ctm = self.state.ctm.changed(self.state.active, |m| if sets { matrix } else { *m * matrix });
        if ctm.is_finite() {
            self.state.ctm = ctm;
        } else {
            diagnostics.error(span, "this transformation is not finite");
        }
    }

    fn coordinate_system(&mut self, name: &Name, diagnostics: &mut Diagnostics) {
        match self.coordinate_systems.get(&name.text) {
            Some(ctm) => self.state.ctm.clone_from(ctm),
            None => {
                let known = self.coordinate_systems.keys().map(String::as_str);
                diagnostics.unknown(name.span, "coordinate system", &name.text, known);
            }
        }
    }

    fn camera(&mut self, name: Name, params: ParamSet, span: Span, diagnostics: &mut Diagnostics) {
        if !self.has_inverse("a camera", span, diagnostics) {
            return;
        }
        let ctm = self.state.ctm.clone();
        self.coordinate_systems.insert("camera".to_owned(), ctm.inverse());
        let (folder, medium) = (self.folder.clone(), self.state.media.outside.clone());
        self.options.camera(CameraDirective { pending: Pending { name, params }, ctm, folder, medium });
    }

    fn film(&mut self, name: Name, params: ParamSet, diagnostics: &mut Diagnostics) {
        if self.state.color_space != ColorSpace::Srgb {
            let message = "the image is in linear Rec.709, whatever the colour space before `Film`";
            diagnostics.warning_once(name.span, message);
        }
        self.options.film(name, params);
    }

    fn medium_interface(&mut self, inside: Name, outside: Name) {
        let [inside, outside] = [inside, outside].map(|name| Some(name).filter(|name| !name.text.is_empty()));
        self.state.media = Arc::new(MediumNames { inside, outside });
    }

    fn world_begin(&mut self) {
        self.origin = self.options.origin();
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
        self.object_names.insert(name.text, index);
        self.objects.push(ObjectDesc { span: name.span, instances: Vec::new() });
        self.current_object = Some(index);
    }

    fn object_end(&mut self) {
        self.current_object = None;
        self.pop();
    }

    fn object_instance(&mut self, name: Name, span: Span, diagnostics: &mut Diagnostics) {
        let Some(&object) = self.object_names.get(&name.text) else {
            let ctm = self.state.ctm.clone();
            self.late_instances.push(LateInstance { name, holder: self.current_object, ctm, span });
            return;
        };
        let instance = InstanceDesc { object, ctm: self.state.ctm.clone(), span };
        match self.current_object {
            Some(current) if current == object => {
                diagnostics.error(span, format!("the object `{}` cannot contain itself", name.text));
            }
            Some(current) => self.objects[current].instances.push(instance),
            None => self.instances.push(instance),
        }
    }

    fn pop(&mut self) {
        // The parser checks the nesting of blocks, so each `End` has its `Begin` on the stack.
        if let Some(state) = self.stack.pop() {
            self.state = state;
        }
    }
}

/// The target of `Attribute` whose defaults hold for a directive.
fn target_of(kind: &DirectiveKind) -> Option<AttributeTarget> {
    use DirectiveKind as D;
    match kind {
        D::MakeNamedMedium(_) => Some(AttributeTarget::Medium),
        D::Material(_) | D::MakeNamedMaterial(_) => Some(AttributeTarget::Material),
        D::Texture { .. } => Some(AttributeTarget::Texture),
        D::LightSource(_) | D::AreaLightSource(_) => Some(AttributeTarget::Light),
        D::Shape(_) => Some(AttributeTarget::Shape),
        _ => None,
    }
}
