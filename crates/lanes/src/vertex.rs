//! Direct light of many vertices at once, in columns: weights of light samples, and shadow segments.
//!
//! The formulas for single vertices are in the module `direct`. Columns have the same length, a multiple of [`LANES`].

pub use super::lane::{Columns3, ColumnsMut3};
use super::lane::{F, I, LANES, Vec3s, load, or_zero, store};
use super::wide::Wide;
use fearless_simd::{Level, Simd, dispatch, prelude::*};
use lumiris_numbers::estimators::heuristics::Heuristic;
use lumiris_numbers::math::ray::{COINCIDENCE, SEGMENT_END};

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
        wi.or(is_far, d).store(&mut out.d, i);
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
    let distance = n.abs().dot(error).max(largest * COINCIDENCE);
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
