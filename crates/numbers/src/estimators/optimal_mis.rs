//! Optimal multiple importance sampling [Kondapaneni et al. 2019]: the weights of m techniques with the least variance
//! for given numbers of samples n_j, not confined to 0..1.
//!
//! With p_α = Σ (n_j/N) p_j, r_j = p_j/p_α and y = f/p_α, all N samples estimate
//!
//! - the technique matrix A_jk = ∫ p_j p_k/p_α ≈ (1/N) Σ r_j r_k, and
//! - the contribution vector b_j = ∫ f p_j/p_α ≈ (1/N) Σ r_j y.
//!
//! (Both are N times the quantities of the paper, which cancels.) The coefficients solve A α = b, and the estimate with
//! the optimal weights is Σ_j α_j ∫p_j + (1/N) Σ (f − Σ_j α_j p_j)/p_α.
//!
//! - [`direct`]: α from the same samples. The second term is then 0, and the estimate is Σ α_j ∫p_j. Bias O(1/N).
//! - progressive, [`coefficients`] and [`estimate`]: α from earlier, independent samples. Unbiased.
//!
//! This is the regression of optimizing control variates without penalty: since Σ (n_j/N) r_j = 1, the columns r_j span
//! the intercept, and α_j differs from β_j by a multiple of n_j.

use super::ocv::ldlt::{Columns, Factors, Matrix};
use super::ocv::{IllConditioned, MAX_COMPONENTS, NormalEquations};

/// An estimate, and a flag for an ill-conditioned system.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Outcome {
    /// The estimate of ∫f by channel.
    pub estimate: [f32; 3],
    /// True if there was no solution (the estimate is then MIS), or if techniques were dropped.
    pub is_ill_conditioned: bool,
}

/// α of A α = b from `sums` of columns that are **not** centred, r_j = p_j/p_α: `alpha[3 j + channel]`; all 0 on error.
///
/// Returns the number of techniques that were dropped since they are linearly dependent on the others; the solution is
/// then not unique. An error if anything is not finite, or if there are no more samples than independent techniques.
pub fn coefficients(equations: NormalEquations, sums: &[f32], alpha: &mut [f32]) -> Result<usize, IllConditioned> {
    let alpha = &mut alpha[..equations.coefficients()];
    let result = try_coefficients(equations, sums, alpha);
    if result.is_err() {
        alpha.fill(0.0);
    }
    result
}

fn try_coefficients(equations: NormalEquations, sums: &[f32], alpha: &mut [f32]) -> Result<usize, IllConditioned> {
    let m = equations.components();
    let (mut a, mut b) = (Matrix::default(), Columns::default());
    for j in 0..m {
        for k in 0..m {
            a[j][k] = equations.sum_of_products(sums, j, k);
        }
        for (i, b) in b.iter_mut().enumerate() {
            b[j] = equations.sum_with_y(sums, j, i);
        }
    }
    let factors = Factors::new(m, a)?;
    if f64::from(equations.samples(sums)) <= factors.rank() as f64 {
        return Err(IllConditioned);
    }
    for (i, b) in b.into_iter().enumerate() {
        let x = factors.solve(b);
        for (alpha, x) in alpha.chunks_exact_mut(3).zip(x) {
            alpha[i] = x as f32;
        }
    }
    if alpha.iter().all(|a| a.is_finite()) { Ok(factors.dropped()) } else { Err(IllConditioned) }
}

/// Σ_j α_j I_j + (1/N) Σ (y − Σ_j α_j r_j) with the known integrals I_j = ∫p_j; 0 without samples. α = 0 is the balance
/// heuristic.
pub fn estimate(equations: NormalEquations, sums: &[f32], integrals: &[f32], alpha: &[f32]) -> [f32; 3] {
    let n = f64::from(equations.samples(sums));
    if !(n > 0.0) {
        return [0.0; 3];
    }
    std::array::from_fn(|i| {
        let control = (0..equations.components()).map(|j| {
            let known = f64::from(integrals[j]) - equations.sum_of_column(sums, j) / n;
            f64::from(alpha[3 * j + i]) * known
        });
        (equations.sum_of_y(sums, i) / n + control.sum::<f64>()) as f32
    })
}

