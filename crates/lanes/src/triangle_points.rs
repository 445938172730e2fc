//! Surface points of rays on triangles of meshes, and derivatives by their texture coordinates.
//!
//! The formulas for single points are in the module `geometry::mesh`.

use super::lane::{ColumnsMut3, F, LANES, Vec3s, load, narrowed, or_zero, store, widened};
use fearless_simd::{Level, Simd, dispatch, f64x8, prelude::*};
use lumiris_numbers::math::{Vec2, Vec3, gamma};

/// Hits on [`LANES`] triangles: `[axis][lane]` for vectors.
#[derive(Clone, Copy, Debug, Default)]
pub struct TriangleHits {
    /// The corners.
    pub corners: [[[f32; LANES]; 3]; 3],
    /// Shading normals of the corners; zero if there are none.
    pub normals: [[[f32; LANES]; 3]; 3],
    /// Weights of corners 1 and 2.
    pub b: [[f32; LANES]; 2],
    /// 1, or −1 if the normal is the reverse of (p1 − p0) × (p2 − p0).
    pub orientation: [f32; LANES],
    /// Directions of the rays.
    pub d: [[f32; LANES]; 3],
}

/// Minimum determinant of the texture coordinates of a triangle that has derivatives.
pub const MIN_DETERMINANT: f64 = 1e-9;

/// Texture coordinates of the corners of [`LANES`] triangles: `[corner][axis][lane]`.
pub type CornerCoordinates = [[[f32; LANES]; 2]; 3];

/// Surface points.
#[derive(Debug)]
pub struct Points<'a> {
    /// The points.
    pub p: ColumnsMut3<'a>,
    /// Bounds of their rounding errors.
    pub p_error: ColumnsMut3<'a>,
    /// Geometric normals.
    pub n: ColumnsMut3<'a>,
    /// Geometric normals on the side of `wo`.
    pub facing: ColumnsMut3<'a>,
    /// Shading normals.
    pub ns: ColumnsMut3<'a>,
    /// Unit directions to the rays' origins.
    pub wo: ColumnsMut3<'a>,
}

/// [`LANES`] surface points with derivatives: `[axis][lane]`.
#[derive(Clone, Copy, Debug, Default)]
pub struct TexturedPoints {
    /// The points.
    pub p: [[f32; LANES]; 3],
    /// Bounds of their rounding errors.
    pub p_error: [[f32; LANES]; 3],
    /// Geometric normals.
    pub n: [[f32; LANES]; 3],
    /// Shading normals.
    pub ns: [[f32; LANES]; 3],
    /// Unit directions to the rays' origins.
    pub wo: [[f32; LANES]; 3],
    /// ∂p/∂u and ∂p/∂v; zero if they do not span the triangle.
    pub derivatives: [[[f32; LANES]; 3]; 2],
    /// Their inverse lengths; 0 if they do not span the triangle.
    pub inverse_lengths: [[f32; LANES]; 2],
    /// Texture coordinates.
    pub uv: [[f32; LANES]; 2],
}

impl TexturedPoints {
    /// Texture coordinates of point `k`.
    #[inline]
    pub fn uv(&self, k: usize) -> Vec2 {
        Vec2::new(self.uv[0][k], self.uv[1][k])
    }
}

/// The vector of lane `k`.
#[inline]
pub fn lane(rows: &[[f32; LANES]; 3], k: usize) -> Vec3 {
    Vec3::new(rows[0][k], rows[1][k], rows[2][k])
}

/// Sets the vector of lane `k`.
#[inline]
pub fn set_lane(rows: &mut [[f32; LANES]; 3], k: usize, v: Vec3) {
    (rows[0][k], rows[1][k], rows[2][k]) = v.into();
}

/// Computes the surface points of hits.
pub fn points(level: Level, hits: &[TriangleHits], out: &mut Points<'_>) {
    dispatch!(level, simd => points_lanes(simd, hits, out));
}

/// Computes the surface points of hits with their derivatives. All slices have the same length.
pub fn textured_points(
    level: Level,
    hits: &[TriangleHits],
    coordinates: &[CornerCoordinates],
    out: &mut [TexturedPoints],
) {
    dispatch!(level, simd => textured_points_lanes(simd, hits, coordinates, out));
}

#[inline(always)]
fn points_lanes<S: Simd>(simd: S, hits: &[TriangleHits], out: &mut Points<'_>) {
    for (block, hits) in hits.iter().enumerate() {
        let i = block * LANES;
        let Hit { p, p_error, n, ns, wo, .. } = hit(simd, hits);
        p.store(&mut out.p, i);
        p_error.store(&mut out.p_error, i);
        n.store(&mut out.n, i);
        reversed(n).or(n.dot(wo).simd_lt(F::splat(simd, 0.0)), n).store(&mut out.facing, i);
        ns.store(&mut out.ns, i);
        wo.store(&mut out.wo, i);
    }
}

