//! Embree's query functions, with one interface for both API versions.
#![allow(unsafe_code)]

use super::callbacks::first_filter;
use super::context::{Mode, QueryContext, QueryKind, RtcContext};
use super::scene_ids::SceneIds;
use crate::accel::RayBatch;
use embree4_sys as sys;
use lumiris_lanes::hits::BLOCK;

/// Words per hit in addition to the eight of all versions: `instPrimID`, if it exists.
const EXTRA_HIT_WORDS: usize = if size_of::<sys::RTCRayHit8>() == 640 { 0 } else { 1 };

/// N rays.
#[repr(C, align(64))]
#[derive(Clone, Copy, Debug)]
pub(super) struct RayPacket<const N: usize> {
    pub o: [[f32; N]; 3],
    pub tnear: [f32; N],
    pub d: [[f32; N]; 3],
    pub time: [f32; N],
    pub tfar: [f32; N],
    pub mask: [u32; N],
    pub id: [u32; N],
    pub flags: [u32; N],
}

/// N rays and their hits.
#[repr(C, align(64))]
#[derive(Clone, Copy, Debug)]
pub(super) struct RayHitPacket<const N: usize> {
    pub rays: RayPacket<N>,
    pub ng: [[f32; N]; 3],
    pub u: [f32; N],
    pub v: [f32; N],
    pub primitive: [u32; N],
    pub geometry: [u32; N],
    pub instance: [u32; N],
    pub extra: [[u32; N]; EXTRA_HIT_WORDS],
}

/// −1 in lanes that hold a ray.
#[repr(C, align(64))]
#[derive(Clone, Copy, Debug)]
pub(super) struct Valid<const N: usize>(pub [i32; N]);

const _: () = {
    assert!(size_of::<RayPacket<4>>() == size_of::<sys::RTCRay4>());
    assert!(size_of::<RayPacket<8>>() == size_of::<sys::RTCRay8>());
    assert!(size_of::<RayHitPacket<4>>() >= size_of::<sys::RTCRayHit4>());
    assert!(size_of::<RayPacket<16>>() == size_of::<sys::RTCRay16>());
    assert!(size_of::<RayHitPacket<8>>() >= size_of::<sys::RTCRayHit8>());
    assert!(size_of::<RayHitPacket<16>>() == size_of::<sys::RTCRayHit16>());
    assert!(align_of::<RayPacket<16>>() >= align_of::<sys::RTCRayHit16>());
    assert!(std::mem::offset_of!(RayHitPacket<4>, ng) == std::mem::offset_of!(sys::RTCRayHit4, hit));
    assert!(std::mem::offset_of!(RayHitPacket<8>, ng) == std::mem::offset_of!(sys::RTCRayHit8, hit));
    assert!(std::mem::offset_of!(RayHitPacket<16>, ng) == std::mem::offset_of!(sys::RTCRayHit16, hit));
    assert!(std::mem::offset_of!(RayPacket<16>, tfar) == std::mem::offset_of!(sys::RTCRay16, tfar));
    assert!(std::mem::offset_of!(RayPacket<8>, tfar) == std::mem::offset_of!(sys::RTCRay8, tfar));
};

/// Start of the interval that Embree tests. Embree accepts hits at t = 0, and rays that leave a plane through a
/// coordinate origin start exactly on it. The value is far below any distance, and large enough not to underflow when
/// multiplied.
pub(super) const T_NEAR: f32 = 1e-20;

/// True if the ray is finite, not empty, and has a direction. Other rays could break the traversal.
#[inline]
pub(super) fn can_trace(o: [f32; 3], d: [f32; 3], t_max: f32) -> bool {
    // x·0 is NaN if x is not finite, and so is the sum
    let zero = o[0] * 0.0 + o[1] * 0.0 + o[2] * 0.0 + d[0] * 0.0 + d[1] * 0.0 + d[2] * 0.0;
    (zero == 0.0) & (t_max > 0.0) & ((d[0] != 0.0) | (d[1] != 0.0) | (d[2] != 0.0))
}

