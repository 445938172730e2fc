//! Points along the Hilbert curve at scrambled strata.
//!
//! The k-th base-4 digit of a position on the curve, hi·2 + lo, selects a quadrant: x = hi, y = hi ⊕ lo. Digit 0
//! reflects the quadrant's contents about the diagonal; digit 3 reflects them about the antidiagonal, which is the
//! diagonal and both axes. These reflections commute, so all digits are processed at once. In digit k, the axes are
//! swapped if the number of digits 0 or 3 before it is odd, and reversed if the number of digits 3 before it is odd.

use fearless_simd::{Level, dispatch};

/// A 32-bit hash: two rounds of multiply and xor-shift [Wellons 2018].
#[inline(always)]
const fn mix(mut x: u32) -> u32 {
    x ^= x >> 16;
    x = x.wrapping_mul(0x7feb_352d);
    x ^= x >> 15;
    x = x.wrapping_mul(0x846c_a68b);
    x ^ (x >> 16)
}

/// The even bits of `x`, packed into the low half.
#[inline(always)]
const fn even_bits(x: u32) -> u32 {
    let x = x & 0x5555_5555;
    let x = (x | (x >> 1)) & 0x3333_3333;
    let x = (x | (x >> 2)) & 0x0f0f_0f0f;
    let x = (x | (x >> 4)) & 0x00ff_00ff;
    (x | (x >> 8)) & 0xffff
}

/// Replaces each of 16 bits by the parity of the bits above it.
#[inline(always)]
const fn parity_above(x: u32) -> u32 {
    let x = x >> 1;
    let x = x ^ (x >> 1);
    let x = x ^ (x >> 2);
    let x = x ^ (x >> 4);
    x ^ (x >> 8)
}

/// The cell, 16 bits per coordinate, at position `t` on the curve of order 16.
#[inline(always)]
pub const fn hilbert_cell(t: u32) -> [u32; 2] {
    let (hi, lo) = (even_bits(t >> 1), even_bits(t));
    let swap = parity_above(!(hi ^ lo) & 0xffff);
    let reverse = parity_above(hi & lo);
    // x and y differ where lo is set
    let x = hi ^ reverse ^ (lo & swap);
    [x, x ^ lo]
}

#[inline(always)]
fn hilbert_points_lanes(t: &[u32], jitter: &[u32], u0: &mut [f32], u1: &mut [f32]) {
    let n = t.len();
    let (jitter, u0, u1) = (&jitter[..n], &mut u0[..n], &mut u1[..n]);
    for i in 0..n {
        let [x, y] = hilbert_cell(t[i]);
        let unit = |cell: u32, low: u32| (cell << 8 | low & 0xff) as i32 as f32 * (1.0 / 16_777_216.0);
        u0[i] = unit(x, jitter[i]);
        u1[i] = unit(y, jitter[i] >> 8);
    }
}

/// Points of [0, 1)² at the positions `t`/2³² along the Hilbert curve of order 16. The cell gives 16 bits of each
/// coordinate; the low byte of `jitter` (for x) and the next byte (for y) give 8 more. All slices have the same length.
pub fn hilbert_points(t: &[u32], jitter: &[u32], u0: &mut [f32], u1: &mut [f32]) {
    dispatch!(Level::new(), _simd => hilbert_points_lanes(t, jitter, u0, u1));
}

/// The scalar twin of [`hilbert_points`].
pub fn hilbert_points_scalar(t: &[u32], jitter: &[u32], u0: &mut [f32], u1: &mut [f32]) {
    for i in 0..t.len() {
        let cell = hilbert_cell(t[i]);
        u0[i] = (cell[0] * 256 + (jitter[i] & 255)) as f32 / 16_777_216.0;
        u1[i] = (cell[1] * 256 + (jitter[i] >> 8 & 255)) as f32 / 16_777_216.0;
    }
}

