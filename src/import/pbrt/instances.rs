//! Instances of objects, and of moving or nested parts within them.

use super::descriptions::{InstanceDesc, ObjectDesc};
use super::make_shapes::placed_quadric;
use crate::geometry::{GroupId, Instance, Quadric, Shape};
use lumiris_formats::source::Span;
use lumiris_numbers::math::origin::rebased;
use lumiris_numbers::math::transform::{compose_placements, swaps_handedness};
use lumiris_numbers::math::{Affine3A, DAffine3, DVec3};

/// Maximum number of instances of groups in a scene.
pub(super) const MAX_INSTANCES: u64 = 100_000_000;

/// A group that moves within an object, or is far from its origin.
pub(super) struct MovingGroup {
    pub group: GroupId,
    /// Its transforms.
    pub placements: Vec<DAffine3>,
}

/// The objects of a scene. The static part of an object is a group with the object's index.
pub(super) struct Objects<'a> {
    /// Objects; each contains only earlier ones.
    pub objects: &'a [ObjectDesc],
    /// By object, groups that move within it or are far from its origin.
    pub moving: &'a [Vec<MovingGroup>],
    /// Opening and closing of the shutter, as fractions of the motion.
    pub shutter: [f32; 2],
    /// The point of world space that is the origin of rendered space.
    pub origin: DVec3,
}

/// Transforms to rendered space, for a group whose space has its own origin.
pub(super) fn rendered(placements: &[DAffine3], origin: DVec3, of_group: DVec3) -> Vec<Affine3A> {
    placements.iter().map(|m| rebased(m, origin, of_group).as_affine3a()).collect()
}

/// Instances of groups.
#[derive(Default)]
pub(super) struct Placed {
    pub instances: Vec<Instance>,
    /// Singular instances.
    pub flat: Vec<FlatInstance>,
}

/// A singular instance, which ray tracers do not support: it flattens its group.
pub(super) struct FlatInstance {
    pub instance: Instance,
    /// Source position.
    pub span: Span,
}

impl Placed {
    fn push(&mut self, instance: Instance, span: Span) {
        let has_inverse = |m: &Affine3A| m.matrix3.determinant() != 0.0 && m.inverse().is_finite();
        if instance.world_from_group.iter().all(has_inverse) {
            self.instances.push(instance);
        } else {
            self.flat.push(FlatInstance { instance, span });
        }
    }
}

/// The shape in world space flattened by a singular transform; `None` if it cannot be flat.
pub(super) fn flattened(shape: &Shape, world_from_group: &Affine3A) -> Option<Shape> {
    match shape {
        Shape::Mesh(mesh) => Some(Shape::Mesh(mesh.transformed(world_from_group))),
        Shape::Bilinear(patches) => Some(Shape::Bilinear(patches.transformed(world_from_group))),
        Shape::Quadric(q) => {
            let placed = placed_quadric(q.kind, &(*world_from_group * q.group_from_local))?;
            let reverse = q.flip_normal ^ swaps_handedness(&q.group_from_local);
            Some(Shape::Quadric(Quadric { flip_normal: placed.flip_normal ^ reverse, ..placed }))
        }
        Shape::Curves(_) => None,
    }
}

impl Objects<'_> {
    /// The instances of groups that these instances of objects expand to.
    ///
    /// Returns `Err` with a message if they are too many.
    pub(super) fn place(&self, instances: Vec<InstanceDesc>) -> Result<Placed, String> {
        // Number of instances
        let mut sizes: Vec<u64> = Vec::new();
        for (object, moving) in self.objects.iter().zip(self.moving) {
            let nested = object.instances.iter().map(|i| sizes[i.object]).fold(0, u64::saturating_add);
            sizes.push(nested.saturating_add(1 + moving.len() as u64));
        }
        let all = instances.iter().map(|i| sizes[i.object]).fold(0, u64::saturating_add);
        if all > MAX_INSTANCES {
            return Err(format!("objects within objects make {all} instances; at most {MAX_INSTANCES} are"));
        }

        // Expand
        let mut placed = Placed { instances: Vec::with_capacity(all as usize), flat: Vec::new() };
        for asked in instances {
            // Iterative, since the nesting depth of objects is unlimited
            let mut open = vec![(asked.object, asked.ctm.samples(self.shutter))];
            while let Some((object, placement)) = open.pop() {
                let instance = |group: GroupId, placement: &[DAffine3]| Instance {
                    group,
                    world_from_group: rendered(placement, self.origin, DVec3::ZERO),
                };
                for MovingGroup { group, placements } in &self.moving[object] {
                    placed.push(instance(*group, &compose_placements(&placement, placements)), asked.span);
                }
                let within = |i: &InstanceDesc| compose_placements(&placement, &i.ctm.samples(self.shutter));
                open.extend(self.objects[object].instances.iter().map(|i| (i.object, within(i))));
                placed.push(instance(object as GroupId, &placement), asked.span);
            }
        }
        Ok(placed)
    }
}
