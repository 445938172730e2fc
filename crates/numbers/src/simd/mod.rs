//! Lane kernels: the same arithmetic for many numbers at once, over slices.
//!
//! A kernel is written once over vectors and compiled for each instruction set; [`Level`] chooses one when it is called.
//! Only IEEE addition, multiplication, division and square root are used, in one order and never fused, so that the
//! results are the same bits at every level. The scalar twin of a kernel is the kernel itself at the level without
//! vectors, `Level::fallback()`. Slices may have any length: the last
//! vector overlaps the one before it, and fewer numbers than one vector are padded.
//!
//! In kernels there are no closures and no `map` over arrays: their code would be compiled without the vectors.
//!
//! Reading order: [`lane`], [`curve`], [`light`], [`area`], [`environment`], [`bsdf`], [`combine`], [`ocv`].

pub mod area;
pub mod bsdf;
pub mod combine;
pub mod curve;
pub mod environment;
pub mod lane;
pub mod light;
pub mod ocv;

pub use environment::Environment;
pub use fearless_simd::Level;
pub use light::LightLanes;

/// The best instruction set of this machine.
#[inline]
pub fn level() -> Level {
    Level::new()
}

#[cfg(test)]
pub(crate) mod test_support {
    use super::Level;

    /// All levels of this machine, the scalar one first.
    pub(crate) fn levels() -> Vec<Level> {
        let mut levels = vec![Level::fallback(), Level::baseline()];
        #[cfg(target_arch = "x86_64")]
        {
            let best = Level::new();
            levels.extend(best.as_sse4_2().map(Level::Sse4_2));
            levels.extend(best.as_avx2().map(Level::Avx2));
            levels.extend(best.as_avx512().map(Level::Avx512));
        }
        levels
    }

    /// Lengths with and without full vectors.
    pub(crate) const LENGTHS: [usize; 12] = [0, 1, 3, 4, 7, 8, 9, 16, 23, 32, 77, 128];

    /// Asserts that `run` writes the same bits at all levels.
    pub(crate) fn assert_same_bits<const N: usize>(len: usize, mut run: impl FnMut(Level, [&mut [f32]; N])) {
        let mut first: Option<[Vec<u32>; N]> = None;
        for level in levels() {
            let mut out: [Vec<f32>; N] = std::array::from_fn(|_| vec![-7.0; len]);
            run(level, out.each_mut().map(|v| &mut v[..]));
            // NaN is NaN: its payload is not kept by all.
            let bits = out.map(|v| v.iter().map(|x| if x.is_nan() { u32::MAX } else { x.to_bits() }).collect());
            match &first {
                None => first = Some(bits),
                Some(first) => assert_eq!(*first, bits, "{level:?}, {len} lanes"),
            }
        }
    }
}
