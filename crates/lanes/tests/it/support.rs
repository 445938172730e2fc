//! Levels and lengths at which kernels are tested.

use lumiris_lanes::Level;

/// All levels of this machine, the scalar one first if it is compiled in.
pub(crate) fn levels() -> Vec<Level> {
    #[cfg(feature = "scalar")]
    let scalar = Some(Level::fallback());
    #[cfg(not(feature = "scalar"))]
    let scalar = None;
    scalar.into_iter().chain(lumiris_lanes::levels()).collect()
}

/// Lengths with and without full vectors.
pub(crate) const LENGTHS: [usize; 12] = [0, 1, 3, 4, 7, 8, 9, 16, 23, 32, 77, 128];

/// Asserts that `run` writes the same bits at all levels. Returns the numbers.
pub(crate) fn assert_same_bits<const N: usize>(
    len: usize,
    mut run: impl FnMut(Level, [&mut [f32]; N]),
) -> [Vec<f32>; N] {
    let (mut first, mut last): (Option<[Vec<u32>; N]>, _) = (None, [const { Vec::new() }; N]);
    for level in levels() {
        let mut out: [Vec<f32>; N] = std::array::from_fn(|_| vec![-7.0; len]);
        run(level, out.each_mut().map(|v| &mut v[..]));
        // Payloads of NaN may differ
        let bits = out.each_ref().map(|v| v.iter().map(|x| if x.is_nan() { u32::MAX } else { x.to_bits() }).collect());
        match &first {
            None => first = Some(bits),
            Some(first) => assert_eq!(*first, bits, "{level:?}, {len} lanes"),
        }
        last = out;
    }
    last
}
