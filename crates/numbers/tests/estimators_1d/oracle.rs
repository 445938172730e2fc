//! Slow and simple f64 versions, for comparison with the shipping ones.

use lumiris_numbers::estimators::ocv::ldlt::{self, Columns, Factors};
use lumiris_numbers::estimators::ocv::{MAX_COMPONENTS, Matrix, NormalEquations, System};

/// Fraction of Σ c² below which Σ (c − c̄)² is rounding.
const CONSTANT: f64 = 1e-6;

/// The coefficients of one row of sums, `beta[3 j + channel]`, by an f64 factorisation with pivoting.
pub(crate) fn solve(equations: NormalEquations, system: System, sums: &[f32]) -> Vec<f64> {
    let m = equations.components();
    let mut beta = vec![0.0; equations.coefficients()];
    let n = f64::from(equations.samples(sums));
    if n == 0.0 {
        return beta;
    }
    let (mut a, b) = assemble(equations, system.matrix, sums);
    let ridge = f64::from(system.ridge);
    (0..m).for_each(|j| a[j][j] += ridge);
    let factors = Factors::new(m, a).expect("the sums are finite");
    let effective = factors.rank() as f64 - ridge * inverse_trace(&factors, m);
    for (i, b) in b.into_iter().enumerate() {
        let x = factors.solve(b);
        let mut factor = 1.0;
        if system.shrink > 0.0 {
            let dot = |b: &[f64]| b.iter().zip(&x).map(|(b, x)| b * x).sum::<f64>();
            let explained = dot(&b) + ridge * dot(&x);
            let total = equations.sum_of_squares(sums, i) - equations.sum_of_y(sums, i).powi(2) / n;
            factor = shrink_factor(f64::from(system.shrink), n - 1.0, effective, [explained, total]);
        }
        (0..m).for_each(|j| beta[3 * j + i] = factor * x[j]);
    }
    beta
}

fn assemble(equations: NormalEquations, matrix: Matrix, sums: &[f32]) -> (ldlt::Matrix, Columns) {
    let (m, n) = (equations.components(), f64::from(equations.samples(sums)));
    let (mut a, mut b) = (ldlt::Matrix::default(), Columns::default());
    for j in 0..m {
        let mean = equations.sum_of_column(sums, j) / n;
        for k in 0..m {
            let product = equations.sum_of_products(sums, j, k);
            a[j][k] = match matrix {
                Matrix::KnownMeans => product,
                Matrix::SampleMeans => product - mean * equations.sum_of_column(sums, k),
                Matrix::Intercept => match (j + 1 == m, k + 1 == m) {
                    (false, false) => product,
                    (false, true) => equations.sum_of_column(sums, j),
                    (true, false) => equations.sum_of_column(sums, k),
                    (true, true) => n,
                },
            };
        }
        if a[j][j] < CONSTANT * equations.sum_of_products(sums, j, j) {
            a[j][j] = 0.0;
        }
        for (i, b) in b.iter_mut().enumerate() {
            let (mixed, y) = (equations.sum_with_y(sums, j, i), equations.sum_of_y(sums, i));
            b[j] = match matrix {
                Matrix::KnownMeans | Matrix::SampleMeans => mixed - mean * y,
                Matrix::Intercept => {
                    if j + 1 == m {
                        y
                    } else {
                        mixed
                    }
                }
            };
        }
    }
    (a, b)
}

/// Trace of the inverse of the matrix without dropped columns.
fn inverse_trace(factors: &Factors, m: usize) -> f64 {
    let diagonal = |i: usize| {
        let mut unit = [0.0; MAX_COMPONENTS];
        unit[i] = 1.0;
        factors.solve(unit)[i]
    };
    (0..m).map(diagonal).sum()
}

/// max(0, 1 − κ σ² p/T); 0 if fewer than half a degree of freedom is left for σ².
fn shrink_factor(kappa: f64, freedom: f64, effective: f64, [explained, total]: [f64; 2]) -> f64 {
    let left = freedom - effective;
    if !(explained > 0.0 && left > 0.5) {
        return 0.0;
    }
    let variance = (total - explained).max(0.0) / left;
    (1.0 - kappa * effective * variance / explained).max(0.0)
}
