//! Piecewise-constant densities over [0, 1] and [0, 1]², sampled by inversion [Pharr et al. 2023, §A.4.7, §A.5.6].
//!
//! Sums are in f64; the tables are f32. A bin of value 0 is never sampled; a function of zeros has no samples.
//!
//! A guide table [Chen and Asau 1974] accelerates the inversion: for each of G equal parts of [0, 1), it stores the bin
//! of its beginning. From there, bins are skipped sixteen at a time, on average less than once: a branch that waited for
//! the table would have to be predicted.

use super::{ONE_MINUS_EPSILON, Vec2};

/// A point sampled from a [`PiecewiseConstant1D`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sample1D {
    /// The point, in [0, 1).
    pub x: f32,
    /// Density at `x` per unit length.
    pub pdf: f32,
    /// The bin that holds `x`.
    pub index: usize,
}

/// A point sampled from a [`PiecewiseConstant2D`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sample2D {
    /// The point, in [0, 1)².
    pub p: Vec2,
    /// Density at `p` per unit area of the square.
    pub pdf: f32,
}

/// Index of the bin of `x` among `n`.
#[inline]
pub(super) fn bin_of(x: f32, n: usize) -> usize {
    ((x * n as f32) as usize).min(n - 1)
}

/// Number of bins skipped at a time.
pub const STEP: usize = 16;

/// Length of the table of a running integral over `n` bins: n + 1 values, and padding for reads beyond the end.
const fn cdf_len(n: usize) -> usize {
    n + 1 + STEP
}

/// Length of the guide over `n` bins: a power of two, so that the multiplication by it is exact.
const fn guide_len(n: usize) -> usize {
    n.div_ceil(4).next_power_of_two()
}

/// Writes the running integral of `values`, normalised to end at 1, into `cdf`, and its guide; returns the integral.
fn fill_cdf(values: &[f32], cdf: &mut [f32], guide: &mut [u16]) -> f64 {
    let sum: f64 = values.iter().map(|&v| f64::from(v)).sum();
    let mut running = 0.0_f64;
    for (c, &v) in cdf.iter_mut().zip(values) {
        *c = if sum > 0.0 { (running / sum) as f32 } else { 0.0 };
        running += f64::from(v);
    }
    let n = values.len();
    cdf[n] = if sum > 0.0 { 1.0 } else { 0.0 };
    cdf[n + 1..].fill(f32::INFINITY);
    let parts = guide.len() as f32;
    let mut bin = 0;
    for (part, first) in guide.iter_mut().enumerate() {
        while bin + 1 < n && cdf[bin + 1] <= part as f32 / parts {
            bin += 1;
        }
        // A bin that is too low costs steps but is correct.
        *first = bin.min(usize::from(u16::MAX)) as u16;
    }
    sum / n as f64
}

/// The bin of a running integral that contains a number.
#[derive(Clone, Copy, Debug)]
pub struct Bin {
    /// Index.
    pub index: usize,
    /// The running integral at its beginning, at most the number.
    pub begin: f32,
    /// The running integral at its end, more than the number.
    pub end: f32,
}

impl Bin {
    /// Relative position of the number in the bin, in [0, 1).
    #[inline(always)]
    pub fn fraction(&self, u: f32) -> f32 {
        ((u - self.begin) / (self.end - self.begin)).min(ONE_MINUS_EPSILON)
    }
}

/// A point in one of equal bins.
#[derive(Clone, Copy, Debug)]
pub struct BinPosition {
    /// Index of the bin.
    pub index: usize,
    /// Relative position in the bin, in [0, 1).
    pub fraction: f32,
}

/// A running integral and its guide.
#[derive(Clone, Copy, Debug)]
pub struct Running<'a> {
    /// The integral at the bounds of the bins, followed by [`STEP`] infinities.
    pub cdf: &'a [f32],
    /// For each part of [0, 1), a power of two in number, a bin that is at most the bin of its beginning.
    pub guide: &'a [u16],
}

