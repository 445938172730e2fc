//! Directions from many points to one surface. The formulas are in the modules of `lights::kinds::area`.

use super::shapes::{Rectangle, barycentric};
use super::spherical::SphericalSetup;
use crate::lane::{F, LANES, M, Vec3s, load, narrowed, or_zero, store, widened};
use fearless_simd::{Level, Simd, dispatch, f64x8, prelude::*};
use lumiris_numbers::math::{Vec3, gamma};

/// Largest diagonal, relative to the distance of the centre, for sampling by area. Larger rectangles are sampled by
/// solid angle.
pub const MAX_EXTENT: f32 = 0.5;

/// Directions from many points to one surface.
#[derive(Debug)]
pub struct PointsOnLight<'a> {
    /// Unit directions.
    pub wi: [&'a mut [f32]; 3],
    /// Points of the surface.
    pub p: [&'a mut [f32]; 3],
    /// Bounds of their rounding errors.
    pub p_error: [&'a mut [f32]; 3],
    /// Densities per steradian; 0 where there is no sample.
    pub pdf: &'a mut [f32],
}

/// Samples a direction from each of the points `from` to a rectangle whose corners are off by up to `flatness_error`.
/// Directions are uniform in solid angle where this is accurate and the solid angle is large, else uniform in area.
/// Slices have the same length, a multiple of [`LANES`].
pub fn sample_rectangle(
    level: Level,
    rectangle: &Rectangle,
    flatness_error: f32,
    from: [&[f32]; 3],
    u: [&[f32]; 2],
    out: &mut PointsOnLight<'_>,
) {
    dispatch!(level, simd => sample_rectangle_lanes(simd, (rectangle, flatness_error), from, u, out));
}

#[inline(always)]
fn sample_rectangle_lanes<S: Simd>(
    simd: S,
    (rectangle, flatness_error): (&Rectangle, f32),
    from: [&[f32]; 3],
    u: [&[f32]; 2],
    out: &mut PointsOnLight<'_>,
) {
    // Constants of the rectangle
    let zero = F::splat(simd, 0.0);
    let (n, size) = (Vec3s::splat(simd, rectangle.n), rectangle.size);
    let center = rectangle.corner + rectangle.ex * (0.5 * size.x) + rectangle.ey * (0.5 * size.y);
    let (corner, ex, ey) = (rectangle.corner, rectangle.ex, rectangle.ey);
    for i in (0..out.pdf.len()).step_by(LANES) {
        let from = Vec3s::load(simd, from, i);
        // Solid angle or area
        let (u0, u1) = (load(simd, u[0], i), load(simd, u[1], i));
        let (s, t, density, is_spherical) = spherical_place(rectangle, center, from, (u0, u1));
        let (s, t) = (is_spherical.select(s, u0 * size.x), is_spherical.select(t, u1 * size.y));
        // Directions and densities
        let p = rectangle.point(s, t);
        let d = p.minus(from);
        let t2 = d.dot(d);
        let inverse = F::splat(simd, 1.0) / t2.sqrt();
        let wi = d.times(inverse);
        let by_area = t2 * (1.0 / (size.x * size.y)) / n.dot(wi).abs();
        let pdf = is_spherical.select(density, by_area);
        let is_sample = pdf.simd_gt(zero) & pdf.is_finite() & inverse.is_finite();
        store(or_zero(is_sample, pdf), out.pdf, i);
        wi.store(&mut out.wi, i);
        p.store(&mut out.p, i);
        // Error bounds
        let (s, t) = (s.abs(), t.abs());
        let error = Vec3s {
            x: (s * ex.x.abs() + t * ey.x.abs() + corner.x.abs()) * gamma(6) + flatness_error,
            y: (s * ex.y.abs() + t * ey.y.abs() + corner.y.abs()) * gamma(6) + flatness_error,
            z: (s * ex.z.abs() + t * ey.z.abs() + corner.z.abs()) * gamma(6) + flatness_error,
        };
        error.store(&mut out.p_error, i);
    }
}

/// Positions along the edges uniform in solid angle, their density (1/sr), and the mask of lanes in which they are
/// used.
#[inline(always)]
fn spherical_place<S: Simd>(
    rectangle: &Rectangle,
    center: Vec3,
    from: Vec3s<S>,
    (u0, u1): (F<S>, F<S>),
) -> (F<S>, F<S>, F<S>, M<S>) {
    let simd = u0.token();
    let seen = SphericalSetup::from_points(rectangle, [widened(from.x), widened(from.y), widened(from.z)]);
    let (s, t) = seen.sample(widened(u0), widened(u1));
    // Infinity where the solid angle is inaccurate
    let solid_angle = seen.is_accurate(rectangle).select(seen.solid_angle, f64x8::splat(simd, f64::INFINITY));
    let density = F::splat(simd, 1.0) / narrowed(solid_angle);
    let d = Vec3s::splat(simd, center).minus(from);
    let is_near = (d.dot(d) * (MAX_EXTENT * MAX_EXTENT)).simd_le(F::splat(simd, rectangle.size.length_squared()));
    let is_spherical = is_near & density.simd_gt(F::splat(simd, 0.0));
    (s, t, density, is_spherical)
}

/// Samples a direction from each of the points `from` to a triangle, given by its corners, unit normal and area,
/// uniform in area; see [`sample_rectangle`].
pub fn sample_triangle(
    level: Level,
    triangle: ([Vec3; 3], Vec3, f32),
    from: [&[f32]; 3],
    u: [&[f32]; 2],
    out: &mut PointsOnLight<'_>,
) {
    dispatch!(level, simd => sample_triangle_lanes(simd, triangle, from, u, out));
}

#[inline(always)]
fn sample_triangle_lanes<S: Simd>(
    simd: S,
    (corners, n, area): ([Vec3; 3], Vec3, f32),
    from: [&[f32]; 3],
    u: [&[f32]; 2],
    out: &mut PointsOnLight<'_>,
) {
    // As for rectangles sampled by area
    let n = Vec3s::splat(simd, n);
    for i in (0..out.pdf.len()).step_by(LANES) {
        let b = barycentric(load(simd, u[0], i), load(simd, u[1], i));
        let p = b.combine(corners[0], corners[1], corners[2]);
        let d = p.minus(Vec3s::load(simd, from, i));
        let t2 = d.dot(d);
        let wi = d.times(F::splat(simd, 1.0) / t2.sqrt());
        let pdf = t2 * (1.0 / area) / n.dot(wi).abs();
        store(or_zero(pdf.simd_gt(F::splat(simd, 0.0)) & pdf.is_finite(), pdf), out.pdf, i);
        wi.store(&mut out.wi, i);
        p.store(&mut out.p, i);
        let error = b.combine(corners[0].abs(), corners[1].abs(), corners[2].abs());
        error.times(F::splat(simd, gamma(6))).store(&mut out.p_error, i);
    }
}
