//! Traversal of both levels by a single ray.

use super::curve_block::{CurveBlock, CurveRay};
use super::hierarchy::{Bvh, TESTED};
use super::tree::{BOX_GROWTH, Block, Child, ChildRef, Node, Other, Tree};
use crate::accel::{Accel, AccelStats, Coherence, Hit, RayBatch};
use crate::geometry::triangle::{RayPrecomputed, intersect_triangle};
use crate::geometry::{LocalHit, Shape, Visibility};
use lumiris_numbers::math::{Ray, Vec4, gamma};

/// A query along a ray.
pub(super) trait Query {
    /// True if near boxes are visited first.
    const ORDERED: bool;
    /// Visibility bits of the geometries that count.
    const MASK: u32;
    /// Boxes and hits beyond this parameter are ignored.
    fn limit(&self) -> f32;
    /// True if the hit, at a parameter of `limit` or less, changes the result.
    fn wants(&self, hit: &Hit) -> bool;
    /// Accepts a hit. Returns true if the result is final.
    fn take(&mut self, hit: Hit) -> bool;
}

/// Query for the first hit.
pub(super) struct Closest {
    limit: f32,
    /// The result.
    pub best: Option<Hit>,
}

impl Closest {
    /// `best` is a hit that is known already.
    fn new(t_max: f32, best: Option<Hit>) -> Self {
        Closest { limit: best.map_or(t_max, |hit| hit.t), best }
    }
}

impl Query for Closest {
    const ORDERED: bool = true;
    const MASK: u32 = Visibility::PATH.0;

    #[inline]
    fn limit(&self) -> f32 {
        self.limit
    }

    #[inline]
    fn wants(&self, hit: &Hit) -> bool {
        // The end of the ray is open
        self.best.as_ref().map_or(hit.t < self.limit, |best| hit.precedes(best))
    }

    #[inline]
    fn take(&mut self, hit: Hit) -> bool {
        self.limit = hit.t;
        self.best = Some(hit);
        false
    }
}

/// Query for occlusion.
pub(super) struct Any {
    limit: f32,
    /// The result.
    pub found: bool,
}

impl Any {
    pub(super) fn new(t_max: f32) -> Self {
        Any { limit: t_max, found: false }
    }
}

impl Query for Any {
    const ORDERED: bool = false;
    const MASK: u32 = Visibility::SHADOW.0;

    #[inline]
    fn limit(&self) -> f32 {
        self.limit
    }

    #[inline]
    fn wants(&self, hit: &Hit) -> bool {
        hit.t < self.limit
    }

    #[inline]
    fn take(&mut self, _hit: Hit) -> bool {
        self.found = true;
        true
    }
}

/// A ray prepared for slab tests.
struct Slabs {
    /// Origins for near and far planes, moved apart to grow the box, by axis.
    near_origin: [Vec4; 3],
    far_origin: [Vec4; 3],
    inv_d: [Vec4; 3],
    /// Rows of near and far planes in [`Node::bounds`], by axis.
    near_row: [usize; 3],
    far_row: [usize; 3],
}

impl Slabs {
    fn new(ray: &Ray) -> Self {
        let growth = ray.o.abs().max_element() * BOX_GROWTH;
        let smallest = ray.d.abs().max_element() * 1e-18;
        let mut slabs = Slabs {
            near_origin: [Vec4::ZERO; 3],
            far_origin: [Vec4::ZERO; 3],
            inv_d: [Vec4::ZERO; 3],
            near_row: [0; 3],
            far_row: [0; 3],
        };
        for axis in 0..3 {
            // Finite inverses, so that no product is NaN
            let d = ray.d[axis];
            let inv_d = 1.0 / d.abs().max(smallest).max(f32::MIN_POSITIVE).copysign(d);
            let apart = growth.copysign(d);
            slabs.near_origin[axis] = Vec4::splat(ray.o[axis] + apart);
            slabs.far_origin[axis] = Vec4::splat(ray.o[axis] - apart);
            slabs.inv_d[axis] = Vec4::splat(inv_d);
            let backward = inv_d < 0.0;
            slabs.near_row[axis] = if backward { axis + 3 } else { axis };
            slabs.far_row[axis] = if backward { axis } else { axis + 3 };
        }
        slabs
    }

    /// The boxes that the ray intersects in 0..=limit. The exit is increased by its rounding error [Ize 2013].
    #[inline(always)]
    fn test(&self, node: &Node, limit: Vec4) -> EnteredBoxes {
        const WIDEN: f32 = 1.0 + 2.0 * gamma(3);
        let half = |h: usize| {
            let near = |axis: usize| (node.bounds[self.near_row[axis]][h] - self.near_origin[axis]) * self.inv_d[axis];
            let far = |axis: usize| (node.bounds[self.far_row[axis]][h] - self.far_origin[axis]) * self.inv_d[axis];
            let entry = near(0).max(near(1)).max(near(2).max(Vec4::ZERO));
            let exit = (far(0).min(far(1)).min(far(2)) * WIDEN).min(limit);
            (entry.cmple(exit).bitmask(), entry)
        };
        let ((low, entry_low), (high, entry_high)) = (half(0), half(1));
        EnteredBoxes { mask: low | high << 4, entries: [entry_low, entry_high] }
    }
}

