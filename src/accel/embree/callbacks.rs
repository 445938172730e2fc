//! Callbacks from Embree: nearest hits, alpha masks, quadrics and bilinear patches.
//!
//! Embree passes N rays at once as a structure of arrays with N elements per field. Lanes whose `valid` is not −1 are
//! ignored. Fields are addressed by their index in the order of the header, which is the same for any N, including 1.
#![allow(unsafe_code)]

use super::context::{QueryContext, Ties};
use super::scene_ids::{Refined, Reported, SceneIds};
use crate::accel::{AlphaTest, Hit};
use crate::geometry::hit::LocalHit;
use crate::geometry::{GeometryId, Shape};
use embree4_sys as sys;
use lumiris_numbers::math::{Bounds3, Ray, Vec4};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;

/// Relative growth of the boxes of quadrics and patches, for rounding errors of rays transformed into a group.
const BOX_GROWTH: f32 = 1.0 / (1 << 20) as f32;

/// User data of a geometry for its callbacks.
#[derive(Clone)]
pub(super) struct GeometryContext {
    pub world: Arc<SceneIds>,
    pub id: GeometryId,
    /// The alpha test, if the geometry has an alpha mask.
    pub alpha: Option<AlphaTest>,
}

impl GeometryContext {
    pub(super) fn has_alpha(&self) -> bool {
        self.alpha.is_some()
    }

    /// True if the hit stops the ray. `crossing` distinguishes hits on the same primitive.
    fn stops(&self, hit: &Hit, crossing: usize, world_ray: &Ray) -> bool {
        self.alpha.as_ref().is_none_or(|alpha| alpha.stops(hit, crossing, world_ray))
    }

    /// True if there is an exact hit on a quadric or patch with `start` < t < `end`.
    fn occludes(&self, world_ray: &Ray, primitive: u32, instance: u32, [start, end]: [f32; 2]) -> bool {
        match &self.world.set.geometries[self.id as usize].shape {
            // Segments are never continued behind a hit, so they start before all hits
            Shape::Quadric(quadric) if !self.has_alpha() => {
                quadric.distance(&Ray { t_max: end, ..self.world.group_ray(world_ray, instance) }).is_some()
            }
            _ => self.intersect(world_ray, primitive, instance, [start, end]).is_some(),
        }
    }

    /// The first exact hit on a quadric or patch with `start` < t < `end` that stops the ray.
    fn intersect(&self, world_ray: &Ray, primitive: u32, instance: u32, [start, end]: [f32; 2]) -> Option<LocalHit> {
        let ray = Ray { t_max: end, ..self.world.group_ray(world_ray, instance) };
        self.world.set.geometries[self.id as usize].shape.intersect(primitive, &ray, |hit, crossing| {
            let found = Hit { t: hit.t, uv: hit.uv, geometry: self.id, primitive, instance };
            hit.t > start && self.stops(&found, crossing, world_ray)
        })
    }
}

/// N rays, followed by N hits if the callback gets both in one buffer.
#[derive(Clone, Copy)]
pub(super) struct Lanes {
    pub words: *mut f32,
    pub n: usize,
}

pub(super) const TNEAR: usize = 3;
pub(super) const TFAR: usize = 8;
pub(super) const ID: usize = 10;
/// Number of words in a ray.
pub(super) const RAY_WORDS: usize = 12;

pub(super) const HIT_U: usize = 3;
pub(super) const HIT_V: usize = 4;
pub(super) const HIT_PRIM: usize = 5;
pub(super) const HIT_GEOM: usize = 6;
pub(super) const HIT_INST: usize = 7;

impl Lanes {
    /// # Safety
    /// `words` has fields beyond `field`, and `lane` is below n.
    #[inline]
    pub(super) unsafe fn get(self, field: usize, lane: usize) -> f32 {
        // SAFETY: by the caller.
        unsafe { *self.words.add(field * self.n + lane) }
    }

    /// # Safety
    /// As [`Self::get`].
    #[inline]
    pub(super) unsafe fn set(self, field: usize, lane: usize, value: f32) {
        // SAFETY: by the caller.
        unsafe { *self.words.add(field * self.n + lane) = value }
    }

    /// # Safety
    /// As [`Self::get`].
    #[inline]
    pub(super) unsafe fn get_u32(self, field: usize, lane: usize) -> u32 {
        // SAFETY: by the caller.
        unsafe { self.get(field, lane) }.to_bits()
    }
}

