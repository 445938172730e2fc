//! Sums that do not depend on the order and division of their terms: fixed-point integers.
//!
//! Each term is rounded to a multiple of a quantum; sums of integers are exact. Terms above the magnitude in the column
//! "exact from" are not rounded, since all bits of an f32 fit.
//!
//! | sum | terms | quantum | limit | exact from | bytes |
//! |---|---|---|---|---|---|
//! | [`FixedSum`] | radiance, depth, control variates | 2⁻⁵⁶ | 2³⁹ = 5.5·10¹¹ | 1.2·10⁻¹⁰ | 16 |
//! | [`SquareSum`] | radiance² | 2⁻⁸⁰ | 2⁷⁸ | (7.6·10⁻⁶)² | 24 |
//! | [`UnitSum`] | albedos, normals | 2⁻²⁹ | 4 (clamped) | 0.03 | 8 |
//!
//! Sums of 2³² terms do not overflow.

use lumiris_lanes::sums;

/// Limit of the magnitude of terms of [`FixedSum`], and of the roots of terms of [`SquareSum`]; exclusive.
pub const LIMIT: f32 = 549_755_813_888.0;
/// Limit of albedos and normals.
const UNIT_LIMIT: f32 = 4.0;
/// Terms of [`FixedSum`] with a smaller magnitude are less than 2⁶³ quanta.
const SMALL: f64 = 64.0;
/// Binary digits after the binary point.
const FIXED_BITS: i32 = 56;
const SQUARE_BITS: i32 = 80;
const UNIT_SCALE: f64 = (1_u64 << 29) as f64;

// The same quanta as sums in lanes
const _: () = assert!(sums::QUANTA[0] == -FIXED_BITS && sums::QUANTA[1] == -SQUARE_BITS && sums::QUANTA[2] == -29);

/// m·2^shift, rounded to the nearest integer.
#[inline(always)]
fn shifted(m: u64, shift: i32) -> u128 {
    match shift {
        0.. => u128::from(m) << shift,
        -63..0 => u128::from((m + (1 << (-shift - 1))) >> -shift),
        _ => 0,
    }
}

/// 2^exponent.
fn power(exponent: i32) -> f64 {
    f64::from_bits(((1023 + exponent) as u64) << 52)
}

/// A sum of numbers below [`LIMIT`].
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[repr(Rust, packed(8))]
pub struct FixedSum(i128);

impl FixedSum {
    /// Bytes of [`Self::bits`].
    pub const BYTES: usize = 16;

    /// Adds a number whose magnitude is below [`LIMIT`].
    #[inline(always)]
    pub fn add(&mut self, x: f32) {
        let bits = x.to_bits();
        let exponent = ((bits >> 23) & 0xff) as i32;
        // Subnormal numbers have no implicit digit, but are far below the quantum
        let m = (bits & 0x7f_ffff) | 0x80_0000;
        let term = shifted(m.into(), exponent - 150 + FIXED_BITS) as i128;
        self.0 = { self.0 }.wrapping_add(if x < 0.0 { -term } else { term });
    }

    /// Adds the product of two numbers, if its magnitude is below [`LIMIT`]; otherwise, adds nothing.
    #[inline(always)]
    pub fn add_product(&mut self, a: f32, b: f32) {
        // The f64 product is exact
        let x = f64::from(a) * f64::from(b);
        if x.abs() < SMALL {
            // From 2⁵¹ quanta on, the product of two f32 numbers is a multiple of the quantum
            let quanta = x * power(FIXED_BITS);
            let half = if quanta.abs() < (1_u64 << 51) as f64 { 0.5_f64.copysign(quanta) } else { 0.0 };
            self.0 = { self.0 }.wrapping_add(((quanta + half) as i64).into());
            return;
        }
        if !(x.abs() < f64::from(LIMIT)) {
            return;
        }
        let bits = x.to_bits();
        let exponent = ((bits >> 52) & 0x7ff) as i32;
        let m = (bits & 0xf_ffff_ffff_ffff) | 0x10_0000_0000_0000;
        let term = shifted(m, exponent - 1075 + FIXED_BITS) as i128;
        self.0 = { self.0 }.wrapping_add(if x < 0.0 { -term } else { term });
    }

    /// Adds high·2^`shift` + low quanta; both numbers are integers.
    #[inline(always)]
    pub fn add_parts(&mut self, [high, low]: [f64; 2], shift: u32) {
        self.0 = { self.0 }.wrapping_add((i128::from(high as i64) << shift) + i128::from(low as i64));
    }

