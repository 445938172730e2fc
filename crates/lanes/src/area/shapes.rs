//! Rectangles and triangles.

use crate::lane::{F, Vec3s};
use fearless_simd::{Simd, prelude::*};
use lumiris_numbers::math::{Vec2, Vec3};

/// A rectangle.
#[derive(Clone, Copy, Debug)]
pub struct Rectangle {
    /// A corner.
    pub corner: Vec3,
    /// Unit vector along an edge from the corner.
    pub ex: Vec3,
    /// Unit vector along the other edge.
    pub ey: Vec3,
    /// Lengths of the two edges.
    pub size: Vec2,
    /// Unit normal.
    pub n: Vec3,
}

impl Rectangle {
    /// The points at `s` along one edge and `t` along the other.
    #[inline(always)]
    pub(super) fn point<S: Simd>(&self, s: F<S>, t: F<S>) -> Vec3s<S> {
        let simd = s.token();
        Vec3s {
            x: F::splat(simd, self.corner.x) + s * self.ex.x + t * self.ey.x,
            y: F::splat(simd, self.corner.y) + s * self.ex.y + t * self.ey.y,
            z: F::splat(simd, self.corner.z) + s * self.ex.z + t * self.ey.z,
        }
    }
}

/// Barycentric weights uniform over a triangle [Heitz 2019].
#[inline(always)]
pub(super) fn barycentric<S: Simd>(u0: F<S>, u1: F<S>) -> Vec3s<S> {
    let is_left = u0.simd_lt(u1);
    let half = is_left.select(u0, u1) * 0.5;
    let (b0, b1) = (is_left.select(half, u0 - half), is_left.select(u1 - half, half));
    Vec3s { x: b0, y: b1, z: F::splat(u0.token(), 1.0) - b0 - b1 }
}
