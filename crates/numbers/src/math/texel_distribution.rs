//! A piecewise-constant density over the texels of an image, with adaptive resolution.
//!
//! Large images are divided into blocks of 4 × 4 texels. A block is chosen by inversion, and in most blocks the density
//! is constant: running integrals of blocks fit into a cache, unlike those of texels. In a block whose values vary by
//! more than [`MAX_VARIATION`], local running integrals choose the texel. The order of numbers is preserved at block
//! level, so points of nets remain well distributed.

use super::distribution::{Bin, Running, bin_of, cleaned, place_in_bin};
use super::{ONE_MINUS_EPSILON, PiecewiseConstant2D, Vec2};

/// Texels of a block along each axis.
const EDGE: usize = 4;
/// Minimum number of texels for blocks.
const MANY: usize = 1 << 18;
/// Maximum relative variance of the values of a block with a constant density: the relative increase of the second
/// moment of an estimate whose integrand is proportional to the values.
pub const MAX_VARIATION: f64 = 0.01;
/// Minimum value of a non-zero texel of a block, relative to the mean of the block: smaller ones would be lost by
/// rounding.
const LEAST: f64 = 1.0 / 65536.0;

/// The density.
#[derive(Clone, Debug)]
pub struct TexelDistribution {
    blocks: PiecewiseConstant2D,
    /// Texels of a block along each axis: [`EDGE`] or 1.
    edge: usize,
    width: usize,
    height: usize,
    /// For each 64 blocks, a bit mask of blocks with varying texels, and the number of such blocks before.
    varied: Vec<(u64, u32)>,
    within: Vec<WithinBlock>,
}

/// The choice of a texel in a block, in a cache line: inner bounds of the running integral over rows, and of the
/// running integrals along each row.
#[derive(Clone, Copy, Debug)]
#[repr(align(64))]
pub struct WithinBlock {
    rows: [f32; EDGE - 1],
    columns: [[f32; EDGE - 1]; EDGE],
}

/// A texel, and the position in it, in [0, 1)².
#[derive(Clone, Copy, Debug)]
pub struct TexelPlace {
    /// Column and row.
    pub texel: [usize; 2],
    /// Relative position in the texel.
    pub within: [f32; 2],
}

/// Inner bounds of the running integral of the values, normalised.
fn bounds(values: [f64; EDGE]) -> [f32; EDGE - 1] {
    let sum: f64 = values.iter().sum();
    let upto = |k: usize| values[..=k].iter().sum::<f64>();
    std::array::from_fn(|k| if upto(k) < sum { (upto(k) / sum) as f32 } else { 1.0 })
}

/// The bin of `u` in [0, 1) between inner bounds.
#[inline(always)]
fn bin_between(bounds: &[f32; EDGE - 1], u: f32) -> Bin {
    let index = usize::from(bounds[0] <= u) + usize::from(bounds[1] <= u) + usize::from(bounds[2] <= u);
    let begin = if index > 0 { bounds[index - 1] } else { 0.0 };
    Bin { index, begin, end: if index < EDGE - 1 { bounds[index] } else { 1.0 } }
}

/// Probability of bin `k` between inner bounds.
fn probability(bounds: &[f32; EDGE - 1], k: usize) -> f32 {
    let bound = |k: usize| if k < EDGE { bounds[k - 1] } else { 1.0 };
    if k > 0 { bound(k + 1) - bound(k) } else { bound(1) }
}

impl WithinBlock {
    fn new(values: [[f64; EDGE]; EDGE]) -> Self {
        let least = values.iter().flatten().sum::<f64>() / (EDGE * EDGE) as f64 * LEAST;
        let values = values.map(|row| row.map(|v| if v > 0.0 { v.max(least) } else { 0.0 }));
        WithinBlock { rows: bounds(values.map(|row| row.iter().sum())), columns: values.map(bounds) }
    }

    /// The texel of the block for a position in it, both in [0, 1)².
    #[inline(always)]
    pub fn choose(&self, [x, y]: [f32; 2]) -> TexelPlace {
        let row = bin_between(&self.rows, y);
        let column = bin_between(&self.columns[row.index], x);
        TexelPlace { texel: [column.index, row.index], within: [column.fraction(x), row.fraction(y)] }
    }

