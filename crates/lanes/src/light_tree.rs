//! Importance of a bound of lights at many points at once.
//!
//! The formulas are in [`lumiris_numbers::math::light_bound`].

use super::lane::{F, LANES, Vec3s, load, store};
use super::vertex::Columns3;
use super::wide::Wide;
use fearless_simd::{Level, Simd, dispatch, prelude::*};
use lumiris_numbers::math::light_bound::{GlossyLobe, LightBound, Receiver};
use std::ops::Range;

/// Receivers, in columns of a multiple of [`LANES`].
#[derive(Clone, Copy, Debug)]
pub struct Receivers<'a> {
    /// Positions.
    pub p: Columns3<'a>,
    /// Shading normals; zero for points without a surface.
    pub ns: Columns3<'a>,
    /// Glossy lobes; `None` if all receivers are diffuse.
    pub lobes: Option<GlossyLobes<'a>>,
}

impl<'a> Receivers<'a> {
    /// A range of rows.
    pub fn rows(&self, rows: Range<usize>) -> Receivers<'a> {
        let of = |column: &'a [f32]| &column[rows.clone()];
        let lobes = self.lobes.as_ref().map(|lobes| GlossyLobes {
            wo: lobes.wo.map(of),
            cos_o: of(lobes.cos_o),
            alpha_squared: of(lobes.alpha_squared),
            scale: of(lobes.scale),
            diffuse: of(lobes.diffuse),
        });
        Receivers { p: self.p.map(of), ns: self.ns.map(of), lobes }
    }
}

/// [`GlossyLobe`] in columns.
#[derive(Clone, Copy, Debug)]
pub struct GlossyLobes<'a> {
    /// Directions to the viewer.
    pub wo: Columns3<'a>,
    /// Cosines of `wo` with the shading normals.
    pub cos_o: &'a [f32],
    /// α² of microfacets.
    pub alpha_squared: &'a [f32],
    /// Scale of the lobe's density; 0 if there is no lobe.
    pub scale: &'a [f32],
    /// Diffuse part.
    pub diffuse: &'a [f32],
}

/// For each receiver, the importance of a bound.
pub fn importances(level: Level, bound: &LightBound, at: &Receivers<'_>, out: &mut [f32]) {
    dispatch!(level, simd => importances_lanes(simd, bound, at, out));
}

#[inline(always)]
fn importances_lanes<S: Simd>(simd: S, bound: &LightBound, at: &Receivers<'_>, out: &mut [f32]) {
    for i in (0..out.len()).step_by(LANES) {
        let receiver = receiver(simd, at, i);
        store(bound.in_lanes(receiver.p[0]).importance(&receiver).0, out, i);
    }
}

#[inline(always)]
pub(crate) fn receiver<S: Simd>(simd: S, at: &Receivers<'_>, i: usize) -> Receiver<Wide<S>> {
    let (p, ns) = (three(simd, at.p, i), three(simd, at.ns, i));
    let mut lobe = None;
    if let Some(lobes) = &at.lobes {
        let scale = load(simd, lobes.scale, i);
        if scale.simd_gt(F::splat(simd, 0.0)).any_true() {
            lobe = Some(GlossyLobe {
                wo: three(simd, lobes.wo, i),
                cos_o: Wide(load(simd, lobes.cos_o, i)),
                alpha_squared: Wide(load(simd, lobes.alpha_squared, i)),
                scale: Wide(scale),
                diffuse: Wide(load(simd, lobes.diffuse, i)),
            });
        }
    }
    Receiver { p, ns, lobe }
}

#[inline(always)]
fn three<S: Simd>(simd: S, from: Columns3<'_>, i: usize) -> [Wide<S>; 3] {
    let v = Vec3s::load(simd, from, i);
    [Wide(v.x), Wide(v.y), Wide(v.z)]
}
