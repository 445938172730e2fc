//! Trials of settings on some cells of the image: CPU time and variance of a camera sample.
//!
//! A cell is rendered twice, with two seeds. The difference of both means gives the relative variance of a pixel, and
//! the CPU time of the thread gives the cost. All trials have the same cells and seeds, so the ratio of two trials has
//! a smaller error than either. The jackknife over cells estimates it.

use super::allocation::may_split;
use super::constants::{CELL, MIN_ERRORS, MIN_GAIN};
use super::preparation::Preparation;
use super::probe::{LeftToLightPaths, Probe};
use super::processor_time;
use crate::film::{FeatureSet, PixelBounds};
use crate::imaging::metrics::difference::DEFAULT_EPSILON;
use crate::integrators::light_paths;
use crate::scene::RenderJob;
use crate::settings::{IntegratorSettings, Settings};
use lumiris_numbers::math::hash::pcg4d;
use rayon::prelude::*;

/// Combined with the seed of the image to give the seeds of trials.
const SEED: u32 = 0x74_72_69_61;

/// Cells of trials, and the scale of their errors.
pub(super) struct Trials {
    cells: Vec<Vec<[u32; 2]>>,
    spp: u32,
    seeds: [u32; 2],
    left: LeftToLightPaths,
    /// 1/√(m² + ε) of each channel, by cell and pixel, where m is the mean of the images of the first trial.
    scales: Vec<Vec<[f64; 3]>>,
    /// Difference of the two seeds' images in visible emission, by cell and pixel. Its noise is left to emission rays.
    emission: Vec<Vec<[f64; 3]>>,
}

/// Result of a trial: CPU time per camera sample (ns), and sums of |d| and d² over the pixels of each cell. d is the
/// difference of the two images.
#[derive(Clone, Debug)]
pub(super) struct TrialResult {
    pub(super) nanoseconds: f64,
    of_cells: Vec<[f64; 2]>,
    /// True if the error is the squared mean of |d|: direct light, whose adaptive samples follow the noise.
    by_deviations: bool,
}

impl Trials {
    /// Trials on about `count` cells, with `spp` samples per pixel and seed. Every `round` has other cells.
    pub(super) fn new(job: &RenderJob, how: &Preparation<'_>, count: usize, round: u32, spp: u32) -> Self {
        let bounds = job.world.scene.film.bounds;
        let all: Vec<PixelBounds> = bounds.tiles(CELL);
        let step = (all.len() as f64 / count.max(1) as f64).max(1.0);
        let first = f64::from(pcg4d([SEED, round, 0, 1])[0]) / f64::from(u32::MAX) * step;
        let indices = (0..).map(|i| (first + f64::from(i) * step) as usize).take_while(|&i| i < all.len());
        let cells = indices.map(|i| all[i].pixels().collect()).collect();
        let seed = job.settings().sampling.seed;
        let seeds = [0, 1].map(|k| pcg4d([seed, SEED, round, k])[0]);
        Trials { cells, spp, seeds, left: LeftToLightPaths::new(job, how), scales: Vec::new(), emission: Vec::new() }
    }

    /// Renders with the settings of the job on the threads of the current pool.
    pub(super) fn measure(&mut self, job: &RenderJob) -> TrialResult {
        // Light that is left to light paths
        let Settings { integrator: settings, .. } = job.settings();
        let knows_light = light_paths::per_sample(job) > 0.0;
        let none = LeftToLightPaths::none();
        let left = if knows_light { &self.left } else { &none };
        let probe = || Probe::new(job, left, FeatureSet::None);

        // In the first trial, measure visible emission
        if self.emission.is_empty() {
            let only_emission = IntegratorSettings { max_depth: 0, ..*settings };
            let is_split = may_split(job.settings(), settings);
            let of_cell = |probe: &mut Probe<'_>, cell: &Vec<[u32; 2]>| {
                let [a, b] = self.seeds.map(|seed| self.means(probe, &only_emission, cell, seed));
                let part = if is_split { 1.0 } else { 0.0 };
                a.iter().zip(&b).map(|(a, b)| [0, 1, 2].map(|c| part * (a[c] - b[c]))).collect()
            };
            self.emission = self.cells.par_iter().map_init(probe, of_cell).collect();
        }

