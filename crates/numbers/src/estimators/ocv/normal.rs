//! The sums of the regression of y on the columns, and β from them.

use super::ldlt::{Columns, Factors, IllConditioned, MAX_COMPONENTS, Matrix};

/// Samples after which the sums stay as they are: the count would no longer be exact in f32.
const MOST_SAMPLES: f32 = 16_777_216.0;

/// Part of Σ c² below which Σ (c − c̄)² is rounding: the column is constant and takes no part.
const CONSTANT: f64 = 1e-6;

/// How coefficients of few samples are held back: β = 0 is MIS, and so is every multiple of α.
///
/// The columns c_j are dimensionless and of order one, so that the ridge is a number of samples, and scaling f scales β.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Penalty {
    /// λ of λ Σ β_j², in samples whose columns have a mean square of one.
    pub ridge: f32,
    /// The system is Σ c_j c_k, which uses that the columns are known to have mean 0; else it is centred with the means of
    /// the samples, as in a regression with an intercept.
    pub known_means: bool,
    /// κ of the factor max(0, 1 − κ σ² p/T) of each channel [James and Stein 1961]: T is what β explains of the sum of
    /// squares of y, p = tr (C + λ1)⁻¹C the number of effective coefficients, and σ² what is not explained, by degree of
    /// freedom n − 1 − p. 0 is no factor.
    pub shrink: f32,
}

impl Penalty {
    /// Plain least squares with an intercept.
    pub const NONE: Penalty = Penalty { ridge: 0.0, known_means: false, shrink: 0.0 };

    /// For β that is applied to the samples it was fitted to.
    pub const SAME_SAMPLES: Penalty = Penalty { ridge: 1.0, known_means: false, shrink: 0.0 };
}

impl Default for Penalty {
    /// For β that is applied to other samples. Chosen by measurement, see `docs/measurements/ocv`: the smallest that keeps the
    /// first four passes within 2 % of MIS where nothing is to be gained.
    fn default() -> Self {
        Penalty { ridge: 4.0, known_means: true, shrink: 1.0 }
    }
}

