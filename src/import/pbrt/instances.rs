//! Instances of objects, and of moving or nested parts within them.

use super::descriptions::{InstanceDesc, ObjectDesc};
use super::layout::{Groups, Layout};
use super::make_shapes::placed_quadric;
use crate::geometry::{ClusterId, Clusters, Group, GroupId, Instance, Member, Shape};
use lumiris_formats::source::Span;
use lumiris_numbers::math::origin::rebased;
use lumiris_numbers::math::transform::{compose_placements, swaps_handedness};
use lumiris_numbers::math::{Affine3A, DAffine3, DVec3};

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
    /// The groups of static shapes, by object.
    pub groups: &'a [Group],
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
    pub clusters: Clusters,
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
            Some(Shape::Quadric(placed.with_flip(placed.flip_normal ^ reverse)))
        }
        Shape::Curves(_) => None,
    }
}

impl Objects<'_> {
    /// The instances of groups that these instances of objects expand to, and the clusters, which are not expanded.
    ///
    /// Returns `Err` with a message if they are too many.
    pub(super) fn place(&self, instances: Vec<InstanceDesc>) -> Result<Placed, String> {
        // Clusters
        let layout = Layout::new(self.objects, &self.own_groups(), &instances)?;
        let mut placed = Placed::default();
        placed.instances.reserve(layout.stored.instances as usize);
        let mut clusters: Vec<Option<ClusterId>> = vec![None; self.objects.len()];
        for object in layout.clusters {
            clusters[object] = Some(placed.clusters.add(self.members(object)));
        }

        // Instances and places
        for InstanceDesc { object, ctm, span } in instances {
            let outer = ctm.samples(self.shutter).iter().map(|m| rebased(m, self.origin, DVec3::ZERO)).collect();
            let nested = Nested { object, outer, is_fixed: ctm.is_fixed() };
            self.expand(nested, &clusters, |part, placements| match part {
                Part::Cluster(cluster) => placed.clusters.place(cluster, placements[0]),
                Part::Group(group) => {
                    let world_from_group = placements.iter().map(DAffine3::as_affine3a).collect();
                    placed.push(Instance { group, world_from_group }, span);
                }
            });
        }
        Ok(placed)
    }

    /// By object, the groups of its shapes. Curves do not matter here.
    fn own_groups(&self) -> Vec<Groups> {
        let of_object = |moving: &Vec<MovingGroup>| Groups {
            count: 1 + moving.len() as u64,
            with_curves: 0,
            is_moving: moving.iter().any(|group| group.placements.len() > 1),
        };
        self.moving.iter().map(of_object).collect()
    }

    /// The groups of an object and of those within it.
    fn members(&self, object: usize) -> Vec<Member> {
        let mut members = Vec::new();
        let nested = Nested { object, outer: vec![DAffine3::IDENTITY], is_fixed: true };
        self.expand(nested, &[], |part, placements| {
            if let Part::Group(group) = part {
                members.push(Member { group, cluster_from_group: placements[0] });
            }
        });
        members
    }

    /// Calls `visit` with the parts of an object and their transforms. `clusters` are those of objects, if there are
    /// any.
    fn expand(&self, nested: Nested, clusters: &[Option<ClusterId>], mut visit: impl FnMut(Part, Vec<DAffine3>)) {
        // Iterative, since the nesting depth of objects is unlimited
        let mut open = vec![nested];
        while let Some(Nested { object, outer, is_fixed }) = open.pop() {
            if let Some(Some(cluster)) = clusters.get(object).filter(|_| is_fixed) {
                visit(Part::Cluster(*cluster), outer);
                continue;
            }
            for MovingGroup { group, placements } in &self.moving[object] {
                visit(Part::Group(*group), compose_placements(&outer, placements));
            }
            open.extend(self.objects[object].instances.iter().map(|i| Nested {
                object: i.object,
                outer: compose_placements(&outer, &i.ctm.samples(self.shutter)),
                is_fixed: is_fixed && i.ctm.is_fixed(),
            }));
            if !self.groups[object].geometries.is_empty() {
                visit(Part::Group(object as GroupId), outer);
            }
        }
    }
}

/// An instance of an object within others.
struct Nested {
    object: usize,
    outer: Vec<DAffine3>,
    /// True if neither this nor an outer instance moves or is singular.
    is_fixed: bool,
}

/// A part of an object.
enum Part {
    Group(GroupId),
    Cluster(ClusterId),
}
