//! Formulas that are written once for single samples and for vectors of them.

use std::ops::{Add, Div, Mul};

/// A number of one sample or of a vector of them: what a single sample and a kernel both need is written once over it.
/// NaN compares as false.
pub trait Number: Copy + Add<Output = Self> + Mul<Output = Self> + Div<Output = Self> {
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

    /// 0 where it is infinite or NaN.
    fn or_zero_if_not_finite(self) -> Self;
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
    fn or_zero_if_not_finite(self) -> f32 {
        if self.is_finite() { self } else { 0.0 }
    }
}
