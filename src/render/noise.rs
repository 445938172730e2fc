//! `--noise`: as many camera samples as a standard error needs, block by block.
//!
//! The noise of a block of 16 × 16 pixels is σ/(m + 0.01): m is its mean luminance, and σ² the mean over its pixels of the
//! variance of their luminance. A *pilot* estimates both: each pixel is rendered twice with n samples, by two seeds of their
//! own, and half the squared difference of the two is the variance of n samples, whatever the sampler gains over
//! independent ones. It falls at least as fast as 1/n, which says how many samples the block needs. The schedule: n = 2,
//! doubled for blocks that need more than [`REACH`] times the pilot's samples, until none does or the limit is reached.
//!
//! So the number of samples follows from the pilot alone, and is independent of the samples of the image, whose mean is
//! therefore unbiased. Rendering until the image's own samples agree would stop too early where they agree by chance: where
//! they all miss what is rare and bright.

use super::pilot_samples::{LeftToLightPaths, pilot_images};
use super::worker::Worker;
use super::{RenderSettings, Run, position};
use crate::film::{FeatureSet, PixelBounds};
use crate::imaging::metrics::difference::DEFAULT_EPSILON;
use crate::integrators::PathTracer;
use crate::scene::{PixelSamples, RenderJob};
use lumiris_numbers::math::hash::pcg4d;
use lumiris_numbers::math::luminance;
use rayon::prelude::*;
use std::sync::atomic::{AtomicBool, Ordering};

/// Edge of a block (pixels).
pub const BLOCK: u32 = 16;
/// Samples of a pixel and seed of the pilot in the beginning.
const FIRST: u32 = 2;
/// Samples that a block may need for each sample of the pilot.
const REACH: u32 = 16;
/// Combined with the seed of the image to give those of the pilot.
const SEED: u32 = 0x6e_6f_69_73;

/// The camera samples of each pixel for a noise of `threshold` in every block, at most those of the settings. They are of no use
/// once `stop` is true, which ends the pilot.
pub(super) fn counts_for(job: &RenderJob, threshold: f32, stop: &AtomicBool) -> PixelSamples {
    let render = RenderSettings::default();
    let run = Run::new(job, &render, stop, &|_| ());
    let seed = job.settings().sampling.seed;
    let seeds = [0, 1].map(|k| pcg4d([seed, SEED, 0, k])[0]);
    let bounds = job.world.scene.film.bounds;
    let blocks = bounds.tiles(BLOCK);
    let left = LeftToLightPaths::new(job);
    let of_block = |worker: &mut _, block| count_of_block(&run, worker, block, (seeds, threshold), stop);
    let of_blocks: Vec<u32> = blocks.par_iter().map_init(|| left.worker(job, FeatureSet::None), of_block).collect();

    let mut counts = vec![1; bounds.area()];
    for (block, count) in blocks.iter().zip(of_blocks) {
        for i in 0..block.area() as u32 {
            let [x, y] = position(block, i);
            counts[(y - bounds.y0) as usize * bounds.width() as usize + (x - bounds.x0) as usize] = count;
        }
    }
    let mean = counts.iter().map(|&n| u64::from(n)).sum::<u64>().div_ceil(counts.len().max(1) as u64);
    PixelSamples { bounds, spp: (mean as u32).max(1), counts, looks: Vec::new() }
}

/// The samples per pixel of a block.
fn count_of_block(
    run: &Run<'_>,
    worker: &mut Worker<PathTracer>,
    block: &PixelBounds,
    (seeds, threshold): ([u32; 2], f32),
    stop: &AtomicBool,
) -> u32 {
    let sampling = &run.job.settings().sampling;
    let (limit, pilot_limit) = (sampling.spp, sampling.pilot_spp());
    let mut sums = seeds.map(|_| vec![[0.0; 3]; block.area()]);
    let (mut done, mut until) = (0, FIRST);
    loop {
        for (sums, seed) in sums.iter_mut().zip(seeds) {
            for (sum, added) in sums.iter_mut().zip(pilot_images(run, worker, block, done..until, seed)) {
                (0..3).for_each(|c| sum[c] += added[c]);
            }
        }
        done = until;
        let needed = samples_for(&sums, done, threshold);
        if needed <= f64::from(REACH * 2 * done) || 2 * done >= pilot_limit || stop.load(Ordering::Relaxed) {
            return needed.clamp(1.0, f64::from(limit)) as u32;
        }
        until = 2 * done;
    }
}

/// Samples for a noise of `threshold`, where the pixels have the given sums of `n` samples each, by two seeds.
fn samples_for([a, b]: &[Vec<[f64; 3]>; 2], n: u32, threshold: f32) -> f64 {
    let (mut variance, mut mean) = (0.0, 0.0);
    for (a, b) in a.iter().zip(b) {
        let [a, b] = [a, b].map(|sum| luminance(*sum) / f64::from(n));
        variance += 0.5 * (a - b) * (a - b);
        mean += 0.5 * (a + b);
    }
    let pixels = a.len().max(1) as f64;
    let (variance, mean) = (variance / pixels, mean / pixels);
    let wanted = f64::from(threshold) * (mean.abs() + DEFAULT_EPSILON);
    (f64::from(n) * variance / (wanted * wanted)).ceil()
}

#[cfg(test)]
mod tests {
    use super::*;
    use lumiris_test_support::random::{RngExt, pcg32};

    #[test]
    fn a_block_gets_the_samples_that_its_noise_asks_for() {
        // Uniform numbers from 0 to 2: mean 1, variance 1/3 of each of 4 samples
        let mut s = pcg32([3, 1, 4]);
        let mut sum = || (0..4).map(|_| 2.0 * f64::from(s.random::<f32>())).sum::<f64>();
        let sums = [0, 1].map(|_| (0..4096).map(|_| [sum(); 3]).collect::<Vec<_>>());
        let expected = 1.0 / 3.0 / (0.02 * 1.01_f64).powi(2);
        let found = samples_for(&sums, 4, 0.02);
        assert!((found / expected - 1.0).abs() < 0.07, "{found} {expected}");
        assert_eq!(samples_for(&[vec![[0.0; 3]; 4], vec![[0.0; 3]; 4]], 4, 0.02), 0.0);
    }
}
