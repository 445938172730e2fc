//! Estimators that use the densities of the components of their mixture at each sample: `ocv` and `optimal-mis`.
//!
//! After T2, the samples of a point are accumulated into normal equations in the columns c_j = h_j/p_α − I_j, whose
//! expectation is 0, and y = f·V/p_α. The estimate is ȳ − Σ_j β_j c̄_j [Fan et al. 2006, Eq. 7]; the forms differ in
//! what β is fitted to. The systems of `optimal-mis` have the columns r_j = h_j/p_α, that of the paper's form r_j/I_j.

use super::mixture::Columns;
use super::point::ShadingPoint;
use super::propose::{Candidates, Drawn};
use super::shadow_segments::{Segments, is_traced};
use crate::accel::RayBatch;
use crate::scene::RenderJob;
use crate::settings::{EstimatorKind, IntegratorSettings, OptimalForm};
use lumiris_numbers::estimators::ocv::{Form, NormalEquations, System};
use lumiris_numbers::estimators::optimal_mis;
use lumiris_numbers::math::Rgb;

/// The columns of a system, and how it is solved.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Method {
    /// c_j = r_j − I_j.
    Ocv(Form),
    /// r_j.
    Optimal(OptimalForm),
}

impl Method {
    fn new(settings: &IntegratorSettings) -> Self {
        match settings.estimator {
            EstimatorKind::OptimalMis => Method::Optimal(settings.optimal_mis),
            EstimatorKind::Mc
            | EstimatorKind::Mis
            | EstimatorKind::Ris
            | EstimatorKind::Ocv
            | EstimatorKind::Correlated
            | EstimatorKind::Contributing => Method::Ocv(settings.ocv.form),
        }
    }

    /// The system solved for each row of sums.
    fn system(self) -> Option<System> {
        match self {
            Method::Ocv(form @ (Form::Paper | Form::Regression | Form::Crossfit)) => Some(form.system()),
            Method::Ocv(Form::Progressive) | Method::Optimal(_) => None,
        }
    }

    /// Number of rows of sums per estimate.
    fn rows(self) -> usize {
        match self {
            Method::Ocv(form) => form.rows(),
            Method::Optimal(_) => 1,
        }
    }

    /// Converts sums over r_j to sums over the method's columns.
    fn finish(self, equations: NormalEquations, sums: &mut [f32], integrals: &Columns) {
        match self {
            Method::Ocv(form) => form.finish(equations, sums, integrals),
            Method::Optimal(_) => {}
        }
    }
}

/// Fits shared by estimates: the sums so far, and coefficients for later estimates.
///
/// An estimate uses the coefficients of its fit and adds its samples to the sums; [`Self::solve`] begins a new block
/// with coefficients fitted to all sums. Later estimates must be independent of earlier ones.
#[derive(Clone, Debug)]
pub struct Fits {
    equations: NormalEquations,
    is_optimal: bool,
    sums: Vec<f32>,
    beta: Vec<f32>,
}

impl Default for Fits {
    fn default() -> Self {
        Fits { equations: NormalEquations::new(0), is_optimal: false, sums: Vec::new(), beta: Vec::new() }
    }
}

impl Fits {
    /// `count` fits without samples for the mixtures of an estimate; none if its estimates do not use fits.
    pub fn new(job: &RenderJob, settings: &IntegratorSettings, count: usize) -> Self {
        if !settings.is_progressive() {
            return Fits::default();
        }
        let equations = NormalEquations::new(job.components());
        Fits {
            equations,
            is_optimal: settings.estimator == EstimatorKind::OptimalMis,
            sums: vec![0.0; count * equations.len()],
            beta: vec![0.0; count * equations.coefficients()],
        }
    }

    /// True if there are none: estimates then use no coefficients.
    pub fn is_empty(&self) -> bool {
        self.sums.is_empty()
    }

    /// Begins a block. Returns the number of fits whose system is ill-conditioned; without a solution, estimates are
    /// those of MIS.
    pub fn solve(&mut self) -> u64 {
        if !self.is_optimal {
            return self.equations.solve(Form::Progressive.system(), &self.sums, &mut self.beta) as u64;
        }
        let betas = self.beta.chunks_mut(self.equations.coefficients().max(1));
        let fits = self.sums.chunks(self.equations.len()).zip(betas);
        // Pixels without a surface have nothing to solve
        let lit = fits.filter(|(sums, _)| self.equations.samples(sums) > 0.0);
        lit.map(|(sums, beta)| u64::from(optimal_mis::coefficients(self.equations, sums, beta) != Ok(0))).sum()
    }

    fn beta(&self, fit: u32) -> &[f32] {
        let len = self.equations.coefficients();
        &self.beta[fit as usize * len..][..len]
    }

    fn add(&mut self, fit: u32, sums: &[f32]) {
        let len = self.equations.len();
        self.equations.merge(&mut self.sums[fit as usize * len..][..len], sums);
    }
}

/// The stage's buffers.
#[derive(Debug, Default)]
pub struct Components {
    is_free: Vec<bool>,
    hidden: RayBatch,
    hidden_of: Vec<u32>,
    is_hidden: Vec<bool>,
    sums: Vec<f32>,
    beta: Vec<f32>,
    /// Systems solved or found to have no solution.
    pub systems: u64,
    /// Those without a solution, for which the MIS estimate is used, and those with dropped columns.
    pub ill_conditioned: u64,
    /// Rays traced against emitters to find light samples hidden by another emitter.
    pub emitter_rays: u64,
}