#[inline(always)]
fn textured_points_lanes<S: Simd>(
    simd: S,
    hits: &[TriangleHits],
    coordinates: &[CornerCoordinates],
    out: &mut [TexturedPoints],
) {
    for ((hits, st), out) in hits.iter().zip(coordinates).zip(out) {
        let Hit { corners, b, p, p_error, n, ns, wo } = hit(simd, hits);
        store_rows(p, &mut out.p);
        store_rows(p_error, &mut out.p_error);
        store_rows(n, &mut out.n);
        store_rows(ns, &mut out.ns);
        store_rows(wo, &mut out.wo);

        // Texture coordinates and derivatives
        let st = [load_two(simd, &st[0]), load_two(simd, &st[1]), load_two(simd, &st[2])];
        let [u, v] = derivatives(corners, st);
        store_rows(u, &mut out.derivatives[0]);
        store_rows(v, &mut out.derivatives[1]);
        store(inverse_length(u), &mut out.inverse_lengths[0], 0);
        store(inverse_length(v), &mut out.inverse_lengths[1], 0);
        store(st[0][0] * b[0] + st[1][0] * b[1] + st[2][0] * b[2], &mut out.uv[0], 0);
        store(st[0][1] * b[0] + st[1][1] * b[1] + st[2][1] * b[2], &mut out.uv[1], 0);
    }
}

/// Hits on triangles.
struct Hit<S: Simd> {
    corners: [Vec3s<S>; 3],
    /// Weights of the corners.
    b: [F<S>; 3],
    p: Vec3s<S>,
    p_error: Vec3s<S>,
    n: Vec3s<S>,
    ns: Vec3s<S>,
    wo: Vec3s<S>,
}

#[inline(always)]
fn hit<S: Simd>(simd: S, hits: &TriangleHits) -> Hit<S> {
    let corners = load_three(simd, &hits.corners);
    let (b1, b2) = (load(simd, &hits.b[0], 0), load(simd, &hits.b[1], 0));
    let (zero, one) = (F::splat(simd, 0.0), F::splat(simd, 1.0));
    let b0 = one - b1 - b2;

    // In f64, which keeps the normals of slivers accurate
    let (p, n) = point_and_normal(corners, b1, b2);
    let n = n.times(load(simd, &hits.orientation, 0));

    let terms = [corners[0].times(b0).abs(), corners[1].times(b1).abs(), corners[2].times(b2).abs()];
    let p_error = terms[0].plus(terms[1]).plus(terms[2]).times(F::splat(simd, gamma(7)));

    let normals = load_three(simd, &hits.normals);
    let blend = normals[0].times(b0).plus(normals[1].times(b1)).plus(normals[2].times(b2));
    let inverse = one / blend.dot(blend).sqrt();
    let ns = blend.times(inverse).or(inverse.is_finite() & inverse.simd_gt(zero), n);
    let n = reversed(n).or(n.dot(ns).simd_lt(zero), n);

    let d = load_rows(simd, &hits.d);
    let wo = d.times(-(one / d.dot(d).sqrt()));
    Hit { corners, b: [b0, b1, b2], p, p_error, n, ns, wo }
}

/// Points and unit normals of triangles.
#[inline(always)]
fn point_and_normal<S: Simd>(corners: [Vec3s<S>; 3], b1: F<S>, b2: F<S>) -> (Vec3s<S>, Vec3s<S>) {
    let (b1, b2) = (widened(b1), widened(b2));
    let [p0, p1, p2] = [all_widened(corners[0]), all_widened(corners[1]), all_widened(corners[2])];
    let e1 = [p1[0] - p0[0], p1[1] - p0[1], p1[2] - p0[2]];
    let e2 = [p2[0] - p0[0], p2[1] - p0[1], p2[2] - p0[2]];
    let p = [p0[0] + e1[0] * b1 + e2[0] * b2, p0[1] + e1[1] * b1 + e2[1] * b2, p0[2] + e1[2] * b1 + e2[2] * b2];
    let c = cross(e1, e2);
    let length = (c[0] * c[0] + c[1] * c[1] + c[2] * c[2]).sqrt();
    let (zero, one) = (f64x8::splat(b1.token(), 0.0), f64x8::splat(b1.token(), 1.0));
    let inverse = length.simd_gt(zero).select(one / length, zero);
    (all_narrowed(p), all_narrowed([c[0] * inverse, c[1] * inverse, c[2] * inverse]))
}

