//! The two-level hierarchy and its construction.

use super::build::{LeafKind, PrimRef, build_binary};
use super::tree::Tree;
use crate::accel::{AccelStats, AlphaTest};
use crate::geometry::{AlphaSource, Geometry, GeometrySet, Group, Instance, Shape, Visibility};
use lumiris_numbers::math::{Affine3A, Bounds3, Vec3};
use rayon::prelude::*;
use std::sync::Arc;
use std::time::Instant;

/// The two-level hierarchy of a scene's geometry.
pub struct Bvh {
    pub(super) geometry: Arc<GeometrySet>,
    pub(super) alpha: Option<AlphaTest>,
    /// Visibility bits of each geometry, and [`TESTED`] if it has an alpha mask.
    pub(super) flags: Vec<u32>,
    pub(super) root: Tree,
    pub(super) groups: Vec<Tree>,
    /// Inverse transforms of static instances.
    pub(super) group_from_world: Vec<Option<Affine3A>>,
    pub(super) stats: AccelStats,
}

/// Flag of a geometry whose hits need the alpha test.
pub(super) const TESTED: u32 = 1 << 31;

impl Bvh {
    /// Builds the trees in parallel. The result does not depend on the number of threads. Without `alpha`, alpha masks
    /// are opaque.
    pub fn new(geometry: Arc<GeometrySet>, alpha: Option<Arc<dyn AlphaSource>>) -> Bvh {
        Self::of_shapes(geometry, alpha, |_| true)
    }

    /// Like [`Self::new`], for the shapes for which `is_wanted` is true.
    pub(in crate::accel) fn of_shapes(
        geometry: Arc<GeometrySet>,
        alpha: Option<Arc<dyn AlphaSource>>,
        is_wanted: impl Fn(&Shape) -> bool + Sync,
    ) -> Bvh {
        // Trees of the groups
        let start = Instant::now();
        let flags = geometry.geometries.iter().map(|g| flags_of(g, alpha.is_some())).collect();
        let leaf_kinds: Vec<LeafKind> = geometry.geometries.iter().map(|g| leaf_kind(&g.shape)).collect();
        let build = |prims| build_tree(&geometry, &leaf_kinds, prims);
        let prims_of = |group| group_prims(&geometry, group, &is_wanted);
        let built: Vec<BuiltTree> = geometry.groups.par_iter().map(|group| build(prims_of(group))).collect();
        let group_bounds: Vec<Bounds3> = built.iter().map(|b| b.tree.bounds).collect();

        // Tree of the root
        let mut prims = prims_of(&geometry.root);
        prims.extend(instance_prims(&geometry, &group_bounds));
        let root = build(prims);

        // Transforms and memory
        let group_from_world: Vec<Option<Affine3A>> =
            geometry.instances.iter().map(Instance::group_from_world).collect();
        let group_bytes: u64 = built.iter().map(|b| b.tree.bytes()).sum();
        let group_peak: u64 = built.iter().map(|b| b.peak_bytes).sum();
        let bytes = group_bytes + root.tree.bytes() + size_of_val(&group_from_world[..]) as u64;
        let peak_bytes = bytes.max(group_peak).max(group_bytes + root.peak_bytes);
        Bvh {
            alpha: alpha.map(|source| AlphaTest::new(Arc::clone(&geometry), source)),
            geometry,
            flags,
            root: root.tree,
            groups: built.into_iter().map(|b| b.tree).collect(),
            group_from_world,
            stats: AccelStats { bytes, peak_bytes, build_seconds: start.elapsed().as_secs_f64() },
        }
    }
}

fn leaf_kind(shape: &Shape) -> LeafKind {
    match shape {
        Shape::Mesh(_) => LeafKind::Triangles,
        Shape::Curves(_) => LeafKind::Curves,
        Shape::Bilinear(_) | Shape::Quadric(_) => LeafKind::Single,
    }
}

fn flags_of(geometry: &Geometry, has_alpha_source: bool) -> u32 {
    let tested = if geometry.alpha.is_some() && has_alpha_source { TESTED } else { 0 };
    geometry.visibility.0 & Visibility::ALL.0 | tested
}

