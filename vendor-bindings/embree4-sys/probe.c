/* Compiled by build.rs against the headers, to reject headers that do not fit the committed bindings.
   build.rs defines EXPECT_FAMILY (3 or 4) and EXPECT_INSTANCE_ARRAY (0 or 1), which determine the
   bindings. src/layout.rs asserts the same sizes and offsets for the Rust side. */
#if EXPECT_FAMILY == 4
#include <embree4/rtcore.h>
#else
#include <embree3/rtcore.h>
#endif
#include <stddef.h>

#if EXPECT_FAMILY == 4
_Static_assert(RTC_VERSION >= 40000 && RTC_VERSION < 50000, "Embree 4.0 or later, below 5, is needed");
#else
_Static_assert(RTC_VERSION >= 31300 && RTC_VERSION < 40000, "Embree 3.13 or later is needed");
#endif

_Static_assert(RTC_MAX_INSTANCE_LEVEL_COUNT == 1,
               "Embree was built with EMBREE_MAX_INSTANCE_LEVEL_COUNT other than 1: the bindings have one level");
_Static_assert(RTC_MIN_WIDTH == 0, "Embree was built with EMBREE_MIN_WIDTH: the bindings are without it");

/* A packet of K rays has 12 words per ray, and 8 words per hit (9 with instance arrays), padded to the
   alignment of the packet. */
#define ROUND_UP(size, align) (((size) + (align) - 1) / (align) * (align))
#define HIT_WORDS (8 + EXPECT_INSTANCE_ARRAY)

#define CHECK_RAYHIT(K, ALIGN, RAY, HIT, RAYHIT)                                                              \
  _Static_assert(sizeof(struct RAY) == 48 * (K), "sizeof(" #RAY ") is not that of the bindings");             \
  _Static_assert(_Alignof(struct RAY) == (ALIGN), "alignof(" #RAY ") is not that of the bindings");           \
  _Static_assert(offsetof(struct RAY, tnear) == 12 * (K), "offsetof(" #RAY ", tnear)");                       \
  _Static_assert(offsetof(struct RAY, dir_x) == 16 * (K), "offsetof(" #RAY ", dir_x)");                       \
  _Static_assert(offsetof(struct RAY, time) == 28 * (K), "offsetof(" #RAY ", time)");                         \
  _Static_assert(offsetof(struct RAY, tfar) == 32 * (K), "offsetof(" #RAY ", tfar)");                         \
  _Static_assert(offsetof(struct RAY, mask) == 36 * (K), "offsetof(" #RAY ", mask)");                         \
  _Static_assert(offsetof(struct RAY, id) == 40 * (K), "offsetof(" #RAY ", id)");                             \
  _Static_assert(offsetof(struct RAY, flags) == 44 * (K), "offsetof(" #RAY ", flags)");                       \
  _Static_assert(offsetof(struct HIT, u) == 12 * (K), "offsetof(" #HIT ", u)");                               \
  _Static_assert(offsetof(struct HIT, v) == 16 * (K), "offsetof(" #HIT ", v)");                               \
  _Static_assert(offsetof(struct HIT, primID) == 20 * (K), "offsetof(" #HIT ", primID)");                     \
  _Static_assert(offsetof(struct HIT, geomID) == 24 * (K), "offsetof(" #HIT ", geomID)");                     \
  _Static_assert(offsetof(struct HIT, instID) == 28 * (K), "offsetof(" #HIT ", instID)");                     \
  _Static_assert(sizeof(struct HIT) == ROUND_UP(4 * HIT_WORDS * (K), (ALIGN)),                                \
                 "sizeof(" #HIT ") is not that of the bindings (EMBREE_GEOMETRY_INSTANCE_ARRAY?)");           \
  _Static_assert(offsetof(struct RAYHIT, hit) == 48 * (K), "offsetof(" #RAYHIT ", hit)");                     \
  _Static_assert(sizeof(struct RAYHIT) == ROUND_UP(4 * (12 + HIT_WORDS) * (K), (ALIGN)),                      \
                 "sizeof(" #RAYHIT ") is not that of the bindings (EMBREE_GEOMETRY_INSTANCE_ARRAY?)")

CHECK_RAYHIT(1, 16, RTCRay, RTCHit, RTCRayHit);
CHECK_RAYHIT(4, 16, RTCRay4, RTCHit4, RTCRayHit4);
CHECK_RAYHIT(8, 32, RTCRay8, RTCHit8, RTCRayHit8);
CHECK_RAYHIT(16, 64, RTCRay16, RTCHit16, RTCRayHit16);

_Static_assert(sizeof(struct RTCBounds) == 32 && _Alignof(struct RTCBounds) == 16, "sizeof(RTCBounds)");
_Static_assert(sizeof(struct RTCFilterFunctionNArguments) == 48, "sizeof(RTCFilterFunctionNArguments)");
_Static_assert(offsetof(struct RTCFilterFunctionNArguments, N) == 40, "offsetof(RTCFilterFunctionNArguments, N)");

#if EXPECT_FAMILY == 4
_Static_assert(sizeof(struct RTCIntersectArguments) == 32, "sizeof(RTCIntersectArguments)");
_Static_assert(offsetof(struct RTCIntersectArguments, filter) == 16, "offsetof(RTCIntersectArguments, filter)");
_Static_assert(sizeof(struct RTCOccludedArguments) == 32, "sizeof(RTCOccludedArguments)");
_Static_assert(offsetof(struct RTCOccludedArguments, filter) == 16, "offsetof(RTCOccludedArguments, filter)");
_Static_assert(sizeof(struct RTCRayQueryContext) == 4 + 4 * EXPECT_INSTANCE_ARRAY, "sizeof(RTCRayQueryContext)");
#else
_Static_assert(sizeof(struct RTCIntersectContext) == 24, "sizeof(RTCIntersectContext)");
_Static_assert(offsetof(struct RTCIntersectContext, filter) == 8, "offsetof(RTCIntersectContext, filter)");
_Static_assert(offsetof(struct RTCIntersectContext, instID) == 16, "offsetof(RTCIntersectContext, instID)");
#endif
