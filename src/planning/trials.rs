//! Trials of settings on some cells of the image: the time of a camera sample and its variance.
//!
//! A cell is rendered twice, by two seeds. The difference of both means tells the variance of a pixel, relative to its value, and the
//! processor time of the thread is the cost. All trials have the same cells and seeds, so that the ratio of two of them is known
//! better than either; the jackknife over cells tells how well.

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

/// Combined with the seed of the image to give those of trials.
const SEED: u32 = 0x74_72_69_61;

/// Where trials are made, and by what their errors are relative.
pub(super) struct Trials {
    cells: Vec<Vec<[u32; 2]>>,
    spp: u32,
    seeds: [u32; 2],
    left: LeftToLightPaths,
    /// By cell and pixel, once the first trial was made: 1/√(m² + ε) of each channel, m being the mean of its images.
    scales: Vec<Vec<[f64; 3]>>,
    /// By cell and pixel, how images of the two seeds differ in what they see of lights, whose noise is left to looks.
    seen: Vec<Vec<[f64; 3]>>,
}

/// What was measured of settings: processor time of a camera sample (ns), and sums over the pixels of each cell of |d| and d², d being
/// the difference of the two images.
#[derive(Clone, Debug)]
pub(super) struct Measured {
    pub(super) nanoseconds: f64,
    of_cells: Vec<[f64; 2]>,
    /// True if the squared mean of deviations counts, as where samples go to the noise.
    by_deviations: bool,
}

impl Trials {
    /// Trials on about `count` cells, other ones for each `round`, with so many samples of a pixel and seed.
    pub(super) fn new(job: &RenderJob, how: &Preparation<'_>, (count, round): (usize, u32), spp: u32) -> Self {
        let bounds = job.world.scene.film.bounds;
        let all: Vec<PixelBounds> = bounds.tiles(CELL);
        let step = (all.len() as f64 / count.max(1) as f64).max(1.0);
        let first = f64::from(pcg4d([SEED, round, 0, 1])[0]) / f64::from(u32::MAX) * step;
        let places = (0..).map(|i| (first + f64::from(i) * step) as usize).take_while(|&i| i < all.len());
        let cells = places.map(|i| all[i].pixels().collect()).collect();
        let seed = job.settings().sampling.seed;
        let seeds = [0, 1].map(|k| pcg4d([seed, SEED, round, k])[0]);
        Trials { cells, spp, seeds, left: LeftToLightPaths::new(job, how), scales: Vec::new(), seen: Vec::new() }
    }

    /// Measures the settings of the job. On the threads of the current pool.
    pub(super) fn measure(&mut self, job: &RenderJob) -> Measured {
        let Settings { integrator: settings, .. } = job.settings();
        let knows_light = light_paths::per_sample(job) > 0.0;
        let none = LeftToLightPaths::none();
        let left = if knows_light { &self.left } else { &none };
        let probe = || Probe::new(job, left, FeatureSet::None);
        if self.seen.is_empty() {
            let seeing = IntegratorSettings { max_depth: 0, ..*settings };
            let is_split = may_split(job.settings(), settings);
            let of_cell = |probe: &mut Probe<'_>, cell: &Vec<[u32; 2]>| {
                let [a, b] = self.seeds.map(|seed| self.means(probe, &seeing, cell, seed));
                let part = if is_split { 1.0 } else { 0.0 };
                a.iter().zip(&b).map(|(a, b)| [0, 1, 2].map(|c| part * (a[c] - b[c]))).collect()
            };
            self.seen = self.cells.par_iter().map_init(probe, of_cell).collect();
        }
        let of_cell = |probe: &mut Probe<'_>, cell: &Vec<[u32; 2]>| {
            let start = processor_time::of_thread();
            let images = self.seeds.map(|seed| self.means(probe, settings, cell, seed));
            (images, (processor_time::of_thread() - start).as_secs_f64())
        };
        let images: Vec<_> = self.cells.par_iter().map_init(probe, of_cell).collect();
        if self.scales.is_empty() {
            let scale = |(a, b): (&[f64; 3], &[f64; 3])| {
                [0, 1, 2].map(|c| 1.0 / (0.25 * (a[c] + b[c]).powi(2) + DEFAULT_EPSILON).sqrt())
            };
            self.scales = images.iter().map(|([a, b], _)| a.iter().zip(b).map(scale).collect()).collect();
        }
        let sums = |k: usize| {
            let ([a, b], _) = &images[k];
            let mut sums = [0.0; 2];
            for (i, (a, b)) in a.iter().zip(b).enumerate() {
                for c in 0..3 {
                    let d = (a[c] - b[c] - self.seen[k][i][c]).abs() * self.scales[k][i][c];
                    let d = if d.is_finite() { d } else { 0.0 };
                    sums = [sums[0] + d, sums[1] + d * d];
                }
            }
            sums
        };
        let samples = self.cells.iter().map(Vec::len).sum::<usize>() as f64 * f64::from(2 * self.spp);
        let seconds: f64 = images.iter().map(|(_, seconds)| seconds).sum();
        Measured {
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
        probe.sums(settings, cell, (0..self.spp, seed)).into_iter().map(|sum| sum.map(|x| x / n)).collect()
    }
}