    /// Adds another sum.
    pub fn merge(&mut self, other: &FixedSum) {
        self.0 = { self.0 }.wrapping_add(other.0);
    }

    /// The sum.
    pub fn value(&self) -> f64 {
        let sum = self.0;
        // The processor converts 64-bit integers
        i64::try_from(sum).map_or_else(|_| sum as f64, |sum| sum as f64) * power(-FIXED_BITS)
    }

    /// The sum in quanta.
    pub fn bits(&self) -> i128 {
        self.0
    }

    /// The sum with the given number of quanta.
    pub fn from_bits(bits: i128) -> Self {
        FixedSum(bits)
    }
}

/// A sum of squares of numbers below [`LIMIT`].
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct SquareSum([u64; 3]);

impl SquareSum {
    /// Adds the square of a number whose magnitude is below [`LIMIT`].
    #[inline(always)]
    pub fn add_square(&mut self, x: f32) {
        let bits = x.to_bits();
        let exponent = ((bits >> 23) & 0xff) as i32;
        let m = u64::from((bits & 0x7f_ffff) | 0x80_0000);
        let shift = 2 * (exponent - 150) + SQUARE_BITS;
        if shift >= 64 {
            let term = u128::from(m * m) << (shift - 64);
            self.add_limbs([0, term as u64, (term >> 64) as u64]);
        } else {
            let term = shifted(m * m, shift);
            self.add_limbs([term as u64, (term >> 64) as u64, 0]);
        }
    }

    #[inline(always)]
    fn add_limbs(&mut self, limbs: [u64; 3]) {
        let mut carry = false;
        for (sum, limb) in self.0.iter_mut().zip(limbs) {
            let (a, first) = sum.overflowing_add(limb);
            let (b, second) = a.overflowing_add(carry.into());
            (*sum, carry) = (b, first | second);
        }
    }

    /// Adds high·2^`shift` + low quanta; both numbers are integers.
    #[inline(always)]
    pub fn add_parts(&mut self, [high, low]: [f64; 2], shift: u32) {
        let term = ((i128::from(high as i64) << shift) + i128::from(low as i64)) as u128;
        self.add_limbs([term as u64, (term >> 64) as u64, 0]);
    }

    /// Adds another sum.
    pub fn merge(&mut self, other: &SquareSum) {
        self.add_limbs(other.0);
    }

    /// The sum.
    pub fn value(&self) -> f64 {
        let of_limb = |i: i32| self.0[i as usize] as f64 * power(64 * i - SQUARE_BITS);
        of_limb(2) + (of_limb(1) + of_limb(0))
    }

    /// The sum in quanta, least significant word first.
    pub fn bits(&self) -> [u64; 3] {
        self.0
    }

    /// The sum with the given number of quanta.
    pub fn from_bits(bits: [u64; 3]) -> Self {
        SquareSum(bits)
    }
}

/// A sum of numbers with a magnitude of about 1.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct UnitSum(i64);

impl UnitSum {
    /// Adds a number. NaN counts as 0.
    #[inline(always)]
    pub fn add(&mut self, x: f32) {
        // Conversion by `as` saturates, and converts NaN to 0
        let quanta = f64::from(x.clamp(-UNIT_LIMIT, UNIT_LIMIT)) * UNIT_SCALE;
        self.0 = self.0.wrapping_add((quanta + 0.5_f64.copysign(quanta)) as i64);
    }

    /// Adds an integral number of quanta.
    #[inline(always)]
    pub fn add_quanta(&mut self, quanta: f64) {
        self.0 = self.0.wrapping_add(quanta as i64);
    }

    /// Adds another sum.
    pub fn merge(&mut self, other: &UnitSum) {
        self.0 = self.0.wrapping_add(other.0);
    }

    /// The sum.
    pub fn value(&self) -> f64 {
        self.0 as f64 / UNIT_SCALE
    }

    /// The sum in quanta.
    pub fn bits(&self) -> i64 {
        self.0
    }

