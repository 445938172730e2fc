//! Random streams of tests, by a generator of fixed definition: a test sees the same numbers on every machine and with
//! every version of the renderer, whose own numbers are the renderer's subject.

pub use rand::RngExt;
pub use rand_pcg::Pcg32;

use rand::SeedableRng;

/// The stream of a key; equal keys give equal numbers.
pub fn pcg32(key: [u32; 3]) -> Pcg32 {
    Pcg32::seed_from_u64(key.iter().fold(0, |seed: u64, &k| (seed ^ u64::from(k)).wrapping_mul(0x9e37_79b9_7f4a_7c15)))
}

/// A number of the standard normal distribution [Box and Muller 1958].
pub fn normal(stream: &mut Pcg32) -> f64 {
    let [u, v] = stream.random::<[f32; 2]>().map(f64::from);
    (-2.0 * (1.0 - u).ln()).sqrt() * (std::f64::consts::TAU * v).cos()
}
