//! Scattering at all rows: values and densities for one direction of each, and directions by BSDF sampling.

use super::{Run, Vertices};
use lumiris_lanes::columns::{Column, Columns3, padded, reserve};
use lumiris_lanes::kernels::{self, Directions, Kernel, MAX_PARAMS, Rows, Values};
use lumiris_lanes::lane::LANES;
use lumiris_lanes::level;
use lumiris_lanes::vertex::{self as lambertian, Lambertian};
use std::ops::Range;

/// A BSDF sample of each row, see [`lumiris_lanes::kernels::Drawn`].
#[derive(Debug, Default)]
pub struct BsdfSamples {
    /// Unit directions.
    pub wi: Columns3,
    /// f·|cos θ| (1/sr); of deltas, their weights times `pdf`.
    pub f_cos: Columns3,
    /// Density (1/sr); of deltas, their probability; 0 where there is no sample.
    pub pdf: Column,
    /// Sums of the flags of [`crate::bsdfs::Lobe`].
    pub lobe: Column,
    /// Relative indices of refraction.
    pub eta: Column,
}

impl BsdfSamples {
    /// Lengthens the columns if they are shorter.
    pub fn reserve(&mut self, len: usize) {
        let BsdfSamples { wi, f_cos, pdf, lobe, eta } = self;
        [wi, f_cos].into_iter().for_each(|c| c.reserve(len));
        reserve(&mut [pdf, lobe, eta], len);
    }
}

/// The rows of three columns.
fn part<'a>(columns: &'a Columns3, rows: &Range<usize>) -> [&'a [f32]; 3] {
    columns.get(rows.end).map(|c| &c[rows.start..])
}

/// The same, to be written.
fn part_mut<'a>(columns: &'a mut Columns3, rows: &Range<usize>) -> [&'a mut [f32]; 3] {
    columns.get_mut(rows.end).map(|c| &mut c[rows.start..])
}

impl Vertices<'_> {
    /// The rows from the vector on that the first Lambertian row is in: what they have of others is overwritten.
    fn lambertian_rows(&self) -> Range<usize> {
        self.bsdfs.len() / LANES * LANES..padded(self.len())
    }

    fn lambertian(&self, rows: &Range<usize>) -> Lambertian<'_> {
        let s = &self.surface;
        Lambertian { rho: part(&s.rho, rows), ns: part(&s.ns, rows), wo: part(&s.wo, rows) }
    }

    /// Calls `run` with the rows of a kernel.
    fn with_rows(&self, Run { kernel, rows }: &Run, run: impl FnOnce(Kernel, &Rows<'_>)) {
        let Some(kernel) = *kernel else { return };
        let mut params: [&[f32]; MAX_PARAMS] = [&[]; MAX_PARAMS];
        for (slice, column) in params.iter_mut().zip(&self.params[..kernel.params()]) {
            *slice = &column[rows.clone()];
        }
        let s = &self.surface;
        run(
            kernel,
            &Rows {
                params: &params[..kernel.params()],
                tables: self.bsdfs[rows.start].bsdf.tables(),
                ns: part(&s.ns, rows),
                tangents: Some(part(&self.tangents, rows)),
                wo: part(&s.wo, rows),
            },
        );
    }

    /// f·|cos θ| and the density of BSDF sampling (1/sr) for a direction of each row.
    pub fn evaluate(&self, wi: &Columns3, f_cos: &mut Columns3, pdf: &mut Column) {
        let rows = self.lambertian_rows();
        let (at, directions) = (self.lambertian(&rows), part(wi, &rows));
        lambertian::evaluate_lambertian(level(), &at, directions, &mut part_mut(f_cos, &rows), &mut pdf[rows]);
        for run in &self.runs {
            let rows = run.rows.clone();
            if run.kernel.is_none() {
                for i in rows {
                    let (value, density) = self.bsdfs[i].f_cos_and_pdf(self.surface.wo.vec3(i), wi.vec3(i));
                    f_cos.set_rgb(i, value);
                    pdf[i] = density;
                }
                continue;
            }
            self.with_rows(run, |kernel, of| {
                let mut values = Values { f_cos: part_mut(f_cos, &rows), pdf: &mut pdf[rows.clone()] };
                kernels::evaluate(level(), kernel, of, part(wi, &rows), &mut values);
            });
        }
    }

    /// A BSDF sample of each row by three numbers.
    pub fn sample(&self, u: &[Column; 3], out: &mut BsdfSamples) {
        let rows = self.lambertian_rows();
        let BsdfSamples { wi, f_cos, pdf, lobe, eta } = out;
        let numbers = [&u[1][rows.clone()], &u[2][rows.clone()]];
        let at = self.lambertian(&rows);
        lambertian::sample_lambertian(level(), &at, numbers, &mut part_mut(wi, &rows), &mut pdf[rows.clone()]);
        for (f_cos, rho) in part_mut(f_cos, &rows).into_iter().zip(at.rho) {
            for ((f_cos, rho), pdf) in f_cos.iter_mut().zip(rho).zip(&pdf[rows.clone()]) {
                *f_cos = rho * pdf;
            }
        }
        lobe[rows.clone()].fill(f32::from(kernels::lobe::DIFFUSE | kernels::lobe::REFLECTION));
        eta[rows].fill(1.0);
        for run in &self.runs {
            let rows = run.rows.clone();
            if run.kernel.is_none() {
                for i in rows {
                    let drawn = self.bsdfs[i].sample(self.surface.wo.vec3(i), u[0][i], [u[1][i], u[2][i]]);
                    pdf[i] = drawn.map_or(0.0, |s| s.pdf);
                    let Some(s) = drawn else { continue };
                    wi.set(i, s.wi);
                    f_cos.set_rgb(i, s.f * self.bsdfs[i].cos(s.wi));
                    (lobe[i], eta[i]) = (f32::from(s.lobe.flags()), s.eta);
                }
                continue;
            }
            self.with_rows(run, |kernel, of| {
                let mut directions = Directions {
                    wi: part_mut(wi, &rows),
                    f_cos: part_mut(f_cos, &rows),
                    pdf: &mut pdf[rows.clone()],
                    lobe: &mut lobe[rows.clone()],
                    eta: &mut eta[rows.clone()],
                };
                kernels::sample(level(), kernel, of, u.each_ref().map(|u| &u[rows.clone()]), &mut directions);
            });
        }
    }
}
