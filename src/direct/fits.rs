//! Coefficients that progressive estimators fit to earlier estimates.

use lumiris_numbers::estimators::ocv::NormalEquations;

/// Solves the systems of all fits from their sums. Returns how many are ill-conditioned.
pub(super) type Solver = fn(NormalEquations, &[f32], &mut [f32]) -> u64;

/// Fits shared by estimates: the sums so far, and coefficients for later estimates.
///
/// An estimate uses the coefficients of its fit and adds its samples to the sums; [`Self::solve`] begins a new block
/// with coefficients fitted to all sums. Later estimates must be independent of earlier ones.
#[derive(Clone, Debug)]
pub struct Fits {
    equations: NormalEquations,
    solver: Solver,
    sums: Vec<f32>,
    beta: Vec<f32>,
}

impl Default for Fits {
    fn default() -> Self {
        Fits::new(NormalEquations::new(0), |_, _, _| 0, 0)
    }
}

impl Fits {
    /// `count` fits without samples.
    pub(super) fn new(equations: NormalEquations, solver: Solver, count: usize) -> Self {
        let [sums, beta] = [equations.len(), equations.coefficients()].map(|len| vec![0.0; count * len]);
        Fits { equations, solver, sums, beta }
    }

    /// Begins a block. Returns the number of fits whose system is ill-conditioned; without a solution, estimates are
    /// those of MIS.
    pub fn solve(&mut self) -> u64 {
        (self.solver)(self.equations, &self.sums, &mut self.beta)
    }

    /// The coefficients of a fit; `None` if there are no fits.
    pub(super) fn beta(&self, fit: u32) -> Option<&[f32]> {
        let len = self.equations.coefficients();
        (!self.sums.is_empty()).then(|| &self.beta[fit as usize * len..][..len])
    }

    /// Adds the sums of an estimate to those of its fit, if there are fits.
    pub(super) fn add(&mut self, fit: u32, sums: &[f32]) {
        if !self.sums.is_empty() {
            let len = self.equations.len();
            self.equations.merge(&mut self.sums[fit as usize * len..][..len], sums);
        }
    }
}
