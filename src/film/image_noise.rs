//! The noise of an image, by blocks of pixels. It is the target of `--noise`, for which `planning/noise_target.rs`
//! plans the samples, and printed in the progress line and for finished images.
//!
//! The noise of a block of [`BLOCK`] × [`BLOCK`] pixels is σ/(|m| + 0.01), where m is the mean luminance of its pixels,
//! and σ² the mean of their variances.

use super::pixel::PixelSums;
use super::pixel_bounds::PixelBounds;
use crate::imaging::metrics::difference::DEFAULT_EPSILON;
use lumiris_numbers::math::luminance;

/// Edge of a block (pixels).
pub const BLOCK: u32 = 16;

/// The noise of a block with the mean luminance `mean` and the mean variance `variance` of its pixels.
pub fn of_block(mean: f64, variance: f64) -> f64 {
    variance.sqrt() / (mean.abs() + DEFAULT_EPSILON)
}

/// Maximum noise of a block relative to the target, to count as reached. Both the estimated noise of a block and the
/// pilot estimate behind its sample count are noisy.
pub const TOLERANCE: f64 = 1.25;

/// A block that is not black, with pixels of at least two samples.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Block {
    /// Its noise.
    pub noise: f64,
    /// Maximum number of samples of a pixel.
    pub samples: u64,
}

/// Shares of the blocks, by a noise target.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Reached {
    /// Blocks that reach the target, within [`TOLERANCE`].
    pub reached: f64,
    /// Blocks above the target whose pixels have the maximum number of samples.
    pub limited: f64,
    /// All other blocks.
    pub others: f64,
}

impl Reached {
    /// Shares for at most `limit` samples per pixel; `None` if there are no blocks.
    pub fn of(blocks: &[Block], target: f64, limit: u32) -> Option<Self> {
        let share = |is_one: &dyn Fn(&Block) -> bool| {
            blocks.iter().filter(|block| is_one(block)).count() as f64 / blocks.len() as f64
        };
        let is_reached = |block: &Block| block.noise <= TOLERANCE * target;
        let reached = share(&is_reached);
        let limited = share(&|block| !is_reached(block) && block.samples >= u64::from(limit));
        (!blocks.is_empty()).then_some(Reached { reached, limited, others: (1.0 - reached - limited).max(0.0) })
    }
}

/// The noise of an image.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Noise {
    /// Median noise of the blocks, excluding black blocks; infinite if there are none.
    pub median: f64,
    /// Share of the blocks with more than twice the median.
    pub above_twice: f64,
}

impl Noise {
    /// The noise of an image with these blocks.
    pub(super) fn of_image(blocks: &[Block]) -> Self {
        let mut blocks: Vec<f64> = blocks.iter().map(|block| block.noise).collect();
        blocks.sort_unstable_by(f64::total_cmp);
        let (below, middle) = (blocks.len().saturating_sub(1) / 2, blocks.len() / 2);
        let Some(&upper) = blocks.get(middle) else { return Noise { median: f64::INFINITY, above_twice: 0.0 } };
        let median = 0.5 * (blocks[below] + upper);
        let above = blocks.len() - blocks.partition_point(|noise| *noise <= 2.0 * median);
        Noise { median, above_twice: above as f64 / blocks.len() as f64 }
    }
}

/// The blocks of at most [`BLOCK`] rows, from the variances of pixel means. Black blocks, and blocks without pixels of
/// at least two samples, are omitted. Channels are assumed to be fully correlated.
pub(super) fn of_blocks(rows: &PixelBounds, pixels: &[PixelSums], variances: &[[f64; 3]]) -> Vec<Block> {
    let width = rows.width() as usize;
    let of_columns = |first: usize| {
        let columns = first..width.min(first + BLOCK as usize);
        let indices = (0..rows.height() as usize).flat_map(|y| columns.clone().map(move |x| y * width + x));
        let (mut count, mut mean, mut variance, mut samples) = (0.0, 0.0, 0.0, 0);
        for i in indices.filter(|i| pixels[*i].count > 1) {
            count += 1.0;
            samples = samples.max(pixels[i].count);
            mean += luminance(pixels[i].mean());
            variance += luminance(variances[i].map(f64::sqrt)).powi(2);
        }
        (mean != 0.0 || variance > 0.0).then(|| Block { noise: of_block(mean / count, variance / count), samples })
    };
    (0..width).step_by(BLOCK as usize).filter_map(of_columns).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A row of two and a half blocks; the first is black, the others have a mean of 1.
    fn blocks(variance_of: impl Fn(usize) -> f64) -> Vec<Block> {
        let rows = PixelBounds { x0: 5, x1: 45, y0: 3, y1: 4 };
        let pixel = |x: usize| {
            let value = if x < 16 { 0.0 } else { 1.0 };
            PixelSums { count: 4, radiance: [4.0 * value; 3], ..PixelSums::default() }
        };
        let pixels: Vec<PixelSums> = (0..40).map(pixel).collect();
        let variances: Vec<[f64; 3]> = (0..40).map(|x| [variance_of(x); 3]).collect();
        of_blocks(&rows, &pixels, &variances)
    }

    #[test]
    fn the_noise_of_a_block_is_its_standard_error_by_its_mean() {
        // One of 16 pixels, and half of 8 pixels
        let found = blocks(|x| if x == 20 { 0.16 } else { f64::from(u8::from(x > 35)) });
        let expected = [0.1 / 1.01, (0.5_f64).sqrt() / 1.01];
        assert_eq!(found.len(), 2, "a black block is none");
        assert!(
            found.iter().zip(expected).all(|(a, b)| (a.noise / b - 1.0).abs() < 1e-12 && a.samples == 4),
            "{found:?}"
        );
    }

    fn of(noise: &[f64]) -> Noise {
        Noise::of_image(&noise.iter().map(|&noise| Block { noise, samples: 4 }).collect::<Vec<_>>())
    }

    #[test]
    fn one_block_of_any_noise_does_not_change_the_median() {
        let noise = of(&[0.1, 9.29, 0.2, 0.3, 0.15]);
        assert_eq!(noise, Noise { median: 0.2, above_twice: 0.2 });
        assert_eq!(of(&[0.1, 0.3]), Noise { median: 0.2, above_twice: 0.0 });
        assert_eq!(of(&[]).median, f64::INFINITY);
    }

    #[test]
    fn blocks_above_the_noise_that_was_asked_for_hit_the_limit_or_not() {
        let block = |noise, samples| Block { noise, samples };
        let blocks = [block(0.01, 3), block(0.0249, 64), block(0.026, 64), block(0.03, 63)];
        let expected = Reached { reached: 0.5, limited: 0.25, others: 0.25 };
        assert_eq!(Reached::of(&blocks, 0.02, 64), Some(expected));
        assert_eq!(Reached::of(&[], 0.02, 64), None);
    }
}
