//! Vectors of lanes: loads and stores with padding, directions by component, and elementary functions.

use fearless_simd::{Simd, SimdCombine, SimdSplit, f64x8, prelude::*};
use lumiris_numbers::math::number::Number;
use lumiris_numbers::math::{Frame, Mat3, Vec3};
use std::f32::consts::{FRAC_PI_2, TAU};
use std::ops::{Add, Div, Mul, Sub};

/// The vector of f32 lanes.
pub type F<S> = fearless_simd::f32x8<S>;
/// The vector of i32 lanes.
pub type I<S> = fearless_simd::i32x8<S>;
/// One truth per lane.
pub type M<S> = fearless_simd::mask32x8<S>;

/// Number of lanes.
pub const LANES: usize = 8;

/// The lanes as f64.
#[inline(always)]
pub fn widened<S: Simd>(x: F<S>) -> f64x8<S> {
    let (low, high) = x.widen();
    low.combine(high)
}

/// The lanes rounded to f32.
#[inline(always)]
pub fn narrowed<S: Simd>(x: f64x8<S>) -> F<S> {
    let (low, high) = x.split();
    low.narrow(high)
}

/// Where a vector of `n` ≥ [`LANES`] numbers begins that covers number `i`: the last one overlaps the one before.
#[inline(always)]
pub fn begin(i: usize, n: usize) -> usize {
    i.min(n - LANES)
}

/// The lanes from index `i` on.
#[inline(always)]
pub fn load<S: Simd>(simd: S, from: &[f32], i: usize) -> F<S> {
    F::from_slice(simd, &from[i..i + LANES])
}

/// Stores the lanes from index `i` on.
#[inline(always)]
pub fn store<S: Simd>(v: F<S>, to: &mut [f32], i: usize) {
    v.store_slice(&mut to[i..i + LANES]);
}

/// Fewer numbers than [`LANES`], followed by copies of the last one.
#[inline]
pub fn padded(from: &[f32]) -> [f32; LANES] {
    let mut to = [from.last().copied().unwrap_or(0.0); LANES];
    to[..from.len()].copy_from_slice(from);
    to
}

/// Lanes as a [`Number`], for formulas that kernels and single samples share.
#[derive(Clone, Copy)]
pub struct Wide<S: Simd>(pub F<S>);

impl<S: Simd> Add for Wide<S> {
    type Output = Self;

    #[inline(always)]
    fn add(self, other: Self) -> Self {
        Wide(self.0 + other.0)
    }
}

impl<S: Simd> Sub for Wide<S> {
    type Output = Self;

    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        Wide(self.0 - other.0)
    }
}

impl<S: Simd> Mul for Wide<S> {
    type Output = Self;

    #[inline(always)]
    fn mul(self, other: Self) -> Self {
        Wide(self.0 * other.0)
    }
}

impl<S: Simd> Div for Wide<S> {
    type Output = Self;

    #[inline(always)]
    fn div(self, other: Self) -> Self {
        Wide(self.0 / other.0)
    }
}

impl<S: Simd> Number for Wide<S> {
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
    fn if_above(self, bound: Self, yes: Self, no: Self) -> Self {
        Wide(self.0.simd_gt(bound.0).select(yes.0, no.0))
    }

    #[inline(always)]
    fn if_at_least(self, bound: Self, yes: Self, no: Self) -> Self {
        Wide(self.0.simd_ge(bound.0).select(yes.0, no.0))
    }

    #[inline(always)]
    fn is_above(self, bound: Self) -> bool {
        self.0.simd_gt(bound.0).all_true()
    }

    #[inline(always)]
    fn finite_or(self, other: Self) -> Self {
        Wide(self.0.is_finite().select(self.0, other.0))
    }

    #[inline(always)]
    fn root(self) -> Self {
        Wide(self.0.sqrt())
    }

    #[inline(always)]
    fn magnitude(self) -> Self {
        Wide(self.0.abs())
    }
}

/// Directions or points by component.
#[derive(Clone, Copy, Debug)]
pub struct Vec3s<S: Simd> {
    /// x.
    pub x: F<S>,
    /// y.
    pub y: F<S>,
    /// z.
    pub z: F<S>,
}

impl<S: Simd> Vec3s<S> {
    /// The same vector in all lanes.
    #[inline(always)]
    pub fn splat(simd: S, v: Vec3) -> Self {
        Vec3s { x: F::splat(simd, v.x), y: F::splat(simd, v.y), z: F::splat(simd, v.z) }
    }

    /// The lanes from index `i` on.
    #[inline(always)]
    pub fn load(simd: S, from: [&[f32]; 3], i: usize) -> Self {
        Vec3s { x: load(simd, from[0], i), y: load(simd, from[1], i), z: load(simd, from[2], i) }
    }

    /// Stores the lanes from index `i` on.
    #[inline(always)]
    pub fn store(self, to: &mut [&mut [f32]; 3], i: usize) {
        store(self.x, to[0], i);
        store(self.y, to[1], i);
        store(self.z, to[2], i);
    }

