//! All geometry of a scene: the input of a ray tracer.
//!
//! A [`GeometrySet`] has a root group of geometries in world space, and instances of other groups. Instances do not
//! nest, but many of them may be stored as places of [clusters](Clusters). Those have the ids after all others.

use super::clusters::{Clusters, GroupId, Member};
use super::hit::SurfaceHit;
use super::shape::Shape;
use lumiris_numbers::math::transform::transform_at;
use lumiris_numbers::math::{Affine3A, Bounds3, Ray, Vec3};
use rayon::prelude::*;
use std::borrow::Cow;

/// Index into [`GeometrySet::geometries`].
pub type GeometryId = u32;

/// The instance index of the root group.
pub const NO_INSTANCE: u32 = u32::MAX;

/// The kinds of rays that a geometry stops; a bit set.
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

/// A shape with its properties for ray tracing.
#[derive(Clone, Debug)]
pub struct Geometry {
    /// The shape, in the space of its group.
    pub shape: Shape,
    /// Alpha texture: index of a float texture whose value is the probability that a ray is stopped.
    pub alpha: Option<u32>,
    /// Rays that it stops.
    pub visibility: Visibility,
}

/// Geometries that are instanced together.
#[derive(Clone, Debug, Default)]
pub struct Group {
    /// Members.
    pub geometries: Vec<GeometryId>,
}

/// An instance of a group.
#[derive(Clone, Debug)]
pub struct Instance {
    /// The group.
    pub group: GroupId,
    /// Transforms at equidistant times 0..=1; one entry if the instance does not move. Matrix elements are interpolated
    /// linearly between entries.
    pub world_from_group: Vec<Affine3A>,
}

impl Instance {
    /// Transform at `time` in 0..=1.
    pub fn world_from_group_at(&self, time: f32) -> Affine3A {
        transform_at(&self.world_from_group, time)
    }

    /// The inverse transform; `None` if the instance moves.
    pub fn group_from_world(&self) -> Option<Affine3A> {
        (self.world_from_group.len() == 1).then(|| self.world_from_group[0].inverse())
    }

    /// True if rays can be traced through it: its transforms are finite, and invertible if it is static.
    pub fn is_usable(&self) -> bool {
        let flat = self.group_from_world().is_some_and(|inverse| !inverse.is_finite());
        !self.world_from_group.is_empty() && !flat && self.world_from_group.iter().all(Affine3A::is_finite)
    }
}

/// All geometry of a scene. Ids are indices.
#[derive(Clone, Debug, Default)]
pub struct GeometrySet {
    /// Every geometry of every group.
    pub geometries: Vec<Geometry>,
    /// Groups for instancing.
    pub groups: Vec<Group>,
    /// Geometries in world space, without an instance.
    pub root: Group,
    /// Instances.
    pub instances: Vec<Instance>,
    /// Instances that are stored as places of clusters.
    pub clusters: Clusters,
}

impl GeometrySet {
    /// Bounds of a group in its own space.
    pub fn group_bounds(&self, group: &Group) -> Bounds3 {
        let bounds = group.geometries.par_iter().map(|&id| self.geometries[id as usize].shape.bounds());
        bounds.reduce(|| Bounds3::EMPTY, Bounds3::union)
    }

    /// Bounds of everything in world space, over all times.
    pub fn world_bounds(&self) -> Bounds3 {
        let group_bounds: Vec<Bounds3> = self.groups.iter().map(|g| self.group_bounds(g)).collect();
        let placed = self.instances.iter().flat_map(|i| {
            let b = group_bounds[i.group as usize];
            i.world_from_group.iter().map(move |m| b.transformed(m))
        });
        let all = placed.fold(self.group_bounds(&self.root), Bounds3::union);

        // An instance of each place, then those of places that are not within the bounds so far: most are
        let bounds_of =
            |i| group_bounds[self.clusters.group(i) as usize].transformed(&self.clusters.world_from_group(i));
        let places = self.clusters.places();
        let mut all = places.iter().map(|place| bounds_of(place.first)).fold(all, Bounds3::union);
        let cluster_bounds = self.cluster_bounds(&group_bounds);
        for place in places {
            let around = place.bounds(&cluster_bounds);
            if !(all.contains(around.min) && all.contains(around.max)) {
                all = self.clusters.instances_of(place).map(bounds_of).fold(all, Bounds3::union);
            }
        }
        all
    }

    /// Bounds of the clusters in their own spaces, from those of the groups.
    pub fn cluster_bounds(&self, group_bounds: &[Bounds3]) -> Vec<Bounds3> {
        let bounds_of = |members: &Vec<Member>| {
            let placed = members.iter().map(|member| {
                group_bounds[member.group as usize].transformed(&member.cluster_from_group.as_affine3a())
            });
            placed.fold(Bounds3::EMPTY, Bounds3::union)
        };
        self.clusters.clusters().iter().map(bounds_of).collect()
    }

    /// True if there are instances.
    pub fn has_instances(&self) -> bool {
        self.instance_count() > 0
    }

    /// The group of an instance.
    pub fn group_of(&self, instance: u32) -> GroupId {
        match self.instances.get(instance as usize) {
            Some(instance) => instance.group,
            None => self.clusters.group(instance - self.instances.len() as u32),
        }
    }

