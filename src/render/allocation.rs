//! Camera samples where they lower the error most: more for pixels of more noise, fewer for expensive ones.
//!
//! The relative error of an image is Σ v_p/n_p over pixels of relative variance v_p with n_p samples. For a given time
//! Σ c_p n_p, where c_p is the cost of a sample, it is least for n_p ∝ √(v_p/c_p). Both come from a *pilot*: a few samples
//! per pixel with random numbers of their own. So n_p is independent of the samples of the image, and the mean of a
//! pixel's samples remains unbiased: were n_p to follow from the very samples that are averaged, pixels whose first samples
//! happen to be dark would stay dark.
//!
//! What is gained is estimated from the pilot, too, by one half of the pixels with numbers from the other half, first on a
//! part of the image: where noise is much the same everywhere, as in most paths of many bounces, numbers remain uniform.
//!
//! The numbers depend on scene, settings and seed only; costs are counted in rays and proposals and not in seconds.

use super::noise::counts_for;
use super::pilot_samples::trace_pixels;
use super::worker::Worker;
use super::{RenderSettings, Run, position};
use crate::direct::Estimator;
use crate::film::PixelBounds;
use crate::film::accumulator::PixelAccumulator;
use crate::imaging::metrics::difference::DEFAULT_EPSILON;
use crate::integrators::{PathStats, PathTracer, Tracer};
use crate::scene::{PixelSamples, RenderJob};
use crate::settings::{Allocation, IntegratorKind, Settings};
use lumiris_numbers::math::hash::{pcg4d, unit_f32};
use rayon::prelude::*;
use std::sync::atomic::AtomicBool;

/// Fewest samples per pixel for which a pilot pays.
const MIN_SPP: u32 = 8;
/// Samples of the pilot as a fraction of those of the image.
const PILOT_FRACTION: f64 = 0.05;
/// Fewest and most samples of a pixel in the pilot; with less than the fewest, the pilot has fewer pixels.
const PILOT_SPP: [u32; 2] = [2, 8];
/// Combined with the seed of the image to give that of the pilot.
const PILOT_SEED: u32 = 0x61_6c_6c_6f;
/// Edge of the tiles whose samples have one cost (pixels): part of the result, unlike that of rendering.
const COST_TILE: u32 = 16;
/// Variances are averaged over this many pixels to each side.
const RADIUS: usize = 2;
/// Fewest and most samples of a pixel, relative to the mean.
const RANGE: [f64; 2] = [0.5, 8.0];
/// One in this many tiles is sampled first.
const SCOUTS: u32 = 4;
/// Tiles whose samples are in memory before they are reduced to what [`Measured`] holds.
const TILES_AT_ONCE: usize = 1024;
/// Pixels from which on a part of the image tells whether there is anything to gain.
const MIN_SCOUTED: usize = 256 * (COST_TILE * COST_TILE) as usize;
/// Factor of the error below which numbers remain uniform.
const MIN_GAIN: f64 = 1.05;
/// Maximum number of samples per pixel for a standard error that is asked for, if none is given.
const MAX_SPP_FOR_NOISE: u32 = 4096;

/// The camera samples of each pixel, if the settings ask for different numbers and allow them.
pub(super) fn allocate(job: &RenderJob) -> Option<PixelSamples> {
    let settings = job.settings();
    if let Some(noise) = settings.sampling.noise.filter(|_| allows_adaptive(settings)) {
        return Some(counts_for(job, noise, settings.sampling.spp));
    }
    if settings.sampling.allocation != Allocation::Adaptive || !allows_adaptive(settings) {
        return None;
    }
    let mut pilot = Pilot::new(job);
    let spp = settings.sampling.spp;
    pilot.measure(|tile| tile % SCOUTS == 0);
    // Few tiles say nothing of the others
    if pilot.bounds.area() >= MIN_SCOUTED && pilot.gain(spp) < MIN_GAIN {
        return None;
    }
    pilot.measure(|tile| tile % SCOUTS != 0);
    let counts = counts(&pilot.weights(|_| true), &pilot.costs(), spp);
    (pilot.gain(spp) >= MIN_GAIN).then_some(PixelSamples { bounds: pilot.bounds, spp, counts })
}

