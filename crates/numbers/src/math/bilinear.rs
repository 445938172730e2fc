//! Bilinear functions on a grid over [0, 1]², and bilinear densities, sampled by inversion: first the marginal over
//! rows, then the conditional within the row [Dupuy and Jakob 2018, §4].
//!
//! They form families: one table at each point of a grid of two parameters, with linear blending between these points.
//! Every table of a density is normalised, so that a blend integrates to 1 as well, and the running integrals of the
//! blend are the blend of the running integrals.

use super::{Rgb, Sample2D, Vec2};
use std::ops::{Add, Mul};

/// The grid of the two parameters of a family.
#[derive(Clone, Debug)]
pub struct ParameterGrid {
    axes: [Vec<f32>; 2],
}

/// At most four tables of a family, with weights that add up to 1.
#[derive(Clone, Copy, Debug)]
pub struct Blend {
    tables: [(usize, f32); 4],
    count: usize,
}

impl Blend {
    /// A single table.
    pub fn only(table: usize) -> Self {
        Blend { tables: [(table, 1.0); 4], count: 1 }
    }

    /// Σ weight · value(table).
    #[inline]
    fn of<T: Linear>(&self, value: impl Fn(usize) -> T) -> T {
        let (first, weight) = self.tables[0];
        let others = &self.tables[1..self.count];
        others.iter().fold(value(first) * weight, |sum, &(table, weight)| sum + value(table) * weight)
    }
}

impl ParameterGrid {
    /// From the values along both axes; `None` if they are empty or not increasing.
    pub fn new(axes: [Vec<f32>; 2]) -> Option<Self> {
        let increases = |axis: &Vec<f32>| !axis.is_empty() && axis.windows(2).all(|w| w[0] < w[1]);
        axes.iter().all(increases).then_some(ParameterGrid { axes })
    }

    /// Number of tables; the index of table [i, j] is i · (length of the second axis) + j.
    pub fn tables(&self) -> usize {
        self.axes[0].len() * self.axes[1].len()
    }

    /// The tables around a point, which is clamped to the grid.
    #[inline]
    pub fn at(&self, parameters: [f32; 2]) -> Blend {
        let [Cell { index: i, t: s }, Cell { index: j, t }] = [0, 1].map(|a| place(&self.axes[a], parameters[a]));
        let n = self.axes[1].len();
        let mut blend = Blend { tables: [(0, 0.0); 4], count: 0 };
        for (table, weight) in [
            (i * n + j, (1.0 - s) * (1.0 - t)),
            (i * n + j + 1, (1.0 - s) * t),
            ((i + 1) * n + j, s * (1.0 - t)),
            ((i + 1) * n + j + 1, s * t),
        ] {
            if weight > 0.0 {
                blend.tables[blend.count] = (table, weight);
                blend.count += 1;
            }
        }
        blend
    }
}

/// A cell between two neighbouring values, and a position in it.
struct Cell {
    /// Index of the first value.
    index: usize,
    /// Relative position between both values.
    t: f32,
}

/// The cell that contains `x` among increasing values; the position is 0 at the last value.
#[inline]
fn place(axis: &[f32], x: f32) -> Cell {
    let last = axis.len() - 1;
    let i = axis.partition_point(|&a| a <= x).saturating_sub(1);
    if i == last {
        return Cell { index: last, t: 0.0 };
    }
    // NaN is treated as the first value
    Cell { index: i, t: ((x - axis[i]) / (axis[i + 1] - axis[i])).max(0.0) }
}

/// A type that can be interpolated linearly.
pub trait Linear: Copy + Add<Output = Self> + Mul<f32, Output = Self> {}

impl Linear for f32 {}
impl Linear for Rgb {}

#[inline]
fn lerp<T: Linear>(a: T, b: T, t: f32) -> T {
    a * (1.0 - t) + b * t
}

/// A family of functions over [0, 1]², given by values at the points of a grid that includes the edges.
#[derive(Clone, Debug)]
pub struct BilinearTables<T> {
    /// Columns and rows.
    size: [usize; 2],
    /// Values row by row, table by table.
    values: Vec<T>,
}

impl<T: Linear> BilinearTables<T> {
    /// From the values, row by row and table by table; `None` unless there are at least 2 columns and 2 rows, and a
    /// whole number of tables.
    pub fn new([columns, rows]: [usize; 2], values: Vec<T>) -> Option<Self> {
        let is_whole = columns.checked_mul(rows).is_some_and(|n| n > 0 && values.len().is_multiple_of(n));
        (columns >= 2 && rows >= 2 && is_whole).then_some(BilinearTables { size: [columns, rows], values })
    }