        // Render both images
        let of_cell = |probe: &mut Probe<'_>, cell: &Vec<[u32; 2]>| {
            let start = processor_time::of_thread();
            let images = self.seeds.map(|seed| self.means(probe, settings, cell, seed));
            (images, (processor_time::of_thread() - start).as_secs_f64())
        };
        let images: Vec<_> = self.cells.par_iter().map_init(probe, of_cell).collect();

        // In the first trial, set the scales
        if self.scales.is_empty() {
            let scale = |(a, b): (&[f64; 3], &[f64; 3])| {
                [0, 1, 2].map(|c| 1.0 / (0.25 * (a[c] + b[c]).powi(2) + DEFAULT_EPSILON).sqrt())
            };
            self.scales = images.iter().map(|([a, b], _)| a.iter().zip(b).map(scale).collect()).collect();
        }

        // Sum the differences
        let sums = |k: usize| {
            let ([a, b], _) = &images[k];
            let mut sums = [0.0; 2];
            for (i, (a, b)) in a.iter().zip(b).enumerate() {
                for c in 0..3 {
                    let d = (a[c] - b[c] - self.emission[k][i][c]).abs() * self.scales[k][i][c];
                    let d = if d.is_finite() { d } else { 0.0 };
                    sums = [sums[0] + d, sums[1] + d * d];
                }
            }
            sums
        };

        // Divide the CPU time by the number of samples
        let samples = self.cells.iter().map(Vec::len).sum::<usize>() as f64 * f64::from(2 * self.spp);
        let seconds: f64 = images.iter().map(|(_, seconds)| seconds).sum();
        TrialResult {
            nanoseconds: seconds * 1e9 / samples.max(1.0),
            of_cells: (0..images.len()).map(sums).collect(),
            by_deviations: settings.depth() <= 1,
        }
    }

    fn means(
        &self,
        probe: &mut Probe<'_>,
        settings: &IntegratorSettings,
        cell: &[[u32; 2]],
        seed: u32,
    ) -> Vec<[f64; 3]> {
        let n = f64::from(self.spp);
        probe.sums(settings, cell, 0..self.spp, seed).into_iter().map(|sum| sum.map(|x| x / n)).collect()
    }
}

/// Logarithm of a relative efficiency.
#[derive(Clone, Copy, Debug)]
pub(super) struct LogGain {
    pub(super) value: f64,
    /// Its standard error.
    pub(super) error: f64,
}

impl TrialResult {
    /// Relative error of an image up to a constant factor, by all cells except `without`. It is the squared mean of
    /// |d|, or its geometric mean with the mean of d², because adaptive sampling follows the noise.
    fn error(&self, without: Option<usize>) -> f64 {
        let cells = self.of_cells.iter().enumerate().filter(|(i, _)| Some(*i) != without);
        let (sums, count) = cells.fold(([0.0; 2], 0.0), |([a, b], n), (_, s)| ([a + s[0], b + s[1]], n + 1.0));
        let [deviation, variance] = sums.map(|sum| sum / f64::max(count, 1.0));
        // Both are equal if all pixels have the same |d|. The factor 0.8 between mean and standard deviation is omitted
        let squared = deviation * deviation / f64::from(3 * CELL * CELL);
        if self.by_deviations { squared } else { (squared * variance).sqrt() }
    }

    /// The efficiency relative to `other`.
    pub(super) fn gain_over(&self, other: &TrialResult) -> LogGain {
        let gain =
            |without| (other.error(without) * other.nanoseconds).ln() - (self.error(without) * self.nanoseconds).ln();
        let all: f64 = gain(None);
        let n = self.of_cells.len();
        let left_out: Vec<f64> = (0..n).map(|i| gain(Some(i))).collect();
        let mean = left_out.iter().sum::<f64>() / n.max(1) as f64;
        let variance =
            left_out.iter().map(|g| (g - mean).powi(2)).sum::<f64>() * (n.max(1) - 1) as f64 / n.max(1) as f64;
        LogGain { value: if all.is_finite() { all } else { 0.0 }, error: variance.sqrt() }
    }

    /// True if the gain is significant.
    pub(super) fn is_better_than(&self, other: &TrialResult) -> bool {
        let LogGain { value, error } = self.gain_over(other);
        value > MIN_GAIN.ln().max(MIN_ERRORS * error)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn measured(nanoseconds: f64, deviations: impl Fn(usize) -> f64) -> TrialResult {
        let of_cell = |i: usize| {
            let d = deviations(i);
            [d * f64::from(3 * CELL * CELL), d * d * f64::from(3 * CELL * CELL)]
        };
        TrialResult { nanoseconds, of_cells: (0..24).map(of_cell).collect(), by_deviations: false }
    }

    #[test]
    fn half_the_deviation_in_twice_the_time_is_twice_as_efficient() {
        let noise = |i: usize| 1.0 + 0.1 * (i % 5) as f64;
        let (one, other) = (measured(100.0, noise), measured(200.0, |i| 0.5 * noise(i)));
        let LogGain { value: gain, error } = other.gain_over(&one);
        assert!((gain - 2_f64.ln()).abs() < 1e-9 && error < 1e-9, "{gain} {error}");
        assert!(other.is_better_than(&one) && !one.is_better_than(&other));
    }

    #[test]
    fn one_cell_alone_may_be_chance() {
        let all = measured(100.0, |i| if i == 7 { 6.0 } else { 1.0 });
        let without = measured(100.0, |_| 1.0);
        let LogGain { value: gain, error } = without.gain_over(&all);
        assert!(gain > 0.2 && error > 0.9 * gain, "{gain} {error}");
        assert!(!without.is_better_than(&all));
    }
}
