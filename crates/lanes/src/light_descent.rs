//! Descents of a light tree from several points at once: each step chooses between the children of a node, a different
//! node in each lane. Also evaluates several nodes or lights at one point.
//!
//! The formulas are in [`lumiris_numbers::math::light_bound`] and [`lumiris_numbers::math::expected_visibility`].

use super::lane::{F, LANES, load, or_zero, store};
use super::light_tree::{GlossyLobes, Receivers, receiver};
use super::wide::Wide;
use fearless_simd::{Level, Simd, dispatch, prelude::*};
use lumiris_numbers::math::ONE_MINUS_EPSILON;
use lumiris_numbers::math::expected_visibility::expected_visibility;
use lumiris_numbers::math::light_bound::{BOUND_FIELDS, GlossyLobe, LightBound, Receiver, first_probability};
use lumiris_numbers::math::number::Number;
use std::ops::Range;

/// Number of descents at once: several vectors of lanes, whose long chains of operations overlap.
pub const DESCENTS: usize = 4 * LANES;

/// A bound for each descent.
pub type Bounds<'a> = [&'a LightBound; DESCENTS];

/// The photons of the lights below a node, for each descent.
#[derive(Clone, Copy, Debug, Default)]
pub struct Photons {
    /// Irradiance at which one photon is expected.
    pub of_one: [f32; DESCENTS],
    /// Number of photons. −1: the node has weight 0, so that it is chosen only if its sibling has weight 0 too.
    pub count: [f32; DESCENTS],
}

impl Photons {
    /// `importance` times √V̂, or 0 if the count is −1. `e` is the importance for a diffuse surface.
    #[inline(always)]
    fn weight<S: Simd>(&self, simd: S, i: usize, importance: Wide<S>, e: Wide<S>) -> Wide<S> {
        let (of_one, count) = (Wide(load(simd, &self.of_one, i)), Wide(load(simd, &self.count, i)));
        let visibility = expected_visibility(e, of_one, count);
        (importance * visibility.root()).or_zero(count.at_least(e.constant(0.0)))
    }
}

/// The bounds of descents.
#[inline(always)]
fn gathered<S: Simd>(simd: S, bounds: &[&LightBound]) -> LightBound<Wide<S>> {
    // At the root all are the same
    if bounds.iter().fold(true, |all, bound| all & std::ptr::eq(*bound, bounds[0])) {
        return bounds[0].in_lanes(Wide(F::splat(simd, 0.0)));
    }
    let [x, y, z, r2, ax, ay, az, cos_o] = fields_from(simd, bounds, 0);
    let [_, _, _, _, sin_o, cos_e, intensity, two_sided] = fields_from(simd, bounds, BOUND_FIELDS - LANES);
    LightBound::of_fields([x, y, z, r2, ax, ay, az, cos_o, sin_o, cos_e, intensity, two_sided])
}

/// [`LANES`] fields of the bounds, from field `first` on. A transpose in three steps; each interleaves the first and
/// the second half of the rows.
#[inline(always)]
fn fields_from<S: Simd>(simd: S, bounds: &[&LightBound], first: usize) -> [Wide<S>; LANES] {
    let mut rows = [F::splat(simd, 0.0); LANES];
    for (row, bound) in rows.iter_mut().zip(bounds) {
        *row = load(simd, bound.fields(), first);
    }
    for _ in 0..LANES.ilog2() {
        let [a, b, c, d, e, f, g, h] = rows;
        rows = [
            a.zip_low(e),
            a.zip_high(e),
            b.zip_low(f),
            b.zip_high(f),
            c.zip_low(g),
            c.zip_high(g),
            d.zip_low(h),
            d.zip_high(h),
        ];
    }
    let [a, b, c, d, e, f, g, h] = rows;
    [Wide(a), Wide(b), Wide(c), Wide(d), Wide(e), Wide(f), Wide(g), Wide(h)]
}

/// The points of descents.
#[derive(Clone, Copy, Debug, Default)]
struct ReceiverLanes {
    p: [[f32; DESCENTS]; 3],
    ns: [[f32; DESCENTS]; 3],
    wo: [[f32; DESCENTS]; 3],
    cos_o: [f32; DESCENTS],
    alpha_squared: [f32; DESCENTS],
    scale: [f32; DESCENTS],
    diffuse: [f32; DESCENTS],
}

