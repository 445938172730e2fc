//! The lane kernels of Lumiris: the same arithmetic for many numbers at once, over slices.
//!
//! A kernel is written once over vectors and compiled for each instruction set; [`Level`] chooses one when it is
//! called. Only IEEE addition, multiplication, division and square root are used, in one order and never fused, so that
//! the results are the same bits at every level. The scalar twin of a kernel is the kernel itself at the level without
//! vectors, `Level::fallback()`. Slices may have any length: the last vector overlaps the one before it, and fewer
//! numbers than one vector are padded.
//!
//! In kernels there are no closures and no `map` over arrays: their code would be compiled without the vectors.
//!
//! Reading order: [`lane`], [`curve`], [`light`], [`area`], [`environment`], [`bsdf`], [`combine`].

pub mod area;
pub mod bsdf;
pub mod combine;
pub mod curve;
pub mod environment;
pub mod lane;
pub mod light;

pub use environment::Environment;
pub use fearless_simd::Level;
pub use light::LightLanes;

/// The best instruction set of this machine.
#[inline]
pub fn level() -> Level {
    Level::new()
}
