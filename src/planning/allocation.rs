//! Adaptive sampling: numbers of camera samples per pixel that minimise the error of the image.
//!
//! The relative error is Σ v_p/n_p over pixels with the relative variance v_p and n_p samples. For a given time
//! Σ c_p n_p, where c_p is the cost of a sample, it is least for n_p ∝ √(v_p/c_p). Variance and cost are estimated by a
//! *pilot*: a few samples per pixel with random numbers of their own. So n_p is independent of the samples of the
//! image, and the mean of a pixel stays unbiased. If n_p depended on the averaged samples, pixels whose first samples
//! happen to be dark would stay dark.
//!
//! The variance of visible emission is concentrated in few pixels, at the edges of lights. It is measured by more
//! samples than the rest: emission rays, which cost little. The variance of the rest is averaged over neighbours. In
//! the image, too, samples may have several emission rays (`render::emission_rays`). Their number follows from their
//! own variance and cost as if they were independent. Low-discrepancy samples need fewer for the relative error, which
//! would fall by 5 %, but the absolute error would triple.
//!
//! The gain is estimated from the pilot, too: on one half of the pixels, with counts computed from the other half.
//! Where the noise is similar everywhere, as in most paths of many bounces, counts stay uniform.
//!
//! The counts depend on scene, settings and seed only. Costs are counted in rays and proposals, not in seconds.

use super::allocation_counts::{ALONE, Pixel, PixelCounts, Rules, SHARED, Share, counts};
use super::constants::{
    COST_TILE, EDGE_FACTOR, EDGE_RATIO, EMISSION_DIVISOR, EMISSION_RADIUS, EMISSION_RAY_COST, EMISSION_SPP, FEW_PIXELS,
    MAX_SPP_FOR_NOISE, PILOT_SPP, TILES_AT_ONCE,
};
use super::noise_target::counts_for;
use super::preparation::{PlanError, Preparation, Stage};
use super::probe::{LeftToLightPaths, Probe, around};
use crate::direct::Estimator;
use crate::film::accumulator::PixelAccumulator;
use crate::film::{FeatureSet, PixelBounds, PixelSample, PixelSums};
use crate::imaging::metrics::difference::DEFAULT_EPSILON;
use crate::integrators::reuse;
use crate::scene::{PixelSamples, RenderJob};
use crate::settings::{Allocation, IntegratorSettings, MIN_ADAPTIVE_SPP, SamplingSettings, Settings};
use lumiris_numbers::math::hash::{pcg4d, unit_f32};
use lumiris_numbers::math::luminance;
use rayon::prelude::*;
use std::collections::BTreeMap;
use std::sync::atomic::{AtomicBool, Ordering};

/// Combined with the seed of the image to give the seed of the pilot.
const PILOT_SEED: u32 = 0x61_6c_6c_6f;

/// Camera samples of each pixel; `None` if the settings do not ask for adaptive sampling, do not allow it, or nothing
/// is gained.
pub(super) fn allocate(job: &RenderJob, how: &Preparation<'_>) -> Result<Option<PixelSamples>, PlanError> {
    let settings = job.settings();
    if let Some(noise) = settings.sampling.noise.filter(|_| settings.allows_adaptive()) {
        return counts_for(job, noise, how).map(Some);
    }
    let is_short = settings.sampling.pilot_spp() < MIN_ADAPTIVE_SPP;
    if settings.allocation() != Allocation::Adaptive || !settings.allows_adaptive() || is_short {
        return Ok(None);
    }
    let mut pilot = Pilot::new(job, how);
    let spp = settings.sampling.spp;
    pilot.measure();
    let PixelCounts { samples, emission_rays } = counts(&pilot.estimates(|_| true, &[0, 1]), &pilot.rules, spp);
    let is_better = pilot.gain(spp) >= pilot.rules.min_gain;
    how.goes_on()?;
    Ok(is_better.then_some(PixelSamples { bounds: pilot.bounds, spp, counts: samples, emission_rays }))
}