/// Completes settings that ask for a standard error: its maximum number of samples per pixel, unless `has_spp`. `Err` says what it
/// needs.
pub fn complete_for_noise(settings: &mut Settings, has_spp: bool) -> Result<(), &'static str> {
    if settings.sampling.noise.is_none() {
        return Ok(());
    }
    if !has_spp {
        settings.sampling.spp = MAX_SPP_FOR_NOISE;
    }
    let needs = "needs the integrator direct or path, and an estimator that does not fit blocks of samples";
    if allows_adaptive(settings) { Ok(()) } else { Err(needs) }
}

/// True if pixels may have different numbers of samples: they share nothing, are fitted neither to others nor in blocks, and have
/// enough samples for a pilot.
pub fn allows_adaptive(settings: &Settings) -> bool {
    let i = &settings.integrator;
    matches!(i.kind, IntegratorKind::Direct | IntegratorKind::Path)
        && !Estimator::at_vertex(i, 0).is_progressive()
        && !Estimator::at_vertex(i, 0).is_over_pixels()
        && settings.sampling.spp >= MIN_SPP
}

/// What a pilot's samples of a pixel say, in few bytes: a pilot has all pixels of an image at once.
#[derive(Clone, Copy, Debug, Default)]
struct Measured {
    count: u32,
    /// Σ of the samples.
    radiance: [f32; 3],
    /// Variance of a sample; 0 of fewer than two.
    variance: [f32; 3],
    /// Cost of a sample; 0 where nothing was measured.
    cost: f32,
}

impl Measured {
    fn of(samples: &PixelAccumulator, cost: f64) -> Self {
        let sums = samples.sums();
        let variance = sums.variance_of_mean().map(|v| (v * sums.count as f64) as f32);
        Measured { count: sums.count as u32, radiance: sums.radiance.map(|x| x as f32), variance, cost: cost as f32 }
    }
}

/// A few samples of the pixels, or of some of them.
struct Pilot<'a> {
    job: &'a RenderJob,
    /// Samples of a pixel, fraction of the pixels that have them, and seed.
    sampling: (u32, f32, u32),
    bounds: PixelBounds,
    /// Row by row.
    pixels: Vec<Measured>,
}

impl<'a> Pilot<'a> {
    /// Without samples.
    fn new(job: &'a RenderJob) -> Self {
        let sampling = &job.settings().sampling;
        let wanted = PILOT_FRACTION * f64::from(sampling.spp);
        let spp = (wanted.round() as u32).clamp(PILOT_SPP[0], PILOT_SPP[1]);
        let seed = pcg4d([sampling.seed, PILOT_SEED, 0, 0])[0];
        let bounds = job.world.scene.film.bounds;
        let pixels = vec![Measured::default(); bounds.area()];
        Pilot { job, sampling: (spp, (wanted / f64::from(spp)) as f32, seed), bounds, pixels }
    }

    /// Samples the tiles whose numbers are chosen. Tiles with the same remainder lie on lattices.
    fn measure(&mut self, is_chosen: impl Fn(u32) -> bool) {
        let (render, stop) = (RenderSettings::default(), AtomicBool::new(false));
        let run = Run::new(self.job, &render, &stop, &|_| ());
        let mut tiles = self.bounds.tiles(COST_TILE);
        tiles.retain(|t| is_chosen((t.x0 - self.bounds.x0) / COST_TILE + 2 * ((t.y0 - self.bounds.y0) / COST_TILE)));
        let worker = || Worker::new(PathTracer::new(false));
        let of_tile = |worker: &mut _, tile: &_| pilot_tile(&run, worker, tile, self.sampling);
        for tiles in tiles.chunks(TILES_AT_ONCE) {
            let measured: Vec<_> = tiles.par_iter().map_init(worker, of_tile).collect();
            for (tile, measured) in tiles.iter().zip(measured) {
                for (i, measured) in measured.into_iter().enumerate() {
                    let [x, y] = position(tile, i as u32);
                    let row = (y - self.bounds.y0) as usize * self.bounds.width() as usize;
                    self.pixels[row + (x - self.bounds.x0) as usize] = measured;
                }
            }
        }
    }

