//! Macros and inline functions of the headers, for which bindgen generates no code.

use super::*;

/// Embree's major version: 3 or 4.
pub const FAMILY: u32 = if cfg!(embree4) { 4 } else { 3 };

/// Version of the headers at build time, as `major * 10000 + minor * 100 + patch`. The version of the loaded library is
/// `rtcGetDeviceProperty(device, RTC_DEVICE_PROPERTY_VERSION)`.
pub const HEADER_VERSION: u32 = parse(env!("EMBREE_HEADER_VERSION"));

/// `geomID`, `primID` or `instID` of a ray without a hit.
pub const RTC_INVALID_GEOMETRY_ID: u32 = u32::MAX;

/// The context as initialised by `rtcInitIntersectContext`: incoherent rays, no filter, no instance.
#[cfg(embree3)]
#[must_use]
pub const fn rtcInitIntersectContext() -> RTCIntersectContext {
    RTCIntersectContext {
        flags: RTCIntersectContextFlags::RTC_INTERSECT_CONTEXT_FLAG_INCOHERENT,
        filter: None,
        instID: [RTC_INVALID_GEOMETRY_ID],
    }
}

/// The arguments as initialised by `rtcInitIntersectArguments`: incoherent rays, all features, no context, no
/// callbacks.
#[cfg(embree4)]
#[must_use]
pub const fn rtcInitIntersectArguments() -> RTCIntersectArguments {
    RTCIntersectArguments {
        flags: RTCRayQueryFlags::RTC_RAY_QUERY_FLAG_INCOHERENT,
        feature_mask: RTCFeatureFlags::RTC_FEATURE_FLAG_ALL,
        context: std::ptr::null_mut(),
        filter: None,
        intersect: None,
    }
}

/// The arguments as initialised by `rtcInitOccludedArguments`: incoherent rays, all features, no context, no callbacks.
#[cfg(embree4)]
#[must_use]
pub const fn rtcInitOccludedArguments() -> RTCOccludedArguments {
    RTCOccludedArguments {
        flags: RTCRayQueryFlags::RTC_RAY_QUERY_FLAG_INCOHERENT,
        feature_mask: RTCFeatureFlags::RTC_FEATURE_FLAG_ALL,
        context: std::ptr::null_mut(),
        filter: None,
        occluded: None,
    }
}

/// Parses a decimal number written by the build script.
const fn parse(digits: &str) -> u32 {
    let bytes = digits.as_bytes();
    let mut value = 0;
    let mut i = 0;
    while i < bytes.len() {
        value = value * 10 + (bytes[i] - b'0') as u32;
        i += 1;
    }
    value
}
