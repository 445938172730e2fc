//! Kernels over columns: many vertices with one direction each, or one BSDF with many directions.
//!
//! Columns may have any length: the last vector overlaps the previous one, and fewer rows than one vector are padded.

use super::bsdf_kernel::{BsdfKernel, Value};
use super::coated::{Coated, SmoothCoated};
use super::conductor::Conductor;
use super::dielectric::{Dielectric, Exit};
use super::diffuse::Diffuse;
use super::diffuse_transmission::DiffuseTransmission;
use super::kernel::{Kernel, MAX_PARAMS};
use super::principled::Principled;
use super::thin_dielectric::ThinDielectric;
use crate::lane::{Columns3, ColumnsMut3, F, LANES, Vec3s, begin, load, padded, store};
use crate::wide::Wide;
use fearless_simd::{Level, Simd, dispatch, prelude::*};
use lumiris_numbers::math::v3::V3;
use lumiris_numbers::math::{Frame, Vec3};

/// Vertices with the same kernel.
#[derive(Clone, Copy, Debug)]
pub struct Rows<'a> {
    /// Parameters, one column each.
    pub params: &'a [&'a [f32]],
    /// Tables of the kernel.
    pub tables: &'a [f32],
    /// Shading normals.
    pub ns: Columns3<'a>,
    /// x axes of the shading frames; `None` for isotropic BSDFs, which use [`Frame::from_z`].
    pub tangents: Option<Columns3<'a>>,
    /// Unit directions to the viewer, in world space.
    pub wo: Columns3<'a>,
}

/// One BSDF in a frame, for one direction to the viewer.
#[derive(Clone, Copy, Debug)]
pub struct One<'a> {
    /// Parameters.
    pub params: &'a [f32],
    /// Tables of the kernel.
    pub tables: &'a [f32],
    /// Shading frame.
    pub frame: Frame,
    /// Direction to the viewer in the frame.
    pub wo: Vec3,
}

/// Columns of values.
#[derive(Debug)]
pub struct Values<'a> {
    /// f·|cos θi| (1/sr) by channel.
    pub f_cos: ColumnsMut3<'a>,
    /// Density per steradian.
    pub pdf: &'a mut [f32],
}

/// Columns of samples; see [`super::Drawn`].
#[derive(Debug)]
pub struct Directions<'a> {
    /// Unit directions to the light, in world space.
    pub wi: ColumnsMut3<'a>,
    /// f·|cos θi| (1/sr) by channel. For deltas, their weights times `pdf`.
    pub f_cos: ColumnsMut3<'a>,
    /// Density per steradian. For deltas, their probability. 0 if there is no sample.
    pub pdf: &'a mut [f32],
    /// Sums of [`super::lobe`] flags.
    pub lobe: &'a mut [f32],
    /// Indices of refraction on the side of `wi` relative to the side of `wo`; 1 for reflection.
    pub eta: &'a mut [f32],
}

/// Calls a generic function for a kernel.
macro_rules! of_kernel {
    ($kernel:expr, $function:ident, $($argument:expr),*) => {
        match $kernel {
            Kernel::Diffuse => $function::<Diffuse>($($argument),*),
            Kernel::DiffuseTransmission => $function::<DiffuseTransmission>($($argument),*),
            Kernel::Conductor => $function::<Conductor>($($argument),*),
            Kernel::Dielectric => $function::<Dielectric>($($argument),*),
            Kernel::Exit => $function::<Exit>($($argument),*),
            Kernel::ThinDielectric => $function::<ThinDielectric>($($argument),*),
            Kernel::Coated => $function::<Coated>($($argument),*),
            Kernel::SmoothCoated => $function::<SmoothCoated>($($argument),*),
            Kernel::Principled => $function::<Principled>($($argument),*),
        }
    };
}

/// Values and densities for unit directions `wi` in world space, one per row.
pub fn evaluate(level: Level, kernel: Kernel, rows: &Rows<'_>, wi: Columns3<'_>, out: &mut Values<'_>) {
    let n = out.pdf.len();
    if n >= LANES {
        return of_kernel!(kernel, evaluate_rows, level, rows, wi, out);
    }
    let (few, wi) = (Few::new(rows), wi.map(padded));
    let mut values = [[0.0; LANES]; 4];
    few.with(|rows| {
        of_kernel!(kernel, evaluate_rows, level, rows, wi.each_ref().map(|v| &v[..]), &mut of(&mut values))
    });
    out.copy(&values, n);
}

