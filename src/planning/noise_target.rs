//! `--noise`: numbers of camera samples for a given noise, block by block.
//!
//! The noise of a block is defined in [`crate::film::image_noise`]. A *pilot* estimates its mean and variance. It
//! renders each pixel twice with n samples, with two seeds of its own. Half the squared difference is the variance of n
//! samples, including the gain of the sampler over independent samples. This variance falls at least as fast as 1/n,
//! which gives the number of samples that the block needs. The pilot starts with n = 2. It doubles n for blocks that
//! need more than [`REACH`] times its samples, until none does or the limit is reached.
//!
//! Visible emission is measured separately. If it causes much of the variance, as at the edge of a lamp, samples have
//! several emission rays (`render::emission_rays`). Their number minimises the time for the requested noise.
//!
//! The counts depend on the pilot only and are independent of the samples of the image, whose mean is therefore
//! unbiased. Rendering until the image's own samples agree would stop too early where they agree by chance: where all
//! of them miss rare, bright light.

use super::constants::{EMISSION_RAY_COST, FIRST, MAX_EMISSION_RAYS, MAX_RAYS_PER_PILOT_SAMPLE, REACH};
use super::preparation::{PlanError, Preparation, Stage};
use super::probe::{LeftToLightPaths, Probe, around};
use crate::direct::Estimator;
use crate::film::image_noise::{BLOCK, of_block};
use crate::film::{FeatureSet, PixelBounds};
use crate::scene::{PixelSamples, RenderJob};
use crate::settings::{IntegratorSettings, Settings};
use lumiris_numbers::math::hash::pcg4d;
use lumiris_numbers::math::luminance;
use rayon::prelude::*;
use std::sync::atomic::{AtomicBool, Ordering};

/// Combined with the seed of the image to give the seeds of the pilot.
const SEED: u32 = 0x6e_6f_69_73;

/// Camera samples of each pixel for a noise of at most `threshold` in every block, up to the limit of the settings.
pub(super) fn counts_for(job: &RenderJob, threshold: f32, how: &Preparation<'_>) -> Result<PixelSamples, PlanError> {
    // Count the samples of each block
    let seed = job.settings().sampling.seed;
    let seeds = [0, 1].map(|k| pcg4d([seed, SEED, 0, k])[0]);
    let bounds = job.world.scene.film.bounds;
    let blocks = bounds.tiles(BLOCK);
    let left = LeftToLightPaths::new(job, how);
    let stage = Stage::new(how, "measuring the noise of each block", blocks.len());
    let of_block = |probe: &mut _, block| {
        how.goes_on()?;
        let counts = counts_of_block(job, probe, block, seeds, threshold, how.stop);
        stage.add(1);
        Ok(counts)
    };
    let probe = || Probe::new(job, &left, FeatureSet::None);
    let of_blocks: Vec<BlockCounts> = blocks.par_iter().map_init(probe, of_block).collect::<Result<_, PlanError>>()?;

    // Spread the counts over the pixels
    let (mut counts, mut emission_rays) = (vec![1; bounds.area()], vec![1; bounds.area()]);
    for (block, of_block) in blocks.iter().zip(of_blocks) {
        for (pixel, of_pixel) in block.pixels().zip(of_block.emission_rays) {
            let pixel = bounds.index_of(pixel);
            (counts[pixel], emission_rays[pixel]) = (of_block.samples, of_pixel);
        }
    }
    if emission_rays.iter().all(|n| *n == 1) {
        emission_rays = Vec::new();
    }

    // Compute the mean count
    let mean = counts.iter().map(|&n| u64::from(n)).sum::<u64>().div_ceil(counts.len().max(1) as u64);
    Ok(PixelSamples { bounds, spp: (mean as u32).max(1), counts, emission_rays })
}

/// Samples per pixel of a block, and emission rays per sample, pixel by pixel.
struct BlockCounts {
    samples: u32,
    emission_rays: Vec<u8>,
}

/// Sums of the pilot's samples in a block, by two seeds.
struct Sums {
    /// Radiance, row by row.
    all: [Vec<[f64; 3]>; 2],
    /// Visible emission, which is part of the radiance.
    emission: [Vec<[f64; 3]>; 2],
    /// Cost of a sample and of an emission ray.
    costs: [f64; 2],
}