/// Where the sums over samples lie in a slice of f32: Σ c_j c_k (k ≤ j, row by row), Σ c_j y (by column, then channel),
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

    fn products(self) -> usize {
        self.m * (self.m + 1) / 2
    }

    fn columns(self) -> usize {
        self.products() + 3 * self.m
    }

    fn values(self) -> usize {
        self.columns() + self.m
    }

    fn count(self) -> usize {
        self.values() + 6
    }

    /// Number of samples that were added.
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

    /// Adds a sample. One that is not finite is counted as y = 0 at the mean of the columns.
    #[inline]
    pub fn add(self, sums: &mut [f32], columns: &[f32], y: [f32; 3]) {
        let (sums, columns) = (&mut sums[..self.len()], &columns[..self.m]);
        if sums[self.count()] >= MOST_SAMPLES {
            return;
        }
        sums[self.count()] += 1.0;
        match self.m {
            0 => accumulate::<0>(sums, columns, y),
            1 => accumulate::<1>(sums, columns, y),
            2 => accumulate::<2>(sums, columns, y),
            3 => accumulate::<3>(sums, columns, y),
            4 => accumulate::<4>(sums, columns, y),
            5 => accumulate::<5>(sums, columns, y),
            6 => accumulate::<6>(sums, columns, y),
            7 => accumulate::<7>(sums, columns, y),
            _ => accumulate::<MAX_COMPONENTS>(sums, columns, y),
        }
    }

    /// Adds a sample whose columns are 0 but for `columns`, by their indices, which ascend; otherwise as [`add`](Self::add).
    #[inline]
    pub fn add_sparse(self, sums: &mut [f32], columns: &[(usize, f32)], y: [f32; 3]) {
        if sums[self.count()] >= MOST_SAMPLES {
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

    /// Adds `count` samples of y = 0 whose columns are 0 but for column `j`.
    pub fn add_zeros(self, sums: &mut [f32], (j, c): (usize, f32), count: u32) {
        let count = (count as f32).min(MOST_SAMPLES - sums[self.count()]);
        sums[self.count()] += count;
        if c.is_finite() {
            sums[j * (j + 1) / 2 + j] += count * c * c;
            sums[self.columns() + j] += count * c;
        }
    }

    /// Makes sums of columns s_j r_j of those of columns r_j.
    pub fn scale(self, sums: &mut [f32], scales: &[f32]) {
        for j in 0..self.m {
            for k in 0..=j {
                sums[j * (j + 1) / 2 + k] *= scales[j] * scales[k];
            }
            sums[self.products() + 3 * j..][..3].iter_mut().for_each(|sum| *sum *= scales[j]);
            sums[self.columns() + j] *= scales[j];
        }
    }

    /// Makes sums of columns r_j − I_j of those of columns r_j.
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
        if sums[self.count()] >= MOST_SAMPLES {
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

    /// Coefficients of the regression of y on the columns, `beta[3 j + channel]`; all 0 on error.
    pub fn solve(self, sums: &[f32], penalty: Penalty, beta: &mut [f32]) -> Result<(), IllConditioned> {
        let beta = &mut beta[..self.coefficients()];
        let result = self.try_solve(sums, penalty, beta);
        if result.is_err() {
            beta.fill(0.0);
        }
        result
    }

    fn try_solve(self, sums: &[f32], penalty: Penalty, beta: &mut [f32]) -> Result<(), IllConditioned> {
        let n = f64::from(sums[self.count()]);
        if n == 0.0 {
            beta.fill(0.0);
            return Ok(());
        }
        let (mut a, b) = self.system(&sums[..self.len()], n, penalty.known_means);
        let ridge = f64::from(penalty.ridge);
        for (j, row) in a.iter_mut().enumerate().take(self.m) {
            row[j] += ridge;
        }
        let factors = Factors::new(self.m, a)?;
        let effective = factors.rank() as f64 - ridge * factors.inverse_trace();
        for (i, b) in b.iter().enumerate() {
            let x = factors.solve(*b);
            let mut factor = 1.0;
            if penalty.shrink > 0.0 {
                let dot = |b: &[f64]| b.iter().zip(&x).map(|(b, x)| b * x).sum::<f64>();
                let explained = dot(b) + ridge * dot(&x);
                let total = self.sum_of_squares(sums, i) - self.sum_of_y(sums, i) * self.sum_of_y(sums, i) / n;
                factor = shrink_factor(f64::from(penalty.shrink), n - 1.0, effective, explained, total);
            }
            for (beta, x) in beta.chunks_exact_mut(3).zip(x) {
                beta[i] = (factor * x) as f32;
            }
        }
        if beta.iter().all(|b| b.is_finite()) { Ok(()) } else { Err(IllConditioned) }
    }

    /// Σ c_j c_k, less n c̄_j c̄_k where the means are not known, and Σ (c_j − c̄_j) y.
    fn system(self, sums: &[f32], n: f64, known_means: bool) -> (Matrix, Columns) {
        let (mut a, mut b) = (Matrix::default(), Columns::default());
        for j in 0..self.m {
            let mean = self.sum_of_column(sums, j) / n;
            for k in 0..=j {
                let centre = if known_means { 0.0 } else { mean * self.sum_of_column(sums, k) };
                a[j][k] = self.sum_of_products(sums, j, k) - centre;
                a[k][j] = a[j][k];
            }
            if a[j][j] < CONSTANT * self.sum_of_products(sums, j, j) {
                a[j][j] = 0.0;
            }
            for (i, b) in b.iter_mut().enumerate() {
                b[j] = self.sum_with_y(sums, j, i) - mean * self.sum_of_y(sums, i);
            }
        }
        (a, b)
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

/// Adds a sample to all sums but the count, with loops of known length; nothing if it is not finite.
#[inline(always)]
fn accumulate<const M: usize>(sums: &mut [f32], columns: &[f32], y: [f32; 3]) {
    let Some(c) = columns.first_chunk::<M>() else { return };
    let mut probe = (y[0] + y[1] + y[2]) * 0.0;
    for c in c {
        probe += c * 0.0;
    }
    // ∞ · 0 and NaN · 0 are NaN; y whose sum overflows is of no use either.
    if probe.is_nan() {
        return;
    }
    let sums = &mut sums[..M * (M + 1) / 2 + 4 * M + 7];
    let mut at = 0;
    for j in 0..M {
        for k in 0..=j {
            sums[at] += c[j] * c[k];
            at += 1;
        }
    }
    for c in c {
        for y in y {
            sums[at] += c * y;
            at += 1;
        }
    }
    for c in c {
        sums[at] += c;
        at += 1;
    }
    for y in y {
        sums[at] += y;
        sums[at + 3] += y * y;
        at += 1;
    }
}

/// max(0, 1 − κ σ² p/T), see [`Penalty::shrink`]; 0 if fewer than half a degree of freedom is left for σ².
fn shrink_factor(kappa: f64, freedom: f64, effective: f64, explained: f64, total: f64) -> f64 {
    let left = freedom - effective;
    if !(explained > 0.0 && left > 0.5) {
        return 0.0;
    }
    let variance = (total - explained).max(0.0) / left;
    (1.0 - kappa * effective * variance / explained).max(0.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::hash::HashStream;

    fn filled(m: usize, n: usize, y: impl Fn(&[f32]) -> [f32; 3]) -> (NormalEquations, Vec<f32>) {
        let equations = NormalEquations::new(m);
        let (mut sums, mut stream) = (vec![0.0; equations.len()], HashStream::new([7, 8, 9]));
        for _ in 0..n {
            let columns: Vec<f32> = (0..m).map(|_| stream.next_f32() - 0.5).collect();
            equations.add(&mut sums, &columns, y(&columns));
        }
        (equations, sums)
    }

    #[test]
    fn coefficients_of_an_exact_combination_are_found_for_any_number_of_components() {
        for m in 0..=MAX_COMPONENTS {
            let combined = |c: &[f32]| [0, 1, 2].map(|i| c.iter().enumerate().map(|(j, c)| (j + i) as f32 * c).sum());
            let (equations, sums) = filled(m, 50, combined);
            let mut beta = vec![7.0; equations.coefficients()];
            equations.solve(&sums, Penalty::NONE, &mut beta).expect("the columns are independent");
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
        equations.solve(&first, Penalty::NONE, &mut [0.0; 6]).expect("the columns are independent");
    }

    #[test]
    fn what_is_not_finite_is_no_part_of_the_sums_and_huge_sums_are_reported() {
        let (equations, mut sums) = filled(2, 4, |_| [1.0; 3]);
        equations.add(&mut sums, &[f32::NAN, 0.0], [1.0; 3]);
        equations.add(&mut sums, &[0.0, 1.0], [1.0, f32::INFINITY, 1.0]);
        assert_eq!(equations.mean(&sums), [4.0 / 6.0; 3]);
        let mut beta = [7.0; 6];
        assert_eq!(equations.solve(&sums, Penalty::default(), &mut beta), Ok(()));
        equations.add(&mut sums, &[1e30, 1.0], [1.0; 3]);
        assert_eq!(equations.solve(&sums, Penalty::default(), &mut beta), Err(IllConditioned));
        assert_eq!(beta, [0.0; 6]);
    }

    #[test]
    fn sparse_samples_centred_at_the_end_are_samples_added_one_by_one() {
        let equations = NormalEquations::new(4);
        let integrals = [0.3, 0.7, 0.25, 1e-3];
        let (mut dense, mut sparse) = (vec![0.0; equations.len()], vec![0.0; equations.len()]);
        let mut stream = HashStream::new([8, 8, 8]);
        let centred = |columns: &[(usize, f32)]| {
            let mut c = integrals.map(|i: f32| -i);
            columns.iter().for_each(|&(j, r)| c[j] += r);
            c
        };
        for i in 0..50 {
            let [a, b] = stream.next_2d();
            let columns = [(0, a), (1, b), (2 + i % 2, 2.0 - a - b)];
            let y = [a + b, a * a, f32::from(u8::from(i % 3 == 0))];
            equations.add_sparse(&mut sparse, &columns, y);
            equations.add(&mut dense, &centred(&columns), y);
        }
        equations.add_zeros(&mut sparse, (2, 2.0), 7);
        (0..7).for_each(|_| equations.add(&mut dense, &centred(&[(2, 2.0)]), [0.0; 3]));
        equations.centre(&mut sparse, &integrals);
        for (a, b) in dense.iter().zip(&sparse) {
            assert!((a - b).abs() < 1e-4 * (1.0 + a.abs()), "{dense:?} {sparse:?}");
        }
    }
}