    /// The value at a point of a table.
    #[inline]
    pub fn at(&self, blend: &Blend, p: Vec2) -> T {
        let [Cell { index: x, t: s }, Cell { index: y, t }] = [cell(p.x, self.size[0]), cell(p.y, self.size[1])];
        let row = |y: usize| lerp(self.blended(blend, x, y), self.blended(blend, x + 1, y), s);
        lerp(row(y), row(y + 1), t)
    }

    #[inline]
    fn blended(&self, blend: &Blend, x: usize, y: usize) -> T {
        let [columns, rows] = self.size;
        blend.of(|table| self.values[(table * rows + y) * columns + x])
    }
}

/// The cell among n − 1 that contains `x` in [0, 1].
#[inline]
fn cell(x: f32, n: usize) -> Cell {
    let x = x.clamp(0.0, 1.0) * (n - 1) as f32;
    let i = (x as usize).min(n - 2);
    Cell { index: i, t: x - i as f32 }
}

/// A family of densities over [0, 1]².
#[derive(Clone, Debug)]
pub struct PiecewiseBilinear2D {
    /// Densities per unit area.
    density: BilinearTables<f32>,
    /// Integral along each row up to each column.
    within: Vec<f32>,
    /// Integral over the rows up to each row.
    rows: Vec<f32>,
}

impl PiecewiseBilinear2D {
    /// From unnormalised densities, in the layout of [`BilinearTables::new`]. Negative values and NaN count as 0; a
    /// table of zeros becomes the uniform density.
    pub fn new(size: [usize; 2], values: Vec<f32>) -> Option<Self> {
        let mut density = BilinearTables::new(size, values)?;
        let [columns, rows] = size;
        let (mut within, mut marginal) = (Vec::with_capacity(density.values.len()), Vec::new());
        for table in density.values.chunks_exact_mut(columns * rows) {
            table.iter_mut().for_each(|v| *v = v.max(0.0));
            let along: Vec<Vec<f64>> = table.chunks_exact(columns).map(|row| running(row.iter().copied())).collect();
            let integral = |row: &Vec<f64>| row[columns - 1] as f32;
            let total = running(along.iter().map(integral))[rows - 1];
            if !(total > 0.0 && total.is_finite()) {
                table.fill(1.0);
            } else {
                table.iter_mut().for_each(|v| *v = (f64::from(*v) / total) as f32);
            }
            // Computed from the normalised values, so that rounding is consistent
            let along: Vec<Vec<f64>> = table.chunks_exact(columns).map(|row| running(row.iter().copied())).collect();
            within.extend(along.iter().flatten().map(|&c| c as f32));
            marginal.extend(running(along.iter().map(integral)).iter().map(|&c| c as f32));
        }
        Some(PiecewiseBilinear2D { density, within, rows: marginal })
    }

    /// Samples a point by inversion of `u`: the second number selects the row, the first the column.
    #[inline]
    pub fn sample(&self, blend: &Blend, u: Vec2) -> Sample2D {
        let [columns, rows] = self.density.size;
        // Positive, so that the result has a density
        let u = u.clamp(Vec2::splat(f32::MIN_POSITIVE), Vec2::ONE);

        // Find the row
        let target = u.y * self.marginal(blend, rows - 1);
        let y = find(rows, target, |y| self.marginal(blend, y));
        let rest = (target - self.marginal(blend, y)).max(0.0);
        let [r0, r1] = [y, y + 1].map(|y| self.conditional(blend, columns - 1, y));
        let t = invert_linear(r0, r1, rest * (rows - 1) as f32);

        // Find the column
        let target = u.x * lerp(r0, r1, t);
        let along = |x: usize| lerp(self.conditional(blend, x, y), self.conditional(blend, x, y + 1), t);
        let x = find(columns, target, along);
        let rest = (target - along(x)).max(0.0);
        let value = |x: usize| lerp(self.density.blended(blend, x, y), self.density.blended(blend, x, y + 1), t);
        let (c0, c1) = (value(x), value(x + 1));
        let s = invert_linear(c0, c1, rest * (columns - 1) as f32);

        let p = Vec2::new((x as f32 + s) / (columns - 1) as f32, (y as f32 + t) / (rows - 1) as f32);
        Sample2D { p, pdf: lerp(c0, c1, s) }
    }

    /// Density of [`Self::sample`] per unit area.
    #[inline]
    pub fn pdf(&self, blend: &Blend, p: Vec2) -> f32 {
        self.density.at(blend, p)
    }

