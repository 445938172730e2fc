//! All geometry of a scene: what a ray tracer is built from.
//!
//! A [`GeometrySet`] has a root group of geometries in world space, and instances of other groups.
//! Instances do not nest.

use super::Shape;
use crate::math::{Affine3A, Bounds3};

/// Index into [`GeometrySet::geometries`].
pub type GeometryId = u32;
/// Index into [`GeometrySet::groups`].
pub type GroupId = u32;

/// Which rays a geometry stops; a bit set.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Visibility(pub u32);

impl Visibility {
    /// Camera rays and the rays of path segments (closest-hit queries).
    pub const PATH: Visibility = Visibility(1);
    /// Shadow segments (occlusion queries).
    pub const SHADOW: Visibility = Visibility(2);
    /// Both.
    pub const ALL: Visibility = Visibility(3);
}

/// A shape with what a ray tracer must know of it.
#[derive(Clone, Debug)]
pub struct Geometry {
    /// The shape, in the space of its group.
    pub shape: Shape,
    /// Cut-outs: index of a float texture whose value is the probability that a ray is stopped.
    pub alpha: Option<u32>,
    /// Rays that it stops.
    pub visibility: Visibility,
}

/// Geometries that are placed together.
#[derive(Clone, Debug, Default)]
pub struct Group {
    /// Members.
    pub geometries: Vec<GeometryId>,
}

/// A placement of a group.
#[derive(Clone, Debug)]
pub struct Instance {
    /// What is placed.
    pub group: GroupId,
    /// Placement at equidistant times 0..=1; one entry if it does not move. Between entries each matrix element
    /// is interpolated linearly.
    pub world_from_group: Vec<Affine3A>,
}

impl Instance {
    /// Placement at `time` in 0..=1.
    pub fn world_from_group_at(&self, time: f32) -> Affine3A {
        let last = self.world_from_group.len() - 1;
        if last == 0 {
            return self.world_from_group[0];
        }
        let x = time.clamp(0.0, 1.0) * last as f32;
        let i = (x as usize).min(last - 1);
        crate::math::transform::lerp_affine(&self.world_from_group[i], &self.world_from_group[i + 1], x - i as f32)
    }
}

/// All geometry of a scene. Ids are indices.
#[derive(Clone, Debug, Default)]
pub struct GeometrySet {
    /// Every geometry of every group.
    pub geometries: Vec<Geometry>,
    /// Groups that instances place.
    pub groups: Vec<Group>,
    /// What stands in world space without an instance.
    pub root: Group,
    /// Placements.
    pub instances: Vec<Instance>,
}

impl GeometrySet {
    /// Bounds of a group in its own space.
    pub fn group_bounds(&self, group: &Group) -> Bounds3 {
        group.geometries.iter().fold(Bounds3::EMPTY, |b, &id| b.union(self.geometries[id as usize].shape.bounds()))
    }

    /// Bounds of everything in world space, over all times.
    pub fn world_bounds(&self) -> Bounds3 {
        let group_bounds: Vec<Bounds3> = self.groups.iter().map(|g| self.group_bounds(g)).collect();
        let placed = self.instances.iter().flat_map(|i| {
            let b = group_bounds[i.group as usize];
            i.world_from_group.iter().map(move |m| b.transformed(m))
        });
        placed.fold(self.group_bounds(&self.root), Bounds3::union)
    }

    /// Number of primitives as stored: (triangles, quadrics, bilinear patches).
    pub fn primitive_counts(&self) -> (usize, usize, usize) {
        self.geometries.iter().fold((0, 0, 0), |(t, q, b), g| match &g.shape {
            Shape::Mesh(m) => (t + m.triangle_count(), q, b),
            Shape::Quadric(_) => (t, q + 1, b),
            Shape::Bilinear(m) => (t, q, b + m.patch_count()),
        })
    }
}