fn counts_of_block(
    job: &RenderJob,
    probe: &mut Probe<'_>,
    block: &PixelBounds,
    seeds: [u32; 2],
    threshold: f32,
    stop: &AtomicBool,
) -> BlockCounts {
    // Settings of the samples and of emission rays
    let Settings { integrator, sampling } = job.settings();
    let integrator = &Estimator::without_fits(integrator, 0);
    let (limit, pilot_limit) = (sampling.spp, sampling.pilot_spp());
    let only_emission = IntegratorSettings { max_depth: 0, ..*integrator };
    let pixels: Vec<[u32; 2]> = block.pixels().collect();
    let none = || seeds.map(|_| vec![[0.0; 3]; block.area()]);
    let mut sums = Sums { all: none(), emission: none(), costs: [0.0; 2] };
    let (mut done, mut until) = (0, FIRST);

    // Double the samples until they suffice
    loop {
        // Add up radiance, visible emission and their costs
        let Sums { all, emission, costs } = &mut sums;
        for ((sums, settings), of_kind) in [(all, integrator), (emission, &only_emission)].into_iter().zip(costs) {
            probe.take_cost(0);
            for (sums, seed) in sums.iter_mut().zip(seeds) {
                for (sum, added) in sums.iter_mut().zip(probe.sums(settings, &pixels, done..until, seed)) {
                    (0..3).for_each(|c| sum[c] += added[c]);
                }
            }
            *of_kind = probe.take_cost(2 * pixels.len() * (until - done) as usize);
        }

        // Estimate the samples that are needed
        done = until;
        let Needed { samples, emission_rays } = needed_for(&sums, block.width() as usize, done, threshold);
        if samples <= f64::from(REACH * 2 * done) || 2 * done >= pilot_limit || stop.load(Ordering::Relaxed) {
            return BlockCounts { samples: samples.clamp(1.0, f64::from(limit)) as u32, emission_rays };
        }
        until = 2 * done;
    }
}

/// Estimated samples per pixel of a block, without limits, and emission rays per sample, pixel by pixel.
struct Needed {
    samples: f64,
    emission_rays: Vec<u8>,
}

/// The samples for a noise of `threshold`. The pixels, in rows of `width`, have sums of
/// `n` samples of each seed.
fn needed_for(Sums { all, emission, costs }: &Sums, width: usize, n: u32, threshold: f32) -> Needed {
    let pixels = all[0].len();
    let per_sample = 1.0 / f64::from(n);
    let luminances =
        |sums: &[Vec<[f64; 3]>; 2], i: usize| [&sums[0], &sums[1]].map(|sums| luminance(sums[i]) * per_sample);
    // Variance of a single sample
    let variance = |[a, b]: [f64; 2]| 0.5 * (a - b) * (a - b) * f64::from(n);
    let (mut mean, mut whole, mut rest) = (0.0, 0.0, 0.0);
    let mut emission_variances = Vec::with_capacity(pixels);
    for i in 0..pixels {
        let (radiance, lights) = (luminances(all, i), luminances(emission, i));
        mean += 0.5 * (radiance[0] + radiance[1]);
        whole += variance(radiance);
        rest += variance([radiance[0] - lights[0], radiance[1] - lights[1]]);
        emission_variances.push(variance(lights));
    }
    let edges = around_any(&emission_variances, width);
    let (at_edges, emission_variance) =
        (edges.iter().filter(|is_edge| **is_edge).count(), emission_variances.iter().sum::<f64>());
    let count = pixels.max(1) as f64;
    let [mean, whole, rest] = [mean, whole, rest].map(|sum| sum / count);
    let samples = |variance: f64| (of_block(mean, variance) / f64::from(threshold)).powi(2).ceil();
    let alone = Needed { samples: samples(whole), emission_rays: vec![1; pixels] };
    if emission_variance == 0.0 {
        return alone;
    }
    // Emission rays at edge pixels: the number that minimises time × variance, limited because few samples estimate it
    // poorly
    let [cost, ray_cost] = [costs[0].max(1.0), EMISSION_RAY_COST * costs[1].max(1.0)];
    let part = at_edges as f64 / count;
    let emission_rays = (emission_variance / at_edges as f64 * cost / (rest * ray_cost))
        .sqrt()
        .min(f64::from(MAX_RAYS_PER_PILOT_SAMPLE * n))
        .min(f64::from(MAX_EMISSION_RAYS));
    let emission_rays = emission_rays.round();
    let split = rest + emission_variance / count / emission_rays;
    if emission_rays < 2.0 || split * (cost + part * emission_rays * ray_cost) >= whole * cost {
        return alone;
    }
    let of_pixel = |is_edge| if is_edge { emission_rays as u8 } else { 1 };
    Needed { samples: samples(split), emission_rays: edges.into_iter().map(of_pixel).collect() }
}

