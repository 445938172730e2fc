//! Asserts the same sizes and offsets for the bindings that `probe.c` asserts for the headers, so that the structures
//! have one layout on both sides.

use super::*;
use std::mem::{align_of, offset_of, size_of};

/// 1 if a hit has the member `instPrimID`.
const INSTANCE_ARRAY: usize = cfg!(embree_instance_array) as usize;
/// Words of a hit per ray.
const HIT_WORDS: usize = 8 + INSTANCE_ARRAY;

/// Asserts the layout of one packet width: 12 words per ray, then the hit, padded to `align`.
macro_rules! check_ray_hit {
    ($k:literal, $align:literal, $ray:ident, $hit:ident, $ray_hit:ident) => {
        const _: () = {
            assert!(size_of::<$ray>() == 48 * $k);
            assert!(align_of::<$ray>() == $align);
            assert!(offset_of!($ray, tnear) == 12 * $k);
            assert!(offset_of!($ray, dir_x) == 16 * $k);
            assert!(offset_of!($ray, time) == 28 * $k);
            assert!(offset_of!($ray, tfar) == 32 * $k);
            assert!(offset_of!($ray, mask) == 36 * $k);
            assert!(offset_of!($ray, id) == 40 * $k);
            assert!(offset_of!($ray, flags) == 44 * $k);
            assert!(offset_of!($hit, u) == 12 * $k);
            assert!(offset_of!($hit, v) == 16 * $k);
            assert!(offset_of!($hit, primID) == 20 * $k);
            assert!(offset_of!($hit, geomID) == 24 * $k);
            assert!(offset_of!($hit, instID) == 28 * $k);
            assert!(size_of::<$hit>() == (4 * HIT_WORDS * $k as usize).next_multiple_of($align));
            assert!(offset_of!($ray_hit, hit) == 48 * $k);
            assert!(size_of::<$ray_hit>() == (4 * (12 + HIT_WORDS) * $k as usize).next_multiple_of($align));
        };
    };
}

check_ray_hit!(1, 16, RTCRay, RTCHit, RTCRayHit);
check_ray_hit!(4, 16, RTCRay4, RTCHit4, RTCRayHit4);
check_ray_hit!(8, 32, RTCRay8, RTCHit8, RTCRayHit8);
check_ray_hit!(16, 64, RTCRay16, RTCHit16, RTCRayHit16);

const _: () = {
    assert!(size_of::<RTCBounds>() == 32 && align_of::<RTCBounds>() == 16);
    assert!(size_of::<RTCFilterFunctionNArguments>() == 48);
    assert!(offset_of!(RTCFilterFunctionNArguments, N) == 40);
};

#[cfg(embree4)]
const _: () = {
    assert!(size_of::<RTCIntersectArguments>() == 32);
    assert!(offset_of!(RTCIntersectArguments, filter) == 16);
    assert!(size_of::<RTCOccludedArguments>() == 32);
    assert!(offset_of!(RTCOccludedArguments, filter) == 16);
    assert!(size_of::<RTCRayQueryContext>() == 4 + 4 * INSTANCE_ARRAY);
};

#[cfg(embree3)]
const _: () = {
    assert!(size_of::<RTCIntersectContext>() == 24);
    assert!(offset_of!(RTCIntersectContext, filter) == 8);
    assert!(offset_of!(RTCIntersectContext, instID) == 16);
};
