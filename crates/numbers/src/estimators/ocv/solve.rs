//! β from the sums of many shading points at once, one point per lane: small symmetric systems.
//!
//! The factorisation is LDLᵀ without pivoting. A column whose pivot is rounding is dropped.
//!
//! Lanes are arrays, whose loops the compiler vectorises. There are too many loops over columns to unroll them for
//! every level of a dispatch.

use super::ldlt::MAX_COMPONENTS;
use super::normal::NormalEquations;
use std::ops::{Add, AddAssign, Div, Mul, MulAssign, Sub, SubAssign};

/// Number of points that are solved together.
const LANES: usize = 8;

/// Fraction of the diagonal below which a pivot is rounding.
const DEPENDENT: f32 = 1e-5;

/// Fraction of Σ c² below which Σ (c − c̄)² is rounding.
const CONSTANT: f32 = 1e-6;

/// The matrix of the system.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Matrix {
    /// Σ c_j c_k: columns of mean 0.
    KnownMeans,
    /// Σ (c_j − c̄_j)(c_k − c̄_k), as in a regression with an intercept.
    SampleMeans,
    /// Σ c_j c_k with a column of ones instead of the last one.
    Intercept,
}

/// The system with the solution β, and its regularisation for few samples: β = 0 is MIS, and so is every multiple of α.
///
/// The columns c_j are dimensionless and of order one, so that the ridge is a number of samples, and β scales with f.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct System {
    /// The matrix.
    pub matrix: Matrix,
    /// λ of λ Σ β_j², in samples whose columns have a mean square of one.
    pub ridge: f32,
    /// κ of the factor max(0, 1 − κ σ² p/T) of each channel [James and Stein 1961]. T is the part of the sum of squares
    /// of y that β explains, p = tr (C + λ1)⁻¹C is the number of effective coefficients, and σ² is the unexplained part
    /// per degree of freedom n − 1 − p. The factor is 0 if fewer than half a degree is left. κ = 0 disables it.
    pub shrink: f32,
}

impl System {
    /// Plain least squares with an intercept.
    pub const LEAST_SQUARES: System = System { matrix: Matrix::SampleMeans, ridge: 0.0, shrink: 0.0 };

    /// For β that is applied to the samples it is fitted to.
    pub const SAME_SAMPLES: System = System { matrix: Matrix::SampleMeans, ridge: 1.0, shrink: 0.0 };

    /// For β that is applied to other samples. Chosen by measurement, see `docs/measurements/ocv`: the weakest
    /// regularisation that keeps the first four passes within 2 % of MIS if control variates do not reduce variance.
    pub const OTHER_SAMPLES: System = System { matrix: Matrix::KnownMeans, ridge: 4.0, shrink: 1.0 };

    /// Equation (11) of the paper, λ = 1. The penalty shrinks the intercept, which is most of the estimate, as well.
    pub const PAPER: System = System { matrix: Matrix::Intercept, ridge: 1.0, shrink: 0.0 };
}

impl NormalEquations {
    /// Solves the system of each row of `sums` and writes `beta[coefficients·row + 3 j + channel]`, 0 if a solution is
    /// not finite. Returns the number of ill-conditioned systems: systems without a finite solution, and systems in
    /// which a column that is not 0 in all samples was dropped.
    pub fn solve(self, system: System, sums: &[f32], beta: &mut [f32]) -> usize {
        let (len, width) = (self.len(), self.coefficients());
        if width == 0 {
            return 0;
        }
        let points = sums.len() / len;
        let mut ill_conditioned = 0;
        for first in (0..points).step_by(LANES) {
            let lanes = Lanes { equations: self, sums, len, first, last: points - 1 };
            let (x, is_ill) = solve_lanes(&lanes, system);
            for p in 0..LANES.min(points - first) {
                for k in 0..width {
                    beta[(first + p) * width + k] = x[k].0[p];
                }
                ill_conditioned += usize::from(is_ill[p]);
            }
        }
        ill_conditioned
    }
}

/// One number per point.
#[derive(Clone, Copy)]
struct F([f32; LANES]);

impl F {
    const ZERO: F = F([0.0; LANES]);
    const ONE: F = F([1.0; LANES]);

    #[inline(always)]
    fn zip(self, o: F, f: impl Fn(f32, f32) -> f32) -> F {
        let mut v = [0.0; LANES];
        for p in 0..LANES {
            v[p] = f(self.0[p], o.0[p]);
        }
        F(v)
    }

    #[inline(always)]
    fn max(self, min: f32) -> F {
        self.zip(F::ZERO, |v, _| if v > min { v } else { min })
    }

