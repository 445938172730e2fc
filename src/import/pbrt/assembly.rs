//! The geometry of a scene from shapes and instances, in text order.

use super::descriptions::{AreaLightDesc, InstanceDesc, ShapeDesc};
use super::instances::{MovingGroup, Objects, flattened, rendered};
use super::lights::power_factor;
use super::make_shapes::{Made, ShapeError, ShapeMaker};
use super::media::MediaInUse;
use super::state::Builder;
use super::transform::Ctm;
use crate::geometry::{Geometry, GeometryId, GeometrySet, Group, GroupId, Instance, Shape, Visibility};
use crate::lights::{Emission, EmissionImage, area_lights_of};
use crate::materials::{Material, MaterialId};
use crate::scene::Surface;
use lumiris_formats::diagnostic::Diagnostics;
use lumiris_formats::source::Span;
use lumiris_numbers::math::origin::rebased;
use lumiris_numbers::math::{DAffine3, DMat4, DVec3, Rgb};
use rayon::prelude::*;
use std::collections::HashMap;
use std::path::PathBuf;
use std::sync::Arc;

/// The common state of shapes in a group that moves.
#[derive(PartialEq)]
struct Together {
    object: Option<usize>,
    motion: Ctm,
    /// The origin of the group in its object or in the world.
    origin: DVec3,
}

/// An emitting shape.
pub(super) struct Emitter {
    pub geometry: GeometryId,
    pub emission: Emission,
    /// Light group.
    pub group: Option<Arc<str>>,
}

/// Geometry during assembly.
#[derive(Default)]
pub(super) struct Assembly {
    pub set: GeometrySet,
    pub surfaces: Vec<Surface>,
    pub emitters: Vec<Emitter>,
    pub media: MediaInUse,
    /// Opening and closing of the shutter as fractions of the motion.
    shutter: [f32; 2],
    /// Images that area lights emit.
    images: HashMap<PathBuf, Arc<EmissionImage>>,
    /// By object, groups that move within it or are far from its origin.
    moving: Vec<Vec<MovingGroup>>,
    /// The last group that moves.
    last_moving: Option<(Together, GroupId)>,
    /// Groups far from the origin of their object, by the index of the object and their own origin.
    far: HashMap<(usize, [u64; 3]), GroupId>,
}

impl Assembly {
    /// No shapes, and a group for the static shapes of each object.
    pub(super) fn new(
        objects: usize,
        shutter: [f32; 2],
        images: HashMap<PathBuf, Arc<EmissionImage>>,
        media: MediaInUse,
    ) -> Self {
        let mut assembly = Assembly { shutter, images, media, ..Assembly::default() };
        assembly.set.groups.resize_with(objects, Group::default);
        assembly.moving.resize_with(objects, Vec::new);
        assembly
    }

    /// The group of static shapes in an object that have this origin.
    fn in_object(&mut self, object: usize, origin: DVec3) -> GroupId {
        if origin == DVec3::ZERO {
            return object as GroupId;
        }
        *self.far.entry((object, origin.to_array().map(f64::to_bits))).or_insert_with(|| {
            let group = self.set.groups.len() as GroupId;
            self.set.groups.push(Group::default());
            self.moving[object].push(MovingGroup { group, placements: vec![DAffine3::from_translation(origin)] });
            group
        })
    }

    /// Adds the shapes of a singular instance to the root.
    fn add_flat(&mut self, instance: &Instance, span: Span, d: &mut Diagnostics) {
        let [world_from_group] = instance.world_from_group[..] else {
            d.error(span, "an object cannot be flattened while it moves");
            return;
        };

        // Copies of the shapes, in world space
        let mut is_flat = true;
        for id in self.set.groups[instance.group as usize].geometries.clone() {
            let Geometry { shape, alpha, visibility } = &self.set.geometries[id as usize];
            let Some(shape) = flattened(shape, &world_from_group) else {
                is_flat = false;
                continue;
            };
            let geometry = Geometry { shape, alpha: *alpha, visibility: *visibility };
            self.set.root.geometries.push(self.set.geometries.len() as GeometryId);
            self.set.geometries.push(geometry);
            self.surfaces.push(self.surfaces[id as usize].clone());
        }
        if !is_flat {
            let message =
                "spheres, cylinders and curves of the object cannot be flattened: the transformation has no inverse";
            d.error(span, message);
        }
    }
}

