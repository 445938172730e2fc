//! Tracers and buffers of the threads of a rendering.

use super::looks::Looks;
use super::phases::WorkerTimes;
use super::tiles::Tile;
use crate::direct::Fits;
use crate::film::accumulator::PixelAccumulator;
use crate::film::{FeatureSet, PixelBounds, PixelSample};
use crate::integrators::camera_samples::{CameraSampler, Scratch};
use crate::integrators::path::CameraSample;
use crate::integrators::{Integrator, PathStats, Tracer};
use crate::scene::{FilmSettings, RenderJob};
use std::ops::Range;
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::Instant;

/// Buffers of one thread.
pub(super) struct Worker<T> {
    pub(super) tracer: T,
    pub(super) samples: Vec<CameraSample>,
    pub(super) scratch: Scratch,
    pub(super) results: Vec<PixelSample>,
    /// Sums of the traced pixels, while samples are added to them.
    pub(super) sums: Vec<PixelAccumulator>,
    /// Sums of a tile that receives the sums of a cell, where cells are traced instead of tiles.
    of_tile: Vec<PixelAccumulator>,
    /// Sums of the light-group layers.
    layers: Vec<Vec<PixelAccumulator>>,
    /// Buffer for packing sums.
    pub(super) packing: Vec<u8>,
    looks: Looks,
    pub(super) times: WorkerTimes,
}

impl<T> Worker<T> {
    pub(super) fn new(tracer: T) -> Self {
        let (samples, scratch, results, sums, of_tile, layers, packing, looks, times) = Default::default();
        Worker { tracer, samples, scratch, results, sums, of_tile, layers, packing, looks, times }
    }
}

impl AnyWorker<'_> {
    /// Reads the sums of a tile.
    pub(super) fn read(&mut self, tile: &Tile) {
        let start = Instant::now();
        let area = tile.bounds.area();
        self.layers.resize_with(tile.layers.len(), Vec::new);
        let layers = self.layers.iter_mut().zip(&tile.layers);
        for (sums, packed) in layers.chain([(&mut self.sums, &tile.sums)]) {
            sums.resize(area, PixelAccumulator::default());
            packed.read(0..area, sums);
        }
        self.times.film += start.elapsed();
    }

    /// Starts empty sums of `pixels` pixels, without layers. [`Self::add_to`] adds them to tiles.
    pub(super) fn begin(&mut self, pixels: usize) {
        self.sums.clear();
        self.sums.resize(pixels, PixelAccumulator::default());
    }

    /// Adds the sums of the pixels within `bounds` to a tile, where they overlap.
    pub(super) fn add_to(&mut self, tile: &mut Tile, bounds: &PixelBounds) {
        let start = Instant::now();
        let Worker { sums, of_tile, packing, .. } = self;
        of_tile.resize(tile.bounds.area(), PixelAccumulator::default());
        tile.sums.read(0..tile.bounds.area(), of_tile);
        for (to, from) in tile.bounds.common_rows(bounds) {
            of_tile[to].iter_mut().zip(&sums[from]).for_each(|(sum, more)| sum.merge(more));
        }
        tile.set_sums(of_tile, packing);
        self.times.film += start.elapsed();
    }

    /// Traces the samples and their emission rays; the results have the colours of the film. `pixels` lists the pixels
    /// in the order of the samples, with the indices of their samples. `seed` is the seed of the samples.
    pub(super) fn trace(
        &mut self,
        (job, camera): (&RenderJob, &CameraSampler<'_>),
        fits: &mut Fits,
        (pixels, seed): (impl Iterator<Item = ([u32; 2], Range<u32>)>, u32),
    ) {
        // Trace paths, then the additional emission rays
        let start = Instant::now();
        let Worker { tracer, samples, results, looks, .. } = self;
        tracer.trace(job, samples, fits, results);
        looks.replace((job, camera), (samples, seed), pixels, (results, tracer.light_layers()));

        // Apply the white balance
        let film = &job.world.scene.film;
        if film.balance.is_some() {
            for result in &mut self.results {
                (result.radiance, result.offset) = (film.balanced(result.radiance), film.balanced(result.offset));
            }
        }
        self.times.tracing += start.elapsed();
    }

    /// Counts and times since the last call.
    pub(super) fn take_stats(&mut self) -> PathStats {
        let mut stats = self.tracer.take_stats();
        stats.merge(&self.looks.take_stats());
        stats
    }

    /// Adds the results to the sums of their pixels. `pixels` lists the pixels in the order of the results, with the
    /// indices of their samples.
    pub(super) fn add(&mut self, film: &FilmSettings, pixels: impl Iterator<Item = (usize, Range<u32>)>) {
        let start = Instant::now();
        let Worker { tracer, results, sums, layers, .. } = self;
        let count = layers.len();
        let of_layers = tracer.light_layers();
        let mut first = 0;
        for (pixel, samples) in pixels {
            let of_pixel = first..first + samples.len();
            first = of_pixel.end;
            sums[pixel].add_all(samples.start, &results[of_pixel.clone()]);
            for (layer, sums) in layers.iter_mut().enumerate() {
                for (i, k) in samples.clone().zip(of_pixel.clone()) {
                    let radiance = film.balanced(of_layers[k * count + layer]);
                    sums[pixel].add(i, &PixelSample { radiance, ..PixelSample::default() });
                }
            }
        }
        self.times.film += start.elapsed();
    }

    /// Writes the sums back to a tile.
    pub(super) fn write(&mut self, tile: &mut Tile) {
        let start = Instant::now();
        tile.set_sums(&self.sums, &mut self.packing);
        for (layer, sums) in self.layers.iter().enumerate() {
            tile.set_layer(layer, sums, &mut self.packing);
        }
        self.times.film += start.elapsed();
    }
}

/// A worker with any tracer.
pub(super) type AnyWorker<'a> = Worker<Box<dyn Tracer + 'a>>;

/// The workers of a prepared integrator.
pub(super) struct Workers<'a> {
    integrator: &'a dyn Integrator,
    features: FeatureSet,
    /// Number of light-group layers.
    light_layers: usize,
    /// Workers without a tile. Their buffers are kept.
    idle: Mutex<Vec<AnyWorker<'a>>>,
}

impl<'a> Workers<'a> {
    pub(super) fn new(integrator: &'a dyn Integrator, features: FeatureSet, light_layers: usize) -> Self {
        Workers { integrator, features, light_layers, idle: Mutex::default() }
    }

    /// Runs `work` with an idle worker, or with a new one if all are busy.
    pub(super) fn with_one<R>(&self, work: impl FnOnce(&mut AnyWorker<'a>) -> R) -> R {
        let idle = self.idle().pop();
        let mut worker = idle.unwrap_or_else(|| {
            let mut tracer = self.integrator.tracer(self.features);
            tracer.keep_light_layers(self.light_layers);
            Worker { looks: Looks::new(self.light_layers), ..Worker::new(tracer) }
        });
        let (result, times) = WorkerTimes::of(|| work(&mut worker));
        worker.times.merge(&times);
        self.idle().push(worker);
        result
    }

    /// Times of all workers.
    pub(super) fn times(&self) -> WorkerTimes {
        let mut times = WorkerTimes::default();
        self.idle().iter().for_each(|worker| times.merge(&worker.times));
        times
    }

    fn idle(&self) -> MutexGuard<'_, Vec<AnyWorker<'a>>> {
        self.idle.lock().unwrap_or_else(PoisonError::into_inner)
    }
}
