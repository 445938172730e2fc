//! Vertices of many paths at once, in columns: surface points of rays on triangles, weights of light samples, and
//! shadow segments.
//!
//! The formulas for single vertices are in the modules `geometry::mesh` and `direct`. Columns have the same length, a
//! multiple of [`LANES`].

pub use super::lane::{Columns3, ColumnsMut3};
use super::lane::{F, I, LANES, M, Vec3s, load, narrowed, or_zero, store, widened};
use super::wide::Wide;
use fearless_simd::{Level, Simd, dispatch, f64x8, prelude::*};
use lumiris_numbers::estimators::heuristics::Heuristic;
use lumiris_numbers::math::gamma;
use lumiris_numbers::math::ray::{COINCIDENCE, SEGMENT_END};

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

/// Computes the surface points of hits.
pub fn points(level: Level, hits: &[TriangleHits], out: &mut Points<'_>) {
    dispatch!(level, simd => points_lanes(simd, hits, out));
}

#[inline(always)]
fn points_lanes<S: Simd>(simd: S, hits: &[TriangleHits], out: &mut Points<'_>) {
    for (block, hits) in hits.iter().enumerate() {
        let i = block * LANES;
        let corners = load_three(simd, &hits.corners);
        let (b1, b2) = (load(simd, &hits.b[0], 0), load(simd, &hits.b[1], 0));
        let one = F::splat(simd, 1.0);
        let b0 = one - b1 - b2;

        // In f64, which keeps the normals of slivers accurate
        let (p, n) = point_and_normal(corners, b1, b2);
        let n = n.times(load(simd, &hits.orientation, 0));

        let terms = [absolute(corners[0].times(b0)), absolute(corners[1].times(b1)), absolute(corners[2].times(b2))];
        let error = terms[0].plus(terms[1]).plus(terms[2]).times(F::splat(simd, gamma(7)));

        let normals = load_three(simd, &hits.normals);
        let blend = normals[0].times(b0).plus(normals[1].times(b1)).plus(normals[2].times(b2));
        let inverse = one / blend.dot(blend).sqrt();
        let has_normal = inverse.is_finite();
        let ns = either(has_normal, blend.times(inverse), n);
        let zero = F::splat(simd, 0.0);
        let n = either(n.dot(ns).simd_lt(zero), n.times(-one), n);

        let d = load_rows(simd, &hits.d);
        let wo = d.times(-(one / d.dot(d).sqrt()));
        p.store(&mut out.p, i);
        error.store(&mut out.p_error, i);
        n.store(&mut out.n, i);
        either(n.dot(wo).simd_lt(zero), n.times(-one), n).store(&mut out.facing, i);
        ns.store(&mut out.ns, i);
        wo.store(&mut out.wo, i);
    }
}

#[inline(always)]
fn load_rows<S: Simd>(simd: S, rows: &[[f32; LANES]; 3]) -> Vec3s<S> {
    Vec3s { x: load(simd, &rows[0], 0), y: load(simd, &rows[1], 0), z: load(simd, &rows[2], 0) }
}

#[inline(always)]
fn load_three<S: Simd>(simd: S, from: &[[[f32; LANES]; 3]; 3]) -> [Vec3s<S>; 3] {
    [load_rows(simd, &from[0]), load_rows(simd, &from[1]), load_rows(simd, &from[2])]
}

#[inline(always)]
fn absolute<S: Simd>(v: Vec3s<S>) -> Vec3s<S> {
    Vec3s { x: v.x.abs(), y: v.y.abs(), z: v.z.abs() }
}

/// `a` if `first`, else `b`.
#[inline(always)]
fn either<S: Simd>(first: M<S>, a: Vec3s<S>, b: Vec3s<S>) -> Vec3s<S> {
    Vec3s { x: first.select(a.x, b.x), y: first.select(a.y, b.y), z: first.select(a.z, b.z) }
}

#[inline(always)]
fn all_widened<S: Simd>(v: Vec3s<S>) -> [f64x8<S>; 3] {
    [widened(v.x), widened(v.y), widened(v.z)]
}

