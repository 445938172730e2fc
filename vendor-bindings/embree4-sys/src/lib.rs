//! Raw bindings for Embree 4.x and for Embree 3.13 (Debian 12).
//!
//! The build script chooses the bindings for the headers, or generates them with the feature `generate-bindings`. It
//! sets the cfg `embree3` or `embree4`, and `embree_instance_array` if hits have `instPrimID`. Dependents read the
//! family from `DEP_EMBREE_FAMILY` in their build script, or from [`FAMILY`].
//!
//! Names are as in Embree's headers. Enumerations are newtypes over integers (`RTCError::RTC_ERROR_NONE`), never Rust
//! enums: a library newer than the headers may return values that the headers do not have. The inline functions of the
//! headers, which no library exports, are written in Rust as far as they are needed.
//!
//! Differences between the families that a caller must handle:
//!
//! | | 3.13 | 4.x |
//! |---|---|---|
//! | last arguments of `rtcIntersect1`, `rtcOccluded8`, … | `context, ray`, not null | `ray, arguments`, may be null |
//! | flag for coherent rays | `RTCIntersectContextFlags` (bit 0) | `RTCRayQueryFlags` (bit 16) |
//! | ray streams (`rtcOccluded1M`, …) | yes | removed |
//! | a geometry's mask by default | `0xFFFF_FFFF` | `1` |
#![allow(clippy::all, clippy::pedantic, clippy::undocumented_unsafe_blocks)]
#![allow(non_camel_case_types, non_snake_case, non_upper_case_globals)]

/// The committed bindings, or those generated with the feature `generate-bindings`.
#[rustfmt::skip]
mod bindings {
    include!(env!("EMBREE_BINDINGS"));
}

mod inline;
// Generated bindings assert their own layout
#[cfg(not(feature = "generate-bindings"))]
mod layout;

pub use bindings::*;
pub use inline::*;