    /// The cost of a sample of each pixel.
    fn costs(&self) -> Vec<f32> {
        self.pixels.iter().map(|p| p.cost).collect()
    }

    /// The pixels up to `radius` away in each direction.
    fn around(&self, i: usize, radius: usize) -> impl Iterator<Item = usize> + use<> {
        let (width, height) = (self.bounds.width() as usize, self.bounds.height() as usize);
        let window = |i: usize, len: usize| i.saturating_sub(radius)..(i + radius + 1).min(len);
        let columns = window(i % width, width);
        window(i / width, height).flat_map(move |y| columns.clone().map(move |x| y * width + x))
    }

    /// Σ of the variance of a sample over its squared mean plus ε by channel; the mean is that of neighbours, too. `None`
    /// where it is not known.
    fn relative_variance(&self, i: usize) -> Option<f64> {
        let p = &self.pixels[i];
        if p.count < 2 {
            return None;
        }
        let (mut sum, mut count) = ([0.0; 3], 0);
        for q in self.around(i, 1).map(|q| &self.pixels[q]) {
            count += q.count;
            (0..3).for_each(|c| sum[c] += f64::from(q.radiance[c]));
        }
        let of_channel = |c: usize| {
            let mean = sum[c] / f64::from(count);
            f64::from(p.variance[c]) / (mean * mean + DEFAULT_EPSILON)
        };
        Some((0..3).map(of_channel).sum())
    }

    /// v_p: the relative variance, averaged over the chosen ones of the neighbours.
    fn weights(&self, is_chosen: impl Fn(usize) -> bool + Sync) -> Vec<f32> {
        let area = self.bounds.area();
        // Not a number where it is not known
        let of_pixel = |i: usize| self.relative_variance(i).map_or(f32::NAN, |v| v as f32);
        let of_pixels: Vec<f32> = (0..area).into_par_iter().map(of_pixel).collect();
        let smooth = |i: usize| {
            let known = self.around(i, RADIUS).filter(|&q| is_chosen(q)).map(|q| of_pixels[q]).filter(|v| !v.is_nan());
            let (sum, count) = known.fold((0.0, 0), |(s, n), v| (s + f64::from(v), n + 1));
            (sum / f64::from(count.max(1))) as f32
        };
        (0..area).into_par_iter().map(smooth).collect()
    }

    /// By how much the numbers lower the error: that of half of the pixels, with numbers that follow from the other half.
    fn gain(&self, spp: u32) -> f64 {
        let width = self.bounds.width() as usize;
        let is_even = |i: usize| (i % width + i / width).is_multiple_of(2);
        let counts = counts(&self.weights(is_even), &self.costs(), spp);
        let odd = (0..counts.len()).filter(|&i| !is_even(i));
        let known = odd.filter_map(|i| Some((self.relative_variance(i)?, f64::from(counts[i]))));
        let (uniform, adaptive) = known.fold((0.0, 0.0), |(u, a), (v, n)| (u + v / f64::from(spp), a + v / n));
        if adaptive > 0.0 { uniform / adaptive } else { 1.0 }
    }
}

/// What the pilot's samples in a tile say.
fn pilot_tile(
    run: &Run<'_>,
    worker: &mut Worker<PathTracer>,
    tile: &PixelBounds,
    (spp, fraction, seed): (u32, f32, u32),
) -> Vec<Measured> {
    let mut sums = vec![PixelAccumulator::default(); tile.area()];
    let is_chosen = |i: &u32| {
        let [x, y] = position(tile, *i);
        unit_f32(pcg4d([x, y, PILOT_SEED, 1])[0]) < fraction
    };
    let chosen: Vec<u32> = (0..tile.area() as u32).filter(is_chosen).collect();
    trace_pixels(run, worker, (tile, &chosen), 0..spp, seed, |i, sample| sums[i as usize].add(0, sample));
    let cost = cost(&worker.tracer.take_stats());
    sums.iter().map(|samples| Measured::of(samples, cost)).collect()
}

