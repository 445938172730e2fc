//! Small symmetric systems of many shading points, a point per lane: the kernel of `estimators::ocv`, whose sums it reads.
//!
//! The sums of a point lie in a row: Σ c_j c_k (k ≤ j, row by row), Σ c_j y (by column, then channel), Σ c_j, Σ y, Σ y², n.
//! The factorisation is LDLᵀ without pivots. A column whose pivot is rounding is dropped.

use super::lane::{F, LANES, M, or_zero, store};
use fearless_simd::{Level, Simd, dispatch, prelude::*};

/// Most columns.
const MOST: usize = 8;

/// Part of its diagonal below which a pivot is rounding.
const DEPENDENT: f32 = 1e-5;

/// Part of Σ c² below which Σ (c − c̄)² is rounding.
const CONSTANT: f32 = 1e-6;

/// Which system is made of the sums.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Matrix {
    /// Σ c_j c_k: columns of mean 0.
    KnownMeans,
    /// Σ (c_j − c̄_j)(c_k − c̄_k).
    SampleMeans,
    /// Σ c_j c_k with a column of ones in place of the last one.
    Intercept,
}

/// The system of a point and how its solution is held back; see `estimators::ocv::Penalty`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct System {
    /// Number of columns, at most 8.
    pub columns: usize,
    /// The matrix.
    pub matrix: Matrix,
    /// λ, which is added to the diagonal.
    pub ridge: f32,
    /// κ of the factor max(0, 1 − κ σ² p/T); 0 is no factor.
    pub shrink: f32,
}

impl System {
    /// Number of sums of a point.
    #[allow(clippy::len_without_is_empty)]
    pub fn len(&self) -> usize {
        self.columns * (self.columns + 1) / 2 + 4 * self.columns + 7
    }
}

/// Solves the system of each point of `sums` and writes `beta[3 columns · point + 3 j + channel]`, 0 where a solution is not
/// finite. Returns the number of these.
pub fn solve(level: Level, system: &System, sums: &[f32], beta: &mut [f32]) -> usize {
    assert!(system.columns <= MOST, "at most {MOST} columns");
    if system.columns == 0 { 0 } else { dispatch!(level, simd => solve_points(simd, system, sums, beta)) }
}

#[inline(always)]
fn solve_points<S: Simd>(simd: S, system: &System, sums: &[f32], beta: &mut [f32]) -> usize {
    let (len, width) = (system.len(), 3 * system.columns);
    let points = sums.len() / len;
    let mut failed = 0;
    for first in (0..points).step_by(LANES) {
        let lanes = Lanes { simd, sums, len, first, last: points - 1 };
        let (x, ok) = solve_lanes(&lanes, system);
        let mut row = [0.0; LANES];
        let filled = LANES.min(points - first);
        for k in 0..width {
            store(x[k], &mut row, 0);
            for p in 0..filled {
                beta[(first + p) * width + k] = row[p];
            }
        }
        store(or_zero(ok, F::splat(simd, 1.0)), &mut row, 0);
        for good in &row[..filled] {
            failed += usize::from(*good == 0.0);
        }
    }
    failed
}

/// Sums of [`LANES`] points from `first` on; past the `last` one, of that one.
struct Lanes<'a, S> {
    simd: S,
    sums: &'a [f32],
    len: usize,
    first: usize,
    last: usize,
}

impl<S: Simd> Lanes<'_, S> {
    #[inline(always)]
    fn get(&self, k: usize) -> F<S> {
        let mut v = [0.0; LANES];
        for p in 0..LANES {
            v[p] = self.sums[(self.first + p).min(self.last) * self.len + k];
        }
        F::from_slice(self.simd, &v)
    }
}

/// Coefficients by column and channel, and where they are finite.
#[inline(always)]
fn solve_lanes<S: Simd>(lanes: &Lanes<'_, S>, system: &System) -> ([F<S>; 3 * MOST], M<S>) {
    let (m, simd) = (system.columns, lanes.simd);
    let (zero, one) = (F::splat(simd, 0.0), F::splat(simd, 1.0));
    let [_, _, values] = offsets(m);
    let n = lanes.get(values + 6);
    let per_n = one / n.max(1.0);
    let (a, b) = assemble(lanes, system, per_n);
    let factors = factorise(simd, m, &a, system.ridge);
    let left = n - 1.0 - factors.effective(simd, m, system.ridge);

    let mut x = [zero; 3 * MOST];
    // What is not finite in the system or in a solution makes this NaN, whatever is dropped or shrunk to 0.
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
            factor = or_zero(explained.simd_gt(zero) & left.simd_gt(F::splat(simd, 0.5)), shrunk);
        }
        for j in 0..m {
            sum += (solution[j] + b[i][j]) * 0.0;
            x[3 * j + i] = solution[j] * factor;
            sum += x[3 * j + i] * 0.0;
        }
    }
    let ok = sum.is_finite();
    for x in &mut x[..3 * m] {
        *x = or_zero(ok, *x);
    }
    (x, ok)
}

/// Where Σ c_j y, Σ c_j and Σ y begin.
#[inline(always)]
fn offsets(m: usize) -> [usize; 3] {
    let mixed = m * (m + 1) / 2;
    [mixed, mixed + 3 * m, mixed + 4 * m]
}

/// The lower triangle of a matrix.
type Triangle<S> = [[F<S>; MOST]; MOST];