    /// Dot product.
    #[inline(always)]
    pub fn dot(self, o: Self) -> F<S> {
        self.x * o.x + self.y * o.y + self.z * o.z
    }

    /// Dot product with one vector.
    #[inline(always)]
    pub fn dot_splat(self, o: Vec3) -> F<S> {
        self.x * o.x + self.y * o.y + self.z * o.z
    }

    /// Sum.
    #[inline(always)]
    pub fn plus(self, o: Self) -> Self {
        Vec3s { x: self.x + o.x, y: self.y + o.y, z: self.z + o.z }
    }

    /// Difference.
    #[inline(always)]
    pub fn minus(self, o: Self) -> Self {
        Vec3s { x: self.x - o.x, y: self.y - o.y, z: self.z - o.z }
    }

    /// Multiple.
    #[inline(always)]
    pub fn times(self, s: F<S>) -> Self {
        Vec3s { x: self.x * s, y: self.y * s, z: self.z * s }
    }

    /// `x·self.x + y·self.y + z·self.z`.
    #[inline(always)]
    pub fn combine(self, x: Vec3, y: Vec3, z: Vec3) -> Self {
        Vec3s {
            x: self.x * x.x + self.y * y.x + self.z * z.x,
            y: self.x * x.y + self.y * y.y + self.z * z.y,
            z: self.x * x.z + self.y * y.z + self.z * z.z,
        }
    }

    /// Multiplied by a matrix.
    #[inline(always)]
    pub fn transformed(self, m: &Mat3) -> Self {
        self.combine(m.x_axis, m.y_axis, m.z_axis)
    }

    /// World to local.
    #[inline(always)]
    pub fn to_local(self, frame: &Frame) -> Self {
        Vec3s { x: self.dot_splat(frame.x), y: self.dot_splat(frame.y), z: self.dot_splat(frame.z) }
    }
}

/// `√max(x, 0)`.
#[inline(always)]
pub fn safe_sqrt<S: Simd>(x: F<S>) -> F<S> {
    x.max(0.0).sqrt()
}

/// `v` where `keep`, else 0.
#[inline(always)]
pub fn or_zero<S: Simd>(keep: M<S>, v: F<S>) -> F<S> {
    keep.select(v, F::splat(v.token(), 0.0))
}

/// sin x and cos x for |x| ≤ π/4, by Chebyshev interpolation; errors below 2⁻²⁴.
#[inline(always)]
pub fn sin_cos_eighth<S: Simd>(x: F<S>) -> (F<S>, F<S>) {
    let x2 = x * x;
    let sin = ((x2 * -1.951_528_96e-4 + 8.332_161_3e-3) * x2 - 1.666_665_46e-1) * x2 * x + x;
    let cos = ((x2 * 2.443_315_71e-5 - 1.388_731_63e-3) * x2 + 4.166_664_57e-2) * x2 * x2 - x2 * 0.5 + 1.0;
    (sin, cos)
}

/// sin 2πt and cos 2πt for |t| < 2²⁰; errors below 2⁻²³.
#[inline(always)]
pub fn sin_cos_turns<S: Simd>(t: F<S>) -> (F<S>, F<S>) {
    // The nearest quarter turn, and what remains, which is exact.
    let quarters = (t * 4.0).round_ties_even();
    let (sin, cos) = sin_cos_eighth((t - quarters * 0.25) * TAU);
    let k: I<S> = quarters.to_int();
    let (one, two) = (I::splat(t.token(), 1), I::splat(t.token(), 2));
    let is_odd = (k & one).simd_eq(one);
    let (s, c) = (is_odd.select(cos, sin), is_odd.select(sin, cos));
    ((k & two).simd_eq(two).select(-s, s), ((k + one) & two).simd_eq(two).select(-c, c))
}

/// sin θ and cos θ for θ = (a + 1)π/4, |a| ≤ 1.
#[inline(always)]
pub fn sin_cos_quadrant<S: Simd>(a: F<S>) -> (F<S>, F<S>) {
    let (s, c) = sin_cos_eighth(a * (FRAC_PI_2 * 0.5));
    let scale = std::f32::consts::FRAC_1_SQRT_2;
    ((c + s) * scale, (c - s) * scale)
}

/// e^x for x ≤ 0, by the series about the nearest power of two; relative errors below 2⁻²², 0 below e⁻⁸⁶.
#[inline(always)]
pub fn exp<S: Simd>(x: F<S>) -> F<S> {
    let simd = x.token();
    let powers = (x.max(-87.0).min(0.0) * std::f32::consts::LOG2_E).round_ties_even();
    // ln 2 in two parts, of which the first has few digits.
    let r = x.max(-87.0).min(0.0) - powers * 0.693_359_375 + powers * 2.121_944_4e-4;
    let series =
        (((((r * (1.0 / 720.0) + 1.0 / 120.0) * r + 1.0 / 24.0) * r + 1.0 / 6.0) * r + 0.5) * r + 1.0) * r + 1.0;
    let exponent: I<S> = (powers.to_int::<I<S>>() + 127) << 23;
    or_zero(x.simd_gt(F::splat(simd, -86.0)), series * exponent.bitcast::<F<S>>())
}