    /// Inverse of [`Self::sample`]: the u that maps to `p`.
    #[inline]
    pub fn invert(&self, blend: &Blend, p: Vec2) -> Vec2 {
        let [columns, rows] = self.density.size;
        let [Cell { index: x, t: s }, Cell { index: y, t }] = [cell(p.x, columns), cell(p.y, rows)];
        let [r0, r1] = [y, y + 1].map(|y| self.conditional(blend, columns - 1, y));
        let above = self.marginal(blend, y) + integral_linear(r0, r1, t) / (rows - 1) as f32;
        let value = |x: usize| lerp(self.density.blended(blend, x, y), self.density.blended(blend, x, y + 1), t);
        let before = lerp(self.conditional(blend, x, y), self.conditional(blend, x, y + 1), t)
            + integral_linear(value(x), value(x + 1), s) / (columns - 1) as f32;
        let (row, all) = (lerp(r0, r1, t), self.marginal(blend, rows - 1));
        let of = |part: f32, whole: f32| if whole > 0.0 { (part / whole).clamp(0.0, 1.0) } else { 0.5 };
        Vec2::new(of(before, row), of(above, all))
    }

    #[inline]
    fn conditional(&self, blend: &Blend, x: usize, y: usize) -> f32 {
        let [columns, rows] = self.density.size;
        blend.of(|table| self.within[(table * rows + y) * columns + x])
    }

    #[inline]
    fn marginal(&self, blend: &Blend, y: usize) -> f32 {
        let rows = self.density.size[1];
        blend.of(|table| self.rows[table * rows + y])
    }
}

/// Integrals of the piecewise linear function through evenly spaced values over [0, 1], up to each of them.
fn running(values: impl ExactSizeIterator<Item = f32>) -> Vec<f64> {
    let step = 0.5 / (values.len() - 1) as f64;
    let mut before: Option<f64> = None;
    let mut sum = 0.0;
    let next = |value: f32| {
        let value = f64::from(value);
        sum += before.map_or(0.0, |before| (before + value) * step);
        before = Some(value);
        sum
    };
    values.map(next).collect()
}

/// The last of n − 1 cells that begins below `target`; `begin` must increase.
#[inline]
fn find(n: usize, target: f32, begin: impl Fn(usize) -> f32) -> usize {
    let (mut low, mut high) = (0, n - 1);
    while high - low > 1 {
        let middle = usize::midpoint(low, high);
        if begin(middle) < target { low = middle } else { high = middle }
    }
    low
}

/// ∫ from 0 to t of the linear function with the values `a` at 0 and `b` at 1.
#[inline]
fn integral_linear(a: f32, b: f32, t: f32) -> f32 {
    t * (a + 0.5 * t * (b - a))
}