/// Values and densities of one BSDF for many directions.
pub fn evaluate_one(level: Level, kernel: Kernel, one: &One<'_>, wi: Columns3<'_>, out: &mut Values<'_>) {
    let n = out.pdf.len();
    if n >= LANES {
        return of_kernel!(kernel, evaluate_many, level, one, wi, out);
    }
    let wi = wi.map(padded);
    let mut values = [[0.0; LANES]; 4];
    of_kernel!(kernel, evaluate_many, level, one, wi.each_ref().map(|v| &v[..]), &mut of(&mut values));
    out.copy(&values, n);
}

/// Samples a direction per row from uniform numbers: the first of them chooses the lobe.
pub fn sample(level: Level, kernel: Kernel, rows: &Rows<'_>, u: Columns3<'_>, out: &mut Directions<'_>) {
    let n = out.pdf.len();
    if n >= LANES {
        return of_kernel!(kernel, sample_rows, level, rows, u, out);
    }
    let (few, u) = (Few::new(rows), u.map(padded));
    let mut columns = [[0.0; LANES]; 9];
    let [x, y, z, r, g, b, pdf, lobe, eta] = &mut columns;
    let mut directions = Directions { wi: [x, y, z], f_cos: [r, g, b], pdf, lobe, eta };
    few.with(|rows| of_kernel!(kernel, sample_rows, level, rows, u.each_ref().map(|v| &v[..]), &mut directions));
    let Directions { wi: [x, y, z], f_cos: [r, g, b], pdf, lobe, eta } = out;
    for (to, from) in [x, y, z, r, g, b, pdf, lobe, eta].into_iter().zip(&columns) {
        to.copy_from_slice(&from[..n]);
    }
}

/// Columns of values that refer to an array.
fn of(values: &mut [[f32; LANES]; 4]) -> Values<'_> {
    let [r, g, b, pdf] = values;
    Values { f_cos: [r, g, b], pdf }
}

impl Values<'_> {
    /// Copies the first `n` values.
    fn copy(&mut self, from: &[[f32; LANES]; 4], n: usize) {
        for (to, from) in self.f_cos.iter_mut().zip(from) {
            to.copy_from_slice(&from[..n]);
        }
        self.pdf.copy_from_slice(&from[3][..n]);
    }
}

/// Fewer rows than lanes, padded.
struct Few<'a> {
    params: [[f32; LANES]; MAX_PARAMS],
    count: usize,
    tables: &'a [f32],
    ns: [[f32; LANES]; 3],
    tangents: Option<[[f32; LANES]; 3]>,
    wo: [[f32; LANES]; 3],
}

impl<'a> Few<'a> {
    fn new(rows: &Rows<'a>) -> Self {
        let mut params = [[0.0; LANES]; MAX_PARAMS];
        for (to, from) in params.iter_mut().zip(rows.params) {
            *to = padded(from);
        }
        let tangents = rows.tangents.map(|columns| columns.map(padded));
        let (ns, wo) = (rows.ns.map(padded), rows.wo.map(padded));
        Few { params, count: rows.params.len(), tables: rows.tables, ns, tangents, wo }
    }