impl<const N: usize> RayPacket<N> {
    pub(super) fn new(mask: u32) -> Self {
        let zero = [0.0; N];
        let (o, d) = ([zero; 3], [zero; 3]);
        RayPacket { o, tnear: [T_NEAR; N], d, time: zero, tfar: zero, mask: [mask; N], id: [0; N], flags: [0; N] }
    }
}

impl<const N: usize> RayHitPacket<N> {
    pub(super) fn new(mask: u32) -> Self {
        let (zero, none) = ([0.0; N], [u32::MAX; N]);
        RayHitPacket {
            rays: RayPacket::new(mask),
            ng: [zero; 3],
            u: zero,
            v: zero,
            primitive: none,
            geometry: none,
            instance: none,
            extra: [none; EXTRA_HIT_WORDS],
        }
    }

    /// Stores the hits in the block of a query, from `lane` on.
    #[inline]
    pub(super) fn store(&self, query: &mut QueryContext<'_>, lane: usize) {
        const { assert!(BLOCK.is_multiple_of(N)) };
        let (first, best_t, lanes) = (&mut query.first, &query.best_t, lane..lane + N);
        first.geometry[lanes.clone()].copy_from_slice(&self.geometry);
        first.primitive[lanes.clone()].copy_from_slice(&self.primitive);
        first.instance[lanes.clone()].copy_from_slice(&self.instance);
        first.t[lanes.clone()].copy_from_slice(&best_t[lanes.clone()]);
        first.uv[0][lanes.clone()].copy_from_slice(&self.u);
        first.uv[1][lanes].copy_from_slice(&self.v);
    }
}

/// The context of queries for a batch.
pub(super) fn query_context<'a>(world: &'a SceneIds, rays: &'a RayBatch, mode: Mode) -> QueryContext<'a> {
    QueryContext::new(rtc_context(mode), world, rays, mode)
}

#[cfg(embree3)]
fn rtc_context(mode: Mode) -> RtcContext {
    let mut context = sys::rtcInitIntersectContext();
    if mode.coherent {
        context.flags = sys::RTCIntersectContextFlags::RTC_INTERSECT_CONTEXT_FLAG_COHERENT;
    }
    if matches!(mode.query, QueryKind::First(_)) {
        context.filter = Some(first_filter);
    }
    context
}

#[cfg(embree4)]
fn rtc_context(_mode: Mode) -> RtcContext {
    let mut context = RtcContext::default();
    // SAFETY: it consists of ids, and the invalid id has all bits set.
    unsafe { std::ptr::write_bytes(&raw mut context, 0xFF, 1) };
    context
}

#[cfg(embree4)]
fn query_flags(mode: Mode) -> sys::RTCRayQueryFlags {
    use sys::RTCRayQueryFlags as Flags;
    let coherent = if mode.coherent { Flags::RTC_RAY_QUERY_FLAG_COHERENT.0 } else { 0 };
    let filter =
        if matches!(mode.query, QueryKind::First(_)) { Flags::RTC_RAY_QUERY_FLAG_INVOKE_ARGUMENT_FILTER.0 } else { 0 };
    Flags(coherent | filter)
}

#[cfg(embree4)]
fn intersect_arguments(context: *mut QueryContext<'_>, mode: Mode) -> sys::RTCIntersectArguments {
    sys::RTCIntersectArguments {
        flags: query_flags(mode),
        context: context.cast(),
        filter: Some(first_filter),
        ..sys::rtcInitIntersectArguments()
    }
}

#[cfg(embree4)]
fn occluded_arguments(context: *mut QueryContext<'_>, mode: Mode) -> sys::RTCOccludedArguments {
    sys::RTCOccludedArguments { flags: query_flags(mode), context: context.cast(), ..sys::rtcInitOccludedArguments() }
}