    /// Density of a texel, relative to the density of the block.
    fn density(&self, [x, y]: [usize; 2]) -> f32 {
        (EDGE * EDGE) as f32 * probability(&self.rows, y) * probability(&self.columns[y], x)
    }
}

impl TexelDistribution {
    /// The density proportional to `values`, row-major from y = 0, of an image `width` wide, but constant in blocks of
    /// nearly equal values. Incomplete rows are ignored. Negative or non-finite values count as 0. There are blocks if
    /// sizes are multiples of 4 and there are at least 2¹⁸ texels.
    pub fn new(values: &[f32], width: usize) -> Self {
        Self::of_blocks(values, width, if values.len() >= MANY { EDGE } else { 1 })
    }

    /// The same with blocks whenever sizes are multiples of 4.
    pub fn with_blocks(values: &[f32], width: usize) -> Self {
        Self::of_blocks(values, width, EDGE)
    }

    fn of_blocks(values: &[f32], width: usize, edge: usize) -> Self {
        let width = width.max(1);
        let height = (values.len() / width).max(1);
        if edge == 1 || !width.is_multiple_of(edge) || !height.is_multiple_of(edge) || values.len() < width * height {
            let blocks = PiecewiseConstant2D::new(values, width);
            return TexelDistribution { blocks, edge: 1, width, height, varied: Vec::new(), within: Vec::new() };
        }
        let values = cleaned(&values[..width * height]);
        let count = width * height / (EDGE * EDGE);
        let (mut means, mut varied, mut within) = (Vec::with_capacity(count), vec![(0, 0); count.div_ceil(64)], vec![]);
        for rows in values.chunks_exact(EDGE * width) {
            for x in (0..width).step_by(EDGE) {
                let block: [[f64; EDGE]; EDGE] =
                    std::array::from_fn(|j| std::array::from_fn(|i| f64::from(rows[j * width + x + i])));
                let mean =
                    |of: fn(f64) -> f64| block.iter().flatten().map(|&v| of(v)).sum::<f64>() / (EDGE * EDGE) as f64;
                let (first, second) = (mean(|v| v), mean(|v| v * v));
                let (word, bit) = (means.len() / 64, means.len() % 64);
                if bit == 0 {
                    varied[word].1 = within.len() as u32;
                }
                if second > (1.0 + MAX_VARIATION) * first * first {
                    varied[word].0 |= 1 << bit;
                    within.push(WithinBlock::new(block));
                }
                means.push(first as f32);
            }
        }
        let blocks = PiecewiseConstant2D::new(&means, width / EDGE);
        TexelDistribution { blocks, edge, width, height, varied, within }
    }

    /// Integral of the unnormalised function over the square, the mean of its values.
    #[inline]
    pub fn integral(&self) -> f32 {
        self.blocks.integral()
    }

    /// Texels in x and y.
    #[inline]
    pub fn resolution(&self) -> [usize; 2] {
        [self.width, self.height]
    }

    /// Texels of a block along each axis.
    #[inline(always)]
    pub fn edge(&self) -> usize {
        self.edge
    }

    /// True if any block has varying texels.
    #[inline(always)]
    pub fn has_varied(&self) -> bool {
        !self.within.is_empty()
    }

