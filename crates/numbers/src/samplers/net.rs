//! Points of nets.

use super::blue_noise::{BLOCK, BlueNoise};
use crate::math::hash::{pcg4d, unit_f32};
use openqmc::float::uint_to_float;
use openqmc::owen::{scramble_and_reverse, shuffled_scrambled_sobol};
use openqmc::rotate::rotate_bytes;

/// Domain of Russian roulette; an arbitrary reserved key.
const ROULETTE: u32 = 0x9e37_79b9;

/// A point of a net in the tree of domains.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Net {
    /// Hash of the seed, the domains, and the pixel or its block.
    pub(super) key: [u32; 2],
    /// Index of the point.
    pub(super) index: u16,
    /// The pixel in its block.
    pub(super) pixel: [u8; 2],
}

impl Net {
    /// The root of a sample; `place` is the pixel or its block.
    pub(super) fn new(place: [u32; 2], pixel: [u32; 2], sample: u32, seed: u32) -> Self {
        // The sequences have 65,536 points
        let [a, b, ..] = pcg4d([place[0], place[1], sample >> 16, seed]);
        Net { key: [a, b], index: sample as u16, pixel: pixel.map(|x| (x % BLOCK) as u8) }
    }

    #[inline]
    pub(super) fn domain(&self, key: u32) -> Self {
        let [a, b, ..] = pcg4d([self.key[0], self.key[1], key, 0]);
        Net { key: [a, b], ..*self }
    }

    #[inline]
    pub(super) fn split(&self, key: u32, count: u32, index: u32) -> Self {
        let all = u32::from(self.index).wrapping_mul(count).wrapping_add(index);
        Net { index: all as u16, ..self.domain(key).domain(all >> 16) }
    }

    /// Coordinates of the point of a separate net.
    #[inline]
    pub(super) fn draw<const N: usize>(&self) -> [f32; N] {
        coordinates(u32::from(self.index), self.key[0], self.key[1])
    }

    /// Coordinates of the point with blue-noise errors.
    #[inline]
    pub(super) fn draw_blue_noise<const N: usize>(&self) -> [f32; N] {
        let BlueNoise { seed, rank } = BlueNoise::of(self.key[0], self.words()[2] >> 16);
        coordinates(u32::from(self.index) ^ rank, seed, self.key[1])
    }

    /// A number that is independent of all others.
    #[inline]
    pub(super) fn random(&self) -> f32 {
        let [a, b, place] = self.words();
        unit_f32(pcg4d([a, b, place, ROULETTE])[0])
    }
}

/// The first coordinates of a point of an Owen-scrambled Sobol' sequence in four dimensions, with a second Owen
/// scramble.
#[inline]
fn coordinates<const N: usize>(index: u32, seed: u32, scramble: u32) -> [f32; N] {
    let u = shuffled_scrambled_sobol::<N>(index, seed);
    std::array::from_fn(|d| {
        let scramble = rotate_bytes(scramble, d as i32);
        uint_to_float(scramble_and_reverse(u[d].reverse_bits(), scramble))
    })
}
