//! The sums of the regression of y on the columns, and the estimate with β from them.

use super::ldlt::MAX_COMPONENTS;

/// Maximum number of samples: beyond it, the count would not be exact in f32, and sums remain unchanged.
const MAX_SAMPLES: f32 = 16_777_216.0;

/// Layout of the sums over samples in a slice of f32: Σ c_j c_k (k ≤ j, row by row), Σ c_j y (by column, then channel),
/// Σ c_j, Σ y, Σ y², and the number of samples.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct NormalEquations {
    m: usize,
}

impl NormalEquations {
    /// The equations of `components` columns, at most [`MAX_COMPONENTS`].
    pub fn new(components: usize) -> Self {
        assert!(components <= MAX_COMPONENTS, "at most {MAX_COMPONENTS} components");
        NormalEquations { m: components }
    }

    /// Number m of columns.
    pub fn components(self) -> usize {
        self.m
    }

    /// Number of sums.
    #[allow(clippy::len_without_is_empty)]
    pub fn len(self) -> usize {
        self.count() + 1
    }

    /// Number of coefficients: three for each column.
    pub fn coefficients(self) -> usize {
        3 * self.m
    }

    pub(super) fn products(self) -> usize {
        self.m * (self.m + 1) / 2
    }

    pub(super) fn columns(self) -> usize {
        self.products() + 3 * self.m
    }

    pub(super) fn values(self) -> usize {
        self.columns() + self.m
    }

    pub(super) fn count(self) -> usize {
        self.values() + 6
    }

    /// Number of added samples.
    pub fn samples(self, sums: &[f32]) -> f32 {
        sums[self.count()]
    }

    /// Σ c_j c_k.
    pub fn sum_of_products(self, sums: &[f32], j: usize, k: usize) -> f64 {
        let (j, k) = (j.max(k), j.min(k));
        f64::from(sums[j * (j + 1) / 2 + k])
    }

    /// Σ c_j.
    pub fn sum_of_column(self, sums: &[f32], j: usize) -> f64 {
        f64::from(sums[self.columns() + j])
    }

    /// Σ c_j y of a channel.
    pub fn sum_with_y(self, sums: &[f32], j: usize, channel: usize) -> f64 {
        f64::from(sums[self.products() + 3 * j + channel])
    }

    /// Σ y of a channel.
    pub fn sum_of_y(self, sums: &[f32], channel: usize) -> f64 {
        f64::from(sums[self.values() + channel])
    }

    /// Σ y² of a channel.
    pub fn sum_of_squares(self, sums: &[f32], channel: usize) -> f64 {
        f64::from(sums[self.values() + 3 + channel])
    }

    /// Adds a sample with the non-zero `columns`, given with ascending indices. A non-finite sample counts as y = 0 at
    /// the mean of the columns.
    #[inline]
    pub fn add_sparse(self, sums: &mut [f32], columns: &[(usize, f32)], y: [f32; 3]) {
        if sums[self.count()] >= MAX_SAMPLES {
            return;
        }
        sums[self.count()] += 1.0;
        if !(columns.iter().map(|(_, c)| c).chain(&y).all(|v| v.is_finite())) {
            return;
        }
        for (place, &(j, c)) in columns.iter().enumerate() {
            for &(k, other) in &columns[..=place] {
                sums[j * (j + 1) / 2 + k] += c * other;
            }
            for (sum, y) in sums[self.products() + 3 * j..][..3].iter_mut().zip(y) {
                *sum += c * y;
            }
            sums[self.columns() + j] += c;
        }
        for (i, y) in y.into_iter().enumerate() {
            sums[self.values() + i] += y;
            sums[self.values() + 3 + i] += y * y;
        }
    }

    /// Adds `count` samples of y = 0 in which only column `j` is non-zero, with the value `c`.
    pub fn add_zeros(self, sums: &mut [f32], j: usize, c: f32, count: u32) {
        let count = (count as f32).min(MAX_SAMPLES - sums[self.count()]);
        sums[self.count()] += count;
        if c.is_finite() {
            sums[j * (j + 1) / 2 + j] += count * c * c;
            sums[self.columns() + j] += count * c;
        }
    }

    /// Converts sums over columns r_j to columns s_j r_j.
    pub fn scale(self, sums: &mut [f32], scales: &[f32]) {
        for j in 0..self.m {
            for k in 0..=j {
                sums[j * (j + 1) / 2 + k] *= scales[j] * scales[k];
            }
            sums[self.products() + 3 * j..][..3].iter_mut().for_each(|sum| *sum *= scales[j]);
            sums[self.columns() + j] *= scales[j];
        }
    }

    /// Converts sums over columns r_j to columns r_j − I_j.
    pub fn centre(self, sums: &mut [f32], integrals: &[f32]) {
        let n = sums[self.count()];
        let (rest, y) = (self.columns(), self.values());
        for j in 0..self.m {
            let at = integrals[j];
            for k in 0..=j {
                let (sum_j, sum_k) = (sums[rest + j], sums[rest + k]);
                sums[j * (j + 1) / 2 + k] += n * at * integrals[k] - at * sum_k - integrals[k] * sum_j;
            }
            for i in 0..3 {
                sums[self.products() + 3 * j + i] -= at * sums[y + i];
            }
        }
        for (sum, integral) in sums[rest..rest + self.m].iter_mut().zip(integrals) {
            *sum -= n * integral;
        }
    }

    /// Adds the sums of other samples.
    pub fn merge(self, sums: &mut [f32], other: &[f32]) {
        if sums[self.count()] >= MAX_SAMPLES {
            return;
        }
        for (sum, other) in sums[..self.len()].iter_mut().zip(&other[..self.len()]) {
            *sum += other;
        }
    }

