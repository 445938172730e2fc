//! The forms that fit β to samples of the same estimate.

use super::ldlt::IllConditioned;
use super::ldlt::{Columns, Factors, Matrix};
use super::normal::{NormalEquations, Penalty};

/// λ of equation (11) in the paper.
pub const PAPER_LAMBDA: f32 = 1.0;

/// An estimate, and whether it had to do without β.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Outcome {
    /// The estimate of ∫f by channel.
    pub estimate: [f32; 3],
    /// Number of systems without solution; the estimate, or a half of it, is then that of MIS.
    pub ill_conditioned: u32,
}

/// Equations (10) and (11): β₀ + Σ_{j<m} β_j I_j, where β minimises Σ (y − β₀ − Σ_{j<m} β_j r_j)² + λ Σ_{j≥0} β_j².
///
/// `sums` are of columns that are **not** centred, r_j = p_j/p_α, and `integrals` are the I_j = ∫p_j (1 in the paper). The last
/// component is left out. The penalty draws β₀, which is most of the estimate, to 0 as well: biased.
pub fn paper(equations: NormalEquations, sums: &[f32], integrals: &[f32], lambda: f32) -> Outcome {
    let m = equations.components();
    let failed = Outcome { estimate: equations.mean(sums), ill_conditioned: 1 };
    if m == 0 || !(equations.samples(sums) > 0.0) {
        return Outcome { ill_conditioned: 0, ..failed };
    }

    // The unknown of the last column is that of the intercept.
    let (mut a, mut x) = (Matrix::default(), Columns::default());
    let last = m - 1;
    for j in 0..m {
        for k in 0..m {
            a[j][k] = match (j == last, k == last) {
                (false, false) => equations.sum_of_products(sums, j, k),
                (false, true) => equations.sum_of_column(sums, j),
                (true, false) => equations.sum_of_column(sums, k),
                (true, true) => f64::from(equations.samples(sums)),
            };
        }
        a[j][j] += f64::from(lambda);
        for (i, x) in x.iter_mut().enumerate() {
            x[j] = if j == last { equations.sum_of_y(sums, i) } else { equations.sum_with_y(sums, j, i) };
        }
    }
    let Ok(factors) = Factors::new(m, a) else { return failed };
    let weight = |j: usize| if j == last { 1.0 } else { f64::from(integrals[j]) };
    let estimate = x.map(|b| {
        let beta = factors.solve(b);
        (0..m).map(|j| beta[j] * weight(j)).sum::<f64>() as f32
    });
    if estimate.iter().all(|e| e.is_finite()) { Outcome { estimate, ill_conditioned: 0 } } else { failed }
}

/// Equation (7) with β from the same samples. Bias O(1/N).
pub fn regression(equations: NormalEquations, sums: &[f32], penalty: Penalty) -> Outcome {
    applied(equations, sums, sums, penalty)
}

/// Equation (7) on each half of the samples with β from the other, and the mean of both by numbers of samples. Unbiased if
/// the halves are independent and each is a whole deterministic mixture.
pub fn crossfit(equations: NormalEquations, halves: [&[f32]; 2], penalty: Penalty) -> Outcome {
    let [a, b] = [0, 1].map(|k| applied(equations, halves[k], halves[1 - k], penalty));
    let n = halves.map(|sums| equations.samples(sums));
    if !(n[0] + n[1] > 0.0) {
        return Outcome::default();
    }
    let estimate = [0, 1, 2].map(|i| (n[0] * a.estimate[i] + n[1] * b.estimate[i]) / (n[0] + n[1]));
    Outcome { estimate, ill_conditioned: a.ill_conditioned + b.ill_conditioned }
}

/// Equation (7) on the samples of `sums` with β from those of `fit`.
fn applied(equations: NormalEquations, sums: &[f32], fit: &[f32], penalty: Penalty) -> Outcome {
    let mut beta = [0.0; 3 * super::MAX_COMPONENTS];
    let result = equations.solve(fit, penalty, &mut beta);
    Outcome { estimate: equations.estimate(sums, &beta), ill_conditioned: u32::from(result == Err(IllConditioned)) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::hash::HashStream;

    /// Sums of `n` samples of y = 3 + 2 c₀ − c₁ + `noise`, and their columns plus `shift`.
    fn sums(n: usize, noise: f32, shift: f32) -> (NormalEquations, Vec<f32>) {
        let equations = NormalEquations::new(3);
        let (mut sums, mut stream) = (vec![0.0; equations.len()], HashStream::new([4, 5, 6]));
        for _ in 0..n {
            let [a, b] = stream.next_2d().map(|u| 2.0 * u - 1.0);
            let y = 3.0 + 2.0 * a - b + noise * (stream.next_f32() - 0.5);
            equations.add(&mut sums, &[a + shift, b + shift, shift - a - b], [y, 2.0 * y, 0.0]);
        }
        (equations, sums)
    }

    #[test]
    fn what_the_columns_explain_is_integrated_exactly() {
        let (equations, all) = sums(40, 0.0, 0.0);
        let exact = |o: Outcome| (o.estimate[0] - 3.0).abs() < 1e-5 && (o.estimate[1] - 6.0).abs() < 2e-5;
        let outcome = regression(equations, &all, Penalty::NONE);
        assert!(exact(outcome) && outcome.estimate[2] == 0.0, "{outcome:?}");
        let (_, other) = sums(9, 0.0, 0.0);
        assert!(exact(crossfit(equations, [&all, &other], Penalty::NONE)));
        assert!((equations.mean(&all)[0] - 3.0).abs() > 0.01);
    }

    #[test]
    fn paper_without_penalty_is_the_regression_and_its_penalty_fades() {
        let (equations, uncentred) = sums(40, 1.0, 1.0);
        let (_, centred) = sums(40, 1.0, 0.0);
        let expected = regression(equations, &centred, Penalty::NONE).estimate[0];
        // The last column is 3 less the others here, so that the fit is the same without it.
        let got = paper(equations, &uncentred, &[1.0; 3], 0.0).estimate[0];
        assert!((got - expected).abs() < 1e-4, "{got} {expected}");
        let distance = |n: usize| {
            let (e, s) = sums(n, 1.0, 1.0);
            let at = |lambda| paper(e, &s, &[1.0; 3], lambda).estimate[0];
            (at(PAPER_LAMBDA) - at(0.0)).abs()
        };
        assert!(distance(10) > 10.0 * distance(1000));
    }

    #[test]
    fn nothing_is_zero() {
        let equations = NormalEquations::new(2);
        let sums = vec![0.0; equations.len()];
        assert_eq!(regression(equations, &sums, Penalty::default()), Outcome::default());
        assert_eq!(crossfit(equations, [&sums, &sums], Penalty::default()), Outcome::default());
        assert_eq!(paper(equations, &sums, &[1.0; 2], 1.0), Outcome::default());
    }
}