/// Inverse of [`integral_linear`].
#[inline]
fn invert_linear(a: f32, b: f32, integral: f32) -> f32 {
    // The form without cancellation
    let sum = a + (a * a + 2.0 * integral * (b - a)).max(0.0).sqrt();
    if sum > 0.0 { (2.0 * integral / sum).min(1.0) } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use lumiris_test_support::assert_chi_squared;
    use lumiris_test_support::random::{RngExt, pcg32};

    fn grid() -> ParameterGrid {
        ParameterGrid::new([vec![-1.0, 0.5, 2.0], vec![0.0, 3.0]]).unwrap()
    }

    /// Six tables of 7 × 5 values, with a row, a column and a table of zeros.
    fn family() -> PiecewiseBilinear2D {
        let mut s = pcg32([3, 1, 4]);
        let mut values: Vec<f32> = (0..6 * 35).map(|_| s.random::<f32>().powi(3)).collect();
        for i in 0..values.len() {
            let (table, y, x) = (i / 35, i % 35 / 7, i % 7);
            if table == 4 || (table < 2 && (y == 0 || x == 6)) {
                values[i] = 0.0;
            }
        }
        PiecewiseBilinear2D::new([7, 5], values).unwrap()
    }

    const PARAMETERS: [[f32; 2]; 5] = [[-1.0, 0.0], [0.3, 1.0], [1.9, 2.9], [9.0, -9.0], [0.5, 3.0]];

    #[test]
    fn parameters_find_their_tables() {
        let weights = |p: [f32; 2]| {
            let blend = grid().at(p);
            let mut all = [0.0; 6];
            blend.tables[..blend.count].iter().for_each(|&(table, w)| all[table] += w);
            all
        };
        assert_eq!(weights([-1.0, 0.0]), [1.0, 0.0, 0.0, 0.0, 0.0, 0.0]);
        assert_eq!(weights([1.25, 3.0]), [0.0, 0.0, 0.0, 0.5, 0.0, 0.5]);
        assert_eq!(weights([-7.0, 1.5]), [0.5, 0.5, 0.0, 0.0, 0.0, 0.0]);
        assert_eq!(weights([7.0, 7.0]), [0.0, 0.0, 0.0, 0.0, 0.0, 1.0]);
        assert_eq!(weights([f32::NAN, f32::NAN]), [1.0, 0.0, 0.0, 0.0, 0.0, 0.0]);
        let one = ParameterGrid::new([vec![0.0], vec![1.0]]).unwrap();
        assert_eq!((one.tables(), one.at([3.0, 3.0]).count), (1, 1));
        assert!(ParameterGrid::new([vec![], vec![1.0]]).is_none());
        assert!(ParameterGrid::new([vec![1.0, 1.0], vec![1.0]]).is_none());
        assert!(ParameterGrid::new([vec![f32::NAN, 1.0], vec![1.0]]).is_none());
    }

    #[test]
    fn tables_are_bilinear() {
        // x + 10 y + 100 x y is reproduced exactly by interpolation
        let f = |p: Vec2| p.x + 10.0 * p.y + 100.0 * p.x * p.y;
        let points = (0..12).map(|i| Vec2::new((i % 4) as f32 / 3.0, (i / 4) as f32 / 2.0));
        let table = BilinearTables::new([4, 3], points.map(f).collect()).unwrap();
        for p in [Vec2::ZERO, Vec2::ONE, Vec2::new(0.2, 0.9), Vec2::new(0.77, 0.5)] {
            assert!((table.at(&Blend::only(0), p) - f(p)).abs() < 1e-4, "{p}");
        }
        assert!(BilinearTables::new([1, 3], vec![0.0; 3]).is_none());
        assert!(BilinearTables::new([2, 3], vec![0.0; 7]).is_none());
        assert!(BilinearTables::new([usize::MAX, 3], vec![0.0; 7]).is_none());
    }

    #[test]
    fn densities_integrate_to_one_and_the_inverse_of_a_sample_is_its_number() {
        let (grid, family) = (grid(), family());
        let mut s = pcg32([2, 7, 1]);
        for parameters in PARAMETERS {
            let blend = grid.at(parameters);
            let n = 600;
            let sum: f64 = (0..n * n)
                .map(|i| Vec2::new(((i % n) as f32 + 0.5) / n as f32, ((i / n) as f32 + 0.5) / n as f32))
                .map(|p| f64::from(family.pdf(&blend, p)))
                .sum();
            assert!((sum / f64::from(n * n) - 1.0).abs() < 1e-4, "{parameters:?}: {sum}");
            for _ in 0..10_000 {
                let u = Vec2::from(s.random::<[f32; 2]>());
                let sample = family.sample(&blend, u);
                assert!(sample.pdf > 0.0, "{parameters:?} {u}");
                assert!((family.pdf(&blend, sample.p) - sample.pdf).abs() < 1e-3 * sample.pdf + 1e-4);
                let back = family.invert(&blend, sample.p);
                assert!((back - u).abs().max_element() < 2e-5, "{parameters:?}: {u} {back}");
            }
        }
    }

    #[test]
    fn corners_of_the_square_are_sampled() {
        let (grid, family) = (grid(), family());
        for parameters in PARAMETERS {
            for u in [Vec2::ZERO, Vec2::ONE, Vec2::X, Vec2::Y] {
                let sample = family.sample(&grid.at(parameters), u);
                assert!(sample.pdf.is_finite() && sample.pdf >= 0.0);
                assert!((0.0..=1.0).contains(&sample.p.x) && (0.0..=1.0).contains(&sample.p.y));
            }
        }
    }

    #[test]
    fn samples_follow_their_density_by_chi_squared() {
        const CELLS: usize = 24;
        const FINE: usize = 40;
        let (grid, family, count) = (grid(), family(), 200_000);
        for (k, parameters) in PARAMETERS.into_iter().enumerate() {
            let blend = grid.at(parameters);
            let mut s = pcg32([k as u32, 5, 9]);
            let mut observed = vec![0.0; CELLS * CELLS];
            let cell = |x: f32| ((x * CELLS as f32) as usize).min(CELLS - 1);
            for _ in 0..count {
                let p = family.sample(&blend, Vec2::from(s.random::<[f32; 2]>())).p;
                observed[cell(p.y) * CELLS + cell(p.x)] += 1.0;
            }
            let mut expected = vec![0.0; CELLS * CELLS];
            let n = CELLS * FINE;
            for i in 0..n * n {
                let p = Vec2::new(((i % n) as f32 + 0.5) / n as f32, ((i / n) as f32 + 0.5) / n as f32);
                let part = f64::from(family.pdf(&blend, p)) / (n * n) as f64;
                expected[cell(p.y) * CELLS + cell(p.x)] += part * f64::from(count);
            }
            assert_chi_squared(&observed, &expected, 1e-5);
        }
    }
}
