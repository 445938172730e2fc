//! Small symmetric systems of many shading points, a point per lane: the kernel of `estimators::ocv`, whose sums it reads.
//!
//! The sums of a point lie in a row: Σ c_j c_k (k ≤ j, row by row), Σ c_j y (by column, then channel), Σ c_j, Σ y, Σ y², n.
//! The factorisation is LDLᵀ without pivots. A column whose pivot is rounding is dropped.
//!
//! Lanes are arrays, of whose loops the compiler makes vector code: the loops over columns are too many to be unrolled for every
//! level of a dispatch.

use std::ops::{Add, AddAssign, Div, Mul, MulAssign, Sub, SubAssign};

/// Points that are solved together.
const LANES: usize = 8;

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
pub fn solve(system: &System, sums: &[f32], beta: &mut [f32]) -> usize {
    assert!(system.columns <= MOST, "at most {MOST} columns");
    if system.columns == 0 {
        return 0;
    }
    let (len, width) = (system.len(), 3 * system.columns);
    let points = sums.len() / len;
    let mut failed = 0;
    for first in (0..points).step_by(LANES) {
        let lanes = Lanes { sums, len, first, last: points - 1 };
        let (x, ok) = solve_lanes(&lanes, system);
        for p in 0..LANES.min(points - first) {
            for k in 0..width {
                beta[(first + p) * width + k] = x[k].0[p];
            }
            failed += usize::from(!ok[p]);
        }
    }
    failed
}

/// A number of each point.
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
    fn max(self, least: f32) -> F {
        self.zip(F::ZERO, |v, _| if v > least { v } else { least })
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

/// Sums of [`LANES`] points from `first` on; past the `last` one, of that one.
struct Lanes<'a> {
    sums: &'a [f32],
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
}

/// Coefficients by column and channel, and where they are finite.
fn solve_lanes(lanes: &Lanes<'_>, system: &System) -> ([F; 3 * MOST], [bool; LANES]) {
    let m = system.columns;
    let (zero, one) = (F::ZERO, F::ONE);
    let [_, _, values] = offsets(m);
    let n = lanes.get(values + 6);
    let per_n = one / n.max(1.0);
    let (a, b) = assemble(lanes, system, per_n);
    let factors = factorise(m, &a, system.ridge);
    let left = n - 1.0 - factors.effective(m, system.ridge);

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
    (x, ok)
}

/// Where Σ c_j y, Σ c_j and Σ y begin.
pub fn offsets(m: usize) -> [usize; 3] {
    let mixed = m * (m + 1) / 2;
    [mixed, mixed + 3 * m, mixed + 4 * m]
}

/// The lower triangle of a matrix.
type Triangle = [[F; MOST]; MOST];

/// The matrix without ridge, and three right-hand sides.
fn assemble(lanes: &Lanes<'_>, system: &System, per_n: F) -> (Triangle, [[F; MOST]; 3]) {
    let (m, zero) = (system.columns, F::ZERO);
    let [mixed, means, values] = offsets(m);
    let (mut a, mut b) = ([[zero; MOST]; MOST], [[zero; MOST]; 3]);
    let mut at = 0;
    for j in 0..m {
        let mean = lanes.get(means + j) * per_n;
        for k in 0..=j {
            a[j][k] = lanes.get(at);
            if system.matrix == Matrix::SampleMeans {
                let centred = a[j][k] - mean * lanes.get(means + k);
                let is_constant = a[j][k] * CONSTANT;
                a[j][k] =
                    if j == k { centred.zip(is_constant, |c, least| if c < least { 0.0 } else { c }) } else { centred };
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
struct Factors {
    l: Triangle,
    per_d: [F; MOST],
}

fn factorise(m: usize, a: &Triangle, ridge: f32) -> Factors {
    let (zero, one) = (F::ZERO, F::ONE);
    let (mut l, mut d, mut per_d) = ([[zero; MOST]; MOST], [zero; MOST], [zero; MOST]);
    for j in 0..m {
        let diagonal = a[j][j] + ridge;
        let mut pivot = diagonal;
        for k in 0..j {
            pivot -= l[j][k] * l[j][k] * d[k];
        }
        let least = diagonal * DEPENDENT;
        d[j] = pivot.where_greater(pivot, least);
        per_d[j] = (one / pivot).where_greater(pivot, least);
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
    /// L D Lᵀ x = b, 0 for columns that were dropped.
    fn solve(&self, m: usize, b: &[F; MOST]) -> [F; MOST] {
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
    fn effective(&self, m: usize, ridge: f32) -> F {
        let (zero, one) = (F::ZERO, F::ONE);
        let (mut rank, mut trace) = (zero, zero);
        for c in 0..m {
            rank += one.where_greater(self.per_d[c], zero);
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