/// Points and unit normals of triangles.
#[inline(always)]
fn point_and_normal<S: Simd>(corners: [Vec3s<S>; 3], b1: F<S>, b2: F<S>) -> (Vec3s<S>, Vec3s<S>) {
    let (b1, b2) = (widened(b1), widened(b2));
    let [p0, p1, p2] = [all_widened(corners[0]), all_widened(corners[1]), all_widened(corners[2])];
    let e1 = [p1[0] - p0[0], p1[1] - p0[1], p1[2] - p0[2]];
    let e2 = [p2[0] - p0[0], p2[1] - p0[1], p2[2] - p0[2]];
    let p = [p0[0] + e1[0] * b1 + e2[0] * b2, p0[1] + e1[1] * b1 + e2[1] * b2, p0[2] + e1[2] * b1 + e2[2] * b2];
    let c = [e1[1] * e2[2] - e2[1] * e1[2], e1[2] * e2[0] - e2[2] * e1[0], e1[0] * e2[1] - e2[0] * e1[1]];
    let length = (c[0] * c[0] + c[1] * c[1] + c[2] * c[2]).sqrt();
    let (zero, one) = (f64x8::splat(b1.token(), 0.0), f64x8::splat(b1.token(), 1.0));
    let inverse = length.simd_gt(zero).select(one / length, zero);
    let n = [c[0] * inverse, c[1] * inverse, c[2] * inverse];
    (
        Vec3s { x: narrowed(p[0]), y: narrowed(p[1]), z: narrowed(p[2]) },
        Vec3s { x: narrowed(n[0]), y: narrowed(n[1]), z: narrowed(n[2]) },
    )
}

/// Samples of one technique, with the density of another.
#[derive(Clone, Copy, Debug)]
pub struct Samples<'a> {
    /// f·|cos θ| (1/sr).
    pub f_cos: Columns3<'a>,
    /// Radiance.
    pub li: Columns3<'a>,
    /// Density of the samples' technique; 0 if there is no sample.
    pub p: &'a [f32],
    /// Density of the other technique.
    pub p_other: &'a [f32],
    /// Number of samples of the technique.
    pub n: f32,
    /// Number of samples of the other technique.
    pub n_other: f32,
    /// MIS heuristic.
    pub heuristic: Heuristic,
}

/// Unoccluded contributions of samples, f·|cos θ|·L·w/(n·p); 0 if not finite.
pub fn weigh(level: Level, samples: &Samples<'_>, out: &mut ColumnsMut3<'_>) {
    dispatch!(level, simd => weigh_lanes(simd, samples, out));
}

#[inline(always)]
fn weigh_lanes<S: Simd>(simd: S, samples: &Samples<'_>, out: &mut ColumnsMut3<'_>) {
    let zero = F::splat(simd, 0.0);
    for i in (0..samples.p.len()).step_by(LANES) {
        let x = load(simd, samples.p, i) * samples.n;
        let y = load(simd, samples.p_other, i) * samples.n_other;
        let factor = samples.heuristic.weight_of_expected(Wide(x), Wide(y)).0 / x;
        let (f, l) = (Vec3s::load(simd, samples.f_cos, i), Vec3s::load(simd, samples.li, i));
        let c = Vec3s { x: f.x * l.x * factor, y: f.y * l.y * factor, z: f.z * l.z * factor };
        let is_finite = c.x.is_finite() & c.y.is_finite() & c.z.is_finite();
        let keep = x.simd_gt(zero) & is_finite;
        Vec3s { x: or_zero(keep, c.x), y: or_zero(keep, c.y), z: or_zero(keep, c.z) }.store(out, i);
    }
}

/// Surface points with their error bounds and normals.
#[derive(Clone, Copy, Debug)]
pub struct Ends<'a> {
    /// The points.
    pub p: Columns3<'a>,
    /// Bounds of their rounding errors.
    pub p_error: Columns3<'a>,
    /// Geometric normals; zero for points without a surface.
    pub n: Columns3<'a>,
}

