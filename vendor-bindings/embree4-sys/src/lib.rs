//! Raw bindings for Embree 4.x and for Embree 3.13 (Debian 12).
//!
//! The build script chooses the bindings by the header it finds, or with the feature `generate-bindings` makes them from
//! it, and sets the cfg `embree3` or
//! `embree4`, and `embree_instance_array` if hits carry `instPrimID`. Dependents read the family
//! from `DEP_EMBREE_FAMILY` in their build script, or from [`FAMILY`].
//!
//! Everything is as in Embree's headers. Enumerations are newtypes over integers
//! (`RTCError::RTC_ERROR_NONE`), never Rust enums: a library newer than the header may return
//! values that the header does not have. The inline functions of the headers, which no
//! library exports, are written in Rust as far as they are needed.
//!
//! Differences between the families that a caller must handle:
//!
//! | | 3.13 | 4.x |
//! |---|---|---|
//! | `rtcIntersect1`, `rtcOccluded8`, … end with | `context, ray`; the context is not null | `ray, arguments`; the arguments may be null |
//! | flag for coherent rays | `RTCIntersectContextFlags` (bit 0) | `RTCRayQueryFlags` (bit 16) |
//! | ray streams (`rtcOccluded1M`, …) | yes | removed |
//! | a geometry's mask by default | `0xFFFF_FFFF` | `1` |
#![allow(clippy::all, clippy::pedantic, clippy::undocumented_unsafe_blocks)]
#![allow(non_camel_case_types, non_snake_case, non_upper_case_globals)]

/// A committed file, or what the feature `generate-bindings` made of the headers.
#[rustfmt::skip]
mod bindings {
    include!(env!("EMBREE_BINDINGS"));
}

mod inline;
// Bindings that were made from the headers assert the layout of these.
#[cfg(not(feature = "generate-bindings"))]
mod layout;

pub use bindings::*;
pub use inline::*;
