//! Exact sums of many terms at once, in whole numbers of quanta: as f64 numbers, each of which is split at a fixed digit into
//! two whose sums need no more than the 53 digits that these have.
//!
//! Adding M = 1.5·2⁵²·h to a number, and subtracting it again, rounds it to a multiple of h, if it is much smaller than M. The
//! rest is exact, and is rounded to a quantum by itself: half away from zero for terms, which have all digits wherever they are not
//! less than h, and half upwards for squares, which are not negative.

use fearless_simd::{Level, Simd, dispatch, f32x8, f64x4, prelude::*};

/// Numbers of a term.
pub const TERM: usize = 12;
/// Most terms whose sums do not lose a digit.
pub const MOST: usize = 128;
/// Where terms are split: quanta of the higher part of each number, and of each square.
pub const HIGH: [i32; 2] = [-10, -34];
/// Quanta of numbers, of squares, and of the others.
pub const QUANTA: [i32; 3] = [-56, -80, -29];
/// Magnitudes below which all is exact: of the first three numbers, of the fourth, and of the others.
pub const LIMITS: [f64; 3] = [64.0, 1_073_741_824.0, 4.0];

/// What is summed: four numbers, of which the first three are summed with their squares, and eight of magnitudes about 1.
pub trait Term {
    /// The numbers.
    fn numbers(&self) -> [f32; TERM];
}

/// Sums in quanta, or in multiples of [`HIGH`]: whole numbers.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Sums {
    /// Higher and lower parts of the four numbers.
    pub numbers: [[f64; 4]; 2],
    /// Of their squares.
    pub squares: [[f64; 4]; 2],
    /// The others.
    pub others: [[f64; 4]; 2],
}

/// Sums at most [`MOST`] terms; `None` if one is not below [`LIMITS`].
#[inline]
pub fn sums<T: Term>(level: Level, terms: &[T]) -> Option<Sums> {
    let mut out = Sums::default();
    (terms.len() <= MOST && dispatch!(level, simd => sums_lanes(simd, terms, &mut out))).then_some(out)
}

/// 2^exponent.
#[inline(always)]
const fn power(exponent: i32) -> f64 {
    f64::from_bits(((1023 + exponent) as u64) << 52)
}

#[inline(always)]
fn sums_lanes<S: Simd, T: Term>(simd: S, terms: &[T], out: &mut Sums) -> bool {
    let zero = f64x4::splat(simd, 0.0);
    let [mut high, mut low, mut squares_high, mut squares_low, mut first, mut second] = [zero; 6];
    let [mut greatest, mut greatest_first, mut greatest_second] = [zero; 3];
    for term in terms {
        let row = term.numbers();
        let (x, a) = f32x8::from_slice(simd, &row[..8]).widen();
        greatest = greatest.max(x.abs());
        let (top, rest) = split(x, 1.5 * power(52 + HIGH[0]));
        high += top;
        low += rounded(rest * power(-QUANTA[0]));

        let (top, rest) = split(x * x, 1.5 * power(52 + HIGH[1]));
        squares_high += top;
        squares_low += (rest * power(-QUANTA[1]) + 0.5).floor();

        let (_, b) = f32x8::from_slice(simd, &row[4..]).widen();
        greatest_first = greatest_first.max(a.abs());
        greatest_second = greatest_second.max(b.abs());
        first += rounded(a * power(-QUANTA[2]));
        second += rounded(b * power(-QUANTA[2]));
    }
    (high * power(-HIGH[0])).store_slice(&mut out.numbers[0]);
    low.store_slice(&mut out.numbers[1]);
    (squares_high * power(-HIGH[1])).store_slice(&mut out.squares[0]);
    squares_low.store_slice(&mut out.squares[1]);
    first.store_slice(&mut out.others[0]);
    second.store_slice(&mut out.others[1]);

    // NaN remains in sums, if not in the greatest
    let [numbers, fourth, others] = LIMITS;
    let is_finite = (high + first + second).is_finite();
    let is_below = greatest.simd_lt(f64x4::from_slice(simd, &[numbers, numbers, numbers, fourth]))
        & greatest_first.max(greatest_second).simd_lt(others);
    (is_finite & is_below).all_true()
}

/// A multiple of a quantum, and the rest; `shift` is 1.5·2⁵² of them.
#[inline(always)]
fn split<S: Simd>(x: f64x4<S>, shift: f64) -> (f64x4<S>, f64x4<S>) {
    let top = (x + shift) - shift;
    (top, x - top)
}

/// The nearest whole number, half away from zero.
#[inline(always)]
fn rounded<S: Simd>(x: f64x4<S>) -> f64x4<S> {
    (x + f64x4::splat(x.token(), 0.5).copysign(x)).trunc()
}