/// Boxes of a node that a ray intersects.
#[derive(Clone, Copy)]
struct EnteredBoxes {
    /// Bit mask.
    mask: u32,
    /// Parameters at which the ray enters.
    entries: [Vec4; 2],
}

/// A subtree to be traversed.
#[derive(Clone, Copy)]
pub(super) struct Pending {
    child: ChildRef,
    /// Parameter at which the ray enters the box.
    entry: f32,
}

/// A traversal in progress.
pub(super) struct Walk<'a, Q> {
    bvh: &'a Bvh,
    world_ray: &'a Ray,
    query: Q,
    stack: &'a mut Vec<Pending>,
}

impl<'a, Q: Query> Walk<'a, Q> {
    pub(super) fn new(bvh: &'a Bvh, world_ray: &'a Ray, query: Q, stack: &'a mut Vec<Pending>) -> Self {
        stack.clear();
        Walk { bvh, world_ray, query, stack }
    }

    /// Traverses the scene and returns the query with its result.
    pub(super) fn run(mut self) -> Q {
        if self.world_ray.t_max > 0.0
            && let Some(ray) = RayPrecomputed::new(self.world_ray)
        {
            self.tree(&self.bvh.root, &ray, Hit::NO_INSTANCE);
        }
        self.query
    }

    /// Traverses a tree with a ray in its space. Returns true if the result is final.
    fn tree(&mut self, tree: &'a Tree, ray: &RayPrecomputed, instance: u32) -> bool {
        let Some(root) = tree.root else { return false };
        let slabs = Slabs::new(&ray.ray);
        let mut curve_ray = None;
        let base = self.stack.len();
        self.stack.push(Pending { child: root, entry: 0.0 });
        while self.stack.len() > base {
            let Some(Pending { mut child, entry }) = self.stack.pop() else { break };
            if Q::ORDERED && entry > self.query.limit() {
                continue;
            }
            // Descend through the nearest boxes to a leaf
            let done = loop {
                match child.decode() {
                    Child::Node(index) => {
                        let node = &tree.nodes[index];
                        match self.nearest(node, slabs.test(node, Vec4::splat(self.query.limit()))) {
                            Some(next) => child = next,
                            None => break false,
                        }
                    }
                    Child::Block(index) => break self.block(&tree.blocks[index], ray, instance),
                    Child::Other(index) => break self.other(tree.others[index], ray, instance),
                    Child::Curves(index) => {
                        let curve_ray = curve_ray.get_or_insert_with(|| CurveRay::new(&ray.ray, tree.bounds));
                        break self.curves(&tree.curves[index], ray, curve_ray, instance);
                    }
                }
            };
            if done {
                self.stack.truncate(base);
                return true;
            }
        }
        false
    }

    /// The next box to enter. The others go onto the stack, the nearest on top.
    #[inline(always)]
    fn nearest(&mut self, node: &Node, EnteredBoxes { mask, entries }: EnteredBoxes) -> Option<ChildRef> {
        if mask == 0 {
            return None;
        }
        let first = mask.trailing_zeros() as usize & 7;
        let mut rest = mask & (mask - 1);
        if rest == 0 {
            return Some(node.children[first]);
        }
        let mut lanes = [0.0_f32; 8];
        lanes[..4].copy_from_slice(&entries[0].to_array());
        lanes[4..].copy_from_slice(&entries[1].to_array());
        let mut next = Pending { child: node.children[first], entry: lanes[first] };
        let sorted_from = self.stack.len();
        while rest != 0 {
            let lane = rest.trailing_zeros() as usize & 7;
            rest &= rest - 1;
            let mut pending = Pending { child: node.children[lane], entry: lanes[lane] };
            if Q::ORDERED {
                // Keep the nearest one out of the stack, and the stack in descending order
                if pending.entry < next.entry {
                    std::mem::swap(&mut pending, &mut next);
                }
                self.stack.push(pending);
                let mut i = self.stack.len() - 1;
                while i > sorted_from && self.stack[i - 1].entry < pending.entry {
                    self.stack[i] = self.stack[i - 1];
                    i -= 1;
                }
                self.stack[i] = pending;
            } else {
                self.stack.push(pending);
            }
        }
        Some(next.child)
    }

    #[inline]
    fn block(&mut self, block: &Block, ray: &RayPrecomputed, instance: u32) -> bool {
        let mut lanes = block.candidates(ray);
        while lanes != 0 {
            let lane = lanes.trailing_zeros() as usize & 3;
            lanes &= lanes - 1;
            let Some(hit) = intersect_triangle(ray, block.triangle(lane), self.query.limit()) else { continue };
            let (geometry, primitive) = (block.geometry[lane], block.primitive[lane]);
            let hit = Hit { t: hit.t, uv: [hit.b1, hit.b2], geometry, primitive, instance };
            if self.accepts(&hit, 0) && self.query.take(hit) {
                return true;
            }
        }
        false
    }

