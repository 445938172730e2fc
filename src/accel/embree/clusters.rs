//! Callbacks of the places of clusters. Debian's Embree 3 allows one level of instances, which places groups in the
//! scene of a cluster. All places of clusters are one geometry, whose callbacks transform rays and trace them through
//! that scene, one by one, also those of packets.
#![allow(unsafe_code)]

use super::callbacks::{
    HIT_GEOM, HIT_INST, HIT_PRIM, HIT_U, HIT_V, ID, Lanes, RAY_WORDS, TFAR, TNEAR, active, numbered, set_bounds,
};
use super::calls::{self, can_trace};
use super::context::{Mode, QueryContext};
use super::error::EmbreeError;
use super::scene::{EmbreeScene, UserCallbacks};
use crate::geometry::GeometrySet;
use embree4_sys as sys;
use lumiris_numbers::math::{Affine3A, Bounds3, Vec3};
use std::sync::Arc;

/// Growth of the boxes of places, relative to coordinates, for rounding errors of rays transformed into a cluster.
const BOX_GROWTH: f32 = 1.0 / (1 << 18) as f32;

const TIME: usize = 7;
const MASK: usize = 9;

const CALLBACKS: UserCallbacks =
    UserCallbacks { bounds: Some(bounds), intersect: Some(intersect), occluded: Some(occluded) };

/// User data of the geometry of all places.
pub(super) struct ClustersContext {
    set: Arc<GeometrySet>,
    /// The scene of each cluster, and its bounds.
    scenes: Vec<Arc<EmbreeScene>>,
    bounds: Vec<Bounds3>,
    /// By place.
    cluster_from_world: Vec<Affine3A>,
    /// Number of the first instance of the first place.
    first: u32,
}

impl ClustersContext {
    /// All places, whose instances are numbered from `first` on.
    pub(super) fn new(set: &Arc<GeometrySet>, scenes: Vec<Arc<EmbreeScene>>, first: u32) -> Self {
        let group_bounds: Vec<Bounds3> = set.groups.iter().map(|group| set.group_bounds(group)).collect();
        let bounds = set.cluster_bounds(&group_bounds);
        let inverse = set.clusters.places().iter().map(|place| place.world_from_cluster.inverse().as_affine3a());
        ClustersContext { cluster_from_world: inverse.collect(), set: Arc::clone(set), scenes, bounds, first }
    }

    /// Adds the places to the root scene.
    pub(super) fn add_to(self, root: &mut EmbreeScene) -> Result<(), EmbreeError> {
        let count = self.set.clusters.places().len();
        // SAFETY: the callbacks only read their user data, as a `ClustersContext`.
        unsafe { root.add_user(self, count, &CALLBACKS) }
    }

    /// The ray of a lane in the space of a place; `None` if it cannot be traced.
    ///
    /// # Safety
    /// `rays` has lanes of rays, and `lane` is one of them.
    #[inline]
    unsafe fn ray(&self, place: u32, rays: Lanes, lane: usize) -> Option<sys::RTCRay> {
        // SAFETY: by the caller.
        let (get, id) = (|field| unsafe { rays.get(field, lane) }, unsafe { rays.get_u32(ID, lane) });
        let m = &self.cluster_from_world[place as usize];
        let o = m.transform_point3(Vec3::new(get(0), get(1), get(2)));
        let d = m.transform_vector3(Vec3::new(get(4), get(5), get(6)));
        can_trace(o.to_array(), d.to_array(), get(TFAR)).then_some(sys::RTCRay {
            org_x: o.x,
            org_y: o.y,
            org_z: o.z,
            tnear: get(TNEAR),
            dir_x: d.x,
            dir_y: d.y,
            dir_z: d.z,
            time: get(TIME),
            tfar: get(TFAR),
            mask: get(MASK).to_bits(),
            id,
            flags: 0,
        })
    }