    /// The running integral over the rows of blocks.
    #[inline(always)]
    pub fn rows(&self) -> Running<'_> {
        self.blocks.rows()
    }

    /// The running integral along a row of blocks.
    #[inline(always)]
    pub fn row(&self, y: usize) -> Running<'_> {
        self.blocks.row(y)
    }

    /// The choice of a texel in the block [column, row]; `None` for a constant density.
    #[inline(always)]
    pub fn within(&self, [x, y]: [usize; 2]) -> Option<&WithinBlock> {
        let i = y * (self.width / EDGE) + x;
        let (bits, before) = *self.varied.get(i / 64)?;
        let bit = 1_u64 << (i % 64);
        (bits & bit != 0).then(|| &self.within[before as usize + (bits & (bit - 1)).count_ones() as usize])
    }

    /// The texel of `u`, and the point in the square; `None` if the function is 0.
    #[inline]
    pub fn sample(&self, u: [f32; 2]) -> Option<([usize; 2], Vec2)> {
        if self.blocks.integral() <= 0.0 {
            return None;
        }
        let (bins, u) = self.blocks.bins(u);
        let block = bins.map(|bin| bin.index);
        let fractions = [0, 1].map(|k| bins[k].fraction(u[k]));
        let place = self.within(block).map_or_else(|| self.in_constant(fractions), |within| within.choose(fractions));
        let texel = [0, 1].map(|k| block[k] * self.edge + place.texel[k]);
        let at = |k: usize, n: usize| place_in_bin(texel[k], place.within[k], n);
        Some((texel, Vec2::new(at(0, self.width), at(1, self.height))))
    }

    /// The texel at a position in a block of constant density.
    #[inline]
    fn in_constant(&self, place: [f32; 2]) -> TexelPlace {
        let scaled = place.map(|x| x * self.edge as f32);
        let texel = scaled.map(|x| (x as usize).min(self.edge - 1));
        TexelPlace { texel, within: [0, 1].map(|k| (scaled[k] - texel[k] as f32).min(ONE_MINUS_EPSILON)) }
    }

    /// Density at `p` in [0, 1]² per unit area.
    #[inline]
    pub fn pdf(&self, p: Vec2) -> f32 {
        self.pdf_of_texel([bin_of(p.x, self.width), bin_of(p.y, self.height)])
    }

    /// Density in the texel [column, row], per unit area.
    #[inline]
    pub fn pdf_of_texel(&self, texel: [usize; 2]) -> f32 {
        let block = texel.map(|i| i / self.edge);
        let within = self.within(block).map_or(1.0, |within| within.density(texel.map(|i| i % self.edge)));
        self.blocks.pdf_of_cell(block) * within
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use lumiris_test_support::assert_chi_squared;
    use lumiris_test_support::random::{RngExt, pcg32};

    const WIDTH: usize = 16;
    const HEIGHT: usize = 12;

    /// A smooth sky with a sun over two blocks, black texels, and a black block.
    fn values() -> Vec<f32> {
        let value = |i: usize| {
            let (x, y) = (i % WIDTH, i / WIDTH);
            match (x, y) {
                (5, 6) | (8, 6) => 40.0,
                (9, 7) | (12.., 0) => 0.0,
                (0..=3, 8..) => 0.0,
                _ => 1.0 + 0.02 * x as f32 + 0.3 * (y / EDGE) as f32,
            }
        };
        (0..WIDTH * HEIGHT).map(value).collect()
    }

    #[test]
    fn samples_follow_the_density() {
        let values = values();
        let plain = TexelDistribution::new(&values, WIDTH);
        let blocks = TexelDistribution::with_blocks(&values, WIDTH);
        assert_eq!((plain.edge(), blocks.edge(), blocks.within.len()), (1, EDGE, 3));
        for d in [&plain, &blocks] {
            const PARTS: usize = 3;
            let [columns, rows] = [WIDTH * PARTS, HEIGHT * PARTS];
            let mut observed = vec![0.0; columns * rows];
            let mut stream = pcg32([2, 6, 1]);
            let count = 400_000;
            for _ in 0..count {
                let (texel, p) = d.sample(stream.random::<[f32; 2]>()).unwrap();
                assert_eq!(texel, [(p.x * WIDTH as f32) as usize, (p.y * HEIGHT as f32) as usize]);
                assert!(d.pdf(p) > 0.0 && d.pdf(p) == d.pdf_of_texel(texel));
                observed[(p.y * rows as f32) as usize * columns + (p.x * columns as f32) as usize] += 1.0;
            }
            let texel_of = |i: usize| [i % columns / PARTS, i / columns / PARTS];
            let expected: Vec<f64> = (0..columns * rows)
                .map(|i| f64::from(d.pdf_of_texel(texel_of(i))) * f64::from(count) / (columns * rows) as f64)
                .collect();
            assert_chi_squared(&observed, &expected, 1e-4);
        }
    }

    #[test]
    fn blocks_add_little_to_the_second_moment() {
        let mut s = pcg32([2, 6, 2]);
        let noisy = |amplitude: f32, s: &mut lumiris_test_support::random::Pcg32| -> Vec<f32> {
            values().iter().map(|v| v * (1.0 + amplitude * (s.random::<f32>() - 0.5))).collect()
        };
        for amplitude in [0.0, 0.1, 0.3, 1.0] {
            let values = noisy(amplitude, &mut s);
            let d = TexelDistribution::with_blocks(&values, WIDTH);
            let mean = values.iter().map(|&v| f64::from(v)).sum::<f64>() / values.len() as f64;
            let (mut sum, mut second) = (0.0, 0.0);
            for (i, &v) in values.iter().enumerate() {
                let pdf = f64::from(d.pdf_of_texel([i % WIDTH, i / WIDTH]));
                assert_eq!(pdf > 0.0, v > 0.0);
                sum += pdf / values.len() as f64;
                if pdf > 0.0 {
                    second += f64::from(v).powi(2) / (pdf * values.len() as f64 * mean * mean);
                }
            }
            assert!((sum - 1.0).abs() < 1e-5, "{sum}");
            assert!((1.0 - 1e-5..1.0 + MAX_VARIATION).contains(&second), "{amplitude}: {second}");
            assert_eq!(d.within.len() == 11, amplitude == 1.0, "{amplitude}: {}", d.within.len());
        }
    }

    #[test]
    fn extreme_values_and_numbers_stay_in_texels_that_can_be_sampled() {
        let numbers = [0.0, 1e-30, 1e-7, 0.5, 1.0 - 1e-7, ONE_MINUS_EPSILON, 1.0];
        for at in 0..16 {
            let mut values = vec![1e-4; 64];
            values[at % 4 + 8 * (at / 4)] = 1e30;
            for dim in [1e-4, 0.0] {
                values.iter_mut().filter(|v| **v < 1.0).for_each(|v| *v = dim);
                let d = TexelDistribution::with_blocks(&values, 8);
                assert_eq!(d.edge(), EDGE);
                for (i, &v) in values.iter().enumerate().filter(|(i, _)| i % 8 < 4 && i / 8 < 4) {
                    assert_eq!(d.pdf_of_texel([i % 8, i / 8]) > 0.0, v > 0.0, "{at} {i}");
                }
                for u in numbers.iter().flat_map(|&a| numbers.map(|b| [a, b])) {
                    let (texel, p) = d.sample(u).unwrap();
                    assert!(d.pdf_of_texel(texel) > 0.0 && d.pdf(p) > 0.0 && p.max_element() < 1.0, "{at} {u:?}");
                }
            }
        }
    }

    #[test]
    fn many_blocks_are_told_apart() {
        // 16 × 12 blocks, a third of them noise
        let (width, height) = (64, 48);
        let mut s = pcg32([2, 6, 3]);
        let mut value = |i: usize| {
            let block = i % width / EDGE + i / width / EDGE * (width / EDGE);
            if block % 3 == 1 { 0.2 + s.random::<f32>() } else { 1.0 + block as f32 / 64.0 }
        };
        let values: Vec<f32> = (0..width * height).map(&mut value).collect();
        let d = TexelDistribution::with_blocks(&values, width);
        assert_eq!(d.within.len(), 64);
        let mean = values.iter().sum::<f32>() / values.len() as f32;
        for (i, v) in values.iter().enumerate() {
            let pdf = d.pdf_of_texel([i % width, i / width]);
            assert!((pdf * mean / v - 1.0).abs() < 1e-4, "{i}: {pdf} {}", v / mean);
        }
    }

    #[test]
    fn images_without_blocks_or_light_are_handled() {
        let odd = TexelDistribution::with_blocks(&[1.0; 30], 5);
        assert_eq!((odd.edge(), odd.resolution(), odd.has_varied()), (1, [5, 6], false));
        assert_eq!(TexelDistribution::new(&vec![1.0; MANY], 512).edge(), EDGE);
        let black = TexelDistribution::with_blocks(&[0.0; 64], 8);
        assert!(black.sample([0.3, 0.4]).is_none() && black.pdf(Vec2::splat(0.5)) == 0.0 && black.integral() == 0.0);
        assert!(TexelDistribution::new(&[], 0).sample([0.5; 2]).is_none());
    }
}