struct BuiltTree {
    tree: Tree,
    /// Peak memory of the build.
    peak_bytes: u64,
}

/// Builds a tree. `leaf_kinds` are those of the geometries.
fn build_tree(geometry: &GeometrySet, leaf_kinds: &[LeafKind], mut prims: Vec<PrimRef>) -> BuiltTree {
    let binary = build_binary(&mut prims, leaf_kinds);
    let tree = Tree::new(geometry, &prims, binary.as_ref(), leaf_kinds);
    let binary_bytes = binary.map_or(0, |root| root.bytes());
    let peak_bytes = tree.bytes() + size_of_val(&prims[..]) as u64 + binary_bytes;
    BuiltTree { tree, peak_bytes }
}

/// The finite primitives of a group that are wanted and visible to some ray.
fn group_prims(set: &GeometrySet, group: &Group, is_wanted: impl Fn(&Shape) -> bool) -> Vec<PrimRef> {
    // Hidden geometries have none
    let mut prims = Vec::new();
    for &id in &group.geometries {
        let geometry = &set.geometries[id as usize];
        if geometry.visibility.0 & Visibility::ALL.0 == 0 || !is_wanted(&geometry.shape) {
            continue;
        }

        // One primitive per triangle, patch, quadric or span of a curve
        match &geometry.shape {
            Shape::Mesh(mesh) => prims.par_extend(
                (0..mesh.triangle_count()).into_par_iter().filter_map(|i| PrimRef::of_points(id, i, &mesh.triangle(i))),
            ),
            Shape::Bilinear(mesh) => {
                prims.extend((0..mesh.patch_count()).filter_map(|i| PrimRef::of_points(id, i, &mesh.patch(i))));
            }
            Shape::Quadric(quadric) => prims.extend(PrimRef::of_bounds(id, 0, quadric.bounds())),
            Shape::Curves(curves) => {
                let spans = (0..curves.curves().len()).into_par_iter().flat_map_iter(|curve| curves.spans_of(curve));
                let prim = |first: u32| PrimRef::of_bounds(id, first as usize, curves.capsule(first).bounds());
                prims.par_extend(spans.filter_map(prim));
            }
        }
    }
    prims
}

/// Instances with their bounds over all times. Points move on straight lines between time samples, so the boxes at the
/// samples suffice. Static instances with a singular transform are excluded. Those of clusters are listed one by one.
fn instance_prims(set: &GeometrySet, group_bounds: &[Bounds3]) -> Vec<PrimRef> {
    // Clusters may stand for very many instances
    let is_empty = |group: u32| group_bounds[group as usize].is_empty();
    let clusters = set.clusters.clusters().iter();
    let is_filled: Vec<bool> = clusters.map(|members| members.iter().any(|m| !is_empty(m.group))).collect();
    let stored = set.instances.len() as u32;
    let places = set.clusters.places().par_iter().filter(|place| is_filled[place.cluster as usize]);
    let in_clusters = places.flat_map_iter(|place| set.clusters.instances_of(place)).map(|i| stored + i);

    // Boxes of the others
    let bounds_of = |i: u32| {
        let bounds = group_bounds[set.group_of(i) as usize];
        let instance = (!bounds.is_empty()).then(|| set.instance(i)).filter(|instance| instance.is_usable())?;
        let placed = instance.world_from_group.iter().map(|m| bounds.transformed(m));
        let all = placed.fold(Bounds3::EMPTY, Bounds3::union);
        // The transform of the ray into the group has rounding errors, too
        let pad = all.min.abs().max(all.max.abs()).max_element() * 2.0_f32.powi(-18);
        let bounds = Bounds3 { min: all.min - Vec3::splat(pad), max: all.max + Vec3::splat(pad) };
        PrimRef::of_bounds(PrimRef::INSTANCE, i as usize, bounds)
    };
    (0..stored).into_par_iter().chain(in_clusters).filter_map(bounds_of).collect()
}

#[cfg(test)]
#[path = "tests.rs"]
mod tests;