/// Completes settings with a target noise: sets the maximum number of samples per pixel unless `has_spp`. `Err` names
/// the missing requirement.
pub fn complete_for_noise(settings: &mut Settings, has_spp: bool) -> Result<(), &'static str> {
    if settings.sampling.noise.is_none() {
        return Ok(());
    }
    if !has_spp {
        settings.sampling.spp = MAX_SPP_FOR_NOISE;
    }
    let enough = SamplingSettings { spp: MIN_ADAPTIVE_SPP, ..settings.sampling };
    if settings.allows_adaptive() {
        Ok(())
    } else if (Settings { sampling: enough, ..*settings }).allows_adaptive() {
        Err("needs 8 samples per pixel at least (--spp)")
    } else {
        Err("needs the integrator direct or path, and an estimator that does not fit blocks of samples")
    }
}

/// Statistics of the pilot's samples of a pixel. Compact, because a pilot holds all pixels of an image at once.
#[derive(Clone, Copy, Debug, Default)]
struct PixelStatistics {
    count: u32,
    /// Σ of the samples without visible emission.
    radiance: [f32; 3],
    /// Variance of these; 0 for fewer than two samples.
    variance: [f32; 3],
    /// Mean visible emission.
    emission: [f32; 3],
    /// Variance of the visible emission, from each of two sets of emission rays.
    emission_variance: [[f32; 3]; 2],
    /// Cost of a sample, and of an emission ray; 0 if nothing was measured.
    cost: f32,
    ray_cost: f32,
    /// Material of the first surface, or [`NO_MATERIAL`].
    material: u32,
}

/// The material of pixels without a surface.
const NO_MATERIAL: u32 = u32::MAX;

impl PixelStatistics {
    fn of(samples: &PixelAccumulator, emission: &EmissionSums, [cost, ray_cost]: [f64; 2]) -> Self {
        let sums = samples.sums();
        let [a, b] = emission.sets.each_ref().map(PixelAccumulator::sums);
        PixelStatistics {
            count: sums.count as u32,
            radiance: sums.radiance.map(|x| x as f32),
            variance: variance(&sums).map(|v| v as f32),
            emission: std::array::from_fn(|c| {
                ((a.radiance[c] + b.radiance[c]) / (a.count + b.count).max(1) as f64) as f32
            }),
            emission_variance: [a, b].map(|sums| variance(&sums).map(|v| v as f32)),
            cost: cost as f32,
            ray_cost: ray_cost as f32,
            material: emission.material,
        }
    }

    /// Variance of the visible emission, averaged over the given sets.
    fn mean_emission_variance(&self, sets: &[usize]) -> [f64; 3] {
        let of =
            |c: usize| sets.iter().map(|&k| f64::from(self.emission_variance[k][c])).sum::<f64>() / sets.len() as f64;
        [0, 1, 2].map(of)
    }
}

/// Σ over channels.
fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a.into_iter().zip(b).map(|(a, b)| a * b).sum()
}

/// Two sets of emission rays of a pixel, and the material of the first surface.
struct EmissionSums {
    sets: [PixelAccumulator; 2],
    material: u32,
}

/// Variance of a single sample.
fn variance(sums: &PixelSums) -> [f64; 3] {
    sums.variance_of_mean().map(|v| v * sums.count as f64)
}

/// The pilot: a few samples of all pixels, or of some.
struct Pilot<'a> {
    job: &'a RenderJob,
    stage: Stage<'a>,
    stop: &'a AtomicBool,
    sampling: PilotSampling,
    rules: Rules,
    left: LeftToLightPaths,
    bounds: PixelBounds,
    /// Row by row.
    pixels: Vec<PixelStatistics>,
}

#[derive(Clone, Copy)]
struct PilotSampling {
    /// Samples per pixel.
    spp: u32,
    /// Fraction of the pixels that are sampled.
    fraction: f32,
    seed: u32,
    /// Edge of the blocks of pixels that are sampled together and share paths (pixels).
    edge: u32,
    /// Emission rays per pixel in each of the two sets.
    emission: u32,
}