/// The matrix without ridge, and three right-hand sides.
#[inline(always)]
fn assemble<S: Simd>(lanes: &Lanes<'_, S>, system: &System, per_n: F<S>) -> (Triangle<S>, [[F<S>; MOST]; 3]) {
    let (m, zero) = (system.columns, F::splat(lanes.simd, 0.0));
    let [mixed, means, values] = offsets(m);
    let (mut a, mut b) = ([[zero; MOST]; MOST], [[zero; MOST]; 3]);
    let mut at = 0;
    for j in 0..m {
        let mean = lanes.get(means + j) * per_n;
        for k in 0..=j {
            a[j][k] = lanes.get(at);
            if system.matrix == Matrix::SampleMeans {
                let centred = a[j][k] - mean * lanes.get(means + k);
                let is_constant = centred.simd_lt(a[j][k] * CONSTANT);
                a[j][k] = if j == k { is_constant.select(zero, centred) } else { centred };
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
        a[m - 1][m - 1] = lanes.get(values + 6);
        for i in 0..3 {
            b[i][m - 1] = lanes.get(values + i);
        }
    }
    (a, b)
}

/// L below the diagonal, and 1/D, which is 0 for columns that are dropped.
struct Factors<S: Simd> {
    l: Triangle<S>,
    per_d: [F<S>; MOST],
}

#[inline(always)]
fn factorise<S: Simd>(simd: S, m: usize, a: &Triangle<S>, ridge: f32) -> Factors<S> {
    let (zero, one) = (F::splat(simd, 0.0), F::splat(simd, 1.0));
    let (mut l, mut d, mut per_d) = ([[zero; MOST]; MOST], [zero; MOST], [zero; MOST]);
    for j in 0..m {
        let diagonal = a[j][j] + ridge;
        let mut pivot = diagonal;
        for k in 0..j {
            pivot -= l[j][k] * l[j][k] * d[k];
        }
        let is_kept = pivot.simd_gt(diagonal * DEPENDENT);
        d[j] = or_zero(is_kept, pivot);
        per_d[j] = or_zero(is_kept, one / pivot);
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

impl<S: Simd> Factors<S> {
    /// L D Lᵀ x = b, 0 for columns that were dropped.
    #[inline(always)]
    fn solve(&self, m: usize, b: &[F<S>; MOST]) -> [F<S>; MOST] {
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

    /// rank − λ tr A⁻¹, by the columns of L⁻¹.
    #[inline(always)]
    fn effective(&self, simd: S, m: usize, ridge: f32) -> F<S> {
        let (zero, one) = (F::splat(simd, 0.0), F::splat(simd, 1.0));
        let (mut rank, mut trace) = (zero, zero);
        for c in 0..m {
            rank += or_zero(self.per_d[c].simd_gt(zero), one);
            let mut v = [zero; MOST];
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
    use crate::math::hash::HashStream;
    use crate::simd::test_support::{LENGTHS, assert_same_bits};

    /// Sums of `n` samples of each of `points`.
    fn sums(system: &System, points: usize, n: usize) -> Vec<f32> {
        let (m, len) = (system.columns, system.len());
        let [mixed, means, values] = offsets(m);
        let (mut sums, mut stream) = (vec![0.0; points * len], HashStream::new([m as u32, n as u32, 3]));
        for row in sums.chunks_exact_mut(len) {
            for _ in 0..n {
                let c: Vec<f32> = (0..m).map(|_| 2.0 * stream.next_f32() - 1.0).collect();
                let y: [f32; 3] = std::array::from_fn(|i| 1.0 + c[i % m] + stream.next_f32());
                let mut at = 0;
                for j in 0..m {
                    (0..=j).for_each(|k| row[at + k] += c[j] * c[k]);
                    at += j + 1;
                    (0..3).for_each(|i| row[mixed + 3 * j + i] += c[j] * y[i]);
                    row[means + j] += c[j];
                }
                (0..3).for_each(|i| row[values + i] += y[i]);
                (0..3).for_each(|i| row[values + 3 + i] += y[i] * y[i]);
                row[values + 6] += 1.0;
            }
        }
        sums
    }

    #[test]
    fn solutions_are_the_same_at_all_levels_and_what_is_not_finite_is_counted() {
        for columns in [1, 3, 5, 8] {
            for matrix in [Matrix::KnownMeans, Matrix::SampleMeans, Matrix::Intercept] {
                for points in LENGTHS {
                    let system = System { columns, matrix, ridge: 1.5, shrink: 1.0 };
                    let mut sums = sums(&system, points, 7);
                    let spoilt = (points > 2) as usize;
                    if spoilt > 0 {
                        sums[2 * system.len() + offsets(columns)[2]] = f32::NAN;
                    }
                    assert_same_bits::<1>(points * 3 * columns, |level, [beta]| {
                        assert_eq!(solve(level, &system, &sums, beta), spoilt, "{columns} {matrix:?} {points}");
                        assert!(beta.iter().all(|b| b.is_finite()));
                    });
                }
            }
        }
    }

    #[test]
    fn points_without_samples_and_without_columns_have_no_coefficients() {
        let system = System { columns: 3, matrix: Matrix::SampleMeans, ridge: 0.0, shrink: 0.0 };
        let mut beta = vec![7.0; 9 * 9];
        assert_eq!(solve(super::super::level(), &system, &vec![0.0; 9 * system.len()], &mut beta), 0);
        assert!(beta.iter().all(|b| *b == 0.0));
        let none = System { columns: 0, ..system };
        assert_eq!(solve(super::super::level(), &none, &[0.0; 7], &mut []), 0);
    }
}