/// ∂p/∂u and ∂p/∂v of triangles with the texture coordinates `st` of their corners; zero if they are linearly
/// dependent.
#[inline(always)]
fn derivatives<S: Simd>(corners: [Vec3s<S>; 3], st: [[F<S>; 2]; 3]) -> [Vec3s<S>; 2] {
    let simd = st[0][0].token();
    let (zero, one) = (f64x8::splat(simd, 0.0), f64x8::splat(simd, 1.0));
    let (du02, dv02) = (widened(st[0][0] - st[2][0]), widened(st[0][1] - st[2][1]));
    let (du12, dv12) = (widened(st[1][0] - st[2][0]), widened(st[1][1] - st[2][1]));
    let (dp02, dp12) = (all_widened(corners[0].minus(corners[2])), all_widened(corners[1].minus(corners[2])));

    // Solve for the derivatives
    let det = du02 * dv12 - dv02 * du12;
    let [ux, uy, uz] =
        [dv12 * dp02[0] - dv02 * dp12[0], dv12 * dp02[1] - dv02 * dp12[1], dv12 * dp02[2] - dv02 * dp12[2]];
    let [vx, vy, vz] =
        [du02 * dp12[0] - du12 * dp02[0], du02 * dp12[1] - du12 * dp02[1], du02 * dp12[2] - du12 * dp02[2]];
    let u = all_narrowed([ux / det, uy / det, uz / det]);
    let v = all_narrowed([vx / det, vy / det, vz / det]);

    // Zero if they do not span the triangle
    let c = cross(all_widened(u), all_widened(v));
    let has_area = (c[0] * c[0] + c[1] * c[1] + c[2] * c[2]).simd_gt(zero);
    let is_regular = det.abs().simd_ge(f64x8::splat(simd, MIN_DETERMINANT));
    let spans = narrowed((has_area & is_regular).select(one, zero)).simd_gt(F::splat(simd, 0.0));
    let is_finite = u.x.is_finite() & u.y.is_finite() & u.z.is_finite();
    let is_finite = is_finite & v.x.is_finite() & v.y.is_finite() & v.z.is_finite();
    let none = Vec3s::splat(simd, Vec3::ZERO);
    [u.or(spans & is_finite, none), v.or(spans & is_finite, none)]
}

/// 1/|v|; 0 for the zero vector.
#[inline(always)]
fn inverse_length<S: Simd>(v: Vec3s<S>) -> F<S> {
    let length = v.dot(v).sqrt();
    or_zero(length.simd_gt(F::splat(length.token(), 0.0)), F::splat(length.token(), 1.0) / length)
}

#[inline(always)]
fn cross<S: Simd>(a: [f64x8<S>; 3], b: [f64x8<S>; 3]) -> [f64x8<S>; 3] {
    [a[1] * b[2] - b[1] * a[2], a[2] * b[0] - b[2] * a[0], a[0] * b[1] - b[0] * a[1]]
}

#[inline(always)]
fn reversed<S: Simd>(v: Vec3s<S>) -> Vec3s<S> {
    v.times(F::splat(v.x.token(), -1.0))
}

#[inline(always)]
fn load_rows<S: Simd>(simd: S, rows: &[[f32; LANES]; 3]) -> Vec3s<S> {
    Vec3s { x: load(simd, &rows[0], 0), y: load(simd, &rows[1], 0), z: load(simd, &rows[2], 0) }
}

#[inline(always)]
fn load_two<S: Simd>(simd: S, rows: &[[f32; LANES]; 2]) -> [F<S>; 2] {
    [load(simd, &rows[0], 0), load(simd, &rows[1], 0)]
}

#[inline(always)]
fn load_three<S: Simd>(simd: S, from: &[[[f32; LANES]; 3]; 3]) -> [Vec3s<S>; 3] {
    [load_rows(simd, &from[0]), load_rows(simd, &from[1]), load_rows(simd, &from[2])]
}

#[inline(always)]
fn store_rows<S: Simd>(v: Vec3s<S>, rows: &mut [[f32; LANES]; 3]) {
    store(v.x, &mut rows[0], 0);
    store(v.y, &mut rows[1], 0);
    store(v.z, &mut rows[2], 0);
}

#[inline(always)]
fn all_widened<S: Simd>(v: Vec3s<S>) -> [f64x8<S>; 3] {
    [widened(v.x), widened(v.y), widened(v.z)]
}

#[inline(always)]
fn all_narrowed<S: Simd>(v: [f64x8<S>; 3]) -> Vec3s<S> {
    Vec3s { x: narrowed(v[0]), y: narrowed(v[1]), z: narrowed(v[2]) }
}