impl<'a> Pilot<'a> {
    /// A pilot without samples.
    fn new(job: &'a RenderJob, how: &'a Preparation<'a>) -> Self {
        let (sampling, edge) = (&job.settings().sampling, reuse::edge(job));
        let rules = if edge > 1 { SHARED } else { ALONE };
        let wanted = rules.fraction * f64::from(sampling.pilot_spp());
        let spp = (wanted.round() as u32).clamp(PILOT_SPP[0], PILOT_SPP[1]);
        let sampling = PilotSampling {
            spp,
            fraction: (wanted / f64::from(spp)) as f32,
            seed: pcg4d([sampling.seed, PILOT_SEED, 0, 0])[0],
            edge,
            emission: (sampling.pilot_spp() / EMISSION_DIVISOR).clamp(EMISSION_SPP[0], EMISSION_SPP[1]),
        };
        let bounds = job.world.scene.film.bounds;
        let pixels = vec![PixelStatistics::default(); bounds.area()];
        let stage = Stage::new(how, "measuring the noise of each pixel", bounds.tiles(COST_TILE).len());
        Pilot { job, stage, stop: how.stop, sampling, rules, left: LeftToLightPaths::new(job, how), bounds, pixels }
    }

    /// Samples all tiles, [`TILES_AT_ONCE`] at a time.
    fn measure(&mut self) {
        // Sample one tile, unless stopped
        let tiles = self.bounds.tiles(COST_TILE);
        let features = if self.rules.radius.is_none() { FeatureSet::NoAlbedo } else { FeatureSet::None };
        let probe = || Probe::new(self.job, &self.left, features);
        let of_tile = |probe: &mut _, tile: &PixelBounds| {
            let is_over = self.stop.load(Ordering::Relaxed);
            let measured = if is_over { Vec::new() } else { pilot_tile(self.job, probe, tile, self.sampling) };
            self.stage.add(1);
            measured
        };

        // Chunks of tiles in parallel
        for tiles in tiles.chunks(TILES_AT_ONCE) {
            let measured: Vec<_> = tiles.par_iter().map_init(probe, of_tile).collect();
            for (tile, measured) in tiles.iter().zip(measured) {
                for (pixel, measured) in tile.pixels().zip(measured) {
                    self.pixels[self.bounds.index_of(pixel)] = measured;
                }
            }
        }
    }

    /// Pixels at most `radius` from pixel `i` in both directions.
    fn around(&self, i: usize, radius: usize) -> impl Iterator<Item = usize> + use<> {
        around(i, [self.bounds.width() as usize, self.bounds.height() as usize], radius)
    }

    /// 1/(m² + ε) per channel. m is the visible emission of the pixel plus the mean of the rest over its neighbours.
    fn relative_to(&self, i: usize) -> [f64; 3] {
        self.relative_beside(i, self.pixels[i].emission.map(f64::from))
    }

    /// The same for the given visible emission.
    fn relative_beside(&self, i: usize, emission: [f64; 3]) -> [f64; 3] {
        let (mut sum, mut count) = ([0.0; 3], 0);
        for q in self.around(i, self.rules.mean_radius).map(|q| &self.pixels[q]) {
            count += q.count;
            (0..3).for_each(|c| sum[c] += f64::from(q.radiance[c]));
        }
        std::array::from_fn(|c| {
            let mean = emission[c] + sum[c] / f64::from(count.max(1));
            1.0 / (mean * mean + DEFAULT_EPSILON)
        })
    }

    /// Relative variance of a sample without visible emission, summed over channels; `None` for fewer than two samples.
    fn relative_variance(&self, i: usize) -> Option<f64> {
        let p = &self.pixels[i];
        let of_channels = self.relative_to(i).into_iter().zip(p.variance);
        (p.count >= 2).then(|| of_channels.map(|(relative, v)| relative * f64::from(v)).sum())
    }

