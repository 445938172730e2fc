//! Names that may be used before their definition, as in pbrt. After all directives have been read, textures and
//! materials are made, and references to objects and shape textures are resolved.
//!
//! pbrt-v4 makes image textures first, then the other float textures and the other spectrum textures, each in text
//! order. A texture refers to textures made before it, so none can contain itself.

use super::descriptions::{InstanceDesc, LateInstance, MaterialDesc, ParamState, PendingMedium};
use super::state::Builder;
use crate::materials::{Material, MaterialId};
use crate::textures::FloatTextureId;
use lumiris_formats::diagnostic::Diagnostics;
use lumiris_formats::source::Span;
use std::collections::HashMap;

/// A mixture of two materials.
struct Mixture {
    id: MaterialId,
    parts: [MaterialId; 2],
    /// Source position of its parts.
    span: Span,
}

impl Builder<'_> {
    /// The current state that determines the meaning of texture, material and medium parameters.
    pub(super) fn param_state(&self) -> ParamState {
        ParamState { ctm: self.state.ctm.clone(), color_space: self.state.color_space }
    }

    fn set_param_state(&mut self, state: ParamState) {
        (self.state.ctm, self.state.color_space) = (state.ctm, state.color_space);
    }

    /// Makes and resolves everything with a name.
    pub fn resolve(&mut self, d: &mut Diagnostics) {
        self.make_media(d);
        self.make_textures(d);
        self.make_materials(d);
        self.fill_late_textures(d);
        self.place_late_instances(d);
    }

    fn make_media(&mut self, d: &mut Diagnostics) {
        for PendingMedium { index, mut params, state } in std::mem::take(&mut self.pending_media) {
            self.set_param_state(state);
            self.make_medium(index, &mut params, d);
        }
    }

    fn make_textures(&mut self, d: &mut Diagnostics) {
        let mut textures = std::mem::take(&mut self.pending_textures);
        // The sort is stable
        textures.sort_by_key(|texture| match texture.class.text.as_str() {
            "imagemap" | "ptex" => 0,
            _ if texture.is_float => 1,
            _ => 2,
        });
        for texture in &textures {
            self.set_param_state(texture.state.clone());
            self.make_texture(texture, d);
        }
    }

    fn make_materials(&mut self, d: &mut Diagnostics) {
        let materials = std::mem::take(&mut self.pending_materials);
        for desc in &materials {
            self.set_param_state(desc.state.clone());
            self.materials[desc.id as usize] = self.material_entry(desc, d);
            desc.params.report_unused(d);
        }

        // Mixtures, after all materials are known
        let mixture = |desc: &MaterialDesc| match self.materials[desc.id as usize].material {
            Material::Mix { materials: parts, .. } => {
                Some(Mixture { id: desc.id, parts, span: desc.params.span_of("materials") })
            }
            _ => None,
        };
        let mixtures: Vec<Mixture> = materials.iter().filter_map(mixture).collect();
        for Mixture { parts, span, .. } in &mixtures {
            for id in parts.iter().filter(|id| self.interiors.contains_key(id)) {
                let name = &self.materials[*id as usize].name;
                d.warning_once(*span, format!("a mix has no interior: `{name}` is clear glass in it"));
            }
        }
        self.check_mixtures(mixtures, d);
    }

    /// Mixtures that contain themselves are errors.
    fn check_mixtures(&self, mixtures: Vec<Mixture>, d: &mut Diagnostics) {
        // Mixtures by a mixture that they contain, and for each the number of contained mixtures not yet known to be
        // valid
        let mut holders: HashMap<MaterialId, Vec<MaterialId>> =
            mixtures.iter().map(|mixture| (mixture.id, Vec::new())).collect();
        let mut open: HashMap<MaterialId, usize> = HashMap::new();
        for Mixture { id, parts, .. } in &mixtures {
            let parts = parts.iter().filter_map(|part| holders.get_mut(part).map(|of| of.push(*id)));
            open.insert(*id, parts.count());
        }
        let mut sound: Vec<MaterialId> = open.iter().filter_map(|(id, parts)| (*parts == 0).then_some(*id)).collect();
        while let Some(id) = sound.pop() {
            for holder in &holders[&id] {
                let parts = open.entry(*holder).or_default();
                *parts -= 1;
                sound.extend((*parts == 0).then_some(*holder));
            }
        }
        // The remaining mixtures are in a cycle, or contain one that is
        for Mixture { id, span, .. } in mixtures.into_iter().filter(|mixture| open[&mixture.id] > 0) {
            let name = &self.materials[id as usize].name;
            d.error(span, format!("the mixture `{name}` holds itself, or one that does"));
        }
    }

    /// The float texture with this name for a shape, which may be defined later.
    pub(super) fn late_float_texture(&mut self, name: &str, span: Span) -> FloatTextureId {
        if let Some((_, id)) = self.late_textures.get(name) {
            return *id;
        }
        let id = self.textures.reserve_float();
        self.late_textures.insert(name.to_owned(), (span, id));
        id
    }

    fn fill_late_textures(&mut self, d: &mut Diagnostics) {
        let mut wanted: Vec<_> = std::mem::take(&mut self.late_textures).into_iter().collect();
        wanted.sort_by_key(|(_, (span, _))| *span);
        for (name, (span, reserved)) in wanted {
            if let Some(texture) = self.float_textures.find(&name, span, &self.rgb_textures, d) {
                self.textures.fill_float(reserved, texture);
            }
        }
    }

    fn place_late_instances(&mut self, d: &mut Diagnostics) {
        for LateInstance { name, holder, ctm, span } in std::mem::take(&mut self.late_instances) {
            match (self.object_names.get(&name.text), holder) {
                (Some(&object), None) => self.instances.push(InstanceDesc { object, ctm, span }),
                // Objects contain only earlier ones, so none can contain itself
                (Some(&object), Some(_)) => {
                    let message = format!("object `{}` is defined after the one that holds it", name.text);
                    d.error(name.span, message).label(self.objects[object].span, "defined here");
                }
                (None, _) => {
                    d.unknown(name.span, "object", &name.text, self.object_names.keys().map(String::as_str));
                }
            }
        }
    }
}
