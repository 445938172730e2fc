//! Formulas that are written once, for single samples and vectors.

use std::ops::{Add, BitAnd, BitOr, Div, Mul, Neg, Not, Sub};

/// A truth value of one sample, or of a vector.
pub trait Mask: Copy + BitAnd<Output = Self> + BitOr<Output = Self> + Not<Output = Self> {
    /// True if any lane is true.
    fn any(self) -> bool;

    /// True if all lanes are true.
    fn all(self) -> bool;
}

impl Mask for bool {
    #[inline(always)]
    fn any(self) -> bool {
        self
    }

    #[inline(always)]
    fn all(self) -> bool {
        self
    }
}

/// Adding this to a number below 2²² rounds it to an integer.
pub const ROUNDS: f32 = 12_582_912.0;

/// A number of one sample, or of a vector. Formulas shared by single samples and kernels are written over it once and
/// are bit-identical for both. Comparisons with NaN are false.
pub trait Number:
    Copy
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<Output = Self>
    + Div<Output = Self>
    + Neg<Output = Self>
    + Add<f32, Output = Self>
    + Sub<f32, Output = Self>
    + Mul<f32, Output = Self>
{
    /// Result of comparisons.
    type Mask: Mask;

    /// `v`, in all lanes.
    fn constant(self, v: f32) -> Self;

    /// The minimum; `other` if either is NaN.
    fn lesser(self, other: Self) -> Self;

    /// The maximum; `other` if either is NaN.
    fn greater(self, other: Self) -> Self;

    /// `self > bound`.
    fn above(self, bound: Self) -> Self::Mask;

    /// `self ≥ bound`.
    fn at_least(self, bound: Self) -> Self::Mask;

    /// False where it is infinite or NaN.
    fn finite(self) -> Self::Mask;

    /// `yes` where the mask is true, else `no`.
    fn choose(mask: Self::Mask, yes: Self, no: Self) -> Self;

    /// The square root.
    fn root(self) -> Self;

    /// The absolute value.
    fn magnitude(self) -> Self;

    /// The absolute value, with the sign of `sign`.
    fn signed_as(self, sign: Self) -> Self;

    /// The nearest integer, ties to even, below 2²².
    fn nearest(self) -> Self;

    /// The integer part.
    fn whole(self) -> Self;

    /// 2 to the power of an integer from −126 to 127.
    fn power_of_two(self) -> Self;

    /// Exponent e of a normal positive number m·2^e, 1 ≤ m < 2.
    fn exponent(self) -> Self;

    /// The significand m of such a number.
    fn significand(self) -> Self;

    /// The table entries at `row`·`stride` + `column`, which are integers; 0 beyond its end.
    fn entry(table: &[f32], row: Self, stride: usize, column: Self) -> Self;

    /// `self` where the mask is true, else 0.
    #[inline(always)]
    fn or_zero(self, mask: Self::Mask) -> Self {
        Self::choose(mask, self, self.constant(0.0))
    }

    /// `yes` where `self > bound`, else `no`.
    #[inline(always)]
    fn if_above(self, bound: Self, yes: Self, no: Self) -> Self {
        Self::choose(self.above(bound), yes, no)
    }

    /// `yes` where `self ≥ bound`, else `no`.
    #[inline(always)]
    fn if_at_least(self, bound: Self, yes: Self, no: Self) -> Self {
        Self::choose(self.at_least(bound), yes, no)
    }

    /// True if `self > bound` in all lanes: other results are then unused.
    #[inline(always)]
    fn is_above(self, bound: Self) -> bool {
        self.above(bound).all()
    }

    /// Replaces infinities and NaN by `other`.
    #[inline(always)]
    fn finite_or(self, other: Self) -> Self {
        Self::choose(self.finite(), self, other)
    }

    /// `√max(x, 0)`.
    #[inline(always)]
    fn safe_root(self) -> Self {
        self.greater(self.constant(0.0)).root()
    }

    /// The square.
    #[inline(always)]
    fn squared(self) -> Self {
        self * self
    }
}