    /// The sum with the given number of quanta.
    pub fn from_bits(bits: i64) -> Self {
        UnitSum(bits)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use lumiris_test_support::random::{RngExt, pcg32};

    /// Numbers of magnitudes from 10⁻⁶ to 10⁹, with both signs.
    fn numbers(seed: u32, count: usize) -> Vec<f32> {
        let mut s = pcg32([seed, 2, 3]);
        let mut number = || {
            let magnitude = 10.0_f32.powf(15.0 * s.random::<f32>() - 6.0);
            if s.random::<f32>() < 0.3 { -magnitude } else { magnitude }
        };
        (0..count).map(|_| number()).collect()
    }

    fn sums(terms: &[f32]) -> (FixedSum, SquareSum, UnitSum) {
        let mut sums = (FixedSum::default(), SquareSum::default(), UnitSum::default());
        for &x in terms {
            sums.0.add(x);
            sums.1.add_square(x);
            sums.2.add(x * 1e-9);
        }
        sums
    }

    #[test]
    fn neither_order_nor_splits_change_a_bit_where_floats_do_change() {
        let terms = numbers(1, 5000);
        let whole = sums(&terms);
        let backwards: Vec<f32> = terms.iter().rev().copied().collect();
        assert_eq!(whole, sums(&backwards));
        let f64_sum = |terms: &[f32]| terms.iter().map(|&x| f64::from(x)).sum::<f64>();
        assert_ne!(f64_sum(&terms), f64_sum(&backwards), "these terms are no test");
        for at in [0, 1, 77, 2500, 4999] {
            let (mut a, b) = (sums(&terms[at..]), sums(&terms[..at]));
            a.0.merge(&b.0);
            a.1.merge(&b.1);
            a.2.merge(&b.2);
            assert_eq!(a, whole);
        }
    }

    #[test]
    fn sums_are_those_of_the_terms_to_the_precision_of_the_result() {
        for magnitude in [1e-6_f32, 1e-3, 1.0, 1e4, 1e9] {
            let terms: Vec<f32> = numbers(2, 999).iter().map(|x| (x.abs() % 1.0 + 0.5) * magnitude).collect();
            let (sum, squares, _) = sums(&terms);
            let exact: f64 = terms.iter().map(|&x| f64::from(x)).sum();
            let exact_squares: f64 = terms.iter().map(|&x| f64::from(x) * f64::from(x)).sum();
            assert!((sum.value() / exact - 1.0).abs() < 1e-12, "{} {exact}", sum.value());
            assert!((squares.value() / exact_squares - 1.0).abs() < 1e-9, "{} {exact_squares}", squares.value());
        }
    }

    #[test]
    fn single_terms_come_back() {
        for x in [0.0, 1.0, -1.0, 0.1, -3.5e-8, 1.2e-10, 1e9, -5.4e11, 1e-30, f32::MIN_POSITIVE, 1e-42] {
            let (sum, squares, _) = sums(&[x]);
            let expected = if x.abs() < 1e-20 { 0.0 } else { f64::from(x) };
            assert_eq!(sum.value(), expected, "{x}");
            let square = f64::from(x) * f64::from(x);
            assert!((squares.value() - square).abs() <= (square * 1e-15).max(0.5 * power(-SQUARE_BITS)), "{x}");
            assert_eq!(FixedSum::from_bits(sum.bits()), sum);
            let mut product = FixedSum::default();
            product.add_product(x, 1.0);
            assert_eq!(product.value(), expected, "{x}");
        }
        for (x, expected) in [(0.3_f32, f64::from(0.3_f32)), (-1.0, -1.0), (9.0, 4.0), (f32::NAN, 0.0)] {
            let mut unit = UnitSum::default();
            unit.add(x);
            assert!((unit.value() - expected).abs() < 1e-9, "{x} {}", unit.value());
        }
    }

    #[test]
    fn the_largest_sums_do_not_overflow() {
        let below = f32::from_bits(LIMIT.to_bits() - 1);
        let (mut sum, mut squares, mut units) = sums(&[below]);
        for _ in 0..31 {
            let (a, b, c) = (sum, squares, units);
            sum.merge(&a);
            squares.merge(&b);
            units.merge(&c);
        }
        let count = 2_f64.powi(31);
        assert!((sum.value() / (f64::from(below) * count) - 1.0).abs() < 1e-12);
        assert!((squares.value() / (f64::from(below).powi(2) * count) - 1.0).abs() < 1e-12);
        assert_eq!(units.value(), 4.0 * count, "549 is cut off at 4");
        let mut product = FixedSum::default();
        product.add_product(LIMIT, 1.0);
        product.add_product(f32::NAN, 1.0);
        assert_eq!(product, FixedSum::default(), "what is beyond the limit is left out");
    }
}