    /// Calls `trace` with the scene of a place, while `context` adds the number of its first instance to hits.
    ///
    /// # Safety
    /// `context` is the live context of the query, and nothing refers to it.
    #[inline]
    unsafe fn enter(&self, place: u32, context: *mut QueryContext<'_>, trace: impl FnOnce(sys::RTCScene, Mode)) {
        let place = &self.set.clusters.places()[place as usize];
        // SAFETY: by the caller.
        let mode = unsafe {
            (*context).first_instance = self.first + place.first;
            Mode { coherent: false, ..(*context).mode }
        };
        trace(self.scenes[place.cluster as usize].raw(), mode);
        // SAFETY: by the caller.
        unsafe { (*context).first_instance = 0 };
    }
}

/// Computes the box of a place.
unsafe extern "C" fn bounds(arguments: *const sys::RTCBoundsFunctionArguments) {
    // SAFETY: Embree passes valid arguments, among them the user data that was set.
    unsafe {
        let arguments = &*arguments;
        let context = &*arguments.geometryUserPtr.cast::<ClustersContext>();
        let place = &context.set.clusters.places()[arguments.primID as usize];
        set_bounds(arguments, place.bounds(&context.bounds), BOX_GROWTH);
    }
}

/// Finds the first hits in a place.
unsafe extern "C" fn intersect(arguments: *const sys::RTCIntersectFunctionNArguments) {
    // SAFETY: Embree passes valid arguments: the user data that was set, the context of this query, and N lanes of rays
    // followed by N lanes of hits. The scenes of clusters are committed, and their rays can be traced.
    unsafe {
        let arguments = &*arguments;
        let places = &*arguments.geometryUserPtr.cast::<ClustersContext>();
        let query = arguments.context.cast::<QueryContext<'_>>();
        let n = arguments.N as usize;
        let rays = Lanes { words: arguments.rayhit.cast(), n };
        let hits = Lanes { words: rays.words.add(RAY_WORDS * n), n };
        for lane in active(arguments.valid, n) {
            // Trace the ray in the space of the cluster
            *arguments.valid.add(lane) = 0;
            let Some(ray) = places.ray(arguments.primID, rays, lane) else { continue };
            let mut found = sys::RTCRayHit { ray, ..Default::default() };
            found.hit.geomID = sys::RTC_INVALID_GEOMETRY_ID;
            found.hit.instID = [sys::RTC_INVALID_GEOMETRY_ID];
            let mut first = 0;
            places.enter(arguments.primID, query, |scene, mode| {
                first = (*query).first_instance;
                calls::intersect1(scene, query, mode, &mut found);
            });
            if found.hit.geomID == sys::RTC_INVALID_GEOMETRY_ID {
                continue;
            }
            // Report its hit
            *arguments.valid.add(lane) = -1;
            rays.set(TFAR, lane, found.ray.tfar);
            hits.set(HIT_U, lane, found.hit.u);
            hits.set(HIT_V, lane, found.hit.v);
            hits.set(HIT_PRIM, lane, f32::from_bits(found.hit.primID));
            hits.set(HIT_GEOM, lane, f32::from_bits(found.hit.geomID));
            hits.set(HIT_INST, lane, f32::from_bits(numbered(found.hit.instID[0], first)));
        }
    }
}

/// Tests a place for occlusion.
unsafe extern "C" fn occluded(arguments: *const sys::RTCOccludedFunctionNArguments) {
    // SAFETY: as in `intersect`, with N lanes of rays only.
    unsafe {
        let arguments = &*arguments;
        let places = &*arguments.geometryUserPtr.cast::<ClustersContext>();
        let query = arguments.context.cast::<QueryContext<'_>>();
        let rays = Lanes { words: arguments.ray.cast(), n: arguments.N as usize };
        for lane in active(arguments.valid, rays.n) {
            *arguments.valid.add(lane) = 0;
            let Some(mut ray) = places.ray(arguments.primID, rays, lane) else { continue };
            places.enter(arguments.primID, query, |scene, _| calls::occluded1(scene, query, &mut ray));
            if ray.tfar < 0.0 {
                *arguments.valid.add(lane) = -1;
                rays.set(TFAR, lane, f32::NEG_INFINITY);
            }
        }
    }
}