    /// Relative variance of the visible emission, by the given sets.
    fn relative_emission_variance(&self, i: usize, sets: &[usize]) -> f64 {
        let variance = self.pixels[i].mean_emission_variance(sets);
        if variance == [0.0; 3] { 0.0 } else { dot(variance, self.relative_to(i)) }
    }

    /// Estimates for each pixel. The relative variance without visible emission is averaged over chosen pixels: the
    /// neighbours, or all pixels with the same material. The variance of visible emission uses the given sets.
    fn estimates(&self, is_chosen: impl Fn(usize) -> bool + Sync, sets: &[usize]) -> Vec<Pixel> {
        let variance = |i: usize| self.relative_variance(i).filter(|_| is_chosen(i));
        let rest = match self.rules.radius {
            Some(radius) => {
                // Σ over neighbours, and their number
                let terms = (0..self.bounds.area()).into_par_iter().map(|i| variance(i).map_or([0.0; 2], |v| [v, 1.0]));
                box_sums(terms.collect(), self.bounds.width() as usize, radius)
            }
            None => self.of_materials(variance),
        };
        // In a tile with few pixels, none may be sampled: it has the mean cost
        let (sum, count) =
            self.pixels.iter().filter(|p| p.cost > 0.0).fold((0.0, 0), |(sum, n), p| (sum + f64::from(p.cost), n + 1));
        let mean = (sum / f64::from(count.max(1))) as f32;
        let of_pixel = |(i, [sum, count]): (usize, [f64; 2])| {
            let PixelStatistics { cost, ray_cost, .. } = self.pixels[i];
            let cost = if cost == 0.0 && ray_cost > 0.0 { mean } else { cost };
            let rest = (sum.max(0.0) / count.max(1.0)) as f32;
            Pixel { rest, emission: self.emission_variance_around(i, sets) as f32, cost, ray_cost }
        };
        rest.into_par_iter().enumerate().map(of_pixel).collect()
    }

    /// Σ of the estimates over pixels with the same first material, and their number. A material with few pixels is
    /// close to the mean of all.
    fn of_materials(&self, variance: impl Fn(usize) -> Option<f64>) -> Vec<[f64; 2]> {
        let (mut all, mut of_material) = ([0.0; 2], BTreeMap::<u32, [f64; 2]>::new());
        for (i, pixel) in self.pixels.iter().enumerate() {
            let Some(v) = variance(i) else { continue };
            for sums in [&mut all, of_material.entry(pixel.material).or_default()] {
                *sums = [sums[0] + v, sums[1] + 1.0];
            }
        }
        let mean = all[0] / all[1].max(1.0);
        let with_mean = |[sum, count]: [f64; 2]| [sum + FEW_PIXELS * mean, count + FEW_PIXELS];
        let of = |pixel: &PixelStatistics| with_mean(of_material.get(&pixel.material).copied().unwrap_or_default());
        self.pixels.iter().map(of).collect()
    }

    /// Relative variance of visible emission of a pixel, or of its neighbourhood if that is larger: a few samples do
    /// not hit the edge of a light in all pixels that it crosses.
    fn emission_variance_around(&self, i: usize, sets: &[usize]) -> f64 {
        let (mut variance, mut emission, mut count) = ([0.0; 3], [0.0; 3], 0.0);
        for q in self.around(i, EMISSION_RADIUS).map(|q| &self.pixels[q]) {
            let of_pixel = q.mean_emission_variance(sets);
            (0..3).for_each(|c| {
                variance[c] += of_pixel[c];
                emission[c] += f64::from(q.emission[c]);
            });
            count += 1.0;
        }
        if variance == [0.0; 3] {
            return 0.0;
        }
        let of_all = dot(variance, self.relative_beside(i, emission.map(|s| s / count))) / count;
        of_all.max(self.relative_emission_variance(i, sets))
    }