/// Active lanes of a callback, at most 64.
///
/// # Safety
/// `valid` has `n` elements, −1 or 0.
#[inline]
pub(super) unsafe fn active(valid: *const i32, n: usize) -> impl Iterator<Item = usize> {
    let mut lanes = 0_u64;
    if n.is_multiple_of(4) {
        // Four signs at once: often only one of 8 or 16 lanes is active
        for begin in (0..n).step_by(4) {
            // SAFETY: by the caller.
            let four = unsafe { valid.add(begin).cast::<[f32; 4]>().read_unaligned() };
            lanes |= u64::from(Vec4::from_array(four).is_negative_bitmask()) << begin;
        }
    } else {
        for lane in 0..n {
            // SAFETY: by the caller.
            lanes |= u64::from(unsafe { *valid.add(lane) } == -1) << lane;
        }
    }
    std::iter::from_fn(move || {
        let lane = lanes.trailing_zeros() as usize;
        lanes &= lanes.wrapping_sub(1);
        (lane < 64).then_some(lane)
    })
}

/// Filter that rejects hits of triangles where the alpha mask is transparent.
pub(super) unsafe extern "C" fn alpha_filter(arguments: *const sys::RTCFilterFunctionNArguments) {
    // SAFETY: Embree passes valid arguments: the user data that was set, the context of this query, N lanes each.
    unsafe {
        let arguments = &*arguments;
        let geometry = &*arguments.geometryUserPtr.cast::<GeometryContext>();
        let query = &mut *arguments.context.cast::<QueryContext<'_>>();
        let n = arguments.N as usize;
        let rays = Lanes { words: arguments.ray.cast(), n };
        let hits = Lanes { words: arguments.hit.cast(), n };
        for lane in active(arguments.valid, n) {
            let (id, reported) = (rays.get_u32(ID, lane), reported(rays, hits, lane, query.first_instance));
            let mut stops = false;
            query.guard(|query| {
                let ray = query.rays.get(id as usize);
                let instance = geometry.world.instance(reported.instance);
                stops = match geometry.world.refine_primitive(&ray, geometry.id, instance, &reported) {
                    Refined::Hit(hit) => geometry.stops(&hit, 0, &ray),
                    Refined::Behind | Refined::Beyond => false,
                };
            });
            if !stops {
                *arguments.valid.add(lane) = 0;
            }
        }
    }
}

/// Filter that receives the hits of triangles.
pub(super) unsafe extern "C" fn first_filter(arguments: *const sys::RTCFilterFunctionNArguments) {
    // SAFETY: Embree passes valid arguments: the context of this query, N lanes each, which nothing else refers to.
    unsafe {
        let arguments = &*arguments;
        let query = &mut *arguments.context.cast::<QueryContext<'_>>();
        let n = arguments.N as usize;
        let rays = Lanes { words: arguments.ray.cast(), n };
        let hits = Lanes { words: arguments.hit.cast(), n };
        for lane in active(arguments.valid, n) {
            let id = rays.get_u32(ID, lane);
            let end = match query.ties {
                Ties::Noted => Some(query.note(id, rays.get(TFAR, lane))),
                Ties::Settled => query.settle(id, &reported(rays, hits, lane, query.first_instance)),
            };
            match end {
                Some(end) => rays.set(TFAR, lane, end),
                None => *arguments.valid.add(lane) = 0,
            }
        }
    }
}

/// The number of an instance for [`SceneIds::instance`].
#[inline]
pub(super) fn numbered(inst_id: u32, first_instance: u32) -> u32 {
    if inst_id == u32::MAX { u32::MAX } else { inst_id + first_instance }
}

/// The hit of a triangle in a lane of a filter. The position on the triangle is computed later, with the exact hit.
///
/// # Safety
/// `rays` and `hits` have n lanes of rays and of hits, and `lane` is below n.
#[inline]
unsafe fn reported(rays: Lanes, hits: Lanes, lane: usize, first_instance: u32) -> Reported {
    // SAFETY: by the caller.
    unsafe {
        Reported {
            geometry: hits.get_u32(HIT_GEOM, lane),
            primitive: hits.get_u32(HIT_PRIM, lane),
            instance: numbered(hits.get_u32(HIT_INST, lane), first_instance),
            t: rays.get(TFAR, lane),
            uv: [0.0; 2],
        }
    }
}

/// Computes the box of a quadric or patch.
pub(super) unsafe extern "C" fn bounds(arguments: *const sys::RTCBoundsFunctionArguments) {
    // SAFETY: Embree passes valid arguments, among them the user data that was set.
    unsafe {
        let arguments = &*arguments;
        let geometry = &*arguments.geometryUserPtr.cast::<GeometryContext>();
        let box_of = || match &geometry.world.set.geometries[geometry.id as usize].shape {
            Shape::Bilinear(mesh) => Bounds3::from_points(mesh.patch(arguments.primID as usize)),
            Shape::Quadric(quadric) => quadric.bounds(),
            Shape::Mesh(_) | Shape::Curves(_) => Bounds3::EMPTY,
        };
        // An empty box excludes the primitive
        let found = catch_unwind(AssertUnwindSafe(box_of)).unwrap_or(Bounds3::EMPTY);
        set_bounds(arguments, found, BOX_GROWTH);
    }
}

