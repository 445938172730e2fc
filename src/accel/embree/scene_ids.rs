//! Conversion of Embree's ids to ids of the scene, and of Embree's hits to exact hits. `query` refines single hits,
//! `exact_hits` blocks of them, and `context` the hits of a tie.

use crate::accel::Hit;
use crate::geometry::triangle::{RayPrecomputed, intersect_triangle};
use crate::geometry::{GeometryId, GeometrySet, Group, Instance, Shape};
use lumiris_numbers::math::{Affine3A, Ray, Vec3};
use std::sync::Arc;

/// A hit reported by Embree.
#[derive(Clone, Copy, Debug)]
pub(super) struct Reported {
    /// `geomID` in the scene that contains the geometry.
    pub geometry: u32,
    /// `primID`.
    pub primitive: u32,
    /// `instID[0]`, or the number of a cluster's instance after all ids of the root; `u32::MAX` in the root.
    pub instance: u32,
    /// Ray parameter.
    pub t: f32,
    /// Parametric position.
    pub uv: [f32; 2],
}

/// Result of the exact computation of a reported hit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Refined {
    /// A hit.
    Hit(Hit),
    /// The exact parameter is not positive: the surface that the ray left.
    Behind,
    /// The exact parameter is not below `t_max`.
    Beyond,
}

/// The numbering of a scene in Embree.
#[derive(Debug)]
pub(super) struct SceneIds {
    /// The scene.
    pub set: Arc<GeometrySet>,
    /// Geometry of each id in Embree's root scene. Instances have the ids after them.
    pub root: Vec<GeometryId>,
    /// Geometry of each id in the scene of each group.
    pub groups: Vec<Vec<GeometryId>>,
    /// Instances in Embree's root scene.
    pub instances: Vec<u32>,
    /// Inverse transforms of static instances.
    group_from_world: Vec<Option<Affine3A>>,
}

impl Refined {
    /// True if this is a hit and [precedes](Hit::precedes) `other`.
    pub(super) fn precedes(&self, other: &Refined) -> bool {
        match (self, other) {
            (Refined::Hit(a), Refined::Hit(b)) => a.precedes(b),
            (Refined::Hit(_), Refined::Behind | Refined::Beyond) => true,
            (Refined::Behind | Refined::Beyond, _) => false,
        }
    }
}

impl SceneIds {
    /// Assigns ids to everything that rays can hit except curves.
    pub(super) fn new(set: Arc<GeometrySet>) -> SceneIds {
        let members = |group: &Group| group.geometries.iter().copied().filter(|&id| can_be_met(&set, id)).collect();
        let groups: Vec<Vec<GeometryId>> = set.groups.iter().map(members).collect();
        let root = members(&set.root);
        let filled = |i: u32| !groups[set.instances[i as usize].group as usize].is_empty();
        let instances =
            (0..set.instances.len() as u32).filter(|&i| filled(i) && set.instances[i as usize].is_usable()).collect();
        let group_from_world = set.instances.iter().map(Instance::group_from_world).collect();
        SceneIds { root, groups, instances, group_from_world, set }
    }

    /// The instance of an `instID`.
    #[inline]
    pub(super) fn instance(&self, inst_id: u32) -> u32 {
        if inst_id == u32::MAX {
            return Hit::NO_INSTANCE;
        }
        match self.instances.get(inst_id as usize - self.root.len()) {
            Some(&instance) => instance,
            None => self.set.instances.len() as u32 + (inst_id - self.first_of_clusters()),
        }
    }

    /// Number of the first instance of a cluster: the ids of Embree's root scene are before it.
    #[inline]
    pub(super) fn first_of_clusters(&self) -> u32 {
        (self.root.len() + self.instances.len()) as u32
    }

    /// The geometry of a `geomID` in `instance`.
    #[inline]
    pub(super) fn geometry(&self, geom_id: u32, instance: u32) -> GeometryId {
        if instance == Hit::NO_INSTANCE {
            return self.root[geom_id as usize];
        }
        self.groups[self.set.group_of(instance) as usize][geom_id as usize]
    }