    /// `self` where `test > bound`, else 0.
    #[inline(always)]
    fn where_greater(self, test: F, bound: F) -> F {
        let mut v = [0.0; LANES];
        for p in 0..LANES {
            v[p] = if test.0[p] > bound.0[p] { self.0[p] } else { 0.0 };
        }
        F(v)
    }
}

macro_rules! operators {
    ($($trait:ident $method:ident $operator:tt),+) => {$(
        impl $trait for F {
            type Output = F;
            #[inline(always)]
            fn $method(self, o: F) -> F {
                self.zip(o, |a, b| a $operator b)
            }
        }

        impl $trait<f32> for F {
            type Output = F;
            #[inline(always)]
            fn $method(self, o: f32) -> F {
                self.zip(F::ZERO, |a, _| a $operator o)
            }
        }
    )+};
}
operators!(Add add +, Sub sub -, Mul mul *, Div div /);

macro_rules! assignments {
    ($($trait:ident $method:ident $operator:tt),+) => {$(
        impl $trait for F {
            #[inline(always)]
            fn $method(&mut self, o: F) {
                *self = *self $operator o;
            }
        }
    )+};
}
assignments!(AddAssign add_assign +, SubAssign sub_assign -, MulAssign mul_assign *);

/// Sums of [`LANES`] points from `first` on; lanes after the `last` point repeat it.
struct Lanes<'a> {
    equations: NormalEquations,
    sums: &'a [f32],
    /// Number of sums of a point.
    len: usize,
    first: usize,
    last: usize,
}

impl Lanes<'_> {
    fn get(&self, k: usize) -> F {
        let mut v = [0.0; LANES];
        for p in 0..LANES {
            v[p] = self.sums[(self.first + p).min(self.last) * self.len + k];
        }
        F(v)
    }

    /// Σ c_j²; n for a column of ones.
    fn squares(&self, system: System) -> [F; MAX_COMPONENTS] {
        let m = self.equations.components();
        let mut squares = [F::ZERO; MAX_COMPONENTS];
        for j in 0..m {
            squares[j] = self.get(j * (j + 3) / 2);
        }
        if system.matrix == Matrix::Intercept {
            squares[m - 1] = self.get(self.equations.count());
        }
        squares
    }
}

/// Coefficients by column and channel, and flags of ill-conditioned systems.
fn solve_lanes(lanes: &Lanes<'_>, system: System) -> ([F; 3 * MAX_COMPONENTS], [bool; LANES]) {
    let (m, values) = (lanes.equations.components(), lanes.equations.values());
    let (zero, one) = (F::ZERO, F::ONE);
    let n = lanes.get(lanes.equations.count());
    let per_n = one / n.max(1.0);
    let Assembled { a, b } = assemble(lanes, system, per_n);
    let factors = factorise(m, &a, system.ridge);
    let left = n - 1.0 - factors.effective(m, system.ridge);

    let mut x = [zero; 3 * MAX_COMPONENTS];
    // NaN if anything in the system or in a solution is not finite, even if it is dropped or shrunk to 0.
    let mut sum = zero;
    for j in 0..m {
        for k in 0..=j {
            sum += a[j][k] * 0.0;
        }
    }
    for i in 0..3 {
        let solution = factors.solve(m, &b[i]);
        let mut factor = one;
        if system.shrink > 0.0 {
            let (mut explained, y) = (zero, lanes.get(values + i));
            for j in 0..m {
                explained += solution[j] * (b[i][j] + solution[j] * system.ridge);
            }
            let total = lanes.get(values + 3 + i) - y * y * per_n;
            let variance = (total - explained).max(0.0) / left;
            let effective = n - 1.0 - left;
            let shrunk = (one - effective * variance / explained * system.shrink).max(0.0);
            factor = shrunk.where_greater(explained, zero).where_greater(left, one * 0.5);
        }
        for j in 0..m {
            sum += (solution[j] + b[i][j]) * 0.0;
            x[3 * j + i] = solution[j] * factor;
            sum += x[3 * j + i] * 0.0;
        }
    }
    let ok = sum.0.map(f32::is_finite);
    for x in &mut x[..3 * m] {
        for p in 0..LANES {
            x.0[p] = if ok[p] { x.0[p] } else { 0.0 };
        }
    }
    let mut is_ill = factors.drops(&lanes.squares(system), &a);
    for p in 0..LANES {
        is_ill[p] |= !ok[p];
    }
    (x, is_ill)
}

