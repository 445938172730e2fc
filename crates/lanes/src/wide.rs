//! Lanes as a [`Number`], for formulas shared by kernels and single samples, and elementary functions.

use super::lane::{F, I, LANES, M, Vec3s, load};
use fearless_simd::{Simd, prelude::*};
use lumiris_numbers::math::elementary::{self, SinCos};
use lumiris_numbers::math::number::{Mask, Number, ROUNDS};
use lumiris_numbers::math::v3::V3;
use std::f32::consts::{FRAC_PI_2, TAU};
use std::ops::{Add, BitAnd, BitOr, Div, Mul, Neg, Not, Sub};

/// Lanes as a [`Number`].
#[derive(Clone, Copy)]
pub struct Wide<S: Simd>(pub F<S>);

/// The mask of lanes as a [`Mask`].
#[derive(Clone, Copy)]
pub struct Truths<S: Simd>(pub M<S>);

macro_rules! operator {
    ($operator:ident, $name:ident) => {
        impl<S: Simd> $operator for Wide<S> {
            type Output = Self;

            #[inline(always)]
            fn $name(self, other: Self) -> Self {
                Wide($operator::$name(self.0, other.0))
            }
        }
    };
    ($operator:ident, $name:ident, f32) => {
        operator!($operator, $name);

        impl<S: Simd> $operator<f32> for Wide<S> {
            type Output = Self;

            #[inline(always)]
            fn $name(self, other: f32) -> Self {
                Wide($operator::$name(self.0, other))
            }
        }
    };
}

operator!(Add, add, f32);
operator!(Sub, sub, f32);
operator!(Mul, mul, f32);
operator!(Div, div);

impl<S: Simd> Neg for Wide<S> {
    type Output = Self;

    #[inline(always)]
    fn neg(self) -> Self {
        Wide(-self.0)
    }
}

impl<S: Simd> BitAnd for Truths<S> {
    type Output = Self;

    #[inline(always)]
    fn bitand(self, other: Self) -> Self {
        Truths(self.0 & other.0)
    }
}

impl<S: Simd> BitOr for Truths<S> {
    type Output = Self;

    #[inline(always)]
    fn bitor(self, other: Self) -> Self {
        Truths(self.0 | other.0)
    }
}

impl<S: Simd> Not for Truths<S> {
    type Output = Self;

    #[inline(always)]
    fn not(self) -> Self {
        Truths(!self.0)
    }
}

impl<S: Simd> Mask for Truths<S> {
    #[inline(always)]
    fn any(self) -> bool {
        self.0.any_true()
    }

    #[inline(always)]
    fn all(self) -> bool {
        self.0.all_true()
    }
}

impl<S: Simd> Number for Wide<S> {
    type Mask = Truths<S>;

    #[inline(always)]
    fn constant(self, v: f32) -> Self {
        Wide(F::splat(self.0.token(), v))
    }

    #[inline(always)]
    fn lesser(self, other: Self) -> Self {
        Wide(self.0.min(other.0))
    }

    #[inline(always)]
    fn greater(self, other: Self) -> Self {
        Wide(self.0.max(other.0))
    }

    #[inline(always)]
    fn above(self, bound: Self) -> Truths<S> {
        Truths(self.0.simd_gt(bound.0))
    }

    #[inline(always)]
    fn at_least(self, bound: Self) -> Truths<S> {
        Truths(self.0.simd_ge(bound.0))
    }

    #[inline(always)]
    fn finite(self) -> Truths<S> {
        Truths(self.0.is_finite())
    }

    #[inline(always)]
    fn choose(mask: Truths<S>, yes: Self, no: Self) -> Self {
        Wide(mask.0.select(yes.0, no.0))
    }

    #[inline(always)]
    fn root(self) -> Self {
        Wide(self.0.sqrt())
    }

    #[inline(always)]
    fn magnitude(self) -> Self {
        Wide(self.0.abs())
    }

