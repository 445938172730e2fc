//! SIMD kernels: the same arithmetic for many numbers at once, over slices of any length. (The last vector overlaps the
//! previous one; fewer numbers than one vector are padded.) A kernel is written once over vectors and compiled for each
//! instruction set; its [`Level`] argument chooses one. Only IEEE addition, multiplication, division and square root
//! are used, in one order and never fused, so that results are bit-identical at every level. The scalar twin is the
//! kernel at the level without vectors, `Level::fallback()`, which the feature `scalar` adds. Kernels contain no
//! closures and no `map` over arrays: these would be compiled without vector instructions.
//!
//! Reading order: [`lane`], [`wide`], [`columns`], [`hilbert`], [`sampler`], [`light`], [`area`], [`environment`],
//! [`kernels`], [`ris_weights`], [`camera`], [`hits`], [`triangles`], [`triangle_points`], [`vertex`], [`connections`],
//! [`light_tree`], [`light_descent`], [`sums`], [`prefetch`].

pub mod area;
pub mod camera;
pub mod columns;
pub mod connections;
pub mod environment;
pub mod hilbert;
pub mod hits;
pub mod kernels;
pub mod lane;
pub mod light;
pub mod light_descent;
pub mod light_tree;
pub mod prefetch;
pub mod ris_weights;
pub mod sampler;
pub mod sums;
pub mod triangle_points;
pub mod triangles;
pub mod vertex;
pub mod wide;

pub use environment::Environment;
pub use fearless_simd::Level;
pub use light::LightLanes;

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{PoisonError, RwLock};

/// The level chosen by [`set_level`].
static CHOSEN: RwLock<Option<Level>> = RwLock::new(None);

/// True if a level was chosen.
static IS_CHOSEN: AtomicBool = AtomicBool::new(false);

/// The instruction set for kernels: the best of this machine, unless another was chosen.
#[inline]
pub fn level() -> Level {
    let chosen = || *CHOSEN.read().unwrap_or_else(PoisonError::into_inner);
    if IS_CHOSEN.load(Ordering::Relaxed) { chosen().unwrap_or_else(Level::new) } else { Level::new() }
}

/// Chooses the instruction set for all kernels of the process from now on; `None` for the best one. Results do not
/// change by a bit.
pub fn set_level(level: Option<Level>) {
    *CHOSEN.write().unwrap_or_else(PoisonError::into_inner) = level;
    IS_CHOSEN.store(level.is_some(), Ordering::Relaxed);
}

/// The instruction sets of this machine, the best last.
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