/// Shapes that were made before the others, by their indices.
pub(super) type MadeEarly = HashMap<usize, Result<Made, ShapeError>>;

/// Number of shapes that are described and made at the same time.
const BLOCK: usize = 1 << 12;

impl Builder<'_> {
    /// Moves the shapes of objects that have one instance, without motion, to the place of the instance. So they need
    /// no group, and no acceleration structure of their own.
    pub(super) fn place_single_objects(&mut self, shapes: &mut [ShapeDesc]) {
        // Objects with one instance
        let mut counts = vec![0_u32; self.objects.len()];
        let nested = self.objects.iter().flat_map(|object| &object.instances);
        nested.chain(&self.instances).for_each(|instance| counts[instance.object] += 1);
        let mut placements: Vec<Option<DMat4>> = vec![None; self.objects.len()];
        for InstanceDesc { object, ctm, .. } in &self.instances {
            let is_single = counts[*object] == 1 && self.objects[*object].instances.is_empty();
            placements[*object] = Some(ctm.start).filter(|_| is_single && !ctm.is_moving() && ctm.is_invertible());
        }
        for shape in shapes.iter().filter(|shape| !shape.can_leave_object()) {
            shape.object.inspect(|&object| placements[object] = None);
        }

        // Their shapes
        for shape in shapes {
            let Some(placement) = shape.object.and_then(|object| placements[object]) else { continue };
            shape.ctm = shape.ctm.within(&placement);
            shape.object = None;
        }
        self.instances.retain(|instance| placements[instance.object].is_none());
        self.instances.shrink_to_fit();
    }

    /// Makes the shapes and places them in text order. Blocks of them are made in parallel, so that most are in memory
    /// either as a description or as geometry.
    pub(super) fn place_shapes(
        &self,
        assembly: &mut Assembly,
        shapes: Vec<ShapeDesc>,
        mut made_early: MadeEarly,
        maker: &ShapeMaker<'_>,
        d: &mut Diagnostics,
    ) {
        // Displacements need all textures
        let has_textures = !d.has_errors();
        let mut rest = shapes.into_iter().enumerate();
        loop {
            // Make a block
            let mut block: Vec<(usize, ShapeDesc)> = rest.by_ref().take(BLOCK).collect();
            if block.is_empty() {
                return;
            }
            let make = |(i, desc): &mut (usize, ShapeDesc)| {
                let can_be_made = !made_early.contains_key(i) && (has_textures || desc.displacement.is_none());
                can_be_made.then(|| maker.make(desc))
            };
            let made: Vec<_> = block.par_iter_mut().map(make).collect();

            // Place it
            for ((i, desc), made) in block.iter().zip(made) {
                if let Some(made) = made.or_else(|| made_early.remove(i)) {
                    self.place_or_report(assembly, desc, made, d);
                }
            }
        }
    }

    fn place_or_report(
        &self,
        assembly: &mut Assembly,
        desc: &ShapeDesc,
        made: Result<Made, ShapeError>,
        d: &mut Diagnostics,
    ) {
        // The material first, so that its errors are reported even if the shape has some
        let material = self.material_of(&desc.material, d);
        match (made, material) {
            (Ok(mut made), Some(material)) => {
                for warning in made.warnings.drain(..) {
                    d.warning_first(desc.span, warning);
                }
                self.place(assembly, desc, made, material, d);
            }
            (Err(ShapeError::Missing(path, reason)), _) => d.missing_file(path, reason, Some(desc.span)),
            (Err(ShapeError::Wrong(reason)), _) => {
                d.error(desc.span, reason);
            }
            (Ok(_), None) => {}
        }
    }

    /// Adds the shapes of one description to their group, to the root, or to an instance of their own if they move.
    fn place(&self, assembly: &mut Assembly, desc: &ShapeDesc, made: Made, material: MaterialId, d: &mut Diagnostics) {
        let sides = assembly.media.sides(&desc.media, material);
        let passes = matches!(self.materials[material as usize].material, Material::Interface);
        let light = desc.area_light.as_deref().filter(|light| emits(desc, light, passes, d));

        // Geometries, surfaces and emitters
        let first = assembly.set.geometries.len() as GeometryId;
        for shape in made.shapes {
            if passes && light.is_none() && sides.is_none() {
                // No scattering, and the same medium on both sides: rays need not stop
                continue;
            }
            let geometry = assembly.set.geometries.len() as GeometryId;
            assembly.emitters.extend(light.map(|light| {
                let emission = emission_of(light, &shape, &assembly.images);
                Emitter { geometry, emission, group: light.group.clone() }
            }));
            assembly.set.geometries.push(Geometry { shape, alpha: desc.alpha, visibility: Visibility::ALL });
            assembly.surfaces.push(Surface { material, name: Arc::clone(&desc.name), sides });
        }

        // Their group
        let ids = first..assembly.set.geometries.len() as GeometryId;
        let group = match (desc.object, desc.ctm.is_moving()) {
            (Some(object), false) => Some(assembly.in_object(object, made.origin)),
            (None, false) => None,
            (object, true) => Some(self.moving_group(assembly, object, desc.ctm.motion(), made.origin)),
        };
        let set = &mut assembly.set;
        group.map_or(&mut set.root, |group| &mut set.groups[group as usize]).geometries.extend(ids);
    }

    /// The last group that moves, if it is in the same object and moves alike; otherwise a new one.
    fn moving_group(&self, assembly: &mut Assembly, object: Option<usize>, motion: Ctm, origin: DVec3) -> GroupId {
        let together = Together { object, motion, origin };
        if let Some((_, group)) = assembly.last_moving.as_ref().filter(|(last, _)| *last == together) {
            return *group;
        }

        // Group, in the object or in an instance of its own
        let group = assembly.set.groups.len() as GroupId;
        assembly.set.groups.push(Group::default());
        let samples = together.motion.samples(assembly.shutter);
        match object {
            Some(object) => {
                let placements = samples.iter().map(|m| rebased(m, DVec3::ZERO, origin)).collect();
                assembly.moving[object].push(MovingGroup { group, placements });
            }
            None => {
                let world_from_group = rendered(&samples, self.origin, origin);
                assembly.set.instances.push(Instance { group, world_from_group });
            }
        }
        assembly.last_moving = Some((together, group));
        group
    }

    /// Adds the instances of objects.
    pub(super) fn place_instances(&mut self, assembly: &mut Assembly, d: &mut Diagnostics) {
        let instances = std::mem::take(&mut self.instances);
        let (moving, shutter) = (&assembly.moving, assembly.shutter);
        let groups = &assembly.set.groups[..];
        let objects = Objects { objects: &self.objects, groups, moving, shutter, origin: self.origin };
        match objects.place(instances) {
            Ok(placed) => {
                assembly.set.instances.extend(placed.instances);
                assembly.set.clusters = placed.clusters;
                placed.flat.iter().for_each(|flat| assembly.add_flat(&flat.instance, flat.span, d));
            }
            Err(reason) => {
                d.error_without_place(reason);
            }
        }
    }
}

