//! Directions from many points to one surface. The formulas are in the modules of `lights::kinds::area`.

use super::shapes::{Rectangle, barycentric};
use super::spherical::SphericalSetup;
use crate::lane::{F, LANES, Vec3s, load, narrowed, or_zero, store, widened};
use crate::wide::Wide;
use fearless_simd::{Level, Simd, dispatch, f64x8, prelude::*};
use lumiris_numbers::math::subtended_cone::SubtendedCone;
use lumiris_numbers::math::{Sphere, Vec3, gamma};

/// Largest diagonal, relative to the distance of the centre, for sampling by area. Larger rectangles are sampled by
/// solid angle.
pub const MAX_EXTENT: f32 = 0.5;

/// SIMD vectors of points whose setups are computed together.
const TOGETHER: usize = 8;

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
    dispatch!(level, simd => sample_rectangle_lanes(simd, rectangle, flatness_error, from, u, out));
}

#[inline(always)]
fn sample_rectangle_lanes<S: Simd>(
    simd: S,
    rectangle: &Rectangle,
    flatness_error: f32,
    from: [&[f32]; 3],
    u: [&[f32]; 2],
    out: &mut PointsOnLight<'_>,
) {
    let zero = F::splat(simd, 0.0);
    let mut setups = [SphericalSetup::empty(simd); TOGETHER];
    let mut places = [Place { s: zero, t: zero, density: zero }; TOGETHER];
    let end = out.pdf.len();
    for first in (0..end).step_by(TOGETHER * LANES) {
        // Each step is a loop: it is a long chain of operations, and the processor overlaps several chains
        let vectors = || (first..end.min(first + TOGETHER * LANES)).step_by(LANES);
        for (setup, i) in setups.iter_mut().zip(vectors()) {
            let Vec3s { x, y, z } = Vec3s::load(simd, from, i);
            *setup = SphericalSetup::from_points(rectangle, [widened(x), widened(y), widened(z)]);
        }
        for ((place, setup), i) in places.iter_mut().zip(&setups).zip(vectors()) {
            *place =
                Place::new(rectangle, setup, Vec3s::load(simd, from, i), [load(simd, u[0], i), load(simd, u[1], i)]);
        }
        for (place, i) in places.iter().zip(vectors()) {
            store_points(rectangle, flatness_error, place, (Vec3s::load(simd, from, i), i), out);
        }
    }
}

/// A place on a rectangle, as distances from the corner along the edges.
#[derive(Clone, Copy)]
struct Place<S: Simd> {
    s: F<S>,
    t: F<S>,
    /// Density (1/sr) of places uniform in solid angle; 0 of places uniform in area.
    density: F<S>,
}

impl<S: Simd> Place<S> {
    /// A place that is seen from the points `from`.
    #[inline(always)]
    fn new(rectangle: &Rectangle, seen: &SphericalSetup<S>, from: Vec3s<S>, [u0, u1]: [F<S>; 2]) -> Self {
        let (simd, size) = (u0.token(), rectangle.size);
        let [s, t] = seen.sample(widened(u0), widened(u1));
        // Infinity where the solid angle is inaccurate
        let solid_angle = seen.is_accurate(rectangle).select(seen.solid_angle, f64x8::splat(simd, f64::INFINITY));
        let density = F::splat(simd, 1.0) / narrowed(solid_angle);

        // By area if the rectangle is small
        let center = rectangle.corner + rectangle.ex * (0.5 * size.x) + rectangle.ey * (0.5 * size.y);
        let d = Vec3s::splat(simd, center).minus(from);
        let is_near = (d.dot(d) * (MAX_EXTENT * MAX_EXTENT)).simd_le(F::splat(simd, size.length_squared()));
        let is_spherical = is_near & density.simd_gt(F::splat(simd, 0.0));
        let (s, t) = (is_spherical.select(s, u0 * size.x), is_spherical.select(t, u1 * size.y));
        Place { s, t, density: or_zero(is_spherical, density) }
    }
}

/// Stores the points at places of a rectangle that are seen from the points `from`, from index `i` on.
#[inline(always)]
fn store_points<S: Simd>(
    rectangle: &Rectangle,
    flatness_error: f32,
    &Place { s, t, density }: &Place<S>,
    (from, i): (Vec3s<S>, usize),
    out: &mut PointsOnLight<'_>,
) {
    let (simd, size) = (s.token(), rectangle.size);
    let zero = F::splat(simd, 0.0);
    // Directions and densities
    let p = rectangle.point(s, t);
    let d = p.minus(from);
    let t2 = d.dot(d);
    let inverse = F::splat(simd, 1.0) / t2.sqrt();
    let wi = d.times(inverse);
    let by_area = t2 * (1.0 / (size.x * size.y)) / Vec3s::splat(simd, rectangle.n).dot(wi).abs();
    let pdf = density.simd_gt(zero).select(density, by_area);
    let is_sample = pdf.simd_gt(zero) & pdf.is_finite() & inverse.is_finite();
    store(or_zero(is_sample, pdf), out.pdf, i);
    wi.store(&mut out.wi, i);
    p.store(&mut out.p, i);
    // Error bounds
    let (corner, ex, ey) = (rectangle.corner.abs(), rectangle.ex.abs(), rectangle.ey.abs());
    let (s, t) = (s.abs(), t.abs());
    let error = Vec3s {
        x: (s * ex.x + t * ey.x + corner.x) * gamma(6) + flatness_error,
        y: (s * ex.y + t * ey.y + corner.y) * gamma(6) + flatness_error,
        z: (s * ex.z + t * ey.z + corner.z) * gamma(6) + flatness_error,
    };
    error.store(&mut out.p_error, i);
}

/// Samples a direction from each of the points `from` to a sphere, uniform in the cone that it subtends; see
/// [`sample_rectangle`]. Densities of points inside of the sphere are −1, and their samples undefined. `outward`
/// receives the outward unit normals.
pub fn sample_sphere(
    level: Level,
    sphere: &Sphere,
    from: [&[f32]; 3],
    u: [&[f32]; 2],
    outward: [&mut [f32]; 3],
    out: &mut PointsOnLight<'_>,
) {
    dispatch!(level, simd => sample_sphere_lanes(simd, sphere, from, u, outward, out));
}

#[inline(always)]
fn sample_sphere_lanes<S: Simd>(
    simd: S,
    sphere: &Sphere,
    from: [&[f32]; 3],
    u: [&[f32]; 2],
    mut outward: [&mut [f32]; 3],
    out: &mut PointsOnLight<'_>,
) {
    for i in (0..out.pdf.len()).step_by(LANES) {
        let from = Vec3s::load(simd, from, i).into();
        let cone = SubtendedCone::new(sphere, from);
        let point = cone.sample(sphere, from, [Wide(load(simd, u[0], i)), Wide(load(simd, u[1], i))]);
        let pdf = cone.is_outside.0.select(point.pdf.0, F::splat(simd, -1.0));
        store(pdf, out.pdf, i);
        Vec3s::from(point.wi).store(&mut out.wi, i);
        Vec3s::from(point.p).store(&mut out.p, i);
        Vec3s::from(point.p_error).store(&mut out.p_error, i);
        Vec3s::from(point.outward).store(&mut outward, i);
    }
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