impl Running<'_> {
    /// The last bin with `cdf[i] <= u`, for u in [0, 1).
    #[inline]
    fn bin(&self, u: f32) -> Bin {
        let mut i = usize::from(self.guide[self.part(u)]);
        loop {
            let next = &self.cdf[i + 1..i + 1 + STEP];
            let passed = next.iter().fold(0, |sum, &c| sum + u32::from(c <= u)) as usize;
            i += passed;
            if passed < STEP {
                return self.found(i);
            }
        }
    }

    /// The part of the guide for u in [0, 1).
    #[inline(always)]
    pub fn part(&self, u: f32) -> usize {
        ((u * self.guide.len() as f32) as usize).min(self.guide.len() - 1)
    }

    /// The bin that begins at bound `i`, or the last one.
    #[inline(always)]
    pub fn found(&self, i: usize) -> Bin {
        let index = i.min(self.cdf.len() - cdf_len(0) - 1);
        Bin { index, begin: self.cdf[index], end: self.cdf[index + 1] }
    }
}

/// The number, clamped to the range that has bins.
#[inline(always)]
pub fn clamped(u: f32) -> f32 {
    u.clamp(0.0, ONE_MINUS_EPSILON)
}

/// The point of [0, 1) at the relative position `fraction` in bin `i` of `n`.
#[inline]
pub(super) fn place_in_bin(i: usize, fraction: f32, n: usize) -> f32 {
    let mut x = (i as f32 + fraction) / n as f32;
    // Rounding must not carry the point into the next bin, whose value may be 0.
    while bin_of(x, n) > i || x >= 1.0 {
        x = x.next_down();
    }
    while bin_of(x, n) < i {
        x = x.next_up();
    }
    x
}

/// The u that maps to `x`.
#[inline]
fn apply_cdf(cdf: &[f32], x: f32, n: usize) -> f32 {
    let i = bin_of(x, n);
    let within = (x * n as f32 - i as f32).clamp(0.0, 1.0);
    cdf[i] + within * (cdf[i + 1] - cdf[i])
}

/// Valid values of a density: negative and non-finite ones become 0.
pub(super) fn cleaned(values: &[f32]) -> Vec<f32> {
    values.iter().map(|&v| if v.is_finite() { v.max(0.0) } else { 0.0 }).collect()
}

/// A density on [0, 1] that is constant in each of n equal bins.
#[derive(Clone, Debug)]
pub struct PiecewiseConstant1D {
    values: Vec<f32>,
    cdf: Vec<f32>,
    guide: Vec<u16>,
    integral: f32,
}

impl PiecewiseConstant1D {
    /// The density proportional to `values` (at least one). Negative or non-finite values count as 0.
    pub fn new(values: &[f32]) -> Self {
        let values = if values.is_empty() { vec![0.0] } else { cleaned(values) };
        let mut cdf = vec![0.0; cdf_len(values.len())];
        let mut guide = vec![0; guide_len(values.len())];
        let integral = fill_cdf(&values, &mut cdf, &mut guide) as f32;
        PiecewiseConstant1D { values, cdf, guide, integral }
    }

    /// Integral of the unnormalised function over [0, 1], the mean of its values.
    #[inline]
    pub fn integral(&self) -> f32 {
        self.integral
    }

    /// Number of bins.
    #[inline]
    pub fn len(&self) -> usize {
        self.values.len()
    }

    /// False: there is always a bin.
    #[inline]
    pub fn is_empty(&self) -> bool {
        false
    }

    /// The point of cumulative probability `u`; `None` if the function is 0.
    #[inline]
    pub fn sample(&self, u: f32) -> Option<Sample1D> {
        let BinPosition { index, fraction } = self.bin_position(u)?;
        let x = place_in_bin(index, fraction, self.values.len());
        Some(Sample1D { x, pdf: self.values[index] / self.integral, index })
    }

    /// The same point, by its bin. Sums of index and fraction may be rounded up to the next bin.
    #[inline]
    pub fn bin_position(&self, u: f32) -> Option<BinPosition> {
        let u = clamped(u);
        let bin = self.running().bin(u);
        (self.integral > 0.0).then(|| BinPosition { index: bin.index, fraction: bin.fraction(u) })
    }

    #[inline(always)]
    fn running(&self) -> Running<'_> {
        Running { cdf: &self.cdf, guide: &self.guide }
    }

    /// Density at `x` in [0, 1].
    #[inline]
    pub fn pdf(&self, x: f32) -> f32 {
        if self.integral <= 0.0 {
            return 0.0;
        }
        self.values[bin_of(x, self.values.len())] / self.integral
    }

    /// Inverse of [`sample`](Self::sample); `None` if the function is 0.
    #[inline]
    pub fn invert(&self, x: f32) -> Option<f32> {
        (self.integral > 0.0).then(|| apply_cdf(&self.cdf, x, self.values.len()))
    }
}