/// Owen scrambling of the fraction whose bits, lowest first, are `reversed` [Laine and Karras 2011; constants of Burley
/// 2020]. Each bit is flipped depending on a hash of the bits before it.
#[inline(always)]
const fn owen_scramble_reversed(reversed: u32, seed: u32) -> u32 {
    let mut x = reversed.wrapping_add(seed);
    x ^= x.wrapping_mul(0x6c50_b47c);
    x ^= x.wrapping_mul(0xb82f_1e52);
    x ^= x.wrapping_mul(0xc7af_e638);
    x ^= x.wrapping_mul(0x8d22_f6e6);
    x.reverse_bits()
}

/// Hash of a stratum, used as the seed of its scramble.
#[inline(always)]
const fn stratum_seed(seed: u32, i: u32) -> u32 {
    mix(mix(seed).wrapping_add(i.wrapping_mul(0x9e37_79b9)))
}

/// A random number in a stratum.
struct Stratum {
    /// ξ.
    xi: u32,
    jitter: u32,
}

#[inline(always)]
const fn stratum(reversed: u32, hash_phi: u32, seed: u32, i: u32) -> Stratum {
    let key = stratum_seed(seed, i);
    Stratum { xi: owen_scramble_reversed(reversed, key), jitter: mix(key ^ hash_phi) }
}

/// Hash of `phi` for jitter.
#[inline(always)]
const fn phi_hash(phi: u32) -> u32 {
    mix(phi ^ 0x68bc_21eb)
}

#[inline(always)]
fn strata_lanes(phi: u32, seed: u32, m: u32, out: &mut [u32], jitter: &mut [u32]) {
    let n = out.len().min(jitter.len());
    let (out, jitter) = (&mut out[..n], &mut jitter[..n]);
    let (reversed, hash_phi) = (phi.reverse_bits(), phi_hash(phi));
    if m.is_power_of_two() {
        let bits = m.trailing_zeros();
        for i in 0..n {
            let Stratum { xi, jitter: j } = stratum(reversed, hash_phi, seed, i as u32);
            out[i] = (i as u32).wrapping_shl(32 - bits) | xi >> bits;
            jitter[i] = j;
        }
        return;
    }
    // The dividend is an integer below 2⁴⁸, so the fraction of the quotient is within 2⁻²⁰ of a multiple of 1/m.
    // Subtracting (1 − 1/m)/2 makes it round to its floor, in the low bits of a number with an ulp of 1
    let (count, bias) = (f64::from(m), 0.5 / f64::from(m) - 0.5);
    for i in 0..n {
        let Stratum { xi, jitter: j } = stratum(reversed, hash_phi, seed, i as u32);
        let quotient = (i as u32 as f64 * 4_294_967_296.0 + f64::from(xi)) / count;
        out[i] = ((quotient + bias) + 4_503_599_627_370_496.0).to_bits() as u32;
        jitter[i] = j;
    }
}

/// One position in each of `m` ≤ 2¹⁶ equal strata of [0, 1), in units of 2⁻³²: `out[i]` = ⌊(i·2³² + ξᵢ)/m⌋. ξᵢ is the
/// fraction `phi`/2³² after nested (Owen) scrambling seeded by `seed` and i. Each ξᵢ is stratified over the samples of
/// a pixel if `phi` is. `jitter[i]` is a hash of `phi`, `seed` and i. Both slices have the length `m`.
pub fn strata(phi: u32, seed: u32, m: u32, out: &mut [u32], jitter: &mut [u32]) {
    dispatch!(Level::new(), _simd => strata_lanes(phi, seed, m, out, jitter));
}

/// The scalar twin of [`strata`], in integer arithmetic.
pub fn strata_scalar(phi: u32, seed: u32, m: u32, out: &mut [u32], jitter: &mut [u32]) {
    for i in 0..out.len() {
        let Stratum { xi, jitter: j } = stratum(phi.reverse_bits(), phi_hash(phi), seed, i as u32);
        out[i] = (((i as u64) << 32 | u64::from(xi)) / u64::from(m)) as u32;
        jitter[i] = j;
    }
}