impl Number for f32 {
    type Mask = bool;

    #[inline(always)]
    fn constant(self, v: f32) -> f32 {
        v
    }

    // As vector instructions compare, unlike `f32::min`.
    #[inline(always)]
    fn lesser(self, other: f32) -> f32 {
        if self < other { self } else { other }
    }

    #[inline(always)]
    fn greater(self, other: f32) -> f32 {
        if self > other { self } else { other }
    }

    #[inline(always)]
    fn above(self, bound: f32) -> bool {
        self > bound
    }

    #[inline(always)]
    fn at_least(self, bound: f32) -> bool {
        self >= bound
    }

    #[inline(always)]
    fn finite(self) -> bool {
        self.is_finite()
    }

    #[inline(always)]
    fn choose(mask: bool, yes: f32, no: f32) -> f32 {
        if mask { yes } else { no }
    }

    #[inline(always)]
    fn root(self) -> f32 {
        self.sqrt()
    }

    #[inline(always)]
    fn magnitude(self) -> f32 {
        self.abs()
    }

    #[inline(always)]
    fn signed_as(self, sign: f32) -> f32 {
        self.copysign(sign)
    }

    #[inline(always)]
    fn nearest(self) -> f32 {
        self + ROUNDS - ROUNDS
    }

    #[inline(always)]
    fn whole(self) -> f32 {
        (self as i32) as f32
    }

    #[inline(always)]
    fn power_of_two(self) -> f32 {
        f32::from_bits(((self as i32 + 127) as u32) << 23)
    }

    #[inline(always)]
    fn exponent(self) -> f32 {
        ((self.to_bits() as i32 >> 23) - 127) as f32
    }

    #[inline(always)]
    fn significand(self) -> f32 {
        f32::from_bits(self.to_bits() & 0x007f_ffff | 0x3f80_0000)
    }

    #[inline(always)]
    fn entry(table: &[f32], row: f32, stride: usize, column: f32) -> f32 {
        let index = (row as i32).wrapping_mul(stride as i32).wrapping_add(column as i32);
        table.get(index as u32 as usize).copied().unwrap_or(0.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_sample_is_a_number() {
        assert_eq!(7.0_f32.constant(2.5), 2.5);
        assert_eq!((2.0_f32.lesser(3.0), 2.0_f32.greater(3.0)), (2.0, 3.0));
        for (a, above, at_least) in [(0.5, 4.0, 4.0), (1.0, 4.0, 3.0), (2.0, 3.0, 3.0), (f32::NAN, 4.0, 4.0)] {
            assert_eq!((a.if_above(1.0, 3.0, 4.0), a.if_at_least(1.0, 3.0, 4.0)), (above, at_least), "{a}");
        }
        assert_eq!([2.0, f32::INFINITY, f32::NAN].map(|x| x.finite_or(0.5)), [2.0, 0.5, 0.5]);
        assert!(2.0.is_above(1.0) && !1.0.is_above(1.0) && !f32::NAN.is_above(1.0));
        assert_eq!((9.0_f32.root(), (-3.0_f32).magnitude()), (3.0, 3.0));
        assert_eq!((f32::NAN.greater(2.0), f32::NAN.lesser(2.0), 2.0.signed_as(-0.0)), (2.0, 2.0, -2.0));
        assert_eq!([0.5, 1.5, -2.5, 7.3].map(Number::nearest), [0.0, 2.0, -2.0, 7.0]);
        assert_eq!([0.5, 1.9, -2.5].map(Number::whole), [0.0, 1.0, -2.0]);
        assert_eq!([(-126.0_f32).power_of_two(), 127.0.power_of_two()], [2.0_f32.powi(-126), 2.0_f32.powi(127)]);
        assert_eq!([12.0, 0.75].map(|x: f32| (x.exponent(), x.significand())), [(3.0, 1.5), (-1.0, 1.5)]);
        assert_eq!(([1.0, 2.0].map(|c| f32::entry(&[1.0, 2.0, 3.0, 4.0, 5.0], 1.0, 3, c))), [5.0, 0.0]);
    }
}