impl ReceiverLanes {
    #[inline(always)]
    fn columns(&self) -> Receivers<'_> {
        let ReceiverLanes { p: [px, py, pz], ns: [nx, ny, nz], wo: [wx, wy, wz], .. } = self;
        let lobes = GlossyLobes {
            wo: [wx, wy, wz],
            cos_o: &self.cos_o,
            alpha_squared: &self.alpha_squared,
            scale: &self.scale,
            diffuse: &self.diffuse,
        };
        Receivers { p: [px, py, pz], ns: [nx, ny, nz], lobes: Some(lobes) }
    }
}

/// Descents from several points.
#[derive(Clone, Copy, Debug, Default)]
pub struct Descents {
    at: ReceiverLanes,
    /// Random numbers in [0, 1).
    pub u: [f32; DESCENTS],
    /// Probability of the node.
    pub pmf: [f32; DESCENTS],
    /// 1 in lanes that are not at a leaf, else 0.
    pub is_inner: [f32; DESCENTS],
    /// 1 if the last node is a left child, else 0.
    pub is_left: [f32; DESCENTS],
    /// Importance of the node for a diffuse surface, if photons are given.
    pub diffuse_importance: [f32; DESCENTS],
    /// Importance of the node.
    pub importance: [f32; DESCENTS],
}

impl Descents {
    /// Starts descents at the root from the points `rows`, at most [`DESCENTS`], by the random numbers `u` in [0, 1).
    pub fn begin_rows(&mut self, at: &Receivers<'_>, rows: Range<usize>, u: &[f32]) {
        let n = rows.len();
        self.u[..n].copy_from_slice(&u[..n]);
        self.pmf = [0.0; DESCENTS];
        self.pmf[..n].fill(1.0);
        let ReceiverLanes { p, ns, wo, cos_o, alpha_squared, scale, diffuse } = &mut self.at;
        for axis in 0..3 {
            p[axis][..n].copy_from_slice(&at.p[axis][rows.clone()]);
            ns[axis][..n].copy_from_slice(&at.ns[axis][rows.clone()]);
        }
        if let Some(lobes) = &at.lobes {
            for axis in 0..3 {
                wo[axis][..n].copy_from_slice(&lobes.wo[axis][rows.clone()]);
            }
            cos_o[..n].copy_from_slice(&lobes.cos_o[rows.clone()]);
            alpha_squared[..n].copy_from_slice(&lobes.alpha_squared[rows.clone()]);
            scale[..n].copy_from_slice(&lobes.scale[rows.clone()]);
            diffuse[..n].copy_from_slice(&lobes.diffuse[rows]);
        } else {
            scale.fill(0.0);
        }
    }

    /// Starts the descent of a lane at the root, from a point, by the random number `u` in [0, 1).
    #[inline]
    pub fn begin(&mut self, lane: usize, from: &Receiver<f32>, u: f32) {
        let ReceiverLanes { p, ns, wo, cos_o, alpha_squared, scale, diffuse } = &mut self.at;
        let lobe = from.lobe.as_ref().unwrap_or(&GlossyLobe::NONE);
        for (rows, v) in [p, ns, wo].into_iter().zip([from.p, from.ns, lobe.wo]) {
            rows.iter_mut().zip(v).for_each(|(row, x)| row[lane] = x);
        }
        (cos_o[lane], alpha_squared[lane]) = (lobe.cos_o, lobe.alpha_squared);
        (scale[lane], diffuse[lane]) = (lobe.scale, lobe.diffuse);
        (self.u[lane], self.pmf[lane]) = (u, 1.0);
    }
}

