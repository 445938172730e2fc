//! Formulas that are written once for single samples and for vectors of them.

use std::ops::{Add, Div, Mul, Sub};

/// A number of one sample or of a vector of them: what a single sample and a kernel both need is written once over it.
/// NaN compares as false.
pub trait Number: Copy + Add<Output = Self> + Sub<Output = Self> + Mul<Output = Self> + Div<Output = Self> {
    /// `v`, in all lanes.
    fn constant(self, v: f32) -> Self;

    /// The smaller of both.
    fn lesser(self, other: Self) -> Self;

    /// The larger of both.
    fn greater(self, other: Self) -> Self;

    /// `yes` where `self > bound`, else `no`.
    fn if_above(self, bound: Self, yes: Self, no: Self) -> Self;

    /// `yes` where `self ≥ bound`, else `no`.
    fn if_at_least(self, bound: Self, yes: Self, no: Self) -> Self;

    /// True if `self > bound` in all lanes: what else is computed is in vain then.
    fn is_above(self, bound: Self) -> bool;

    /// `other` where it is infinite or NaN.
    fn finite_or(self, other: Self) -> Self;

    /// The square root.
    fn root(self) -> Self;

    /// The absolute value.
    fn magnitude(self) -> Self;
}

impl Number for f32 {
    #[inline(always)]
    fn constant(self, v: f32) -> f32 {
        v
    }

    #[inline(always)]
    fn lesser(self, other: f32) -> f32 {
        self.min(other)
    }

    #[inline(always)]
    fn greater(self, other: f32) -> f32 {
        self.max(other)
    }

    #[inline(always)]
    fn if_above(self, bound: f32, yes: f32, no: f32) -> f32 {
        if self > bound { yes } else { no }
    }

    #[inline(always)]
    fn if_at_least(self, bound: f32, yes: f32, no: f32) -> f32 {
        if self >= bound { yes } else { no }
    }

    #[inline(always)]
    fn is_above(self, bound: f32) -> bool {
        self > bound
    }

    #[inline(always)]
    fn finite_or(self, other: f32) -> f32 {
        if self.is_finite() { self } else { other }
    }

    #[inline(always)]
    fn root(self) -> f32 {
        self.sqrt()
    }

    #[inline(always)]
    fn magnitude(self) -> f32 {
        self.abs()
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
    }
}