/// The estimate with α from the same samples; the balance heuristic if there is no α. Bias O(1/N).
pub fn direct(equations: NormalEquations, sums: &[f32], integrals: &[f32]) -> Outcome {
    let mut alpha = [0.0; 3 * MAX_COMPONENTS];
    let result = coefficients(equations, sums, &mut alpha);
    let estimate = estimate(equations, sums, integrals, &alpha);
    Outcome { estimate, is_ill_conditioned: result != Ok(0) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::estimators::ocv::{Form, System};
    use lumiris_test_support::random::{RngExt, pcg32};

    /// Sums of r_j of samples of three techniques, where Σ r_j/3 = 1.
    fn sums(n: usize) -> (NormalEquations, Vec<f32>) {
        let equations = NormalEquations::new(3);
        let (mut sums, mut stream) = (vec![0.0; equations.len()], pcg32([1, 5, 9]));
        for _ in 0..n {
            let [a, b] = stream.random::<[f32; 2]>();
            let y = [a * a, 1.0 + b, a * b + stream.random::<f32>()];
            equations.add_sparse(&mut sums, &[(0, a), (1, b), (2, 3.0 - a - b)], y);
        }
        (equations, sums)
    }

    #[test]
    fn direct_form_is_the_sum_of_coefficients_and_the_regression_without_penalty() {
        for n in [6, 50] {
            let (equations, uncentred) = sums(n);
            let got = direct(equations, &uncentred, &[1.0; 3]);
            let mut alpha = [0.0; 9];
            coefficients(equations, &uncentred, &mut alpha).expect("there are enough samples");
            let (mut centred, mut beta) = (uncentred.clone(), [0.0; 9]);
            Form::Regression.finish(equations, &mut centred, &[1.0; 3]);
            // Σ c_j = 0: the last column is dropped
            equations.solve(System::LEAST_SQUARES, &centred, &mut beta);
            let expected = Form::Regression.estimate(equations, &centred, &beta, &[1.0; 3]);
            for i in 0..3 {
                let sum = alpha[i] + alpha[3 + i] + alpha[6 + i];
                assert!(
                    (got.estimate[i] - sum).abs() < 1e-4 && (sum - expected[i]).abs() < 1e-3,
                    "{got:?} {expected:?}"
                );
            }
        }
    }

    #[test]
    fn techniques_that_are_alike_are_counted_and_those_that_are_not_there_are_not() {
        let equations = NormalEquations::new(3);
        let ill_conditioned = |third: fn(f32) -> f32| {
            let (mut sums, mut stream) = (vec![0.0; equations.len()], pcg32([1, 5, 9]));
            for _ in 0..40 {
                let u = stream.random::<f32>();
                equations.add_sparse(&mut sums, &[(0, u), (1, 2.0 - u), (2, third(u))], [1.0 + u, u, 1.0]);
            }
            let outcome = direct(equations, &sums, &[1.0; 3]);
            assert!((outcome.estimate[2] - 1.0).abs() < 1e-4, "{outcome:?}");
            outcome.is_ill_conditioned
        };
        assert_eq!([ill_conditioned(|u| u), ill_conditioned(|_| 0.0)], [true, false]);
    }

    #[test]
    fn without_enough_samples_it_is_the_balance_heuristic() {
        let (equations, uncentred) = sums(3);
        let got = direct(equations, &uncentred, &[1.0; 3]);
        assert_eq!((got.estimate, got.is_ill_conditioned), (equations.mean(&uncentred), true));
        let nothing = direct(equations, &vec![0.0; equations.len()], &[1.0; 3]);
        assert_eq!(nothing.estimate, [0.0; 3]);
    }
}