    /// ȳ, the estimate of multiple importance sampling; 0 without samples.
    pub fn mean(self, sums: &[f32]) -> [f32; 3] {
        let n = sums[self.count()];
        let y = &sums[self.values()..];
        if n > 0.0 { [y[0] / n, y[1] / n, y[2] / n] } else { [0.0; 3] }
    }

    /// ȳ − Σ_j β_j c̄_j, equation (7); 0 without samples.
    pub fn estimate(self, sums: &[f32], beta: &[f32]) -> [f32; 3] {
        let n = sums[self.count()];
        if !(n > 0.0) {
            return [0.0; 3];
        }
        let (c, y) = (&sums[self.columns()..self.values()], &sums[self.values()..]);
        std::array::from_fn(|i| {
            let control: f32 = c.iter().enumerate().map(|(j, c)| beta[3 * j + i] * c).sum();
            (y[i] - control) / n
        })
    }
}

#[cfg(test)]
mod tests {
    use super::super::solve::System;
    use super::*;
    use lumiris_test_support::random::{RngExt, pcg32};

    fn all(columns: &[f32]) -> Vec<(usize, f32)> {
        columns.iter().copied().enumerate().collect()
    }

    fn filled(m: usize, n: usize, y: impl Fn(&[f32]) -> [f32; 3]) -> (NormalEquations, Vec<f32>) {
        let equations = NormalEquations::new(m);
        let (mut sums, mut stream) = (vec![0.0; equations.len()], pcg32([7, 8, 9]));
        for _ in 0..n {
            let columns: Vec<f32> = (0..m).map(|_| stream.random::<f32>() - 0.5).collect();
            equations.add_sparse(&mut sums, &all(&columns), y(&columns));
        }
        (equations, sums)
    }

    #[test]
    fn coefficients_of_an_exact_combination_are_found_for_any_number_of_components() {
        for m in 0..=MAX_COMPONENTS {
            let combined = |c: &[f32]| [0, 1, 2].map(|i| c.iter().enumerate().map(|(j, c)| (j + i) as f32 * c).sum());
            let (equations, sums) = filled(m, 50, combined);
            let mut beta = vec![7.0; equations.coefficients()];
            assert_eq!(equations.solve(System::LEAST_SQUARES, &sums, &mut beta), 0);
            for (k, beta) in beta.iter().enumerate() {
                assert!((beta - (k / 3 + k % 3) as f32).abs() < 1e-4, "{m} {k} {beta}");
            }
            assert!(equations.estimate(&sums, &beta).iter().all(|e| e.abs() < 1e-5));
        }
    }

    #[test]
    fn sums_may_be_merged() {
        let y = |c: &[f32]| [c[0], 1.0, 2.0];
        let (equations, mut first) = filled(2, 30, y);
        let (_, second) = filled(2, 60, y);
        equations.merge(&mut first, &second);
        assert_eq!(equations.samples(&first), 90.0);
        assert_eq!(equations.mean(&first)[1..], [1.0, 2.0]);
        assert_eq!(equations.solve(System::LEAST_SQUARES, &first, &mut [0.0; 6]), 0);
    }

    #[test]
    fn what_is_not_finite_is_no_part_of_the_sums_and_huge_sums_are_reported() {
        let (equations, mut sums) = filled(2, 4, |_| [1.0; 3]);
        equations.add_sparse(&mut sums, &[(0, f32::NAN)], [1.0; 3]);
        equations.add_sparse(&mut sums, &[(1, 1.0)], [1.0, f32::INFINITY, 1.0]);
        assert_eq!(equations.mean(&sums), [4.0 / 6.0; 3]);
        let mut beta = [7.0; 6];
        assert_eq!(equations.solve(System::OTHER_SAMPLES, &sums, &mut beta), 0);
        equations.add_sparse(&mut sums, &[(0, 1e30), (1, 1.0)], [1.0; 3]);
        assert_eq!(equations.solve(System::OTHER_SAMPLES, &sums, &mut beta), 1);
        assert_eq!(beta, [0.0; 6]);
    }

    #[test]
    fn sparse_samples_centred_at_the_end_are_samples_added_one_by_one() {
        let equations = NormalEquations::new(4);
        let integrals = [0.3, 0.7, 0.25, 1e-3];
        let (mut dense, mut sparse) = (vec![0.0; equations.len()], vec![0.0; equations.len()]);
        let mut stream = pcg32([8, 8, 8]);
        let centred = |columns: &[(usize, f32)]| {
            let mut c = integrals.map(|i: f32| -i);
            columns.iter().for_each(|&(j, r)| c[j] += r);
            all(&c)
        };
        for i in 0..50 {
            let [a, b] = stream.random::<[f32; 2]>();
            let columns = [(0, a), (1, b), (2 + i % 2, 2.0 - a - b)];
            let y = [a + b, a * a, f32::from(u8::from(i % 3 == 0))];
            equations.add_sparse(&mut sparse, &columns, y);
            equations.add_sparse(&mut dense, &centred(&columns), y);
        }
        equations.add_zeros(&mut sparse, 2, 2.0, 7);
        (0..7).for_each(|_| equations.add_sparse(&mut dense, &centred(&[(2, 2.0)]), [0.0; 3]));
        equations.centre(&mut sparse, &integrals);
        for (a, b) in dense.iter().zip(&sparse) {
            assert!((a - b).abs() < 1e-4 * (1.0 + a.abs()), "{dense:?} {sparse:?}");
        }
    }
}
