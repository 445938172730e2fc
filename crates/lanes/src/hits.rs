//! Exact ray–triangle intersection, one pair per lane: the watertight test of [Woop et al. 2013] without its rare
//! branches, which are in the renderer's `geometry::triangle`.

use super::lane::{F, LANES, Vec3s, load, store};
use super::triangles::Axes;
use fearless_simd::{Level, Simd, dispatch, prelude::*};
use lumiris_numbers::math::gamma;

/// Pairs per block: enough that memory accesses of triangles overlap.
pub const BLOCK: usize = 64;

/// Pairs of a ray and a triangle: `[axis][pair]`.
#[derive(Clone, Debug)]
pub struct Pairs {
    /// Origins.
    pub o: [[f32; BLOCK]; 3],
    /// Directions.
    pub d: [[f32; BLOCK]; 3],
    /// Ends of the rays.
    pub t_max: [f32; BLOCK],
    /// Corners of the triangles.
    pub corners: [[[f32; BLOCK]; 3]; 3],
}

/// Hits of a block.
#[derive(Clone, Debug)]
pub struct Hits {
    /// Ray parameters below the ends of the rays. NaN if the scalar test might take one of its rare branches, or finds
    /// no hit.
    pub t: [f32; BLOCK],
    /// Weights of corner 1.
    pub b1: [f32; BLOCK],
    /// Weights of corner 2.
    pub b2: [f32; BLOCK],
}

impl Default for Pairs {
    fn default() -> Self {
        let zero = [[0.0; BLOCK]; 3];
        Pairs { o: zero, d: zero, t_max: [0.0; BLOCK], corners: [zero; 3] }
    }
}

impl Default for Hits {
    fn default() -> Self {
        Hits { t: [f32::NAN; BLOCK], b1: [0.0; BLOCK], b2: [0.0; BLOCK] }
    }
}

/// The hits of the first `count` pairs, bit-identical to the scalar test.
pub fn exact(level: Level, pairs: &Pairs, count: usize, out: &mut Hits) {
    dispatch!(level, simd => exact_lanes(simd, pairs, count, out));
}

#[inline(always)]
fn exact_lanes<S: Simd>(simd: S, pairs: &Pairs, count: usize, out: &mut Hits) {
    for i in (0..count.min(BLOCK)).step_by(LANES) {
        let (o, d) = (rows(simd, &pairs.o, i), rows(simd, &pairs.d, i));
        let axes = Axes::new(d);
        let d = axes.ordered(d);
        let shear = Vec3s { x: d.x / d.z, y: d.y / d.z, z: F::splat(simd, 1.0) / d.z };
        let a = sheared(shear, axes.ordered(rows(simd, &pairs.corners[0], i).minus(o)));
        let b = sheared(shear, axes.ordered(rows(simd, &pairs.corners[1], i).minus(o)));
        let c = sheared(shear, axes.ordered(rows(simd, &pairs.corners[2], i).minus(o)));

        let (u, v, w) = (c.x * b.y - c.y * b.x, a.x * c.y - a.y * c.x, b.x * a.y - b.y * a.x);
        let inv_det = F::splat(simd, 1.0) / (u + v + w);
        let t = (u * a.z + v * b.z + w * c.z) * shear.z * inv_det;

        // Comparisons with NaN are false, so degenerate rays have no hit
        let zero = F::splat(simd, 0.0);
        let above = u.simd_gt(zero) & v.simd_gt(zero) & w.simd_gt(zero);
        let below = u.simd_lt(zero) & v.simd_lt(zero) & w.simd_lt(zero);
        let error = parameter_error(a, b, c, shear.z * inv_det);
        let is_hit = (above | below) & t.simd_gt(error) & t.simd_lt(load(simd, &pairs.t_max, i)) & t.is_finite();
        store(is_hit.select(t, F::splat(simd, f32::NAN)), &mut out.t, i);
        store(v * inv_det, &mut out.b1, i);
        store(w * inv_det, &mut out.b2, i);
    }
}

#[inline(always)]
fn rows<S: Simd>(simd: S, from: &[[f32; BLOCK]; 3], i: usize) -> Vec3s<S> {
    Vec3s { x: load(simd, &from[0], i), y: load(simd, &from[1], i), z: load(simd, &from[2], i) }
}

#[inline(always)]
fn sheared<S: Simd>(shear: Vec3s<S>, p: Vec3s<S>) -> Vec3s<S> {
    Vec3s { x: p.x - shear.x * p.z, y: p.y - shear.y * p.z, z: p.z }
}

/// Bound on the rounding error of the ray parameter [Pharr et al. 2023, §6.8.7].
#[inline(always)]
fn parameter_error<S: Simd>(a: Vec3s<S>, b: Vec3s<S>, c: Vec3s<S>, scale: F<S>) -> F<S> {
    let x = a.x.abs().max(b.x.abs()).max(c.x.abs());
    let y = a.y.abs().max(b.y.abs()).max(c.y.abs());
    let z = a.z.abs().max(b.z.abs()).max(c.z.abs());
    let (delta_x, delta_y, delta_z) = ((x + z) * gamma(5), (y + z) * gamma(5), z * gamma(3));
    let delta_e = (x * gamma(2) * y + delta_y * x + delta_x * y) * 2.0;
    let e = x * y * 2.0;
    (e * gamma(3) * z + delta_e * z + delta_z * e) * 3.0 * scale.abs()
}