    fn with(&self, run: impl FnOnce(&Rows<'_>)) {
        let params = self.params.each_ref().map(|column| &column[..]);
        run(&Rows {
            params: &params[..self.count],
            tables: self.tables,
            ns: self.ns.each_ref().map(|v| &v[..]),
            tangents: self.tangents.as_ref().map(|t| t.each_ref().map(|v| &v[..])),
            wo: self.wo.each_ref().map(|v| &v[..]),
        });
    }
}

// One function per kernel limits compile time, which grows faster than a function's size

#[inline(never)]
fn evaluate_rows<K: BsdfKernel>(level: Level, rows: &Rows<'_>, wi: Columns3<'_>, out: &mut Values<'_>) {
    dispatch!(level, simd => evaluate_rows_lanes::<_, K>(simd, rows, wi, out));
}

#[inline(never)]
fn evaluate_many<K: BsdfKernel>(level: Level, one: &One<'_>, wi: Columns3<'_>, out: &mut Values<'_>) {
    dispatch!(level, simd => evaluate_many_lanes::<_, K>(simd, one, wi, out));
}

#[inline(never)]
fn sample_rows<K: BsdfKernel>(level: Level, rows: &Rows<'_>, u: Columns3<'_>, out: &mut Directions<'_>) {
    dispatch!(level, simd => sample_rows_lanes::<_, K>(simd, rows, u, out));
}

#[inline(always)]
fn evaluate_rows_lanes<S: Simd, K: BsdfKernel>(simd: S, rows: &Rows<'_>, wi: Columns3<'_>, out: &mut Values<'_>) {
    for i in (0..out.pdf.len()).step_by(LANES) {
        let i = begin(i, out.pdf.len());
        let p = params::<S, K>(simd, rows, i);
        let (frame, wo) = (frames(simd, rows, i), Vec3s::load(simd, rows.wo, i).into());
        let wi = Vec3s::load(simd, wi, i).into();
        let value = K::evaluate(&p, rows.tables, to_local(&frame, wo), to_local(&frame, wi));
        store_value(value, i, &mut out.f_cos, out.pdf);
    }
}

#[inline(always)]
fn evaluate_many_lanes<S: Simd, K: BsdfKernel>(simd: S, one: &One<'_>, wi: Columns3<'_>, out: &mut Values<'_>) {
    let mut p = [Wide(F::splat(simd, 0.0)); MAX_PARAMS];
    for k in 0..K::PARAMS {
        p[k] = Wide(F::splat(simd, one.params[k]));
    }
    let wo = Vec3s::splat(simd, one.wo).into();
    for i in (0..out.pdf.len()).step_by(LANES) {
        let i = begin(i, out.pdf.len());
        let wi = Vec3s::load(simd, wi, i).to_local(&one.frame).into();
        store_value(K::evaluate(&p, one.tables, wo, wi), i, &mut out.f_cos, out.pdf);
    }
}

#[inline(always)]
fn sample_rows_lanes<S: Simd, K: BsdfKernel>(simd: S, rows: &Rows<'_>, u: Columns3<'_>, out: &mut Directions<'_>) {
    for i in (0..out.pdf.len()).step_by(LANES) {
        let i = begin(i, out.pdf.len());
        let p = params::<S, K>(simd, rows, i);
        let (frame, wo) = (frames(simd, rows, i), Vec3s::load(simd, rows.wo, i).into());
        let u = [Wide(load(simd, u[0], i)), Wide(load(simd, u[1], i)), Wide(load(simd, u[2], i))];
        let drawn = K::sample(&p, rows.tables, to_local(&frame, wo), u);
        let [x, y, z] = frame;
        let wi = x.times(drawn.wi.x).plus(y.times(drawn.wi.y)).plus(z.times(drawn.wi.z));
        Vec3s::from(wi).store(&mut out.wi, i);
        store_value(Value { f_cos: drawn.f_cos, pdf: drawn.pdf }, i, &mut out.f_cos, out.pdf);
        store(drawn.lobe.0, out.lobe, i);
        store(drawn.eta.0, out.eta, i);
    }
}

#[inline(always)]
fn params<S: Simd, K: BsdfKernel>(simd: S, rows: &Rows<'_>, i: usize) -> [Wide<S>; MAX_PARAMS] {
    let mut p = [Wide(F::splat(simd, 0.0)); MAX_PARAMS];
    for k in 0..K::PARAMS {
        p[k] = Wide(load(simd, rows.params[k], i));
    }
    p
}

/// x, y and z axes of the shading frames.
#[inline(always)]
fn frames<S: Simd>(simd: S, rows: &Rows<'_>, i: usize) -> [V3<Wide<S>>; 3] {
    let z: V3<Wide<S>> = Vec3s::load(simd, rows.ns, i).into();
    if let Some(tangents) = rows.tangents {
        let x: V3<Wide<S>> = Vec3s::load(simd, tangents, i).into();
        return [x, z.cross(x), z];
    }
    let [x, y] = z.tangents();
    [x, y, z]
}

#[inline(always)]
fn to_local<S: Simd>(frame: &[V3<Wide<S>>; 3], w: V3<Wide<S>>) -> V3<Wide<S>> {
    V3 { x: w.dot(frame[0]), y: w.dot(frame[1]), z: w.dot(frame[2]) }
}

#[inline(always)]
fn store_value<S: Simd>(value: Value<Wide<S>>, i: usize, f_cos: &mut ColumnsMut3<'_>, pdf: &mut [f32]) {
    store(value.f_cos[0].0, f_cos[0], i);
    store(value.f_cos[1].0, f_cos[1], i);
    store(value.f_cos[2].0, f_cos[2], i);
    store(value.pdf.0, pdf, i);
}