/// Marks pixels, in rows of `width`, whose value or a neighbour's is not 0: few samples do not hit an edge in all
/// pixels that it crosses.
fn around_any(values: &[f64], width: usize) -> Vec<bool> {
    let size = [width, values.len() / width.max(1)];
    let is_any = |i: usize| around(i, size, 1).any(|q| values[q] > 0.0);
    (0..values.len()).map(is_any).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use lumiris_test_support::random::{RngExt, pcg32};

    /// Sums of 4 samples of each pixel. The visible emission is uniform in 0 to 2 × `emission`, the rest
    /// uniform in 0 to 2.
    fn sums(pixels: usize, emission: impl Fn(usize) -> f64) -> Sums {
        let mut s = pcg32([3, 1, 4]);
        let mut sum = || (0..4).map(|_| 2.0 * f64::from(s.random::<f32>())).sum::<f64>();
        let emission = [0, 1].map(|_| (0..pixels).map(|i| [sum() * emission(i); 3]).collect::<Vec<_>>());
        let all = emission.each_ref().map(|emission| emission.iter().map(|v| [v[0] + sum(); 3]).collect());
        Sums { all, emission, costs: [20.0, 1.0] }
    }

    #[test]
    fn a_block_gets_the_samples_that_its_noise_asks_for() {
        // Mean 1 and variance 1/3 of each of 4 samples
        let still = sums(4096, |_| 0.0);
        let expected = 1.0 / 3.0 / (0.02 * 1.01_f64).powi(2);
        let Needed { samples, emission_rays } = needed_for(&still, 64, 4, 0.02);
        assert!((samples / expected - 1.0).abs() < 0.07, "{samples} {expected}");
        assert!(emission_rays.iter().all(|n| *n == 1));
        let black = || [0, 1].map(|_| vec![[0.0; 3]; 4]);
        let black = Sums { all: black(), emission: black(), costs: [1.0; 2] };
        let Needed { samples, emission_rays } = needed_for(&black, 2, 4, 0.02);
        assert_eq!((samples, emission_rays), (0.0, vec![1; 4]));
    }

    #[test]
    fn the_edge_of_a_lamp_gets_emission_rays_and_not_samples() {
        // One column of 64 covers the edge of a lamp
        let is_edge = |i: usize| i % 64 == 20;
        let lamp = sums(4096, |i| if is_edge(i) { 100.0 } else { 0.0 });
        let Needed { samples, emission_rays } = needed_for(&lamp, 64, 4, 0.02);
        assert!((0..4096).all(|i| (emission_rays[i] > 1) == (19..=21).contains(&(i % 64))), "in pixels beside it, too");
        let n = f64::from(emission_rays[20]);
        // √(s c/(r c_look)), where s is the mean over three columns
        let best = (1e4 / 3.0 * 20.0 / EMISSION_RAY_COST).sqrt().min(f64::from(4 * MAX_RAYS_PER_PILOT_SAMPLE));
        assert!((n / best - 1.0).abs() < 0.1, "{n} {best}");
        let wanted = |mean: f64| (0.02 * (mean + 0.01)).powi(2);
        let expected = (1.0 / 3.0 + 1e4 / 3.0 / 64.0 / n) / wanted(1.0 + 100.0 / 64.0);
        assert!((samples / expected - 1.0).abs() < 0.2, "{samples} {expected}");
        // If the rest varies as much, additional emission rays are not worth their time
        let faint = sums(4096, |i| if is_edge(i) { 0.2 } else { 0.0 });
        assert!(needed_for(&faint, 64, 4, 0.02).emission_rays.iter().all(|n| *n == 1));
    }
}
