//! First hits of many rays among a few triangles; every ray is tested against every triangle.
//!
//! Triangles are translated to the ray's origin and sheared so that the ray runs along its largest axis. The signs of
//! the three edge functions decide whether it is hit [Woop, Benthin and Wald 2013]. A ray through a common edge of two
//! triangles hits at least one of them.

use super::lane::{F, LANES, M, Vec3s, begin, padded, store};
use fearless_simd::{Level, Simd, dispatch, prelude::*};
use lumiris_numbers::math::Vec3;

/// The first hits of rays.
#[derive(Debug)]
pub struct FirstHits<'a> {
    /// Ray parameters; infinite if there is no hit.
    pub t: &'a mut [f32],
    /// Weights of corners 1 and 2.
    pub b: [&'a mut [f32]; 2],
    /// Indices of triangles.
    pub triangle: &'a mut [f32],
}

/// Intersects rays from `o` in the directions `d` with all `triangles`. Of hits with equal t, the first triangle's is
/// taken.
pub fn first_hits(level: Level, triangles: &[[Vec3; 3]], o: [&[f32]; 3], d: [&[f32]; 3], out: &mut FirstHits<'_>) {
    let n = out.t.len();
    if n >= LANES {
        return dispatch!(level, simd => first_hits_lanes(simd, triangles, o, d, out));
    }
    let (o, d) = (o.map(padded), d.map(padded));
    let [mut t, mut b1, mut b2, mut triangle] = [[0.0; LANES]; 4];
    let mut few = FirstHits { t: &mut t, b: [&mut b1, &mut b2], triangle: &mut triangle };
    first_hits(level, triangles, o.each_ref().map(|o| &o[..]), d.each_ref().map(|d| &d[..]), &mut few);
    out.t.copy_from_slice(&t[..n]);
    out.b[0].copy_from_slice(&b1[..n]);
    out.b[1].copy_from_slice(&b2[..n]);
    out.triangle.copy_from_slice(&triangle[..n]);
}

#[inline(always)]
fn first_hits_lanes<S: Simd>(
    simd: S,
    triangles: &[[Vec3; 3]],
    o: [&[f32]; 3],
    d: [&[f32]; 3],
    out: &mut FirstHits<'_>,
) {
    let n = out.t.len();
    for i in (0..n).step_by(LANES) {
        let i = begin(i, n);
        // Shear along the largest axis of the ray
        let (o, d) = (Vec3s::load(simd, o, i), Vec3s::load(simd, d, i));
        let axes = Axes::new(d);
        let d = axes.ordered(d);
        let z = F::splat(simd, 1.0) / d.z;
        let shear = Vec3s { x: d.x * z, y: d.y * z, z };
        let mut t = F::splat(simd, f32::INFINITY);
        let (mut b1, mut b2, mut index) = (F::splat(simd, 0.0), F::splat(simd, 0.0), F::splat(simd, 0.0));
        // Keep the nearest hit
        for (k, p) in triangles.iter().enumerate() {
            let a = sheared(axes.ordered(Vec3s::splat(simd, p[0]).minus(o)), shear);
            let b = sheared(axes.ordered(Vec3s::splat(simd, p[1]).minus(o)), shear);
            let c = sheared(axes.ordered(Vec3s::splat(simd, p[2]).minus(o)), shear);
            let (u, v, w) = (c.x * b.y - c.y * b.x, a.x * c.y - a.y * c.x, b.x * a.y - b.y * a.x);
            let zero = F::splat(simd, 0.0);
            let inside = (u.simd_ge(zero) & v.simd_ge(zero) & w.simd_ge(zero))
                | (u.simd_le(zero) & v.simd_le(zero) & w.simd_le(zero));
            let det = u + v + w;
            let inverse = F::splat(simd, 1.0) / det;
            let t_hit = (u * a.z + v * b.z + w * c.z) * inverse;
            let is_first = inside & det.simd_ne(zero) & t_hit.simd_gt(zero) & t_hit.simd_lt(t);
            t = is_first.select(t_hit, t);
            b1 = is_first.select(v * inverse, b1);
            b2 = is_first.select(w * inverse, b2);
            index = is_first.select(F::splat(simd, k as f32), index);
        }
        store(t, out.t, i);
        let [out_b1, out_b2] = &mut out.b;
        store(b1, out_b1, i);
        store(b2, out_b2, i);
        store(index, out.triangle, i);
    }
}

/// The largest component of a direction.
#[derive(Clone, Copy)]
pub(crate) struct Axes<S: Simd> {
    is_x: M<S>,
    is_y: M<S>,
}

impl<S: Simd> Axes<S> {
    #[inline(always)]
    pub(crate) fn new(d: Vec3s<S>) -> Self {
        let (x, y, z) = (d.x.abs(), d.y.abs(), d.z.abs());
        let is_x = x.simd_gt(y) & x.simd_gt(z);
        Axes { is_x, is_y: !is_x & y.simd_gt(z) }
    }

    /// Permutes the components cyclically, so that z is the largest component of the direction.
    #[inline(always)]
    pub(crate) fn ordered(self, v: Vec3s<S>) -> Vec3s<S> {
        Vec3s {
            x: self.is_x.select(v.y, self.is_y.select(v.z, v.x)),
            y: self.is_x.select(v.z, self.is_y.select(v.x, v.y)),
            z: self.is_x.select(v.x, self.is_y.select(v.y, v.z)),
        }
    }
}

#[inline(always)]
fn sheared<S: Simd>(p: Vec3s<S>, shear: Vec3s<S>) -> Vec3s<S> {
    Vec3s { x: p.x - shear.x * p.z, y: p.y - shear.y * p.z, z: p.z * shear.z }
}