/// Rays.
#[derive(Debug)]
pub struct Rays<'a> {
    /// Origins.
    pub o: ColumnsMut3<'a>,
    /// Directions.
    pub d: ColumnsMut3<'a>,
    /// Ends of their open intervals of t.
    pub t_max: &'a mut [f32],
}

/// Shadow segments from surfaces to points of lights. Where `is_far` is not 0, infinite rays in the directions `wi`.
pub fn segments(level: Level, from: &Ends<'_>, wi: Columns3<'_>, to: &Ends<'_>, is_far: &[f32], out: &mut Rays<'_>) {
    dispatch!(level, simd => segments_lanes(simd, from, wi, to, is_far, out));
}

#[inline(always)]
fn segments_lanes<S: Simd>(
    simd: S,
    from: &Ends<'_>,
    wi: Columns3<'_>,
    to: &Ends<'_>,
    is_far: &[f32],
    out: &mut Rays<'_>,
) {
    for i in (0..is_far.len()).step_by(LANES) {
        let wi = Vec3s::load(simd, wi, i);
        let o = offset_origins(from.load(simd, i), wi);
        let light = to.load(simd, i);
        let is_far = load(simd, is_far, i).simd_ne(F::splat(simd, 0.0));
        let d = offset_origins(light, o.minus(light[0])).minus(o);
        o.store(&mut out.o, i);
        either(is_far, wi, d).store(&mut out.d, i);
        store(is_far.select(F::splat(simd, f32::INFINITY), F::splat(simd, SEGMENT_END)), out.t_max, i);
    }
}

/// Origins of rays that leave surfaces in the directions `w`.
pub fn origins(level: Level, from: &Ends<'_>, w: Columns3<'_>, out: &mut ColumnsMut3<'_>) {
    dispatch!(level, simd => origins_lanes(simd, from, w, out));
}

#[inline(always)]
fn origins_lanes<S: Simd>(simd: S, from: &Ends<'_>, w: Columns3<'_>, out: &mut ColumnsMut3<'_>) {
    for i in (0..w[0].len()).step_by(LANES) {
        offset_origins(from.load(simd, i), Vec3s::load(simd, w, i)).store(out, i);
    }
}

/// Points, their error bounds, and normals.
pub(super) type End<S> = [Vec3s<S>; 3];

impl Ends<'_> {
    /// Loads the lanes from index `i` on.
    #[inline(always)]
    pub(super) fn load<S: Simd>(&self, simd: S, i: usize) -> End<S> {
        [Vec3s::load(simd, self.p, i), Vec3s::load(simd, self.p_error, i), Vec3s::load(simd, self.n, i)]
    }
}

/// The SIMD version of [`lumiris_numbers::math::ray::offset_origin`].
#[inline(always)]
pub(super) fn offset_origins<S: Simd>([p, error, n]: End<S>, w: Vec3s<S>) -> Vec3s<S> {
    let zero = F::splat(p.x.token(), 0.0);
    let largest = p.x.abs().max(p.y.abs()).max(p.z.abs());
    let distance = absolute(n).dot(error).max(largest * COINCIDENCE);
    let offset = n.times(w.dot(n).simd_lt(zero).select(-distance, distance));
    Vec3s { x: moved(p.x, offset.x), y: moved(p.y, offset.y), z: moved(p.z, offset.z) }
}

/// p + offset, rounded away from p.
#[inline(always)]
fn moved<S: Simd>(p: F<S>, offset: F<S>) -> F<S> {
    let simd = p.token();
    let (zero, one) = (F::splat(simd, 0.0), F::splat(simd, 1.0));
    let sum = p + offset;
    // The next float in the direction of the offset: the next larger float after multiplication by the offset's sign
    let sign = one.copysign(offset);
    let turned = sum * sign + 0.0;
    let bits = turned.bitcast::<I<S>>();
    let one_bit = I::splat(simd, 1);
    let next = turned.simd_lt(zero).select(bits - one_bit, bits + one_bit);
    offset.simd_ne(zero).select(next.bitcast::<F<S>>() * sign, sum)
}