    /// The ray in the space of the group of `instance`.
    #[inline]
    pub(super) fn group_ray(&self, world: &Ray, instance: u32) -> Ray {
        if instance == Hit::NO_INSTANCE {
            return *world;
        }
        let stored = self.group_from_world.get(instance as usize).copied().flatten();
        let group_from_world = stored.unwrap_or_else(|| self.set.world_from_group_at(instance, world.time).inverse());
        Ray { o: group_from_world.transform_point3(world.o), d: group_from_world.transform_vector3(world.d), ..*world }
    }

    /// The exact hit of `world_ray`: the same arithmetic for any kernel, packet width and processor.
    #[inline]
    pub(super) fn refine(&self, world_ray: &Ray, reported: &Reported) -> Refined {
        let instance = self.instance(reported.instance);
        let geometry = self.geometry(reported.geometry, instance);
        self.refine_primitive(world_ray, geometry, instance, reported)
    }

    /// Like [`Self::refine`], with translated `geomID` and `instID`.
    #[inline]
    pub(super) fn refine_primitive(
        &self,
        ray: &Ray,
        geometry: GeometryId,
        instance: u32,
        reported: &Reported,
    ) -> Refined {
        let primitive = reported.primitive;
        let hit_at = |t: f32, uv| {
            let hit = Hit { t, uv, geometry, primitive, instance };
            if t < ray.t_max { Refined::Hit(hit) } else { Refined::Beyond }
        };
        // Hits of other shapes come from callbacks and are exact already
        let Shape::Mesh(mesh) = &self.set.geometries[geometry as usize].shape else {
            return hit_at(reported.t, reported.uv);
        };
        let group_ray = self.group_ray(ray, instance);
        let triangle = mesh.triangle(primitive as usize);
        let exact = RayPrecomputed::new(&group_ray).and_then(|r| intersect_triangle(&r, triangle, f32::INFINITY));
        match exact {
            Some(hit) => hit_at(hit.t, [hit.b1, hit.b2]),
            None => match beside(&group_ray, triangle) {
                None => hit_at(reported.t, reported.uv),
                Some((t, _)) if t <= 0.0 => Refined::Behind,
                Some((t, uv)) => hit_at(t, uv),
            },
        }
    }
}

/// Hit of a ray that Embree accepts although it exactly passes by an edge of the triangle: the parameter at which it
/// intersects the triangle's plane, and the weights of vertices 1 and 2 of a nearby point of the triangle. `None` if
/// the triangle has no plane.
#[cold]
fn beside(ray: &Ray, triangle: [Vec3; 3]) -> Option<(f32, [f32; 2])> {
    let [p0, p1, p2] = triangle.map(Vec3::as_dvec3);
    let (o, d) = (ray.o.as_dvec3(), ray.d.as_dvec3());
    let (e1, e2) = (p1 - p0, p2 - p0);
    let n = e1.cross(e2);
    let t = n.dot(p0 - o) / n.dot(d);
    let q = o + d * t - p0;
    let b1 = n.dot(q.cross(e2)) / n.length_squared();
    let b2 = n.dot(e1.cross(q)) / n.length_squared();
    let (b1, b2) = (b1.max(0.0), b2.max(0.0));
    let sum = (b1 + b2).max(1.0);
    let found = (t as f32, [(b1 / sum) as f32, (b2 / sum) as f32]);
    (found.0.is_finite() && sum.is_finite()).then_some(found)
}

/// True if the geometry has primitives for Embree and is visible to some ray.
fn can_be_met(set: &GeometrySet, id: GeometryId) -> bool {
    let geometry = &set.geometries[id as usize];
    let count = match &geometry.shape {
        Shape::Mesh(mesh) => mesh.triangle_count(),
        Shape::Quadric(_) => 1,
        Shape::Bilinear(mesh) => mesh.patch_count(),
        // Traced by the pure-Rust hierarchy
        Shape::Curves(_) => 0,
    };
    count > 0 && geometry.visibility.0 & crate::geometry::Visibility::ALL.0 != 0
}