/// Mean cost of a camera sample; that of one which hits nothing is 1.
fn cost(stats: &PathStats) -> f64 {
    let work = stats.camera_rays + 2 * stats.bounce_rays + stats.direct.proposals;
    work as f64 / stats.camera_rays.max(1) as f64
}

/// Numbers of samples n ∝ √(v/c), limited to [`RANGE`], of the same cost as `spp` everywhere.
fn counts(weights: &[f32], costs: &[f32], spp: u32) -> Vec<u32> {
    let wanted: Vec<f32> = weights.iter().zip(costs).map(|(v, c)| (v / c.max(1.0)).sqrt()).collect();
    let limit = |n: f64| n.clamp(RANGE[0], RANGE[1]);
    let of_pixel = |factor: f64, (w, c): (&f32, &f32)| limit(factor * f64::from(*w)) * f64::from(*c);
    let cost_of = |factor: f64| wanted.iter().zip(costs).map(|pixel| of_pixel(factor, pixel)).sum::<f64>();
    let all = costs.iter().map(|c| f64::from(*c)).sum::<f64>();
    // Bisection of the logarithm; costs rise with the factor
    let (mut low, mut high) = (-60.0_f64, 60.0_f64);
    for _ in 0..60 {
        let middle = 0.5 * (low + high);
        if cost_of(middle.exp2()) < all { low = middle } else { high = middle }
    }
    let factor = low.exp2();
    // Where nothing varies, all pixels have the mean
    let is_open = |w: f64| w > 0.0 && factor.is_finite();
    let count = |w: f64| if is_open(w) { limit(factor * w) } else { RANGE[0] };
    wanted.iter().map(|w| ((count(f64::from(*w)) * f64::from(spp)).round() as u32).max(1)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::SQRT_2;

    #[test]
    fn numbers_of_samples_follow_noise_and_cost_and_keep_the_time() {
        // Two in three pixels have a quarter of the variance of the others, and one of these costs twice as much
        let weights: Vec<f32> = (0..300).map(|i| if i % 3 == 0 { 4.0 } else { 1.0 }).collect();
        let costs: Vec<f32> = (0..300).map(|i| if i % 3 == 1 { 2.0 } else { 1.0 }).collect();
        let counts = counts(&weights, &costs, 64);
        assert!((f64::from(counts[0]) / f64::from(counts[2]) - 2.0).abs() < 0.05, "{:?}", &counts[..3]);
        assert!((f64::from(counts[2]) / f64::from(counts[1]) - SQRT_2).abs() < 0.05, "{:?}", &counts[..3]);
        let time: f64 = counts.iter().zip(&costs).map(|(&n, &c)| f64::from(n) * f64::from(c)).sum();
        let uniform = 64.0 * f64::from(costs.iter().sum::<f32>());
        assert!((time / uniform - 1.0).abs() < 0.01, "{time} {uniform}");
    }

    #[test]
    fn no_pixel_has_less_than_half_or_more_than_eight_times_the_mean() {
        let weights: Vec<f32> = (0..1000_u16).map(|i| if i == 5 { 1e12 } else { f32::from(i % 2) * 1e-9 }).collect();
        let counts = counts(&weights, &[1.0; 1000], 16);
        assert_eq!((counts[5], counts[0]), (128, 8));
        assert!(counts.iter().all(|n| (8..=128).contains(n)));
        let still = super::counts(&[0.0; 4], &[1.0; 4], 16);
        assert!(still.iter().all(|n| *n >= 1), "nothing varies: {still:?}");
    }
}