impl Measured {
    /// The relative error of an image times a constant, by all cells but the one given: the mean of variances, or its geometric mean
    /// with the squared mean of deviations, since adaptive numbers go to the noise.
    fn error(&self, without: Option<usize>) -> f64 {
        let cells = self.of_cells.iter().enumerate().filter(|(i, _)| Some(*i) != without);
        let (sums, count) = cells.fold(([0.0; 2], 0.0), |([a, b], n), (_, s)| ([a + s[0], b + s[1]], n + 1.0));
        let [deviation, variance] = sums.map(|sum| sum / f64::max(count, 1.0));
        // Alike where all pixels have the same deviation d: |d| is 0.8 of it on average, which is left out
        let squared = deviation * deviation / f64::from(3 * CELL * CELL);
        if self.by_deviations { squared } else { (squared * variance).sqrt() }
    }

    /// How many times as efficient as `other` it is, as a logarithm, and the standard error of that.
    pub(super) fn gain_over(&self, other: &Measured) -> (f64, f64) {
        let gain =
            |without| (other.error(without) * other.nanoseconds).ln() - (self.error(without) * self.nanoseconds).ln();
        let all: f64 = gain(None);
        let n = self.of_cells.len();
        let left_out: Vec<f64> = (0..n).map(|i| gain(Some(i))).collect();
        let mean = left_out.iter().sum::<f64>() / n.max(1) as f64;
        let variance =
            left_out.iter().map(|g| (g - mean).powi(2)).sum::<f64>() * (n.max(1) - 1) as f64 / n.max(1) as f64;
        (if all.is_finite() { all } else { 0.0 }, variance.sqrt())
    }

    /// True if it is better by more than chance.
    pub(super) fn is_better_than(&self, other: &Measured) -> bool {
        let (gain, error) = self.gain_over(other);
        gain > MIN_GAIN.ln().max(MIN_ERRORS * error)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn measured(nanoseconds: f64, deviations: impl Fn(usize) -> f64) -> Measured {
        let of_cell = |i: usize| {
            let d = deviations(i);
            [d * f64::from(3 * CELL * CELL), d * d * f64::from(3 * CELL * CELL)]
        };
        Measured { nanoseconds, of_cells: (0..24).map(of_cell).collect(), by_deviations: false }
    }

    #[test]
    fn half_the_deviation_in_twice_the_time_is_twice_as_efficient() {
        let noise = |i: usize| 1.0 + 0.1 * (i % 5) as f64;
        let (one, other) = (measured(100.0, noise), measured(200.0, |i| 0.5 * noise(i)));
        let (gain, error) = other.gain_over(&one);
        assert!((gain - 2_f64.ln()).abs() < 1e-9 && error < 1e-9, "{gain} {error}");
        assert!(other.is_better_than(&one) && !one.is_better_than(&other));
    }

    #[test]
    fn one_cell_alone_may_be_chance() {
        let all = measured(100.0, |i| if i == 7 { 6.0 } else { 1.0 });
        let without = measured(100.0, |_| 1.0);
        let (gain, error) = without.gain_over(&all);
        assert!(gain > 0.2 && error > 0.9 * gain, "{gain} {error}");
        assert!(!without.is_better_than(&all));
    }
}