/// The lower triangle of a matrix.
type Triangle = [[F; MAX_COMPONENTS]; MAX_COMPONENTS];

/// Systems of equations.
struct Assembled {
    /// The matrix without ridge.
    a: Triangle,
    /// Three right-hand sides.
    b: [[F; MAX_COMPONENTS]; 3],
}

fn assemble(lanes: &Lanes<'_>, system: System, per_n: F) -> Assembled {
    let (m, zero) = (lanes.equations.components(), F::ZERO);
    let [mixed, means, values] = [lanes.equations.products(), lanes.equations.columns(), lanes.equations.values()];
    let (mut a, mut b) = ([[zero; MAX_COMPONENTS]; MAX_COMPONENTS], [[zero; MAX_COMPONENTS]; 3]);
    let mut at = 0;
    for j in 0..m {
        let mean = lanes.get(means + j) * per_n;
        for k in 0..=j {
            a[j][k] = lanes.get(at);
            if system.matrix == Matrix::SampleMeans {
                let centred = a[j][k] - mean * lanes.get(means + k);
                let is_constant = a[j][k] * CONSTANT;
                a[j][k] =
                    if j == k { centred.zip(is_constant, |c, min| if c < min { 0.0 } else { c }) } else { centred };
            }
            at += 1;
        }
        for i in 0..3 {
            b[i][j] = lanes.get(mixed + 3 * j + i);
            if system.matrix != Matrix::Intercept {
                b[i][j] -= mean * lanes.get(values + i);
            }
        }
    }
    if system.matrix == Matrix::Intercept {
        for k in 0..m - 1 {
            a[m - 1][k] = lanes.get(means + k);
        }
        a[m - 1][m - 1] = lanes.get(lanes.equations.count());
        for i in 0..3 {
            b[i][m - 1] = lanes.get(values + i);
        }
    }
    Assembled { a, b }
}

/// L below the diagonal, and 1/D, which is 0 for dropped columns.
struct Factors {
    l: Triangle,
    per_d: [F; MAX_COMPONENTS],
}

fn factorise(m: usize, a: &Triangle, ridge: f32) -> Factors {
    let (zero, one) = (F::ZERO, F::ONE);
    let (mut l, mut d, mut per_d) =
        ([[zero; MAX_COMPONENTS]; MAX_COMPONENTS], [zero; MAX_COMPONENTS], [zero; MAX_COMPONENTS]);
    for j in 0..m {
        let diagonal = a[j][j] + ridge;
        let mut pivot = diagonal;
        for k in 0..j {
            pivot -= l[j][k] * l[j][k] * d[k];
        }
        let min = diagonal * DEPENDENT;
        d[j] = pivot.where_greater(pivot, min);
        per_d[j] = (one / pivot).where_greater(pivot, min);
        for i in j + 1..m {
            let mut v = a[i][j];
            for k in 0..j {
                v -= l[i][k] * l[j][k] * d[k];
            }
            l[i][j] = v * per_d[j];
        }
    }
    Factors { l, per_d }
}

impl Factors {
    /// Solves L D Lᵀ x = b; 0 for dropped columns.
    fn solve(&self, m: usize, b: &[F; MAX_COMPONENTS]) -> [F; MAX_COMPONENTS] {
        let mut x = *b;
        for j in 0..m {
            for k in 0..j {
                x[j] -= self.l[j][k] * x[k];
            }
        }
        for j in (0..m).rev() {
            x[j] *= self.per_d[j];
            for i in j + 1..m {
                x[j] -= self.l[i][j] * x[i];
            }
        }
        x
    }

    /// True if a column is dropped although its sum of squares is not 0: it is constant, or linearly dependent on
    /// earlier ones.
    fn drops(&self, squares: &[F; MAX_COMPONENTS], a: &Triangle) -> [bool; LANES] {
        let mut drops = [false; LANES];
        for (j, squares) in squares.iter().enumerate() {
            for p in 0..LANES {
                drops[p] |= squares.0[p] > 0.0 && (a[j][j].0[p] == 0.0 || self.per_d[j].0[p] == 0.0);
            }
        }
        drops
    }

