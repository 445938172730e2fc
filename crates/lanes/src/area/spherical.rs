//! Spherical rectangles [Ureña, Fajardo and King 2013] from many points at once; see `lights::kinds::area::rectangle`.

use super::shapes::Rectangle;
use crate::lane::{F, narrowed, widened};
use fearless_simd::{Simd, f64x8, mask64x8, prelude::*};
use lumiris_numbers::math::DVec3;
use lumiris_numbers::math::elementary::SinCos;
use std::f64::consts::{FRAC_PI_2, FRAC_PI_4, FRAC_PI_8, PI, TAU};

/// Smallest solid angle (sr) that is sampled by solid angle. Above it, f64 angles are accurate even for rectangles that
/// are nearly edge-on.
pub const MIN_SOLID_ANGLE: f64 = 1e-4;
/// Smallest distance from the plane, in diagonals of the rectangle, that is sampled by solid angle.
pub const MIN_HEIGHT: f64 = 1e-5;

/// Rectangle in the frame of each point, with precomputed values for sampling.
#[derive(Clone, Copy)]
pub(super) struct SphericalSetup<S: Simd> {
    x: [f64x8<S>; 2],
    y: [f64x8<S>; 2],
    z0: f64x8<S>,
    pub(super) solid_angle: f64x8<S>,
    /// cos and −sin of g2 + g3.
    rotation: [f64x8<S>; 2],
    /// z of the normals of the planes through the edges y0 and y1.
    b: [f64x8<S>; 2],
    /// 1 − b0².
    k: f64x8<S>,
}

impl<S: Simd> SphericalSetup<S> {
    #[inline(always)]
    fn new(x: [f64x8<S>; 2], y: [f64x8<S>; 2], z0: f64x8<S>, g23: [f64x8<S>; 2], solid_angle: f64x8<S>) -> Self {
        let z2 = z0 * z0;
        // One division serves all: |g2·g3| = (x0² + z0²)·√(y0² + z0²)·√(y1² + z0²)
        let side = x[0] * x[0] + z2;
        let (below, above) = ((y[0] * y[0] + z2).sqrt(), (y[1] * y[1] + z2).sqrt());
        let scale = f64x8::splat(z0.token(), 1.0) / (side * below * above);
        let (by_below, by_above) = (scale * side * above, scale * side * below);
        let (b, k) = ([-y[0] * by_below, y[1] * by_above], z2 * by_below * by_below);
        SphericalSetup { x, y, z0, solid_angle, rotation: [g23[0] * scale, -(g23[1] * scale)], b, k }
    }

    /// Memory of a setup.
    #[inline(always)]
    pub(super) fn empty(simd: S) -> Self {
        let zero = f64x8::splat(simd, 0.0);
        let two = [zero; 2];
        SphericalSetup { x: two, y: two, z0: zero, solid_angle: zero, rotation: two, b: two, k: zero }
    }

    /// The setup for the points `from`.
    #[inline(always)]
    pub(super) fn from_points(rectangle: &Rectangle, from: [f64x8<S>; 3]) -> Self {
        let (corner, ex, ey) = (rectangle.corner.as_dvec3(), rectangle.ex.as_dvec3(), rectangle.ey.as_dvec3());
        let d = [-from[0] + corner.x, -from[1] + corner.y, -from[2] + corner.z];
        let (x0, y0, z0) = (dot(d, ex), dot(d, ey), -dot(d, ex.cross(ey)).abs());
        let x = [x0, x0 + f64::from(rectangle.size.x)];
        let y = [y0, y0 + f64::from(rectangle.size.y)];
        let (xx, yy, zz) = ([x[0] * x[0], x[1] * x[1]], [y[0] * y[0], y[1] * y[1]], z0 * z0);
        // e^{ig} of the inner angles up to a positive factor, and pairwise products
        let g0 = [x[1] * y[0], -(z0 * (xx[1] + yy[0] + zz).sqrt())];
        let g1 = [-(x[1] * y[1]), -(z0 * (xx[1] + yy[1] + zz).sqrt())];
        let g2 = [x[0] * y[1], -(z0 * (xx[0] + yy[1] + zz).sqrt())];
        let g3 = [-(x[0] * y[0]), -(z0 * (xx[0] + yy[0] + zz).sqrt())];
        let (g01, g23) = (product(g0, g1), product(g2, g3));
        Self::new(x, y, z0, g23, angle(product(g01, g23)))
    }