    fn other(&mut self, other: Other, ray: &RayPrecomputed, instance: u32) -> bool {
        match other {
            Other::Instance(index) => self.instance(index),
            Other::Exact { geometry, primitive } => {
                // A hit at the same t may still win, so the open end of the exact test is one float larger
                let ray = Ray { t_max: self.query.limit().next_up(), ..ray.ray };
                let hit_of = |l: &LocalHit| Hit { t: l.t, uv: l.uv, geometry, primitive, instance };
                let shape = &self.bvh.geometry.geometries[geometry as usize].shape;
                let local = shape.intersect(primitive, &ray, |l, crossing| self.accepts(&hit_of(l), crossing));
                local.is_some_and(|l| self.query.take(hit_of(&l)))
            }
        }
    }

    fn curves(&mut self, block: &CurveBlock, ray: &RayPrecomputed, curve_ray: &CurveRay, instance: u32) -> bool {
        let bvh = self.bvh;
        let mut lanes = block.candidates(curve_ray, self.query.limit());
        while lanes != 0 {
            let lane = lanes.trailing_zeros() as usize & 7;
            lanes &= lanes - 1;
            let (geometry, first) = (block.geometry[lane], block.first[lane]);
            let shape = &bvh.geometry.geometries[geometry as usize].shape;
            let Shape::Curves(curves) = shape else { continue };
            let ray = Ray { t_max: self.query.limit().next_up(), ..ray.ray };
            for (primitive, local) in (first..).zip(curves.intersect_span(first, &ray)) {
                let Some(local) = local else { continue };
                let hit = Hit { t: local.t, uv: local.uv, geometry, primitive, instance };
                if self.query.limit() >= hit.t && self.accepts(&hit, 0) && self.query.take(hit) {
                    return true;
                }
            }
        }
        false
    }

    /// Traverses an instance. Ray parameters stay the same in world space, because the direction is transformed without
    /// normalisation.
    fn instance(&mut self, index: u32) -> bool {
        let (set, world) = (&self.bvh.geometry, self.world_ray);
        let stored = self.bvh.group_from_world.get(index as usize).copied().flatten();
        let group_from_world = stored.unwrap_or_else(|| set.world_from_group_at(index, world.time).inverse());
        let ray = Ray {
            o: group_from_world.transform_point3(world.o),
            d: group_from_world.transform_vector3(world.d),
            ..*world
        };
        let bvh = self.bvh;
        RayPrecomputed::new(&ray).is_some_and(|ray| self.tree(&bvh.groups[set.group_of(index) as usize], &ray, index))
    }

    /// True if the query wants the hit and the hit stops the ray. `crossing` distinguishes hits on the same primitive.
    #[inline]
    fn accepts(&self, hit: &Hit, crossing: usize) -> bool {
        let flags = self.bvh.flags[hit.geometry as usize];
        let is_stopped = || self.bvh.alpha.as_ref().is_none_or(|test| test.stops(hit, crossing, self.world_ray));
        flags & Q::MASK != 0 && self.query.wants(hit) && (flags & TESTED == 0 || is_stopped())
    }
}

impl Bvh {
    /// Replaces hits by preceding ones.
    pub(in crate::accel) fn intersect_before(&self, rays: &RayBatch, hits: &mut [Option<Hit>]) {
        let mut stack = Vec::with_capacity(128);
        for (i, hit) in hits.iter_mut().enumerate() {
            let ray = rays.get(i);
            *hit = Walk::new(self, &ray, Closest::new(ray.t_max, *hit), &mut stack).run().best;
        }
    }

    /// Tests the rays that are not occluded yet.
    pub(in crate::accel) fn occlude_others(&self, rays: &RayBatch, occluded: &mut [bool]) {
        let mut stack = Vec::with_capacity(128);
        for (i, occluded) in occluded.iter_mut().enumerate().filter(|(_, occluded)| !**occluded) {
            let ray = rays.get(i);
            *occluded = Walk::new(self, &ray, Any::new(ray.t_max), &mut stack).run().found;
        }
    }
}

impl Accel for Bvh {
    fn intersect(&self, rays: &RayBatch, _coherence: Coherence, hits: &mut Vec<Option<Hit>>) {
        hits.clear();
        hits.resize(rays.len(), None);
        self.intersect_before(rays, hits);
    }

    fn occluded(&self, rays: &RayBatch, _coherence: Coherence, occluded: &mut Vec<bool>) {
        occluded.clear();
        occluded.resize(rays.len(), false);
        self.occlude_others(rays, occluded);
    }

    fn stats(&self) -> AccelStats {
        self.stats
    }
}