    /// Transform of an instance at `time` in 0..=1.
    pub fn world_from_group_at(&self, instance: u32, time: f32) -> Affine3A {
        match self.instances.get(instance as usize) {
            Some(instance) => instance.world_from_group_at(time),
            None => self.clusters.world_from_group(instance - self.instances.len() as u32),
        }
    }

    /// An instance, stored or of a cluster.
    pub fn instance(&self, instance: u32) -> Cow<'_, Instance> {
        let of_cluster = || {
            let world_from_group = vec![self.world_from_group_at(instance, 0.0)];
            Cow::Owned(Instance { group: self.group_of(instance), world_from_group })
        };
        self.instances.get(instance as usize).map_or_else(of_cluster, Cow::Borrowed)
    }

    /// Number of instances, with those of clusters.
    pub fn instance_count(&self) -> u32 {
        self.instances.len() as u32 + self.clusters.instance_count()
    }

    /// True if an instance moves, so that time matters.
    pub fn has_motion(&self) -> bool {
        self.instances.iter().any(|i| i.world_from_group.len() > 1)
    }

    /// The surface in world space at the parametric position `uv` of a hit; `instance` is [`NO_INSTANCE`] in the root
    /// group. Not valid for curves, which depend on the ray, see [`Self::surface_hit_of_ray`].
    pub fn surface_hit(
        &self,
        geometry: GeometryId,
        primitive: u32,
        instance: u32,
        uv: [f32; 2],
        time: f32,
    ) -> SurfaceHit {
        let ray = Ray { o: Vec3::ZERO, d: Vec3::Z, t_max: f32::INFINITY, time };
        self.surface_hit_of_ray(geometry, primitive, instance, uv, &ray)
    }

    /// The surface in world space at a hit of `ray`; only its direction and time are used.
    pub fn surface_hit_of_ray(
        &self,
        geometry: GeometryId,
        primitive: u32,
        instance: u32,
        uv: [f32; 2],
        ray: &Ray,
    ) -> SurfaceHit {
        let shape = &self.geometries[geometry as usize].shape;
        if instance == NO_INSTANCE {
            return shape.surface_hit(primitive, uv, ray.d);
        }
        let world_from_group = self.world_from_group_at(instance, ray.time);
        let d = match shape {
            Shape::Curves(_) => world_from_group.inverse().transform_vector3(ray.d),
            Shape::Mesh(_) | Shape::Quadric(_) | Shape::Bilinear(_) => ray.d,
        };
        shape.surface_hit(primitive, uv, d).transformed(&world_from_group)
    }

    /// Numbers of stored primitives.
    pub fn primitive_counts(&self) -> PrimitiveCounts {
        let mut counts = PrimitiveCounts::default();
        for geometry in &self.geometries {
            match &geometry.shape {
                Shape::Mesh(mesh) => counts.triangles += mesh.triangle_count(),
                Shape::Quadric(_) => counts.quadrics += 1,
                Shape::Bilinear(mesh) => counts.patches += mesh.patch_count(),
                Shape::Curves(set) => {
                    counts.curves += set.curves().len();
                    counts.curve_pieces += set.piece_count();
                }
            }
        }
        counts
    }
}

/// Numbers of primitives.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct PrimitiveCounts {
    /// Triangles.
    pub triangles: usize,
    /// Quadrics.
    pub quadrics: usize,
    /// Bilinear patches.
    pub patches: usize,
    /// Curves.
    pub curves: usize,
    /// Pieces of curves in the ray tracers.
    pub curve_pieces: usize,
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::TriangleMesh;
    use lumiris_numbers::math::Vec3;

    #[test]
    fn surface_hits_of_instances_follow_their_motion() {
        let mesh = TriangleMesh::new(vec![Vec3::ZERO, Vec3::X, Vec3::Y], vec![[0, 1, 2]]).unwrap();
        let shift = |x: f32| Affine3A::from_translation(Vec3::new(x, 0.0, 0.0));
        let mirror = Affine3A::from_scale(Vec3::new(1.0, 1.0, -2.0));
        let set = GeometrySet {
            geometries: vec![Geometry { shape: Shape::Mesh(mesh), alpha: None, visibility: Visibility::ALL }],
            groups: vec![Group { geometries: vec![0] }],
            root: Group { geometries: vec![0] },
            instances: vec![
                Instance { group: 0, world_from_group: vec![shift(0.0), shift(1.0), shift(5.0)] },
                Instance { group: 0, world_from_group: vec![mirror] },
            ],
            ..GeometrySet::default()
        };
        let at = |instance, time| set.surface_hit(0, 0, instance, [0.25, 0.25], time);
        assert_eq!(at(NO_INSTANCE, 0.5).p, Vec3::new(0.25, 0.25, 0.0));
        for (time, x) in [(0.0, 0.25), (0.5, 1.25), (0.75, 3.25), (1.0, 5.25)] {
            let hit = at(0, time);
            assert!((hit.p.x - x).abs() < 1e-6 && hit.n == Vec3::Z);
            assert!(hit.p_error.x > 0.0);
        }
        // A reflecting instance reflects the normal, too.
        assert_eq!(at(1, 0.0).n, -Vec3::Z);
    }
}