/// Descends to one of two children where `is_inner`: with probabilities in proportion to their importances, times √V̂ by
/// `photons` if given.
pub fn descend(level: Level, children: [&Bounds<'_>; 2], photons: Option<&[Photons; 2]>, descents: &mut Descents) {
    dispatch!(level, simd => descend_lanes(simd, children, photons, descents));
}

#[inline(always)]
fn descend_lanes<S: Simd>(
    simd: S,
    children: [&Bounds<'_>; 2],
    photons: Option<&[Photons; 2]>,
    descents: &mut Descents,
) {
    for i in (0..DESCENTS).step_by(LANES) {
        let is_inner = load(simd, &descents.is_inner, i).simd_gt(F::splat(simd, 0.0));
        if !is_inner.any_true() {
            continue;
        }
        let at = receiver(simd, &descents.at.columns(), i);
        let [left, right] = [gathered(simd, &children[0][i..i + LANES]), gathered(simd, &children[1][i..i + LANES])];
        let reflected = [left.importance(&at), right.importance(&at)];
        let (mut weights, mut e) = (reflected, reflected);
        if let Some([of_left, of_right]) = photons {
            if at.lobe.is_some() {
                let diffuse = Receiver { lobe: None, ..at };
                e = [left.importance(&diffuse), right.importance(&diffuse)];
            }
            weights = [of_left.weight(simd, i, reflected[0], e[0]), of_right.weight(simd, i, reflected[1], e[1])];
        }

        // Choose, and rescale the random number
        let p = first_probability(weights, [left.intensity(), right.intensity()]).0;
        let one = F::splat(simd, 1.0);
        let (u, pmf) = (load(simd, &descents.u, i), load(simd, &descents.pmf, i));
        let is_left = p.simd_gt(u);
        let taken = is_left.select(p, one - p);
        let rest = (is_left.select(u, u - p) / taken).min(F::splat(simd, ONE_MINUS_EPSILON));
        store(is_inner.select(rest, u), &mut descents.u, i);
        store(is_inner.select(pmf * taken, pmf), &mut descents.pmf, i);
        store(or_zero(is_left, one), &mut descents.is_left, i);

        // Importances of the chosen children
        let (e, reflected) = (is_left.select(e[0].0, e[1].0), is_left.select(reflected[0].0, reflected[1].0));
        let before = [load(simd, &descents.diffuse_importance, i), load(simd, &descents.importance, i)];
        store(is_inner.select(e, before[0]), &mut descents.diffuse_importance, i);
        store(is_inner.select(reflected, before[1]), &mut descents.importance, i);
    }
}

/// The expected contributions of the lights of [`Bounds`] at a point.
#[derive(Clone, Copy, Debug, Default)]
pub struct Expected {
    /// Importances.
    pub importance: [f32; DESCENTS],
    /// V̂.
    pub visibility: [f32; DESCENTS],
}

/// The expected contributions of the first `count` lights at a point.
pub fn expect(
    level: Level,
    at: &Receiver<f32>,
    bounds: &Bounds<'_>,
    photons: &Photons,
    count: usize,
    out: &mut Expected,
) {
    dispatch!(level, simd => expect_lanes(simd, at, bounds, photons, count, out));
}

#[inline(always)]
fn expect_lanes<S: Simd>(
    simd: S,
    at: &Receiver<f32>,
    bounds: &Bounds<'_>,
    photons: &Photons,
    count: usize,
    out: &mut Expected,
) {
    let at = at.in_lanes(Wide(F::splat(simd, 0.0)));
    for i in (0..count.min(DESCENTS)).step_by(LANES) {
        let bound = gathered(simd, &bounds[i..i + LANES]);
        let importance = bound.importance(&at);
        let e = if at.lobe.is_some() { bound.importance(&Receiver { lobe: None, ..at }) } else { importance };
        let (of_one, photons) = (Wide(load(simd, &photons.of_one, i)), Wide(load(simd, &photons.count, i)));
        store(importance.0, &mut out.importance, i);
        store(expected_visibility(e, of_one, photons).0, &mut out.visibility, i);
    }
}

/// For each of the first `count` nodes, the probability of its left child at a point.
pub fn left_probabilities(
    level: Level,
    at: &Receiver<f32>,
    children: [&Bounds<'_>; 2],
    count: usize,
    out: &mut [f32; DESCENTS],
) {
    dispatch!(level, simd => left_lanes(simd, at, children, count, out));
}

#[inline(always)]
fn left_lanes<S: Simd>(
    simd: S,
    at: &Receiver<f32>,
    children: [&Bounds<'_>; 2],
    count: usize,
    out: &mut [f32; DESCENTS],
) {
    let at = at.in_lanes(Wide(F::splat(simd, 0.0)));
    for i in (0..count.min(DESCENTS)).step_by(LANES) {
        let [left, right] = [gathered(simd, &children[0][i..i + LANES]), gathered(simd, &children[1][i..i + LANES])];
        let importances = [left.importance(&at), right.importance(&at)];
        store(first_probability(importances, [left.intensity(), right.intensity()]).0, out, i);
    }
}