/// True if a shape with an area light emits; reports why it does not.
fn emits(desc: &ShapeDesc, light: &AreaLightDesc, passes: bool, d: &mut Diagnostics) -> bool {
    let reason = match (desc.object, desc.ctm.is_moving()) {
        (Some(_), _) => "area lights in objects are not rendered, as in pbrt-v4: the shape is dark",
        (None, true) => "moving area lights are not rendered, as in pbrt-v4: the shape is dark",
        (None, false) if passes => "a surface that only bounds a medium does not emit, as in pbrt-v4",
        (None, false) => return true,
    };
    d.warning_once(light.span, reason);
    false
}

/// The emission of a shape in world space.
fn emission_of(light: &AreaLightDesc, shape: &Shape, images: &HashMap<PathBuf, Arc<EmissionImage>>) -> Emission {
    let image = light.image.as_ref().and_then(|(path, _)| images.get(path).cloned());
    let mut emission = Emission { two_sided: light.two_sided, image, ..Emission::constant(light.l) };
    if light.power > 0.0 {
        let area = area_lights_of(shape, &emission).lights.iter().map(|l| l.area()).sum();
        // The image replaces the colour: pbrt-v4 uses white here.
        let white = Emission { l: Rgb::WHITE, ..emission.clone() };
        emission.l *= power_factor(light, area, white.mean_luminance());
    }
    emission
}
