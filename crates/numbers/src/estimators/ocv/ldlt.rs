//! Symmetric systems of up to [`MAX_COMPONENTS`] unknowns, by LDLᵀ with pivots.
//!
//! The pivot is the largest remaining diagonal element, relative to its original value. Once it falls to [`DEPENDENT`]
//! of that, the remaining columns are linearly dependent on the others within the rounding of the sums. They are
//! dropped (their unknowns are 0), which leaves a solution of the system if there is one.

/// Maximum number of components of a system.
pub const MAX_COMPONENTS: usize = 8;

/// The system has no usable solution, since something in it is not finite. The estimate is then MIS (β = 0).
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("the normal equations are ill-conditioned")]
pub struct IllConditioned;

/// Fraction of the diagonal below which a pivot is rounding and its column is dropped. The f32 sums have an error of
/// about 2⁻²⁴ √n.
pub const DEPENDENT: f64 = 1e-5;

/// A square matrix of the size of the largest system.
pub type Matrix = [[f64; MAX_COMPONENTS]; MAX_COMPONENTS];
/// Three right-hand sides or solutions.
pub type Columns = [[f64; MAX_COMPONENTS]; 3];

/// The factors of a symmetric positive semidefinite matrix.
#[derive(Clone, Copy, Debug)]
pub struct Factors {
    /// Rows and columns in the order of their pivots.
    order: [usize; MAX_COMPONENTS],
    /// Number of columns that are not dropped.
    rank: usize,
    /// Number of dropped columns that are not 0.
    dropped: usize,
    m: usize,
    /// D on the diagonal; L D below it, in pivot order, indexed by original rows and columns.
    a: Matrix,
}

impl Factors {
    /// Factorises the leading `m` rows and columns of `a`. An error if anything is not finite.
    pub fn new(m: usize, mut a: Matrix) -> Result<Factors, IllConditioned> {
        let scale: [f64; MAX_COMPONENTS] = std::array::from_fn(|i| if i < m { a[i][i] } else { 0.0 });
        let is_finite = a[..m].iter().all(|row| row[..m].iter().all(|v| v.is_finite()));
        if !is_finite {
            return Err(IllConditioned);
        }

        let mut order: [usize; MAX_COMPONENTS] = std::array::from_fn(|i| i);
        let relative = |a: &Matrix, i: usize| if scale[i] > 0.0 { a[i][i] / scale[i] } else { 0.0 };
        let mut rank = 0;
        while rank < m {
            let best = (rank..m).fold(rank, |b, k| if relative(&a, order[k]) > relative(&a, order[b]) { k } else { b });
            order.swap(rank, best);
            let pivot = order[rank];
            if !(relative(&a, pivot) > DEPENDENT) {
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
        let dropped = order[rank..m].iter().filter(|&&i| scale[i] > 0.0).count();
        Ok(Factors { order, rank, dropped, m, a })
    }

    /// Number of independent columns.
    pub fn rank(&self) -> usize {
        self.rank
    }

    /// Number of dropped columns that are not 0.
    pub fn dropped(&self) -> usize {
        self.dropped
    }

    /// x with A x = b in the remaining columns; 0 in the dropped ones.
    pub fn solve(&self, mut b: [f64; MAX_COMPONENTS]) -> [f64; MAX_COMPONENTS] {
        let (kept, a) = (&self.order[..self.rank], &self.a);
        for (k, &i) in kept.iter().enumerate() {
            for &j in &kept[k + 1..] {
                b[j] -= a[j][i] / a[i][i] * b[i];
            }
        }
        for (k, &i) in kept.iter().enumerate().rev() {
            let below: f64 = kept[k + 1..].iter().map(|&j| a[j][i] * b[j]).sum();
            b[i] = (b[i] - below) / a[i][i];
        }
        for &i in &self.order[self.rank..self.m] {
            b[i] = 0.0;
        }
        b
    }

    /// Trace of the inverse of A without the dropped columns.
    pub fn inverse_trace(&self) -> f64 {
        let diagonal = |&i: &usize| {
            let mut unit = [0.0; MAX_COMPONENTS];
            unit[i] = 1.0;
            self.solve(unit)[i]
        };
        self.order[..self.rank].iter().map(diagonal).sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use lumiris_test_support::random::{Pcg32, RngExt, pcg32};

    /// A = G Gᵀ with a random G of m rows and `rank` columns, and B = A X.
    fn system(m: usize, rank: usize, stream: &mut Pcg32) -> (Matrix, Columns) {
        let mut next = || f64::from(stream.random::<f32>()) - 0.5;
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
        let mut stream = pcg32([1, 2, 3]);
        for m in 0..=MAX_COMPONENTS {
            for rank in 0..=m {
                let (a, b) = system(m, rank, &mut stream);
                let factors = Factors::new(m, a).expect("it is not negative");
                assert_eq!(factors.rank(), rank, "m = {m}");
                assert_eq!(factors.dropped(), if rank > 0 { m - rank } else { 0 }, "m = {m}, rank {rank}");
                for b in &b {
                    let x = factors.solve(*b);
                    for i in 0..m {
                        let left: f64 = (0..m).map(|j| a[i][j] * x[j]).sum();
                        assert!((left - b[i]).abs() < 1e-6, "m = {m}, rank {rank}: {left} {}", b[i]);
                    }
                }
            }
        }
    }

    #[test]
    fn trace_of_the_inverse_is_that_of_a_diagonal_matrix() {
        let mut a = Matrix::default();
        (0..3).for_each(|i| a[i][i] = (i + 1) as f64);
        let trace = Factors::new(4, a).expect("it is not negative").inverse_trace();
        assert!((trace - (1.0 + 1.0 / 2.0 + 1.0 / 3.0)).abs() < 1e-12, "{trace}");
    }

    #[test]
    fn what_is_no_number_is_reported() {
        let mut a = Matrix::default();
        assert!(Factors::new(1, a).is_ok_and(|f| f.rank() == 0 && f.solve([1.0; MAX_COMPONENTS])[0] == 0.0));
        for wrong in [f64::NAN, f64::INFINITY] {
            a[0][0] = wrong;
            assert_eq!(Factors::new(1, a).err(), Some(IllConditioned));
        }
    }
}
