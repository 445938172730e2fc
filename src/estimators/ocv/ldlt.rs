//! Symmetric systems A X = B of up to [`MAX_COMPONENTS`] unknowns and three right-hand sides, by LDLᵀ with pivots.
//!
//! The pivot is the largest remaining diagonal, relative to its original value. Where it has fallen to [`DEPENDENT`] of
//! that, the columns that remain depend on the others as far as rounding of the sums can tell: they are dropped (their
//! unknowns are 0), which leaves a solution of the system if there is one.

use super::normal::{IllConditioned, MAX_COMPONENTS};

/// Part of its diagonal below which a pivot is rounding: a column is dropped. The sums are f32 with about 2⁻²⁴ √n of error.
pub const DEPENDENT: f64 = 1e-5;

/// A square matrix of the size of the largest system.
pub type Matrix = [[f64; MAX_COMPONENTS]; MAX_COMPONENTS];
/// Three right-hand sides or solutions.
pub type Columns = [[f64; MAX_COMPONENTS]; 3];

/// Solves A X = B in place for the leading `m` unknowns, A symmetric and not negative (both triangles are read); returns
/// the rank. An error if a diagonal is negative or anything is not finite.
pub fn solve(m: usize, a: &mut Matrix, x: &mut Columns) -> Result<usize, IllConditioned> {
    let scale: [f64; MAX_COMPONENTS] = std::array::from_fn(|i| if i < m { a[i][i] } else { 0.0 });
    if !scale.iter().all(|s| *s >= 0.0 && s.is_finite()) {
        return Err(IllConditioned);
    }

    // Factorise, the rows in the order of their pivots; L below the diagonal, D on it.
    let mut order: [usize; MAX_COMPONENTS] = std::array::from_fn(|i| i);
    let relative = |a: &Matrix, i: usize| if scale[i] > 0.0 { a[i][i] / scale[i] } else { 0.0 };
    let mut rank = 0;
    while rank < m {
        let best = (rank..m).fold(rank, |b, k| if relative(a, order[k]) > relative(a, order[b]) { k } else { b });
        order.swap(rank, best);
        let pivot = order[rank];
        if !(relative(a, pivot) > DEPENDENT) {
            break;
        }
        for k in rank + 1..m {
            let i = order[k];
            let factor = a[i][pivot] / a[pivot][pivot];
            for &j in &order[rank + 1..=k] {
                a[i][j] -= factor * a[j][pivot];
                a[j][i] = a[i][j];
            }
        }
        rank += 1;
    }

    for b in x.iter_mut() {
        substitute(&order[..m], rank, a, b);
    }
    let is_finite = x.iter().all(|b| b.iter().all(|v| v.is_finite()));
    if is_finite { Ok(rank) } else { Err(IllConditioned) }
}

/// Solves for one right-hand side with the factors of [`solve`]: column `pivot` of `a` below the diagonal holds L D.
fn substitute(order: &[usize], rank: usize, a: &Matrix, b: &mut [f64; MAX_COMPONENTS]) {
    for (k, &i) in order[..rank].iter().enumerate() {
        for &j in &order[k + 1..rank] {
            b[j] -= a[j][i] / a[i][i] * b[i];
        }
    }
    for k in (0..rank).rev() {
        let i = order[k];
        let below: f64 = order[k + 1..rank].iter().map(|&j| a[j][i] * b[j]).sum();
        b[i] = (b[i] - below) / a[i][i];
    }
    for &i in &order[rank..] {
        b[i] = 0.0;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::hash::HashStream;

    /// A = G Gᵀ with G of m rows and `rank` columns, no two of which are alike, and B = A X.
    fn system(m: usize, rank: usize, stream: &mut HashStream) -> (Matrix, Columns) {
        let mut next = || f64::from(stream.next_f32()) - 0.5;
        let g: Vec<Vec<f64>> =
            (0..m).map(|i| (0..rank).map(|k| next() + f64::from(u8::from(i == k))).collect()).collect();
        let (mut a, mut b) = (Matrix::default(), Columns::default());
        for i in 0..m {
            for j in 0..m {
                a[i][j] = (0..rank).map(|k| g[i][k] * g[j][k]).sum();
            }
        }
        for column in &mut b {
            let x: Vec<f64> = (0..m).map(|_| next()).collect();
            for i in 0..m {
                column[i] = (0..m).map(|j| a[i][j] * x[j]).sum();
            }
        }
        (a, b)
    }

    #[test]
    fn systems_of_any_rank_are_solved() {
        let mut stream = HashStream::new([1, 2, 3]);
        for m in 0..=MAX_COMPONENTS {
            for rank in 0..=m {
                let (a, b) = system(m, rank, &mut stream);
                let (mut factors, mut x) = (a, b);
                assert_eq!(solve(m, &mut factors, &mut x), Ok(rank), "m = {m}");
                for (x, b) in x.iter().zip(&b) {
                    for i in 0..m {
                        let left: f64 = (0..m).map(|j| a[i][j] * x[j]).sum();
                        assert!((left - b[i]).abs() < 1e-6, "m = {m}, rank {rank}: {left} {}", b[i]);
                    }
                }
            }
        }
    }

    #[test]
    fn what_is_no_number_is_reported() {
        let (mut a, mut b) = (Matrix::default(), Columns::default());
        a[0][0] = f64::NAN;
        assert_eq!(solve(1, &mut a, &mut b), Err(IllConditioned));
        a[0][0] = -1.0;
        assert_eq!(solve(1, &mut a, &mut b), Err(IllConditioned));
        (a[0][0], b[2][0]) = (1.0, f64::INFINITY);
        assert_eq!(solve(1, &mut a, &mut b), Err(IllConditioned));
    }
}
