//! Whether control variates over pixels gain more than they cost, by a pilot.
//!
//! A net over all samples of a pixel leaves little of what control variates know of most images: there they cost time, and
//! the noise of their coefficients remains. So blocks of pixels spread over the image are rendered twice, with random
//! numbers of their own, and the squared difference of the two is compared with that of the corrected blocks. Where it
//! does not fall by [`MIN_GAIN`], the image is that of `mis`, or of `ris` without them; and without a pilot where there are fewer columns than
//! [`MIN_COLUMNS`], with which little can be gained.
//!
//! The choice follows from scene, settings and seed, and not from the samples of the image: so it adds no bias, and
//! all parts of an image make the same one.

use super::control_variates::{means, pixel};
use super::pilot_samples::LeftToLightPaths;
use super::worker::Worker;
use super::{BATCH_PATHS, RenderSettings, Run, position};
use crate::direct::Estimator;
use crate::film::accumulator::PixelAccumulator;
use crate::film::{FeatureSet, PixelBounds};
use crate::imaging::metrics::difference::DEFAULT_EPSILON;
use crate::integrators::PathTracer;
use crate::scene::RenderJob;
use crate::settings::{ControlVariates, EstimatorKind, IntegratorKind, Settings, Target};
use lumiris_numbers::estimators::ocv::pixels::{Memory, Picture};
use lumiris_numbers::math::hash::{pcg4d, unit_f32};
use lumiris_numbers::samplers::SamplerKind;
use rayon::prelude::*;
use std::sync::atomic::{AtomicBool, Ordering};

/// Edge of a block (pixels).
const BLOCK: u32 = 8;
/// Pixels of the smallest image with a pilot, which takes up to 3 % of its time; smaller ones have control variates.
const MIN_PIXELS: usize = 8192;
/// Fewest and most blocks, and pixels of the image for each.
const BLOCKS: [usize; 2] = [8, 64];
const PIXELS_PER_BLOCK: usize = 3072;
/// Part of the samples per pixel that blocks have, and fewest of them.
const PART: u32 = 4;
const MIN_SPP: u32 = 2;
/// Fewest columns that may pay: by one of light and one of a lobe, no more than 6 % of the variance is explained even in
/// hindsight (`docs/measurements/ocv/pixels.md`).
const MIN_COLUMNS: usize = 3;
/// By how much the error must fall, without and with the column of a lobe: more than columns take of the time, which is
/// some 20 and 25 % (`docs/measurements/efficiency`).
const MIN_GAIN: [f64; 2] = [1.2, 1.25];
/// How many times that where samples are not independent: a net over all of them leaves less to gain than one over a part, 1.11 and
/// 1.18 of 1.3.
const OF_NETS: f64 = 1.15;
/// By how much that of the first half of the blocks must fall, for the pilot to go on.
const SCOUT_GAIN: f64 = 1.03;
/// Combined with the seed of the image to give those of the pilot.
const PILOT_SEED: u32 = 0x63_6f_6e_74;

/// Makes the choice, if the settings leave it open. It is of no use once `stop` is true, which ends the pilot.
pub(super) fn choose(job: &mut RenderJob, stop: &AtomicBool) {
    if !is_open(job.settings(), &job.world.scene.film.bounds) {
        return;
    }
    let is_useful = job.controls() >= MIN_COLUMNS && pays(job, stop);
    job.change(|s| {
        if is_useful {
            s.integrator.ocv.control_variates = ControlVariates::Always;
            return;
        }
        if s.integrator.estimator == EstimatorKind::Ris {
            s.integrator.ris.target = Target::Fgl;
            return;
        }
        let samples = s.integrator.sample_counts().samples;
        s.integrator.estimator = EstimatorKind::Mis;
        if s.integrator.sample_counts().samples != samples {
            s.integrator.samples = Some(samples);
        }
    });
}

/// True if [`choose`] has something to choose for an image with these pixels.
pub(super) fn is_open(settings: &Settings, bounds: &PixelBounds) -> bool {
    let i = &settings.integrator;
    bounds.area() >= MIN_PIXELS
        && Estimator::at_vertex(i, 0).is_over_pixels()
        && i.ocv.control_variates == ControlVariates::Auto
        && matches!(i.kind, IntegratorKind::Direct | IntegratorKind::Path)
}

/// True if the error falls by enough, in half of the blocks by some of it and then in all.
fn pays(job: &RenderJob, stop: &AtomicBool) -> bool {
    let (sampling, bounds) = (&job.settings().sampling, &job.world.scene.film.bounds);
    let render = RenderSettings::default();
    let run = Run::new(job, &render, stop, &|_| ());
    let spp = (sampling.pilot_spp() / PART).max(MIN_SPP);
    let seeds = [0, 1].map(|k| pcg4d([sampling.seed, PILOT_SEED, k, 0])[0]);
    let left = LeftToLightPaths::new(job);
    let of_block = |worker: &mut _, block: &PixelBounds| {
        let is_over = stop.load(Ordering::Relaxed);
        if is_over { [0.0; 2] } else { difference(seeds.map(|seed| images(&run, worker, block, (spp, seed)))) }
    };
    let blocks = blocks(bounds, sampling.seed);
    let of_nets = if sampling.sampler == SamplerKind::Independent { 1.0 } else { OF_NETS };
    let min_gain = of_nets * MIN_GAIN[usize::from(job.controls() > job.lights.groups.len())];
    let [mut alone, mut corrected] = [0.0; 2];
    [(0, SCOUT_GAIN), (1, min_gain)].into_iter().all(|(first, gain)| {
        let some: Vec<_> = blocks.iter().skip(first).step_by(2).collect();
        let worker = || left.worker(job, FeatureSet::NoAlbedo);
        let differences: Vec<_> = some.into_par_iter().map_init(worker, of_block).collect();
        for [a, c] in differences {
            (alone, corrected) = (alone + a, corrected + c);
        }
        alone > gain * corrected
    })
}