/// A density on [0, 1]² that is constant in each cell of a grid; x is chosen given y.
#[derive(Clone, Debug)]
pub struct PiecewiseConstant2D {
    values: Vec<f32>,
    conditional_cdf: Vec<f32>,
    conditional_guide: Vec<u16>,
    marginal: PiecewiseConstant1D,
    width: usize,
    height: usize,
    /// Length of the guide table of a row.
    guide_len: usize,
}

impl PiecewiseConstant2D {
    /// The density proportional to `values`, row-major from y = 0, of a grid `width` wide; incomplete rows are ignored.
    /// Negative or non-finite values count as 0.
    pub fn new(values: &[f32], width: usize) -> Self {
        let width = width.max(1);
        let height = (values.len() / width).max(1);
        let mut values = cleaned(&values[..values.len() / width * width]);
        values.resize(width * height, 0.0);
        let mut conditional_cdf = vec![0.0; cdf_len(width) * height];
        let guide_len = guide_len(width);
        let mut conditional_guide = vec![0; guide_len * height];
        let tables =
            conditional_cdf.chunks_exact_mut(cdf_len(width)).zip(conditional_guide.chunks_exact_mut(guide_len));
        let row_integrals: Vec<f32> = values
            .chunks_exact(width)
            .zip(tables)
            .map(|(row, (cdf, guide))| fill_cdf(row, cdf, guide) as f32)
            .collect();
        let marginal = PiecewiseConstant1D::new(&row_integrals);
        PiecewiseConstant2D { values, conditional_cdf, conditional_guide, marginal, width, height, guide_len }
    }

    /// Integral of the unnormalised function over the square, the mean of its values.
    #[inline]
    pub fn integral(&self) -> f32 {
        self.marginal.integral
    }

    /// Cells in x and y.
    #[inline]
    pub fn resolution(&self) -> [usize; 2] {
        [self.width, self.height]
    }

    #[inline(always)]
    fn row_cdf(&self, y: usize) -> &[f32] {
        &self.conditional_cdf[y * cdf_len(self.width)..(y + 1) * cdf_len(self.width)]
    }