/// # Safety
/// The scene is committed; the pointers are to live values that nothing else refers to; rays are finite and have a
/// direction; ids are indices of the context's batch; the context was made with `mode`. The other three functions have
/// the same conditions.
#[inline]
#[cfg_attr(embree3, expect(unused_variables, reason = "the context holds the mode"))]
pub(super) unsafe fn intersect1(
    scene: sys::RTCScene,
    context: *mut QueryContext<'_>,
    mode: Mode,
    ray: *mut sys::RTCRayHit,
) {
    // SAFETY: by the caller.
    unsafe {
        #[cfg(embree3)]
        sys::rtcIntersect1(scene, context.cast(), ray);
        #[cfg(embree4)]
        sys::rtcIntersect1(scene, ray, &mut intersect_arguments(context, mode));
    }
}

/// # Safety
/// As [`intersect1`].
#[inline]
pub(super) unsafe fn occluded1(scene: sys::RTCScene, context: *mut QueryContext<'_>, ray: *mut sys::RTCRay) {
    // SAFETY: by the caller.
    unsafe {
        #[cfg(embree3)]
        sys::rtcOccluded1(scene, context.cast(), ray);
        #[cfg(embree4)]
        sys::rtcOccluded1(
            scene,
            ray,
            &mut occluded_arguments(context, Mode { query: QueryKind::Any, coherent: false }),
        );
    }
}

/// N is 4, 8 or 16; the context was made with `mode`.
///
/// # Safety
/// As [`intersect1`], for the lanes that `valid` names.
#[inline]
#[cfg_attr(embree3, expect(unused_variables, reason = "the context holds the mode"))]
pub(super) unsafe fn intersect_packet<const N: usize>(
    scene: sys::RTCScene,
    context: *mut QueryContext<'_>,
    mode: Mode,
    valid: &Valid<N>,
    rays: &mut RayHitPacket<N>,
) {
    const { assert!(N == 4 || N == 8 || N == 16) };
    let (valid, rays): (*const i32, *mut RayHitPacket<N>) = (valid.0.as_ptr(), rays);
    // SAFETY: by the caller; the layouts match the header by the assertions above.
    unsafe {
        #[cfg(embree3)]
        match N {
            4 => sys::rtcIntersect4(valid, scene, context.cast(), rays.cast()),
            8 => sys::rtcIntersect8(valid, scene, context.cast(), rays.cast()),
            _ => sys::rtcIntersect16(valid, scene, context.cast(), rays.cast()),
        }
        #[cfg(embree4)]
        match N {
            4 => sys::rtcIntersect4(valid, scene, rays.cast(), &mut intersect_arguments(context, mode)),
            8 => sys::rtcIntersect8(valid, scene, rays.cast(), &mut intersect_arguments(context, mode)),
            _ => sys::rtcIntersect16(valid, scene, rays.cast(), &mut intersect_arguments(context, mode)),
        }
    }
}

/// N is 4, 8 or 16; the context was made with `mode`.
///
/// # Safety
/// As [`intersect1`], for the lanes that `valid` names.
#[inline]
#[cfg_attr(embree3, expect(unused_variables, reason = "the context holds the mode"))]
pub(super) unsafe fn occluded_packet<const N: usize>(
    scene: sys::RTCScene,
    context: *mut QueryContext<'_>,
    mode: Mode,
    valid: &Valid<N>,
    rays: &mut RayPacket<N>,
) {
    const { assert!(N == 4 || N == 8 || N == 16) };
    let (valid, rays): (*const i32, *mut RayPacket<N>) = (valid.0.as_ptr(), rays);
    // SAFETY: by the caller; the layouts match the header by the assertions above.
    unsafe {
        #[cfg(embree3)]
        match N {
            4 => sys::rtcOccluded4(valid, scene, context.cast(), rays.cast()),
            8 => sys::rtcOccluded8(valid, scene, context.cast(), rays.cast()),
            _ => sys::rtcOccluded16(valid, scene, context.cast(), rays.cast()),
        }
        #[cfg(embree4)]
        match N {
            4 => sys::rtcOccluded4(valid, scene, rays.cast(), &mut occluded_arguments(context, mode)),
            8 => sys::rtcOccluded8(valid, scene, rays.cast(), &mut occluded_arguments(context, mode)),
            _ => sys::rtcOccluded16(valid, scene, rays.cast(), &mut occluded_arguments(context, mode)),
        }
    }
}
