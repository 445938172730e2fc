//! Random numbers of many sample streams at once: coordinates of Owen-scrambled Sobol' points [Burley 2020],
//! bit-identical to [`SampleStream::draw`].
//!
//! A point's index is shuffled and each coordinate is scrambled with the Laine–Karras hash, which flips each digit
//! depending on the digits before it. The first coordinate is the index with its digits reversed. The second is the
//! first multiplied by Pascal's triangle modulo 2, in five steps on the digits. The others are products with the
//! columns of their matrices [Joe and Kuo 2008]. An index has 16 digits. A second scramble with a separate seed
//! follows.

use fearless_simd::{Level, dispatch};
use lumiris_numbers::math::ONE_MINUS_EPSILON;
use lumiris_numbers::samplers::{NetPoint, SampleStream};

/// Points per chunk.
const CHUNK: usize = 64;

/// Columns of the generator matrices of the third and fourth coordinate, by the digits of the index, lowest first.
const COLUMNS: [[u32; 16]; 2] = [
    [
        0xaa09, 0x7706, 0x3903, 0x1601, 0x09aa, 0x0677, 0x0339, 0x0116, 0x00a3, 0x0071, 0x003a, 0x0017, 0x0009, 0x0006,
        0x0003, 0x0001,
    ],
    [
        0xa0c3, 0x4041, 0x302d, 0x101e, 0x0b67, 0x079a, 0x02a4, 0x011b, 0x00c9, 0x0045, 0x002e, 0x001f, 0x000a, 0x0004,
        0x0003, 0x0001,
    ],
];

/// Draws N ≤ 4 numbers of each stream: `out[d][i]` is the d-th number of stream `i`. All slices have the same length.
pub fn draw<const N: usize>(level: Level, streams: &[SampleStream], mut out: [&mut [f32]; N]) {
    let none = NetPoint { index: 0, seed: 0, scramble: 0 };
    let mut points = [none; CHUNK];
    for (chunk, streams) in streams.chunks(CHUNK).enumerate() {
        let first = chunk * CHUNK;
        // Streams without a net are drawn one by one
        let mut are_nets = true;
        for (point, stream) in points.iter_mut().zip(streams) {
            match stream.net_point() {
                Some(of_stream) => *point = of_stream,
                None => are_nets = false,
            }
        }
        if are_nets {
            draw_chunk(level, &points[..streams.len()], first, &mut out);
        } else {
            for (lane, stream) in streams.iter().enumerate() {
                for (out, u) in out.iter_mut().zip(stream.draw::<N>()) {
                    out[first + lane] = u;
                }
            }
        }
    }
}

/// The first N ≤ 4 coordinates of each point: `out[d][i]` is the d-th coordinate of point `i`. All slices have the same
/// length.
pub fn draw_points<const N: usize>(level: Level, points: &[NetPoint], mut out: [&mut [f32]; N]) {
    for (chunk, points) in points.chunks(CHUNK).enumerate() {
        draw_chunk(level, points, chunk * CHUNK, &mut out);
    }
}

/// Computes at most [`CHUNK`] points, and stores their coordinates from index `first` on.
#[inline]
fn draw_chunk<const N: usize>(level: Level, points: &[NetPoint], first: usize, out: &mut [&mut [f32]; N]) {
    let (mut index, mut seeds) = ([0; CHUNK], [[0; CHUNK]; 2]);
    for (lane, point) in points.iter().enumerate() {
        (index[lane], seeds[0][lane], seeds[1][lane]) = (point.index, point.seed, point.scramble);
    }
    let mut u = [[0.0; CHUNK]; N];
    dispatch!(level, _simd => coordinates(&index, &seeds, &mut u));
    for (out, u) in out.iter_mut().zip(&u) {
        out[first..first + points.len()].copy_from_slice(&u[..points.len()]);
    }
}

#[inline(always)]
fn coordinates<const N: usize>(
    index: &[u32; CHUNK],
    [seed, scramble]: &[[u32; CHUNK]; 2],
    out: &mut [[f32; CHUNK]; N],
) {
    // Shuffle the indices
    let mut shuffled = [0; CHUNK];
    for i in 0..CHUNK {
        shuffled[i] = permuted(index[i].reverse_bits(), seed[i]) >> 16;
    }
    // Generate the digits of each coordinate, and scramble them
    for (d, out) in out.iter_mut().enumerate() {
        let mut digits = [0; CHUNK];
        match d {
            0 => {
                for i in 0..CHUNK {
                    digits[i] = reversed(shuffled[i]);
                }
            }
            1 => {
                for i in 0..CHUNK {
                    digits[i] = by_pascal(reversed(shuffled[i]));
                }
            }
            _ => {
                for (k, column) in COLUMNS[d - 2].iter().enumerate() {
                    for i in 0..CHUNK {
                        digits[i] ^= (shuffled[i] >> k & 1).wrapping_neg() & column;
                    }
                }
            }
        }
        for i in 0..CHUNK {
            let once = permuted(digits[i], seed[i].rotate_right(8 * d as u32));
            out[i] = unit(permuted(once, scramble[i].rotate_right(8 * d as u32)).reverse_bits());
        }
    }
}

/// The Laine–Karras hash: each digit depends only on lower digits.
#[inline(always)]
const fn permuted(mut x: u32, seed: u32) -> u32 {
    x ^= x.wrapping_mul(0x3d20_adea);
    x = x.wrapping_add(seed);
    x = x.wrapping_mul(seed >> 16 | 1);
    x ^= x.wrapping_mul(0x0552_6c56);
    x ^ x.wrapping_mul(0x53a2_2864)
}

/// Reverses 16 digits.
#[inline(always)]
const fn reversed(x: u32) -> u32 {
    x.reverse_bits() >> 16
}

/// Multiplies 16 digits, the first one highest, by Pascal's triangle modulo 2.
#[inline(always)]
const fn by_pascal(x: u32) -> u32 {
    let x = x ^ x >> 1 & 0x5555;
    let x = x ^ x >> 2 & 0x3333;
    let x = x ^ x >> 4 & 0x0f0f;
    x ^ x >> 8 & 0x00ff
}

/// x/2³², rounded so that the result is below 1.
#[inline(always)]
fn unit(x: u32) -> f32 {
    let u = (x & !(x >> 24)) as f32 * (1.0 / 4_294_967_296.0);
    if u < ONE_MINUS_EPSILON { u } else { ONE_MINUS_EPSILON }
}