    /// Distances from the corner along the edges.
    #[inline(always)]
    pub(super) fn sample(&self, u0: f64x8<S>, u1: f64x8<S>) -> [F<S>; 2] {
        let simd = u0.token();
        let (one, least) = (f64x8::splat(simd, 1.0), F::splat(simd, f32::MIN_POSITIVE));
        // cos and sin of u·S − (g2 + g3)
        let SinCos { sin: sin_us, cos: cos_us } = sin_cos_turns_f64(u0 * (self.solid_angle * (1.0 / TAU)));
        let cos = cos_us * self.rotation[0] - sin_us * self.rotation[1];
        let sin = cos_us * self.rotation[1] + sin_us * self.rotation[0];
        // With fu = f/sin, x = −z0·sgn(fu)/√(fu² + b0² − 1). Differences are in f64, roots and quotients in f32
        let f = cos * self.b[0] - self.b[1];
        let under_root = narrowed(f * f - sin * sin * self.k).max(least);
        let x = widened(narrowed(sin * (-self.z0).copysign(f)) / under_root.sqrt());
        let x = x.max(self.x[0]).min(self.x[1]);

        let d2 = x * x + self.z0 * self.z0;
        let (r0, r1) = ((d2 + self.y[0] * self.y[0]).sqrt(), (d2 + self.y[1] * self.y[1]).sqrt());
        let scale = one / (r0 * r1);
        let (h0, h1) = (r1 * scale * self.y[0], r0 * scale * self.y[1]);
        let h = h0 + u1 * (h1 - h0);
        let slope = (narrowed(d2) / narrowed(one - h * h).max(least)).sqrt();
        let y = (h * widened(slope)).max(self.y[0]).min(self.y[1]);
        [narrowed(x - self.x[0]), narrowed(y - self.y[0])]
    }

    /// True unless the rectangle is edge-on, or so small that its angles lose precision.
    #[inline(always)]
    pub(super) fn is_accurate(&self, rectangle: &Rectangle) -> mask64x8<S> {
        let simd = self.z0.token();
        let (width, height) = (f64::from(rectangle.size.x), f64::from(rectangle.size.y));
        let nearest = f64x8::splat(simd, MIN_HEIGHT * MIN_HEIGHT * (width * width + height * height));
        (self.z0 * self.z0).simd_gt(nearest) & self.solid_angle.simd_ge(f64x8::splat(simd, MIN_SOLID_ANGLE))
    }
}

#[inline(always)]
fn dot<S: Simd>(v: [f64x8<S>; 3], w: DVec3) -> f64x8<S> {
    v[0] * w.x + v[1] * w.y + v[2] * w.z
}

/// The product of two complex numbers.
#[inline(always)]
fn product<S: Simd>(a: [f64x8<S>; 2], b: [f64x8<S>; 2]) -> [f64x8<S>; 2] {
    [a[0] * b[0] - a[1] * b[1], a[0] * b[1] + a[1] * b[0]]
}

/// The argument of a complex number in [0, 2π); 0 for numbers slightly below the positive real axis.
#[inline(always)]
fn angle<S: Simd>([x, y]: [f64x8<S>; 2]) -> f64x8<S> {
    let simd = x.token();
    let zero = f64x8::splat(simd, 0.0);
    let a = atan2(y, x);
    a.simd_lt(f64x8::splat(simd, -1e-6)).select(a + TAU, a.max(zero))
}