    /// rank − λ tr A⁻¹, from the columns of L⁻¹.
    fn effective(&self, m: usize, ridge: f32) -> F {
        let (zero, one) = (F::ZERO, F::ONE);
        let (mut rank, mut trace) = (zero, zero);
        for c in 0..m {
            rank += one.where_greater(self.per_d[c], zero);
            let mut v = [zero; MAX_COMPONENTS];
            v[c] = one;
            for j in c..m {
                for k in c..j {
                    v[j] -= self.l[j][k] * v[k];
                }
                trace += v[j] * v[j] * self.per_d[j];
            }
        }
        rank - trace * ridge
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use lumiris_test_support::random::{RngExt, pcg32};

    /// Numbers of points with and without full lanes.
    const LENGTHS: [usize; 8] = [0, 1, 3, 7, 8, 9, 23, 32];
    const MATRICES: [Matrix; 3] = [Matrix::KnownMeans, Matrix::SampleMeans, Matrix::Intercept];

    /// Rows of sums of `n` samples each; `column` modifies the columns.
    fn rows(m: usize, points: usize, n: usize, column: fn(&mut [f32], f32)) -> (NormalEquations, Vec<f32>) {
        let equations = NormalEquations::new(m);
        let (mut sums, mut stream) = (vec![0.0; points * equations.len()], pcg32([m as u32, n as u32, 3]));
        for row in sums.chunks_exact_mut(equations.len()) {
            for _ in 0..n {
                let mut c: Vec<f32> = (0..m).map(|_| 2.0 * stream.random::<f32>() - 1.0).collect();
                let y: [f32; 3] = std::array::from_fn(|i| 1.0 + c[i % m] + stream.random::<f32>());
                column(&mut c, stream.random::<f32>());
                equations.add_sparse(row, &c.into_iter().enumerate().collect::<Vec<_>>(), y);
            }
        }
        (equations, sums)
    }

    #[test]
    fn solutions_do_not_depend_on_what_is_solved_beside_and_what_is_not_finite_is_counted() {
        for columns in [1, 3, 5, 8] {
            for matrix in MATRICES {
                for points in LENGTHS {
                    let system = System { matrix, ridge: 1.5, shrink: 1.0 };
                    let (equations, mut sums) = rows(columns, points, 7, |_, _| ());
                    let spoilt = (points > 2) as usize;
                    if spoilt > 0 {
                        sums[2 * equations.len() + equations.values()] = f32::NAN;
                    }
                    let width = equations.coefficients();
                    let mut beta = vec![1.0; points * width];
                    assert_eq!(equations.solve(system, &sums, &mut beta), spoilt, "{columns} {matrix:?} {points}");
                    assert!(beta.iter().all(|b| b.is_finite()));
                    for (row, beta) in sums.chunks_exact(equations.len()).zip(beta.chunks_exact(width)) {
                        let mut alone = vec![1.0; width];
                        equations.solve(system, row, &mut alone);
                        assert_eq!(alone, beta, "{columns} {matrix:?} {points}");
                    }
                }
            }
        }
    }

    #[test]
    fn systems_that_drop_a_column_are_counted_unless_it_is_zero() {
        let count = |matrix, ridge, column| {
            let (equations, sums) = rows(3, 11, 20, column);
            let mut beta = vec![7.0; 11 * equations.coefficients()];
            let count = equations.solve(System { matrix, ridge, shrink: 0.0 }, &sums, &mut beta);
            assert!(beta.iter().all(|b| b.is_finite()));
            count
        };
        for matrix in [Matrix::KnownMeans, Matrix::SampleMeans] {
            assert_eq!(count(matrix, 0.0, |c, _| c[2] = c[0] - 0.5 * c[1]), 11, "{matrix:?}");
            assert_eq!(count(matrix, 0.0, |c, u| c[2] = u), 0, "{matrix:?}");
            assert_eq!(count(matrix, 0.0, |c, _| c[2] = 0.0), 0, "{matrix:?}");
            // The penalty makes the columns linearly independent
            assert_eq!(count(matrix, 1.0, |c, _| c[2] = c[0] - 0.5 * c[1]), 0, "{matrix:?}");
        }
        assert_eq!([0.0, 1.0].map(|ridge| count(Matrix::SampleMeans, ridge, |c, _| c[2] = 1.5)), [11, 11]);
        assert_eq!(count(Matrix::KnownMeans, 0.0, |c, _| c[2] = 1.5), 0);
    }

    #[test]
    fn points_without_samples_and_without_columns_have_no_coefficients() {
        let equations = NormalEquations::new(3);
        let mut beta = vec![7.0; 9 * 9];
        assert_eq!(equations.solve(System::LEAST_SQUARES, &vec![0.0; 9 * equations.len()], &mut beta), 0);
        assert!(beta.iter().all(|b| *b == 0.0));
        assert_eq!(NormalEquations::new(0).solve(System::LEAST_SQUARES, &[0.0; 7], &mut []), 0);
    }
}