    #[inline(always)]
    fn signed_as(self, sign: Self) -> Self {
        Wide(self.0.copysign(sign.0))
    }

    #[inline(always)]
    fn nearest(self) -> Self {
        self + ROUNDS - ROUNDS
    }

    #[inline(always)]
    fn whole(self) -> Self {
        Wide(self.0.to_int::<I<S>>().to_float())
    }

    #[inline(always)]
    fn power_of_two(self) -> Self {
        Wide(((self.0.to_int::<I<S>>() + 127) << 23).bitcast())
    }

    #[inline(always)]
    fn exponent(self) -> Self {
        let bits: I<S> = self.0.bitcast();
        Wide(((bits >> 23) - 127).to_float())
    }

    #[inline(always)]
    fn significand(self) -> Self {
        let (simd, bits): (S, I<S>) = (self.0.token(), self.0.bitcast());
        Wide((bits & I::splat(simd, 0x007f_ffff) | I::splat(simd, 0x3f80_0000)).bitcast())
    }

    #[inline(always)]
    fn entry(table: &[f32], row: Self, stride: usize, column: Self) -> Self {
        let (rows, columns): (I<S>, I<S>) = (row.0.to_int(), column.0.to_int());
        let indices = (rows * stride as i32 + columns).to_array();
        let mut entries = [0.0; LANES];
        for lane in 0..LANES {
            if let Some(entry) = table.get(indices[lane] as u32 as usize) {
                entries[lane] = *entry;
            }
        }
        Wide(load(row.0.token(), &entries, 0))
    }
}

impl<S: Simd> From<Vec3s<S>> for V3<Wide<S>> {
    #[inline(always)]
    fn from(v: Vec3s<S>) -> Self {
        V3 { x: Wide(v.x), y: Wide(v.y), z: Wide(v.z) }
    }
}

impl<S: Simd> From<V3<Wide<S>>> for Vec3s<S> {
    #[inline(always)]
    fn from(v: V3<Wide<S>>) -> Self {
        Vec3s { x: v.x.0, y: v.y.0, z: v.z.0 }
    }
}

/// SIMD version of [`elementary::sin_cos_eighth`].
#[inline(always)]
pub fn sin_cos_eighth<S: Simd>(x: F<S>) -> SinCos<F<S>> {
    let SinCos { sin, cos } = elementary::sin_cos_eighth(Wide(x));
    SinCos { sin: sin.0, cos: cos.0 }
}

/// sin 2πt and cos 2πt for |t| < 2²⁰; errors below 2⁻²³.
#[inline(always)]
pub fn sin_cos_turns<S: Simd>(t: F<S>) -> SinCos<F<S>> {
    // The nearest quarter turn, and the remainder, which is exact
    let quarters = (t * 4.0).round_ties_even();
    let SinCos { sin, cos } = sin_cos_eighth((t - quarters * 0.25) * TAU);
    let k: I<S> = quarters.to_int();
    let (one, two) = (I::splat(t.token(), 1), I::splat(t.token(), 2));
    let is_odd = (k & one).simd_eq(one);
    let (s, c) = (is_odd.select(cos, sin), is_odd.select(sin, cos));
    SinCos { sin: (k & two).simd_eq(two).select(-s, s), cos: ((k + one) & two).simd_eq(two).select(-c, c) }
}

/// sin θ and cos θ for θ = (a + 1)π/4, |a| ≤ 1.
#[inline(always)]
pub fn sin_cos_quadrant<S: Simd>(a: F<S>) -> SinCos<F<S>> {
    let SinCos { sin: s, cos: c } = sin_cos_eighth(a * (FRAC_PI_2 * 0.5));
    let scale = std::f32::consts::FRAC_1_SQRT_2;
    SinCos { sin: (c + s) * scale, cos: (c - s) * scale }
}

/// SIMD version of [`elementary::exp`].
#[inline(always)]
pub fn exp<S: Simd>(x: F<S>) -> F<S> {
    elementary::exp(Wide(x)).0
}
