//! `optimal-mis`: MIS weights of minimum variance [Kondapaneni et al. 2019].
//!
//! The linear systems use the columns r_j = h_j/p_α, where the paper uses r_j/I_j.

use super::mis::Mis;
use crate::direct::components::Components;
use crate::direct::fits::Fits;
use crate::direct::point::ShadingPoint;
use crate::direct::stats::DirectStats;
use crate::settings::OptimalForm;
use lumiris_numbers::estimators::ocv::NormalEquations;
use lumiris_numbers::estimators::optimal_mis;
use lumiris_numbers::math::Rgb;

/// Optimal weights for the samples of `mis`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OptimalMis {
    /// The samples.
    pub mis: Mis,
    /// How the weights are determined.
    pub form: OptimalForm,
}

impl OptimalMis {
    /// Computes the estimates from the sums of `components`; `out[i]` belongs to `points[i]`.
    pub(super) fn resolve(
        &self,
        points: &[ShadingPoint<'_>],
        components: &mut Components,
        stats: &mut DirectStats,
        fits: &mut Fits,
        out: &mut [Rgb],
    ) {
        let equations = components.equations;
        let sums = components.sums.chunks(equations.len());

        // Solve them, or use the coefficients of the fit
        for (((out, point), sums), mixture) in out.iter_mut().zip(points).zip(sums).zip(&components.mixtures) {
            let estimate = match (self.form, fits.beta(point.fit)) {
                (OptimalForm::Progressive, None) => equations.mean(sums),
                (OptimalForm::Progressive, Some(beta)) => {
                    optimal_mis::estimate(equations, sums, &mixture.integrals, beta)
                }
                (OptimalForm::Direct, _) => {
                    let outcome = optimal_mis::direct(equations, sums, &mixture.integrals);
                    stats.systems += 1;
                    stats.ill_conditioned += u64::from(outcome.is_ill_conditioned);
                    outcome.estimate
                }
            };
            fits.add(point.fit, sums);
            *out = Rgb::from_array(estimate);
        }
    }
}

/// Fits the coefficients of all fits to their sums. Returns the number of ill-conditioned systems.
pub(super) fn solve(equations: NormalEquations, sums: &[f32], beta: &mut [f32]) -> u64 {
    let fits = sums.chunks(equations.len()).zip(beta.chunks_mut(equations.coefficients().max(1)));
    // Pixels without a surface have nothing to solve
    let lit = fits.filter(|(sums, _)| equations.samples(sums) > 0.0);
    lit.map(|(sums, beta)| u64::from(optimal_mis::coefficients(equations, sums, beta) != Ok(0))).sum()
}
