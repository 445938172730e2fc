//! Exact sums of many terms at once, as whole numbers of quanta. Each f64 number is split at a fixed digit into two
//! parts, whose sums need at most the 53 digits of an f64.
//!
//! Adding M = 1.5·2⁵²·h to a much smaller number, and subtracting it again, rounds the number to a multiple of h. The
//! remainder is exact, and is rounded to a quantum by itself. Terms round half away from zero (a term of at least h has
//! no digits below the quantum). Squares are not negative and round half up.

use fearless_simd::{Level, Simd, dispatch, f32x8, f64x4, prelude::*};

/// Numbers per term.
pub const TERM: usize = 12;
/// Maximum number of terms whose sums are exact.
pub const MOST: usize = 128;
/// Exponents of the quanta of the higher parts: of numbers, and of squares.
pub const HIGH: [i32; 2] = [-10, -34];
/// Exponents of the quanta: of numbers, of squares, and of the other numbers.
pub const QUANTA: [i32; 3] = [-56, -80, -29];
/// Magnitudes below which everything is exact: of the first three numbers, of the fourth, and of the others.
pub const LIMITS: [f64; 3] = [64.0, 1_073_741_824.0, 4.0];

/// A term: four numbers, the first three of which are summed together with their squares, and eight others of magnitude
/// about 1.
pub trait Term {
    /// The numbers.
    fn numbers(&self) -> [f32; TERM];
}

/// Sums as whole numbers: lower parts in quanta, higher parts in multiples of 2 to the power of [`HIGH`].
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Sums {
    /// Higher and lower parts of the four numbers.
    pub numbers: [[f64; 4]; 2],
    /// Higher and lower parts of the sums of squares.
    pub squares: [[f64; 4]; 2],
    /// Sums of the others.
    pub others: [[f64; 4]; 2],
}

/// Sums at most [`MOST`] terms. Returns `None` for more terms, or if a number is not below [`LIMITS`].
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
        let top = multiple(x, 1.5 * power(52 + HIGH[0]));
        high += top;
        low += rounded((x - top) * power(-QUANTA[0]));

        let square = x * x;
        let top = multiple(square, 1.5 * power(52 + HIGH[1]));
        squares_high += top;
        squares_low += ((square - top) * power(-QUANTA[1]) + 0.5).floor();

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

    // NaN propagates to the sums, though not to the maxima
    let [numbers, fourth, others] = LIMITS;
    let is_finite = (high + first + second).is_finite();
    let is_below = greatest.simd_lt(f64x4::from_slice(simd, &[numbers, numbers, numbers, fourth]))
        & greatest_first.max(greatest_second).simd_lt(others);
    (is_finite & is_below).all_true()
}

/// The nearest multiple of a quantum; `shift` is 1.5·2⁵² quanta.
#[inline(always)]
fn multiple<S: Simd>(x: f64x4<S>, shift: f64) -> f64x4<S> {
    (x + shift) - shift
}

/// The nearest whole number; halves are rounded away from zero.
#[inline(always)]
fn rounded<S: Simd>(x: f64x4<S>) -> f64x4<S> {
    (x + f64x4::splat(x.token(), 0.5).copysign(x)).trunc()
}