    /// The running integral over the rows.
    #[inline(always)]
    pub fn rows(&self) -> Running<'_> {
        self.marginal.running()
    }

    /// The running integral along a row.
    #[inline(always)]
    pub fn row(&self, y: usize) -> Running<'_> {
        let guide = &self.conditional_guide[y * self.guide_len..(y + 1) * self.guide_len];
        Running { cdf: self.row_cdf(y), guide }
    }

    /// The bins in x and y of `u`, which is clamped to [0, 1), and the clamped u; the last row if the function is 0.
    #[inline]
    pub fn bins(&self, u: [f32; 2]) -> ([Bin; 2], [f32; 2]) {
        let u = u.map(clamped);
        let row = self.rows().bin(u[1]);
        ([self.row(row.index).bin(u[0]), row], u)
    }

    /// The point of marginal cumulative probability `u[1]` in y and conditional `u[0]` in x; `None` if the function is
    /// 0.
    #[inline]
    pub fn sample(&self, u: [f32; 2]) -> Option<Sample2D> {
        if self.marginal.integral <= 0.0 {
            return None;
        }
        let (bins, u) = self.bins(u);
        let at = |k: usize, n: usize| place_in_bin(bins[k].index, bins[k].fraction(u[k]), n);
        let p = Vec2::new(at(0, self.width), at(1, self.height));
        let pdf = self.pdf_of_cell(bins.map(|b| b.index));
        (pdf > 0.0 && pdf.is_finite()).then_some(Sample2D { p, pdf })
    }

    /// Density at `p` in [0, 1]² per unit area.
    #[inline]
    pub fn pdf(&self, p: Vec2) -> f32 {
        self.pdf_of_cell([bin_of(p.x, self.width), bin_of(p.y, self.height)])
    }

    /// Density in the cell [column, row], per unit area.
    #[inline]
    pub fn pdf_of_cell(&self, [x, y]: [usize; 2]) -> f32 {
        if self.marginal.integral <= 0.0 {
            return 0.0;
        }
        self.values[y * self.width + x] / self.marginal.integral
    }

    /// Inverse of [`sample`](Self::sample); `None` if the row of `p` cannot be sampled.
    #[inline]
    pub fn invert(&self, p: Vec2) -> Option<[f32; 2]> {
        let row = bin_of(p.y, self.height);
        if self.marginal.values[row] <= 0.0 {
            return None;
        }
        Some([apply_cdf(self.row_cdf(row), p.x, self.width), self.marginal.invert(p.y)?])
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use lumiris_test_support::assert_chi_squared;
    use lumiris_test_support::random::{RngExt, pcg32};

    #[test]
    fn samples_in_1d_follow_the_density_and_invert() {
        let values = [0.0, 1.0, 0.5, 0.0, 0.0, 7.0, 0.0];
        let d = PiecewiseConstant1D::new(&values);
        assert!((d.integral() - 8.5 / 7.0).abs() < 1e-6);
        assert!(d.len() == 7 && !d.is_empty());
        let mut observed = vec![0.0; 70];
        let mut stream = pcg32([1, 5, 0]);
        for _ in 0..100_000 {
            let u = stream.random::<f32>();
            let s = d.sample(u).unwrap();
            assert_eq!(s.pdf, d.pdf(s.x));
            assert!(s.pdf > 0.0 && (d.invert(s.x).unwrap() - u).abs() < 2e-6);
            observed[(s.x * 70.0) as usize] += 1.0;
        }
        let expected: Vec<f64> = (0..70).map(|i| f64::from(values[i / 10]) / 85.0 * 100_000.0).collect();
        assert_chi_squared(&observed, &expected, 1e-4);
    }

    #[test]
    fn samples_in_2d_follow_the_density_and_invert() {
        let values = [0.0, 1.0, 2.0, 0.0, 0.0, 0.0, 4.0, 0.0, 0.5, 0.0, 0.0, 0.0];
        let d = PiecewiseConstant2D::new(&values, 3);
        // Densities are values over their mean, 0.625
        assert_eq!(d.pdf_of_cell([2, 0]), 3.2);
        assert_eq!((d.pdf(Vec2::new(0.1, 0.6)), d.pdf(Vec2::new(0.1, 0.1))), (6.4, 0.0));
        let mut observed = vec![0.0; 12];
        let mut stream = pcg32([2, 5, 0]);
        for _ in 0..100_000 {
            let u = stream.random::<[f32; 2]>();
            let s = d.sample(u).unwrap();
            assert_eq!(s.pdf, d.pdf(s.p));
            let v = d.invert(s.p).unwrap();
            assert!((v[0] - u[0]).abs() < 2e-6 && (v[1] - u[1]).abs() < 2e-6);
            observed[(s.p.y * 4.0) as usize * 3 + (s.p.x * 3.0) as usize] += 1.0;
        }
        let expected: Vec<f64> = values.iter().map(|&v| f64::from(v) / 7.5 * 100_000.0).collect();
        assert_chi_squared(&observed, &expected, 1e-4);
    }

    #[test]
    fn extreme_numbers_stay_in_bins_that_can_be_sampled() {
        for n in [3, 7, 10, 49, 1000, 4097] {
            for bright in [0, n / 2, n - 1] {
                let mut values = vec![0.0; n];
                values[bright] = 3.0;
                let d = PiecewiseConstant1D::new(&values);
                for u in [0.0, 1e-30, 1e-7, 0.5, 1.0 - 1e-7, ONE_MINUS_EPSILON, 1.0] {
                    let s = d.sample(u).unwrap();
                    assert!(d.pdf(s.x) > 0.0 && s.x < 1.0 && s.x >= 0.0, "{n} {bright} {u}");
                }
            }
        }
    }

    #[test]
    fn a_zero_function_has_no_samples() {
        let d = PiecewiseConstant2D::new(&[0.0, f32::NAN, -1.0, 0.0], 2);
        assert_eq!(d.sample([0.3, 0.4]), None);
        assert_eq!(d.pdf(Vec2::splat(0.5)), 0.0);
        assert_eq!(d.invert(Vec2::splat(0.5)), None);
        assert_eq!(PiecewiseConstant1D::new(&[]).sample(0.1), None);
        assert_eq!(PiecewiseConstant2D::new(&[], 0).sample([0.1, 0.1]), None);
    }
}
