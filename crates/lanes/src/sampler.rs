//! Random numbers of many sample streams at once: coordinates of Owen-scrambled Sobol' points [Burley 2020],
//! bit-identical to [`SampleStream::draw`](lumiris_numbers::samplers::SampleStream::draw).
//!
//! A point's index is shuffled and each coordinate is scrambled with the Laine–Karras hash, which flips each digit
//! depending on the digits before it. The first coordinate is the index with its digits reversed. The second is the
//! first multiplied by Pascal's triangle modulo 2, in five steps on the digits. The others are products with the
//! columns of their matrices [Joe and Kuo 2008]. An index has 16 digits. A second scramble with a separate seed
//! follows.

use fearless_simd::{Level, dispatch};
use lumiris_numbers::math::ONE_MINUS_EPSILON;
use lumiris_numbers::math::hash::{pcg4d, unit_f32};
use lumiris_numbers::samplers::{BlueNoise, INDEPENDENT, StreamColumns, StreamKind};
use std::ops::Range;

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

/// A node below each stream.
#[derive(Clone, Copy, Debug)]
pub enum Below {
    /// [`SampleStream::domain`](lumiris_numbers::samplers::SampleStream::domain) with this key.
    Domain(u32),
    /// [`SampleStream::split`](lumiris_numbers::samplers::SampleStream::split).
    Split {
        /// Key of the domain.
        key: u32,
        /// Number of points.
        count: u32,
        /// Index of the point.
        index: u32,
    },
}

/// Words of the streams of a chunk.
type Words = [[u32; CHUNK]; 3];

/// A chunk of at most [`CHUNK`] streams, with zeros behind.
#[inline]
fn chunk_of(words: [&[u32]; 3]) -> Words {
    let mut chunk = [[0; CHUNK]; 3];
    for (to, from) in chunk.iter_mut().zip(words) {
        to[..from.len()].copy_from_slice(from);
    }
    chunk
}

/// Replaces all streams by their domains `key`.
pub fn enter(level: Level, streams: &mut StreamColumns, key: u32) {
    let (kind, len) = (streams.kind(), streams.len());
    let mut words = streams.words_mut();
    for first in (0..len).step_by(CHUNK) {
        let rows = first..len.min(first + CHUNK);
        let mut chunk = chunk_of(words.each_ref().map(|words| &words[rows.clone()]));
        dispatch!(level, _simd => descend(kind, Below::Domain(key), &mut chunk));
        for (to, from) in words.iter_mut().zip(&chunk) {
            to[rows.clone()].copy_from_slice(&from[..rows.len()]);
        }
    }
}

/// Draws N ≤ 4 numbers of the node below each of the streams `rows`: `out[d][k]` is the d-th number of stream
/// `rows.start + k`.
pub fn draw<const N: usize>(
    level: Level,
    streams: &StreamColumns,
    rows: Range<usize>,
    below: Below,
    mut out: [&mut [f32]; N],
) {
    let (kind, words) = (streams.kind(), streams.words());
    for first in rows.clone().step_by(CHUNK) {
        let of_chunk = first..rows.end.min(first + CHUNK);
        let mut chunk = chunk_of(words.map(|words| &words[of_chunk.clone()]));
        let mut u = [[0.0; CHUNK]; N];
        draw_chunk(level, kind, below, &mut chunk, &mut u);
        for (out, u) in out.iter_mut().zip(&u) {
            out[first - rows.start..][..of_chunk.len()].copy_from_slice(&u[..of_chunk.len()]);
        }
    }
}

#[inline]
fn draw_chunk<const N: usize>(
    level: Level,
    kind: StreamKind,
    below: Below,
    words: &mut Words,
    out: &mut [[f32; CHUNK]; N],
) {
    match kind {
        StreamKind::Independent => dispatch!(level, _simd => independent(below, words, out)),
        StreamKind::Sobol => dispatch!(level, _simd => sobol(below, words, out)),
        StreamKind::SobolBlueNoise => {
            dispatch!(level, _simd => descend(kind, below, words));
            blue_noise(words);
            dispatch!(level, _simd => coordinates(words, out));
        }
    }
}

/// Replaces streams of points with blue-noise errors by these points.
fn blue_noise([a, _, c]: &mut Words) {
    // The samples of a pixel share their entry of the table
    let mut first = 0;
    while first < CHUNK {
        let (block, pixel) = (a[first], c[first] >> 16);
        let end = (first + 1..CHUNK).find(|&i| (a[i] != block) | (c[i] >> 16 != pixel)).unwrap_or(CHUNK);
        let entry = BlueNoise::of(block, pixel);
        a[first..end].fill(entry.seed);
        c[first..end].iter_mut().for_each(|c| *c = *c & 0xffff ^ entry.rank);
        first = end;
    }
}

/// Replaces streams by a node below each of them.
#[inline(always)]
fn descend(kind: StreamKind, below: Below, words: &mut Words) {
    let [a, b, c] = words;
    match (kind, below) {
        (StreamKind::Independent, Below::Domain(key)) => hash_key(a, b, c, key),
        (StreamKind::Independent, Below::Split { key, index, .. }) => {
            hash_key(a, b, c, key);
            hash_key(a, b, c, index);
        }
        (StreamKind::Sobol | StreamKind::SobolBlueNoise, Below::Domain(key)) => {
            for i in 0..CHUNK {
                [a[i], b[i]] = net_key([a[i], b[i]], key);
            }
        }
        (StreamKind::Sobol | StreamKind::SobolBlueNoise, Below::Split { key, count, index }) => {
            // The index of a point has 16 bits; the rest selects another net
            for i in 0..CHUNK {
                let all = (c[i] & 0xffff).wrapping_mul(count).wrapping_add(index);
                [a[i], b[i]] = net_key([a[i], b[i]], key);
                [a[i], b[i]] = net_key([a[i], b[i]], all >> 16);
                c[i] = c[i] & 0xffff_0000 | all & 0xffff;
            }
        }
    }
}

/// The key of a domain of a net.
#[inline(always)]
fn net_key([a, b]: [u32; 2], key: u32) -> [u32; 2] {
    let [a, b, ..] = pcg4d([a, b, key, 0]);
    [a, b]
}

/// The keys of a domain of independent numbers.
#[inline(always)]
fn hash_key(a: &mut [u32; CHUNK], b: &mut [u32; CHUNK], c: &mut [u32; CHUNK], key: u32) {
    for i in 0..CHUNK {
        let h = pcg4d([a[i], b[i], c[i], key]);
        (a[i], b[i], c[i]) = (h[0], h[1], h[2]);
    }
}

/// Draws from nodes below streams of points of a sequence.
#[inline(always)]
fn sobol<const N: usize>(below: Below, words: &mut Words, out: &mut [[f32; CHUNK]; N]) {
    descend(StreamKind::Sobol, below, words);
    for i in 0..CHUNK {
        words[2][i] &= 0xffff;
    }
    coordinates(words, out);
}

/// Draws from nodes below streams of independent numbers.
#[inline(always)]
fn independent<const N: usize>(below: Below, words: &mut Words, out: &mut [[f32; CHUNK]; N]) {
    descend(StreamKind::Independent, below, words);
    let [a, b, c] = words;
    for i in 0..CHUNK {
        let h = pcg4d([a[i], b[i], c[i], INDEPENDENT]);
        for d in 0..N {
            out[d][i] = unit_f32(h[d]);
        }
    }
}

#[inline(always)]
fn coordinates<const N: usize>([seed, scramble, index]: &Words, out: &mut [[f32; CHUNK]; N]) {
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
