//! Segments between all pairs of Lambertian vertices of two sets. The formulas are in the module
//! `integrators::reuse`.

use super::lane::{F, LANES, Vec3s, or_zero, store};
use super::vertex::{Columns3, ColumnsMut3, End, Ends, offset_origins};
use fearless_simd::{Level, Simd, dispatch, prelude::*};
use lumiris_numbers::math::Vec3;

/// Lambertian vertices, with geometric normals on the lit side.
#[derive(Clone, Copy, Debug)]
pub struct Vertices<'a> {
    /// The points, with their geometric normals.
    pub ends: Ends<'a>,
    /// Shading normals on the same side.
    pub ns: Columns3<'a>,
}

/// Segments from all vertices of the first set to each vertex of the second set, one after another.
#[derive(Debug)]
pub struct Connections<'a> {
    /// cos θ cos θ'/d² (1/area), with shading normals at `from` and geometric normals at `to`; 0 if one vertex is below
    /// the other's horizon.
    pub g: &'a mut [f32],
    /// Origins.
    pub o: ColumnsMut3<'a>,
    /// Directions; their lengths are the segments' lengths.
    pub d: ColumnsMut3<'a>,
}

/// Connects all of `from`, in columns of a multiple of [`LANES`], with all of `to`.
///
/// Segments with `g` = 0 may keep their old values.
pub fn connect(level: Level, from: &Vertices<'_>, to: &Vertices<'_>, out: &mut Connections<'_>) {
    dispatch!(level, simd => connect_lanes(simd, from, to, out));
}

#[inline(always)]
fn connect_lanes<S: Simd>(simd: S, from: &Vertices<'_>, to: &Vertices<'_>, out: &mut Connections<'_>) {
    let len = from.ns[0].len();
    for j in 0..to.ns[0].len() {
        let end: End<S> = [splat(simd, to.ends.p, j), splat(simd, to.ends.p_error, j), splat(simd, to.ends.n, j)];
        let ns = splat(simd, to.ns, j);
        for i in (0..len).step_by(LANES) {
            let at = j * len + i;
            let start = from.ends.load(simd, i);
            let g = density(start, Vec3s::load(simd, from.ns, i), end, ns);
            store(g, out.g, at);
            if g.simd_gt(F::splat(simd, 0.0)).any_true() {
                let o = offset_origins(start, end[0].minus(start[0]));
                let d = offset_origins(end, o.minus(end[0])).minus(o);
                o.store(&mut out.o, at);
                d.store(&mut out.d, at);
            }
        }
    }
}

#[inline(always)]
fn splat<S: Simd>(simd: S, [x, y, z]: Columns3<'_>, j: usize) -> Vec3s<S> {
    Vec3s::splat(simd, Vec3::new(x[j], y[j], z[j]))
}

#[inline(always)]
fn density<S: Simd>(x: End<S>, x_ns: Vec3s<S>, y: End<S>, y_ns: Vec3s<S>) -> F<S> {
    let d = y[0].minus(x[0]);
    let (cos, cos_y, cos_shading) = (x_ns.dot(d), -y[2].dot(d), -y_ns.dot(d));
    let zero = F::splat(d.x.token(), 0.0);
    let d2 = d.dot(d);
    or_zero(cos.simd_gt(zero) & cos_y.simd_gt(zero) & cos_shading.simd_gt(zero), cos * cos_y / (d2 * d2))
}
