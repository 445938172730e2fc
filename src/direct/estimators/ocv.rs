//! `ocv`: optimizing control variates [Fan et al. 2006].
//!
//! After T2, the samples of a point are accumulated into normal equations with the columns c_j = h_j/p_α − I_j, whose
//! expectation is 0, and y = f·V/p_α. The estimate is ȳ − Σ_j β_j c̄_j [Eq. 7 of the paper]. The forms differ in the
//! samples that β is fitted to.
//!
//! The form over pixels does not come here. [`crate::direct::ColumnDirectLighting`] sums the control variates of each
//! pixel, and `render/control_variates.rs` fits β and subtracts them after the last sample. In the stages, this form is
//! `mis`; see [`Estimator`](super::Estimator).

use super::mis::Mis;
use crate::direct::components::Components;
use crate::direct::fits::Fits;
use crate::direct::point::ShadingPoint;
use crate::direct::stats::DirectStats;
use crate::settings::OcvForm;
use lumiris_numbers::estimators::ocv::{Form, NormalEquations};
use lumiris_numbers::math::Rgb;

/// Control variates for the samples of `mis`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ocv {
    /// The samples.
    pub mis: Mis,
    /// How the coefficients are determined.
    pub form: OcvForm,
}

impl Ocv {
    /// Computes the estimates from the sums of `components`; `out[i]` belongs to `points[i]`. The form over pixels,
    /// which does not come here, would have the mean of the samples.
    pub(super) fn resolve(
        &self,
        points: &[ShadingPoint<'_>],
        components: &mut Components,
        stats: &mut DirectStats,
        fits: &mut Fits,
        out: &mut [Rgb],
    ) {
        let Components { equations, mixtures, sums, beta, .. } = components;
        let (form, len, width) = (numeric(self.form), equations.len(), equations.coefficients());
        for (mixture, sums) in mixtures.iter().zip(sums.chunks_mut(len)) {
            form.finish(*equations, sums, &mixture.integrals);
        }

        // The paper's form fits β to the same samples
        if self.form == OcvForm::Paper {
            let systems = sums.len() / len;
            beta.clear();
            beta.resize(systems * width, 0.0);
            stats.systems += systems as u64;
            stats.ill_conditioned += equations.solve(form.system(), sums, beta) as u64;
        }

        // Estimates
        for (i, (out, sums)) in out.iter_mut().zip(sums.chunks(len)).enumerate() {
            let integrals = &mixtures[i].integrals;
            let estimate = match self.form {
                OcvForm::Progressive => match fits.beta(points[i].fit) {
                    Some(beta) => form.estimate(*equations, sums, beta, integrals),
                    None => equations.mean(sums),
                },
                OcvForm::Pixels => equations.mean(sums),
                OcvForm::Paper => form.estimate(*equations, sums, &beta[i * width..][..width], integrals),
            };
            if self.form == OcvForm::Progressive {
                fits.add(points[i].fit, sums);
            }
            *out = Rgb::from_array(estimate);
        }
    }
}

/// The form in `lumiris_numbers`.
fn numeric(form: OcvForm) -> Form {
    match form {
        OcvForm::Paper => Form::Paper,
        OcvForm::Progressive => Form::Progressive,
        OcvForm::Pixels => Form::Pixels,
    }
}

/// Fits the coefficients of all fits to their sums. Returns the number of ill-conditioned systems.
pub(super) fn solve(equations: NormalEquations, sums: &[f32], beta: &mut [f32]) -> u64 {
    equations.solve(Form::Progressive.system(), sums, beta) as u64
}