    /// Factor by which the counts reduce error × cost. It is measured on one half of the pixels with counts from the
    /// other half; visible emission by one set of emission rays with counts from the other set. Where pixels share
    /// paths, it is the geometric mean of the factors for the relative and the absolute error. Nearly all of the
    /// absolute error is at edges of visible lights.
    fn gain(&self, spp: u32) -> f64 {
        // Counts from even pixels and the first set
        let width = self.bounds.width() as usize;
        let is_even = |i: usize| (i % width + i / width).is_multiple_of(2);
        let PixelCounts { samples, emission_rays } = counts(&self.estimates(is_even, &[0]), &self.rules, spp);

        // Errors and costs of odd pixels by the second set, uniform and adaptive
        let (mut uniform, mut adaptive) = ([0.0; 3], [0.0; 3]);
        for i in (0..samples.len()).filter(|&i| !is_even(i)) {
            let Some(relative) = self.relative_variance(i) else { continue };
            let p = &self.pixels[i];
            let [rest, emission] =
                [p.variance, p.emission_variance[1]].map(|v| v.iter().map(|v| f64::from(*v)).sum::<f64>());
            let share = Share { samples: f64::from(samples[i]) / f64::from(spp), emission_rays: emission_rays[i] };
            for (sums, share) in [(&mut uniform, Share::ONE), (&mut adaptive, share)] {
                let pixel = |rest: f64, emission: f64| Pixel {
                    rest: rest as f32,
                    emission: emission as f32,
                    cost: p.cost,
                    ray_cost: p.ray_cost,
                };
                let [relative, cost] = share.of(&pixel(relative, self.relative_emission_variance(i, &[1])));
                let [absolute, _] = share.of(&pixel(rest, emission));
                sums.iter_mut().zip([relative, absolute, cost]).for_each(|(sum, term)| *sum += term);
            }
        }

        // Ratio of the products
        let [relative, absolute, cost] = [0, 1, 2].map(|k| uniform[k] / adaptive[k]);
        let gain = cost * if self.rules.doubles { (relative * absolute).sqrt() } else { relative };
        if gain.is_finite() { gain } else { 1.0 }
    }
}

/// Σ over the neighbours at most `radius` away in both directions, in rows of `width` pixels.
fn box_sums(mut values: Vec<[f64; 2]>, width: usize, radius: usize) -> Vec<[f64; 2]> {
    // Sums of a line by prefix sums
    let sums_of = |line: &[[f64; 2]]| -> Vec<[f64; 2]> {
        let prefix: Vec<[f64; 2]> = std::iter::once([0.0; 2])
            .chain(line.iter().scan([0.0; 2], |sum, v| {
                *sum = [sum[0] + v[0], sum[1] + v[1]];
                Some(*sum)
            }))
            .collect();
        let sum = |i: usize| {
            let from = prefix[i.saturating_sub(radius)];
            let to = prefix[(i + radius + 1).min(line.len())];
            [to[0] - from[0], to[1] - from[1]]
        };
        (0..line.len()).map(sum).collect()
    };

    // Rows, then columns
    let height = values.len() / width.max(1);
    values.par_chunks_mut(width.max(1)).for_each(|row| row.copy_from_slice(&sums_of(row)));
    let columns: Vec<Vec<[f64; 2]>> = (0..width)
        .into_par_iter()
        .map(|x| sums_of(&(0..height).map(|y| values[y * width + x]).collect::<Vec<_>>()))
        .collect();
    (0..values.len()).into_par_iter().map(|i| columns[i % width][i / width]).collect()
}