/// Sets the box of a primitive. `growth` is relative to coordinates.
///
/// # Safety
/// The arguments are those of a callback.
pub(super) unsafe fn set_bounds(arguments: &sys::RTCBoundsFunctionArguments, bounds: Bounds3, growth: f32) {
    let growth = bounds.min.abs().max(bounds.max.abs()).max_element() * growth;
    // SAFETY: by the caller.
    let out = unsafe { &mut *arguments.bounds_o };
    (out.lower_x, out.lower_y, out.lower_z) = (bounds.min - growth).into();
    (out.upper_x, out.upper_y, out.upper_z) = (bounds.max + growth).into();
}

/// Intersects quadrics and patches.
pub(super) unsafe extern "C" fn intersect(arguments: *const sys::RTCIntersectFunctionNArguments) {
    // SAFETY: Embree passes valid arguments: the user data that was set, the context of this query, and N lanes of rays
    // followed by N lanes of hits.
    unsafe {
        let arguments = &*arguments;
        let geometry = &*arguments.geometryUserPtr.cast::<GeometryContext>();
        let query = &mut *arguments.context.cast::<QueryContext<'_>>();
        let n = arguments.N as usize;
        let rays = Lanes { words: arguments.rayhit.cast(), n };
        let hits = Lanes { words: rays.words.add(RAY_WORDS * n), n };
        let (local, inst_id) = (query.rtc.instID[0], numbered(query.rtc.instID[0], query.first_instance));
        for lane in active(arguments.valid, n) {
            let intersect = |ray: &Ray, instance, range| geometry.intersect(ray, arguments.primID, instance, range);
            let found = lane_hit(geometry, query, rays, lane, inst_id, intersect);
            let end = found.and_then(|hit| {
                let (geometry, primitive, instance) = (arguments.geomID, arguments.primID, inst_id);
                let hit = Reported { geometry, primitive, instance, t: hit.t, uv: hit.uv };
                query.offer(rays.get_u32(ID, lane), &hit)
            });
            *arguments.valid.add(lane) = if end.is_some() { -1 } else { 0 };
            let (Some(hit), Some(end)) = (found, end) else { continue };
            rays.set(TFAR, lane, end);
            hits.set(HIT_U, lane, hit.uv[0]);
            hits.set(HIT_V, lane, hit.uv[1]);
            hits.set(HIT_PRIM, lane, f32::from_bits(arguments.primID));
            hits.set(HIT_GEOM, lane, f32::from_bits(arguments.geomID));
            hits.set(HIT_INST, lane, f32::from_bits(local));
        }
    }
}

/// Tests quadrics and patches for occlusion.
pub(super) unsafe extern "C" fn occluded(arguments: *const sys::RTCOccludedFunctionNArguments) {
    // SAFETY: Embree passes valid arguments: the user data that was set, the context of this query, N lanes of rays.
    unsafe {
        let arguments = &*arguments;
        let geometry = &*arguments.geometryUserPtr.cast::<GeometryContext>();
        let query = &mut *arguments.context.cast::<QueryContext<'_>>();
        let n = arguments.N as usize;
        let rays = Lanes { words: arguments.ray.cast(), n };
        let inst_id = numbered(query.rtc.instID[0], query.first_instance);
        for lane in active(arguments.valid, n) {
            let occludes =
                |ray: &Ray, instance, range| geometry.occludes(ray, arguments.primID, instance, range).then_some(());
            let found = lane_hit(geometry, query, rays, lane, inst_id, occludes).is_some();
            *arguments.valid.add(lane) = if found { -1 } else { 0 };
            if found {
                rays.set(TFAR, lane, f32::NEG_INFINITY);
            }
        }
    }
}

/// Calls `intersect` with the ray of a lane, the instance of `inst_id`, and the limits of the ray.
///
/// # Safety
/// `rays` has n lanes of rays, and `lane` is below n.
#[inline]
unsafe fn lane_hit<T>(
    geometry: &GeometryContext,
    query: &mut QueryContext<'_>,
    rays: Lanes,
    lane: usize,
    inst_id: u32,
    intersect: impl Fn(&Ray, u32, [f32; 2]) -> Option<T>,
) -> Option<T> {
    // SAFETY: by the caller.
    let (id, start, end) = unsafe { (rays.get_u32(ID, lane), rays.get(TNEAR, lane), rays.get(TFAR, lane)) };
    let mut found = None;
    query.guard(|query| {
        let ray = query.rays.get(id as usize);
        let instance = geometry.world.instance(inst_id);
        found = intersect(&ray, instance, [start, end]);
    });
    found
}