/// The argument of x + iy in [−π, π], with errors below 2⁻⁴⁸. NaN at 0.
#[inline(always)]
pub fn atan2<S: Simd>(y: f64x8<S>, x: f64x8<S>) -> f64x8<S> {
    let simd = x.token();
    let zero = f64x8::splat(simd, 0.0);
    let is_steep = y.abs().simd_gt(x.abs());
    let (large, small) = (is_steep.select(y.abs(), x.abs()), is_steep.select(x.abs(), y.abs()));
    // The difference to the nearest multiple of π/8, from the tangent of a difference
    let is_third = small.simd_gt(large * TAN_3_PI_16);
    let is_second = small.simd_gt(large * TAN_PI_16);
    let tangent = is_third.select(f64x8::splat(simd, 1.0), is_second.select(f64x8::splat(simd, TAN_PI_8), zero));
    let base = is_third.select(f64x8::splat(simd, FRAC_PI_4), is_second.select(f64x8::splat(simd, FRAC_PI_8), zero));
    let r = (small - large * tangent) / (large + small * tangent);
    let r2 = r * r;
    let series = ((((((((r2 * (-1.0 / 19.0) + 1.0 / 17.0) * r2 - 1.0 / 15.0) * r2 + 1.0 / 13.0) * r2 - 1.0 / 11.0)
        * r2
        + 1.0 / 9.0)
        * r2
        - 1.0 / 7.0)
        * r2
        + 1.0 / 5.0)
        * r2
        - 1.0 / 3.0)
        * r2
        * r
        + r;
    let a = base + series;
    let a = is_steep.select(-a + FRAC_PI_2, a);
    let a = x.simd_lt(zero).select(-a + PI, a);
    a.copysign(y)
}

/// tan π/16.
const TAN_PI_16: f64 = 0.198_912_367_379_658;
/// tan π/8.
const TAN_PI_8: f64 = 0.414_213_562_373_095_03;
/// tan 3π/16.
const TAN_3_PI_16: f64 = 0.668_178_637_919_298_9;

/// sin 2πt and cos 2πt for |t| < 2²⁰, from series around the nearest quarter turn; errors below 2⁻⁴⁵.
#[inline(always)]
pub fn sin_cos_turns_f64<S: Simd>(t: f64x8<S>) -> SinCos<f64x8<S>> {
    let simd = t.token();
    let quarters = (t * 4.0).round_ties_even();
    let x = (t - quarters * 0.25) * TAU;
    let x2 = x * x;
    let sin = (((((x2 * (1.0 / 6_227_020_800.0) - 1.0 / 39_916_800.0) * x2 + 1.0 / 362_880.0) * x2 - 1.0 / 5040.0)
        * x2
        + 1.0 / 120.0)
        * x2
        - 1.0 / 6.0)
        * x2
        * x
        + x;
    let cos = ((((((x2 * (-1.0 / 87_178_291_200.0) + 1.0 / 479_001_600.0) * x2 - 1.0 / 3_628_800.0) * x2
        + 1.0 / 40_320.0)
        * x2
        - 1.0 / 720.0)
        * x2
        + 1.0 / 24.0)
        * x2
        - 0.5)
        * x2
        + 1.0;
    // The quarters modulo 4, exact
    let k = quarters - (quarters * 0.25).floor() * 4.0;
    let (one, two, three) = (f64x8::splat(simd, 1.0), f64x8::splat(simd, 2.0), f64x8::splat(simd, 3.0));
    let (is_1, is_2, is_3): (mask64x8<S>, mask64x8<S>, mask64x8<S>) =
        (k.simd_eq(one), k.simd_eq(two), k.simd_eq(three));
    let is_odd = is_1 | is_3;
    let (s, c) = (is_odd.select(cos, sin), is_odd.select(sin, cos));
    SinCos { sin: (is_2 | is_3).select(-s, s), cos: (is_1 | is_2).select(-c, c) }
}