impl Components {
    /// The estimates of all points from their traced candidates; `out[i]` belongs to `points[i]`, or to both halves of
    /// a point, `points[2i]` and `points[2i + 1]`, where the form has halves.
    pub(super) fn resolve(
        &mut self,
        job: &RenderJob,
        settings: &IntegratorSettings,
        points: &[ShadingPoint<'_>],
        (candidates, contributions, segments): (&mut Candidates, &[Rgb], &Segments),
        fits: &mut Fits,
        out: &mut [Rgb],
    ) {
        (self.systems, self.ill_conditioned) = (0, 0);
        self.find_hidden(job, candidates, contributions, segments);
        let equations = NormalEquations::new(job.components());
        let method = Method::new(settings);
        self.gather(equations, method, candidates, contributions);

        // β of the forms that fit it to these samples
        let (len, width) = (equations.len(), equations.coefficients());
        self.beta.clear();
        if let Some(system) = method.system() {
            self.systems = (self.sums.len() / len) as u64;
            self.beta.resize(self.systems as usize * width, 0.0);
            self.ill_conditioned = equations.solve(system, &self.sums, &mut self.beta) as u64;
        }

        let rows = method.rows();
        for (i, out) in out.iter_mut().enumerate() {
            let sums = &self.sums[i * rows * len..][..rows * len];
            let integrals = &candidates.mixtures[i * rows].integrals;
            let estimate = match method {
                Method::Ocv(Form::Progressive) | Method::Optimal(OptimalForm::Progressive) if fits.is_empty() => {
                    equations.mean(sums)
                }
                Method::Ocv(Form::Progressive) => {
                    Form::Progressive.estimate(equations, sums, fits.beta(points[i].fit), integrals)
                }
                Method::Ocv(form) => {
                    let beta = &self.beta[i * rows * width..][..rows * width];
                    form.estimate(equations, sums, beta, integrals)
                }
                Method::Optimal(OptimalForm::Progressive) => {
                    optimal_mis::estimate(equations, sums, integrals, fits.beta(points[i].fit))
                }
                Method::Optimal(OptimalForm::Direct) => {
                    let outcome = optimal_mis::direct(equations, sums, integrals);
                    self.systems += 1;
                    self.ill_conditioned += u64::from(outcome.is_ill_conditioned);
                    outcome.estimate
                }
            };
            if !fits.is_empty() {
                fits.add(points[i].fit, sums);
            }
            let [r, g, b] = estimate;
            *out = Rgb::new(r, g, b);
        }
    }

    /// Determines which samples are unoccluded, and sets the density of BSDF sampling to zero for those hidden by an
    /// emitter.
    fn find_hidden(
        &mut self,
        job: &RenderJob,
        candidates: &mut Candidates,
        contributions: &[Rgb],
        segments: &Segments,
    ) {
        self.is_free.clear();
        self.hidden.clear();
        self.hidden_of.clear();
        let mut occluded = segments.occluded().iter();
        for (i, (c, contribution)) in candidates.records.iter().zip(contributions).enumerate() {
            let is_free = is_traced(contribution) && occluded.next() == Some(&false);
            self.is_free.push(is_free);
            if !is_free && c.drawn == Drawn::Light && c.p_bsdf > 0.0 && job.world.emitters_hide() {
                self.hidden.push(&c.segment);
                self.hidden_of.push(i as u32);
            }
        }
        self.emitter_rays = self.hidden.len() as u64;
        job.world.occluded_by_emitters(&self.hidden, &mut self.is_hidden);
        for (&i, _) in self.hidden_of.iter().zip(&self.is_hidden).filter(|(_, is_hidden)| **is_hidden) {
            let c = &mut candidates.records[i as usize];
            (c.p_bsdf, c.p_lobe) = (0.0, 0.0);
        }
    }

    /// Sums of the normal equations of each point.
    fn gather(&mut self, equations: NormalEquations, method: Method, candidates: &Candidates, contributions: &[Rgb]) {
        let (m, len) = (equations.components(), equations.len());
        self.sums.clear();
        self.sums.resize(candidates.mixtures.len() * len, 0.0);
        for ((c, contribution), &is_free) in candidates.records.iter().zip(contributions).zip(&self.is_free) {
            let mixture = &candidates.mixtures[c.point as usize];
            let y = if is_free { *contribution * mixture.samples() } else { Rgb::BLACK };
            let (count, columns) = mixture.columns(c);
            equations.add_sparse(&mut self.sums[c.point as usize * len..][..len], &columns[..count], y.to_array());
        }
        for (mixture, sums) in candidates.mixtures.iter().zip(self.sums.chunks_mut(len)) {
            for (component, &count) in mixture.zero_valued[..m].iter().enumerate().filter(|(_, count)| **count > 0) {
                equations.add_zeros(sums, (component, mixture.zero_column(component)), count);
            }
            equations.add_zeros(sums, (0, 0.0), mixture.failed);
            method.finish(equations, sums, &mixture.integrals);
        }
    }
}
