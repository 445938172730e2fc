//! The forms of β: their columns, their systems, and their estimates.

use super::ldlt::MAX_COMPONENTS;
use super::normal::NormalEquations;
use super::solve::System;
use crate::estimators::mc;
use strum::{EnumString, IntoStaticStr, VariantNames};

/// The form of β.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, EnumString, IntoStaticStr, VariantNames)]
#[strum(serialize_all = "kebab-case")]
pub enum Form {
    /// Equations (10) and (11): β₀ + Σ β_j of the ridge solution with λ = 1 on the same samples. Biased.
    Paper,
    /// Equation (7), β from the same samples. Bias O(1/N).
    Regression,
    /// Equation (7), β from the other of two independently randomised halves. Unbiased.
    Crossfit,
    /// Equation (7), β from earlier blocks of passes of the same pixel ([`block_of`](super::block_of)). Unbiased.
    Progressive,
    /// Equation (7) for the means of a pixel over all its samples, β from other pixels ([`super::pixels`]). Unbiased if
    /// pixels are independent.
    #[default]
    Pixels,
}

impl Form {
    /// Number of rows of sums for the samples of an estimate: two in the form that fits β of each half to the other
    /// half.
    pub fn rows(self) -> usize {
        match self {
            Form::Crossfit => 2,
            Form::Paper | Form::Regression | Form::Progressive | Form::Pixels => 1,
        }
    }

    /// The system that β solves.
    pub fn system(self) -> System {
        match self {
            Form::Paper => System::PAPER,
            Form::Regression => System::SAME_SAMPLES,
            Form::Crossfit | Form::Progressive | Form::Pixels => System::OTHER_SAMPLES,
        }
    }

    /// Converts sums over columns r_j = p_j/p_α to the columns of the form: r_j/I_j for the paper, r_j − I_j for the
    /// others.
    pub fn finish(self, equations: NormalEquations, sums: &mut [f32], integrals: &[f32]) {
        match self {
            Form::Paper => {
                let mut scales = [1.0; MAX_COMPONENTS];
                for (scale, integral) in scales.iter_mut().zip(integrals).filter(|(_, integral)| **integral > 0.0) {
                    *scale = 1.0 / integral;
                }
                equations.scale(sums, &scales);
            }
            Form::Regression | Form::Crossfit | Form::Progressive | Form::Pixels => equations.centre(sums, integrals),
        }
    }

    /// The estimate from the samples of [`rows`](Self::rows) rows of `sums`. `beta` are the coefficients of the systems
    /// of these rows; in the progressive form, the coefficients fitted to earlier samples.
    ///
    /// A system without solution has coefficients of 0. The estimate, or its half with these coefficients, is then MIS.
    pub fn estimate(self, equations: NormalEquations, sums: &[f32], beta: &[f32], integrals: &[f32]) -> [f32; 3] {
        match self {
            Form::Paper => with_intercept(equations, sums, beta, integrals),
            Form::Regression | Form::Progressive | Form::Pixels => equations.estimate(sums, beta),
            Form::Crossfit => {
                let [a, b] = [0, 1].map(|half| &sums[half * equations.len()..][..equations.len()]);
                let (beta_of_a, beta_of_b) = beta.split_at(equations.coefficients());
                let estimates = [equations.estimate(a, beta_of_b), equations.estimate(b, beta_of_a)];
                mc::pooled([equations.samples(a), equations.samples(b)], estimates)
            }
        }
    }
}

/// β₀ + Σ β_j over the existing components [Fan et al. 2006, Eq. 10]; the last unknown is β₀. The mean of y if there is
/// no solution.
fn with_intercept(equations: NormalEquations, sums: &[f32], beta: &[f32], integrals: &[f32]) -> [f32; 3] {
    let last = equations.components().saturating_sub(1);
    if beta.iter().all(|b| *b == 0.0) {
        return equations.mean(sums);
    }
    let is_there = |j: usize| j == last || integrals[j] > 0.0;
    [0, 1, 2].map(|c| (0..=last).filter(|&j| is_there(j)).map(|j| beta[3 * j + c]).sum())
}

#[cfg(test)]
mod tests {
    use super::*;
    use lumiris_test_support::random::{RngExt, pcg32};

    const INTEGRALS: [f32; 3] = [1.0; 3];

    /// Sums of `n` samples of y = 3 + 2 c₀ − c₁ + `noise` in the columns r_j = 1 + c_j, where Σ c_j = 0.
    fn sums(n: usize, noise: f32) -> (NormalEquations, Vec<f32>) {
        let equations = NormalEquations::new(3);
        let (mut sums, mut stream) = (vec![0.0; equations.len()], pcg32([4, 5, 6]));
        for _ in 0..n {
            let [a, b] = stream.random::<[f32; 2]>().map(|u| 2.0 * u - 1.0);
            let y = 3.0 + 2.0 * a - b + noise * (stream.random::<f32>() - 0.5);
            equations.add_sparse(&mut sums, &[(0, 1.0 + a), (1, 1.0 + b), (2, 1.0 - a - b)], [y, 2.0 * y, 0.0]);
        }
        (equations, sums)
    }

    /// The estimate with β of `system` from the same rows.
    fn estimate(form: Form, system: System, equations: NormalEquations, rows: &[&[f32]]) -> [f32; 3] {
        let mut sums = rows.concat();
        sums.chunks_exact_mut(equations.len()).for_each(|row| form.finish(equations, row, &INTEGRALS));
        let mut beta = vec![0.0; rows.len() * equations.coefficients()];
        equations.solve(system, &sums, &mut beta);
        form.estimate(equations, &sums, &beta, &INTEGRALS)
    }

    #[test]
    fn what_the_columns_explain_is_integrated_exactly() {
        let (equations, all) = sums(40, 0.0);
        let (_, other) = sums(9, 0.0);
        assert!((equations.mean(&all)[0] - 3.0).abs() > 0.01);
        for (form, rows) in
            [(Form::Regression, &[&all[..]][..]), (Form::Progressive, &[&all]), (Form::Crossfit, &[&all, &other])]
        {
            assert_eq!(rows.len(), form.rows());
            let [a, b, c] = estimate(form, System::LEAST_SQUARES, equations, rows);
            assert!((a - 3.0).abs() < 1e-4 && (b - 6.0).abs() < 2e-4 && c == 0.0, "{form:?}: {a} {b} {c}");
        }
    }

    #[test]
    fn paper_without_penalty_is_the_regression_and_its_penalty_fades() {
        let (equations, all) = sums(40, 1.0);
        let without = System { ridge: 0.0, ..System::PAPER };
        // The last column is 3 minus the others here, so the fit without it is the same.
        let expected = estimate(Form::Regression, System::LEAST_SQUARES, equations, &[&all])[0];
        let got = estimate(Form::Paper, without, equations, &[&all])[0];
        assert!((got - expected).abs() < 1e-3, "{got} {expected}");
        let distance = |n: usize| {
            let (e, s) = sums(n, 1.0);
            let at = |system| estimate(Form::Paper, system, e, &[&s])[0];
            (at(System::PAPER) - at(without)).abs()
        };
        assert!(distance(10) > 10.0 * distance(1000));
    }

    #[test]
    fn nothing_is_zero() {
        let equations = NormalEquations::new(3);
        let nothing = vec![0.0; equations.len()];
        for form in [Form::Paper, Form::Regression, Form::Crossfit, Form::Progressive] {
            let rows = vec![&nothing[..]; form.rows()];
            assert_eq!(estimate(form, form.system(), equations, &rows), [0.0; 3], "{form:?}");
        }
    }
}
