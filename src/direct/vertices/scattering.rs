//! Scattering at all rows: values and densities for one direction per row, and BSDF sampling.

use super::vertex_columns::{Run, Vertices};
use crate::bsdfs::BsdfValue;
use lumiris_lanes::columns::{Column, Columns3, reserve};
use lumiris_lanes::kernels::{self, Directions, Kernel, MAX_PARAMS, Rows, Values};
use lumiris_lanes::level;
use std::ops::Range;

/// A BSDF sample of each row, see [`lumiris_lanes::kernels::Drawn`].
#[derive(Debug, Default)]
pub struct BsdfSamples {
    /// Unit directions.
    pub wi: Columns3,
    /// f·|cos θ| (1/sr); for specular lobes, weight times `pdf`.
    pub f_cos: Columns3,
    /// Density (1/sr); for specular lobes, the probability; 0 if there is no sample.
    pub pdf: Column,
    /// Sums of the flags of [`crate::bsdfs::Lobe`].
    pub lobe: Column,
    /// Relative indices of refraction.
    pub eta: Column,
}

impl BsdfSamples {
    /// Extends the columns to at least `len`.
    pub fn reserve(&mut self, len: usize) {
        let BsdfSamples { wi, f_cos, pdf, lobe, eta } = self;
        [wi, f_cos].into_iter().for_each(|c| c.reserve(len));
        reserve(&mut [pdf, lobe, eta], len);
    }
}

/// A range of rows of three columns.
fn part<'a>(columns: &'a Columns3, rows: &Range<usize>) -> [&'a [f32]; 3] {
    columns.get(rows.end).map(|c| &c[rows.start..])
}

/// The same, mutable.
fn part_mut<'a>(columns: &'a mut Columns3, rows: &Range<usize>) -> [&'a mut [f32]; 3] {
    columns.get_mut(rows.end).map(|c| &mut c[rows.start..])
}

impl Vertices<'_> {
    /// Calls `each` with the rows of a run and its kernel.
    fn with_rows(&self, rows: &Range<usize>, kernel: Kernel, each: impl FnOnce(&Rows<'_>)) {
        let s = &self.surface;
        let (ns, wo) = (part(&s.ns, rows), part(&s.wo, rows));
        let Some(first) = self.bsdfs.get(rows.start) else {
            return each(&Rows { params: &part(&s.rho, rows), tables: &[], ns, tangents: None, wo });
        };
        let mut params: [&[f32]; MAX_PARAMS] = [&[]; MAX_PARAMS];
        let count = kernel.params();
        for (slice, column) in params.iter_mut().zip(&self.params[..count]) {
            *slice = &column[rows.clone()];
        }
        let tangents = Some(part(&self.tangents, rows));
        each(&Rows { params: &params[..count], tables: first.bsdf.tables(), ns, tangents, wo });
    }

    /// The runs among the first `n` rows.
    fn runs(&self, n: usize) -> impl Iterator<Item = &Run> {
        self.runs.iter().filter(move |run| run.rows.start < n)
    }

    /// f·|cos θ| and the density of BSDF sampling (1/sr) for one direction at each of the first `n` rows.
    pub fn evaluate(&self, n: usize, wi: &Columns3, f_cos: &mut Columns3, pdf: &mut Column) {
        for Run { kernel, rows } in self.runs(n) {
            let Some(kernel) = kernel else {
                for i in rows.clone() {
                    let BsdfValue { f_cos: value, pdf: density } =
                        self.bsdfs[i].f_cos_and_pdf(self.surface.wo.vec3(i), wi.vec3(i));
                    f_cos.set_rgb(i, value);
                    pdf[i] = density;
                }
                continue;
            };
            self.with_rows(rows, *kernel, |of| {
                let mut values = Values { f_cos: part_mut(f_cos, rows), pdf: &mut pdf[rows.clone()] };
                kernels::evaluate(level(), *kernel, of, part(wi, rows), &mut values);
            });
        }
    }

    /// Draws a BSDF sample at each of the first `n` rows by three random numbers.
    pub fn sample(&self, n: usize, u: &[Column; 3], out: &mut BsdfSamples) {
        let BsdfSamples { wi, f_cos, pdf, lobe, eta } = out;
        for Run { kernel, rows } in self.runs(n) {
            // BSDFs without a kernel, one by one
            let Some(kernel) = kernel else {
                for i in rows.clone() {
                    let drawn = self.bsdfs[i].sample(self.surface.wo.vec3(i), u[0][i], [u[1][i], u[2][i]]);
                    pdf[i] = drawn.map_or(0.0, |s| s.pdf);
                    let Some(s) = drawn else { continue };
                    wi.set(i, s.wi);
                    f_cos.set_rgb(i, s.f * self.bsdfs[i].cos(s.wi));
                    (lobe[i], eta[i]) = (f32::from(s.lobe.flags()), s.eta);
                }
                continue;
            };

            // Kernel
            self.with_rows(rows, *kernel, |of| {
                let mut directions = Directions {
                    wi: part_mut(wi, rows),
                    f_cos: part_mut(f_cos, rows),
                    pdf: &mut pdf[rows.clone()],
                    lobe: &mut lobe[rows.clone()],
                    eta: &mut eta[rows.clone()],
                };
                kernels::sample(level(), *kernel, of, u.each_ref().map(|u| &u[rows.clone()]), &mut directions);
            });
        }
    }
}