/// Statistics of the pilot's samples in a tile.
fn pilot_tile(
    job: &RenderJob,
    probe: &mut Probe<'_>,
    tile: &PixelBounds,
    PilotSampling { spp, fraction, seed, edge, emission: emission_spp }: PilotSampling,
) -> Vec<PixelStatistics> {
    // Choose blocks of pixels
    let settings = &Estimator::without_fits(&job.settings().integrator, 0);
    let origin = job.world.scene.film.bounds;
    let only_emission = &IntegratorSettings { max_depth: 0, ..*settings };
    let is_chosen = |[x, y]: &[u32; 2]| {
        let [x, y] = [(x - origin.x0) / edge, (y - origin.y0) / edge];
        unit_f32(pcg4d([x, y, PILOT_SEED, 1])[0]) < fraction
    };
    let all: Vec<[u32; 2]> = tile.pixels().collect();
    let (indices, chosen): (Vec<usize>, Vec<[u32; 2]>) = (0..).zip(&all).filter(|(_, pixel)| is_chosen(pixel)).unzip();

    // Visible emission of the samples, which is subtracted from them
    let mut visible = Vec::with_capacity(chosen.len() * spp as usize);
    probe.trace(only_emission, &chosen, 0..spp, seed, |_, sample| visible.push(sample.radiance));
    probe.take_cost(0);

    // Samples without visible emission
    let mut sums = vec![PixelAccumulator::default(); all.len()];
    let mut visible = visible.into_iter();
    probe.trace(settings, &chosen, 0..spp, seed, |i, sample| {
        let radiance = sample.radiance - visible.next().unwrap_or_default();
        sums[indices[i]].add(0, &PixelSample { radiance, ..PixelSample::default() });
    });
    let cost = probe.take_cost(chosen.len() * spp as usize);

    // Emission rays
    let emission = emission_sums(probe, only_emission, &all, tile.width() as usize, emission_spp, seed);
    let emission_rays: u64 =
        emission.iter().flat_map(|emission| &emission.sets).map(|sums| u64::from(sums.radiance.count)).sum();
    let costs = [cost, EMISSION_RAY_COST * probe.take_cost(emission_rays as usize)];
    sums.iter().zip(&emission).map(|(samples, emission)| PixelStatistics::of(samples, emission, costs)).collect()
}

/// Two sets of emission rays, of pixels in rows of the given width. Pixels whose neighbours differ get more of them.
fn emission_sums(
    probe: &mut Probe<'_>,
    settings: &IntegratorSettings,
    pixels: &[[u32; 2]],
    width: usize,
    spp: u32,
    seed: u32,
) -> Vec<EmissionSums> {
    // Samples of both sets, with seeds of their own
    let none = || EmissionSums { sets: <[PixelAccumulator; 2]>::default(), material: NO_MATERIAL };
    let mut sums: Vec<EmissionSums> = std::iter::repeat_with(none).take(pixels.len()).collect();
    let seeds = [1, 2].map(|set| pcg4d([seed, PILOT_SEED, 0, set])[0]);
    let mut add = |indices: &[usize], samples: std::ops::Range<u32>| {
        let some: Vec<[u32; 2]> = indices.iter().map(|&i| pixels[i]).collect();
        for (set, seed) in seeds.into_iter().enumerate() {
            probe.trace(settings, &some, samples.clone(), seed, |i, sample| {
                let emission = &mut sums[indices[i]];
                emission.sets[set].add(0, sample);
                emission.material = sample.features.as_ref().map_or(emission.material, |features| features.material);
            });
        }
        let luminance = |sums: &PixelAccumulator| luminance(sums.radiance.values());
        sums.iter().map(|emission| emission.sets.each_ref().map(luminance)).collect::<Vec<_>>()
    };

    // All pixels, then those at edges
    let all: Vec<usize> = (0..pixels.len()).collect();
    let first = add(&all, 0..spp);
    let differs = |i: &usize| {
        let around = around(*i, [width, pixels.len() / width], 1).flat_map(|q| first[q]);
        let (low, high) = around.fold((f64::INFINITY, 0.0), |(a, b), v| (v.min(a), v.max(b)));
        high > EDGE_RATIO * low
    };
    let edges: Vec<usize> = all.iter().copied().filter(differs).collect();
    add(&edges, spp..EDGE_FACTOR * spp);
    sums
}
