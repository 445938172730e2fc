//! The lane kernels of Lumiris: the same arithmetic for many numbers at once, over slices.
//!
//! A kernel is written once over vectors and compiled for each instruction set; [`Level`] chooses one when it is
//! called. Only IEEE addition, multiplication, division and square root are used, in one order and never fused, so that
//! the results are the same bits at every level. The scalar twin of a kernel is the kernel itself at the level without
//! vectors, `Level::fallback()`, which the feature `scalar` adds. Slices may have any length: the last vector overlaps
//! the one before it, and fewer numbers than one vector are padded.
//!
//! In kernels there are no closures and no `map` over arrays: their code would be compiled without the vectors.
//!
//! Reading order: [`lane`], [`wide`], [`columns`], [`curve`], [`sampler`], [`light`], [`area`], [`environment`], [`kernels`],
//! [`combine`], [`camera`], [`hits`], [`triangles`], [`vertex`], [`connections`],
//! [`light_choice`], [`sums`].

pub mod area;
pub mod camera;
pub mod columns;
pub mod combine;
pub mod connections;
pub mod curve;
pub mod environment;
pub mod hits;
pub mod kernels;
pub mod lane;
pub mod light;
pub mod light_choice;
pub mod sampler;
pub mod sums;
pub mod triangles;
pub mod vertex;
pub mod wide;

pub use environment::Environment;
pub use fearless_simd::Level;
pub use light::LightLanes;

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{PoisonError, RwLock};

/// The level that [`set_level`] chose.
static CHOSEN: RwLock<Option<Level>> = RwLock::new(None);

/// True if there is one.
static IS_CHOSEN: AtomicBool = AtomicBool::new(false);

/// The instruction set that kernels are called for: the best of this machine, unless another was chosen.
#[inline]
pub fn level() -> Level {
    let chosen = || *CHOSEN.read().unwrap_or_else(PoisonError::into_inner);
    if IS_CHOSEN.load(Ordering::Relaxed) { chosen().unwrap_or_else(Level::new) } else { Level::new() }
}

/// Chooses the instruction set of all kernels of the process from now on; the best one if `None`. It changes no bit of
/// a result.
pub fn set_level(level: Option<Level>) {
    *CHOSEN.write().unwrap_or_else(PoisonError::into_inner) = level;
    IS_CHOSEN.store(level.is_some(), Ordering::Relaxed);
}

/// The instruction sets of this machine, the best one last.
pub fn levels() -> Vec<Level> {
    let mut levels = vec![Level::baseline()];
    #[cfg(target_arch = "x86_64")]
    {
        let best = Level::new();
        levels.extend(best.as_sse4_2().map(Level::Sse4_2));
        levels.extend(best.as_avx2().map(Level::Avx2));
        levels.extend(best.as_avx512().map(Level::Avx512));
    }
    levels
}
