//! SIMD vectors: loads and stores with padding, and vectors by component.

use fearless_simd::{Simd, SimdCombine, SimdSplit, f64x8, prelude::*};
use lumiris_numbers::math::{Frame, Mat3, Vec3};

/// Vector of f32 lanes.
pub type F<S> = fearless_simd::f32x8<S>;
/// Vector of i32 lanes.
pub type I<S> = fearless_simd::i32x8<S>;
/// Mask with one boolean per lane.
pub type M<S> = fearless_simd::mask32x8<S>;

/// Number of lanes.
pub const LANES: usize = 8;

/// Converts the lanes to f64.
#[inline(always)]
pub fn widened<S: Simd>(x: F<S>) -> f64x8<S> {
    let (low, high) = x.widen();
    low.combine(high)
}

/// Rounds the lanes to f32.
#[inline(always)]
pub fn narrowed<S: Simd>(x: f64x8<S>) -> F<S> {
    let (low, high) = x.split();
    low.narrow(high)
}

/// Three columns: the components of vectors, or the channels of colours.
pub type Columns3<'a> = [&'a [f32]; 3];

/// Three mutable columns.
pub type ColumnsMut3<'a> = [&'a mut [f32]; 3];

/// Index at which the SIMD vector for item `i` of `n` ≥ [`LANES`] begins: the last vector overlaps the previous one.
#[inline(always)]
pub fn begin(i: usize, n: usize) -> usize {
    i.min(n - LANES)
}

/// Loads the lanes from index `i` on.
#[inline(always)]
pub fn load<S: Simd>(simd: S, from: &[f32], i: usize) -> F<S> {
    F::from_slice(simd, &from[i..i + LANES])
}

/// Stores the lanes from index `i` on.
#[inline(always)]
pub fn store<S: Simd>(v: F<S>, to: &mut [f32], i: usize) {
    v.store_slice(&mut to[i..i + LANES]);
}

/// Fewer numbers than [`LANES`], padded with copies of the last.
#[inline]
pub fn padded(from: &[f32]) -> [f32; LANES] {
    let mut to = [from.last().copied().unwrap_or(0.0); LANES];
    to[..from.len()].copy_from_slice(from);
    to
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

    /// Loads the lanes from index `i` on.
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

    /// Dot product with the same vector in all lanes.
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

    /// Product with a scalar per lane.
    #[inline(always)]
    pub fn times(self, s: F<S>) -> Self {
        Vec3s { x: self.x * s, y: self.y * s, z: self.z * s }
    }

    /// Absolute values of the components.
    #[inline(always)]
    pub fn abs(self) -> Self {
        Vec3s { x: self.x.abs(), y: self.y.abs(), z: self.z.abs() }
    }

    /// `self` if `keep`, else `other`.
    #[inline(always)]
    pub fn or(self, keep: M<S>, other: Self) -> Self {
        Vec3s { x: keep.select(self.x, other.x), y: keep.select(self.y, other.y), z: keep.select(self.z, other.z) }
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

    /// Product with a matrix.
    #[inline(always)]
    pub fn transformed(self, m: &Mat3) -> Self {
        self.combine(m.x_axis, m.y_axis, m.z_axis)
    }

    /// Transforms from world space to the frame.
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

/// `v` if `keep`, else 0.
#[inline(always)]
pub fn or_zero<S: Simd>(keep: M<S>, v: F<S>) -> F<S> {
    keep.select(v, F::splat(v.token(), 0.0))
}