/// The blocks: one of each of as many runs of equal length, row by row.
fn blocks(bounds: &PixelBounds, seed: u32) -> Vec<PixelBounds> {
    let tiles = bounds.tiles(BLOCK);
    let count = (bounds.area() / PIXELS_PER_BLOCK).clamp(BLOCKS[0], BLOCKS[1]);
    let of_run = |k: usize| {
        let u = f64::from(unit_f32(pcg4d([seed, PILOT_SEED, k as u32, 1])[0]));
        tiles[((k as f64 + u) / count as f64 * tiles.len() as f64) as usize]
    };
    (0..count).map(of_run).collect()
}

/// The means of a pixel, as they are and corrected.
type Means = [[f64; 3]; 2];

/// Relative squared difference of two images of a block.
fn difference([a, b]: [Vec<Means>; 2]) -> [f64; 2] {
    let mut sums = [0.0; 2];
    for (a, b) in a.iter().zip(&b) {
        for c in 0..3 {
            let mean = 0.5 * (a[0][c] + b[0][c]);
            let relative = 1.0 / (mean * mean + DEFAULT_EPSILON);
            (0..2).for_each(|k| sums[k] += relative * (a[k][c] - b[k][c]).powi(2));
        }
    }
    sums
}

/// The pixels of a block with `spp` samples each and random numbers of a seed.
fn images(run: &Run<'_>, worker: &mut Worker<PathTracer>, tile: &PixelBounds, (spp, seed): (u32, u32)) -> Vec<Means> {
    let (job, area) = (run.job, tile.area());
    let settings = &job.settings().integrator;
    let mut fits = Estimator::at_vertex(settings, 0).fits(job, area);
    let mut sums = vec![PixelAccumulator::default(); area];
    let all: Vec<u32> = (0..area as u32).collect();
    for pixels in all.chunks((BATCH_PATHS / spp.max(1) as usize).max(1)) {
        worker.samples.clear();
        let of_pixels = pixels.iter().map(|&i| (i, position(tile, i), 0..spp));
        run.camera.samples(of_pixels, seed, &mut worker.scratch, &mut worker.samples);
        worker.tracer.trace(job, settings, &worker.samples, &mut fits, &mut worker.results);
        for (&i, results) in pixels.iter().zip(worker.results.chunks(spp as usize)) {
            results.iter().zip(0..).for_each(|(result, k)| sums[i as usize].add(k, result));
        }
    }

    // As the image would be corrected
    let (m, width) = (fits.controls(), tile.width() as usize);
    let sums: Vec<_> = sums.iter().map(PixelAccumulator::sums).collect();
    let exact = fits.exact_sums();
    let (mut pixels, mut controls) = (Vec::with_capacity(area), vec![0.0; area * m]);
    for (i, (sums, fit)) in sums.iter().zip(exact.chunks_exact(3 + m)).enumerate() {
        pixels.push(pixel(sums, [0, 1, 2].map(|c| fit[c].value())));
        let per_sample = 1.0 / sums.count.max(1) as f64;
        means(fit, |sum| sum * per_sample, &mut controls[i * m..][..m]);
    }
    let picture = Picture::new(width, m, pixels, controls);
    let (mut memory, mut beta) = (Memory::default(), Vec::new());
    let mut images = Vec::with_capacity(area);
    for (row, sums) in sums.chunks(width).enumerate() {
        picture.coefficients(row, &mut memory, &mut beta);
        for (column, (sums, beta)) in sums.iter().zip(beta.chunks(3 * m.max(1))).enumerate() {
            let (mean, off) = (sums.mean(), picture.correction(row * width + column, beta));
            images.push([mean, [0, 1, 2].map(|c| mean[c] - f64::from(off[c]))]);
        }
    }
    images
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn blocks_lie_all_over_the_image_and_most_images_have_few() {
        for (width, height, count) in
            [(128, 64, 8), (192, 128, 8), (193, 131, 8), (1920, 1080, 64), (8192, 3, 8), (3, 8192, 8)]
        {
            let bounds = PixelBounds { x0: 5, y0: 7, x1: 5 + width, y1: 7 + height };
            for seed in 0..40 {
                let blocks = blocks(&bounds, seed);
                assert_eq!(blocks.len(), count);
                let mut places: Vec<_> = blocks.iter().map(|b| (b.y0, b.x0)).collect();
                assert!(places.is_sorted(), "row by row");
                places.dedup();
                assert_eq!(places.len(), count, "each is another one");
                let is_in = |b: &PixelBounds| b.x0 >= 5 && b.y0 >= 7 && b.x1 <= 5 + width && b.y1 <= 7 + height;
                assert!(blocks.iter().all(is_in));
            }
        }
    }

    #[test]
    fn differences_are_relative_to_the_mean_as_it_is() {
        let a = [[[3.0, 0.0, 1.0], [2.5, 0.0, 1.0]]];
        let b = [[[1.0, 0.0, 1.0], [1.5, 0.0, 1.0]]];
        let [alone, corrected] = difference([a.to_vec(), b.to_vec()]);
        assert!((alone - 4.0 / (4.0 + DEFAULT_EPSILON)).abs() < 1e-12 && (corrected - alone / 4.0).abs() < 1e-12);
    }
}
