//! Tracers and buffers of the threads of a rendering.

use super::emission_rays::EmissionRays;
use super::phases::WorkerTimes;
use super::tiles::Tile;
use crate::direct::Fits;
use crate::film::accumulator::PixelAccumulator;
use crate::film::light_layers::{LayerSample, LayerScratch};
use crate::film::{FeatureSet, PixelBounds, PixelSample};
use crate::integrators::CameraSamples;
use crate::integrators::camera_sampler::{CameraSampler, PixelSampleRange, Scratch};
use crate::integrators::light_layers::SampleLight;
use crate::integrators::{Integrator, PathStats, Tracer};
use crate::scene::FilmSettings;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Instant;

/// Buffers of one thread.
pub(super) struct Worker<T> {
    pub(super) tracer: T,
    pub(super) samples: CameraSamples,
    pub(super) scratch: Scratch,
    pub(super) results: Vec<PixelSample>,
    /// Sums of the traced pixels, while samples are added to them.
    pub(super) sums: Vec<PixelAccumulator>,
    /// Sums of a tile that receives the sums of a cell, where cells are traced instead of tiles.
    tile_sums: Vec<PixelAccumulator>,
    /// Samples of each light-group layer with their pixels, until they are added to a tile.
    light: Vec<Vec<LayerSample>>,
    /// Pixel of each sample of a batch.
    pixels: Vec<u32>,
    /// Buffer for packing sums.
    pub(super) packing: Vec<u8>,
    layer_scratch: LayerScratch,
    emission_rays: EmissionRays,
    pub(super) times: WorkerTimes,
}

impl<T> Worker<T> {
    pub(super) fn new(tracer: T) -> Self {
        let (samples, scratch, results, sums, tile_sums, light, pixels) = Default::default();
        let (packing, layer_scratch, emission_rays, times) = Default::default();
        Worker {
            tracer,
            samples,
            scratch,
            results,
            sums,
            tile_sums,
            light,
            pixels,
            packing,
            layer_scratch,
            emission_rays,
            times,
        }
    }
}

impl AnyWorker<'_> {
    /// Reads the sums of a tile.
    pub(super) fn read(&mut self, tile: &Tile) {
        let start = Instant::now();
        let area = tile.bounds.area();
        self.sums.resize(area, PixelAccumulator::default());
        tile.sums.read(0..area, &mut self.sums);
        self.light.resize_with(tile.layers.len(), Vec::new);
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
        let Worker { sums, tile_sums, packing, .. } = self;
        tile_sums.resize(tile.bounds.area(), PixelAccumulator::default());
        tile.sums.read(0..tile.bounds.area(), tile_sums);
        for [to, from] in tile.bounds.common_rows(bounds) {
            tile_sums[to].iter_mut().zip(&sums[from]).for_each(|(sum, more)| sum.merge(more));
        }
        tile.set_sums(tile_sums, packing);
        self.times.film += start.elapsed();
    }

    /// Traces the samples and their emission rays; the results have the colours of the film. `pixels` lists the pixels
    /// in the order of the samples, with the indices of their samples. `seed` is the seed of the samples.
    pub(super) fn trace(
        &mut self,
        camera: &CameraSampler<'_>,
        fits: &mut Fits,
        pixels: impl Iterator<Item = PixelSampleRange>,
        seed: u32,
    ) {
        // Trace paths, then the additional emission rays
        let start = Instant::now();
        let Worker { tracer, samples, results, emission_rays, .. } = self;
        tracer.trace(camera.job(), samples, fits, results);
        emission_rays.replace(camera, samples, seed, pixels, results, tracer.light_layers());

        // Apply the white balance
        let film = &camera.job().world.scene.film;
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
        stats.merge(&self.emission_rays.take_stats());
        stats
    }

    /// Adds the results to the sums of their pixels. `pixels` lists the pixels in the order of the results, with the
    /// indices of their samples.
    pub(super) fn add(&mut self, film: &FilmSettings, pixels: impl Iterator<Item = PixelSampleRange>) {
        let start = Instant::now();
        let Worker { tracer, results, sums, light, pixels: pixel_of, .. } = self;
        let mut first = 0;
        pixel_of.clear();
        for PixelSampleRange { fit, samples, .. } in pixels {
            let of_pixel = first..first + samples.len();
            first = of_pixel.end;
            sums[fit as usize].add_all(samples.start, &results[of_pixel]);
            pixel_of.resize(first, fit);
        }
        if let Some(sums) = tracer.light_layers() {
            let in_pixel = |of_sample: &SampleLight| {
                let pixel = pixel_of[of_sample.sample as usize];
                LayerSample { pixel, radiance: film.balanced(of_sample.radiance) }
            };
            for (layer, light) in light.iter_mut().enumerate().take(sums.count()) {
                light.extend(sums.sums(layer).iter().map(in_pixel));
            }
        }
        self.times.film += start.elapsed();
    }

    /// Writes the sums back to a tile.
    pub(super) fn write(&mut self, tile: &mut Tile) {
        let start = Instant::now();
        tile.set_sums(&self.sums, &mut self.packing);
        for (layer, samples) in self.light.iter_mut().enumerate().filter(|(_, samples)| !samples.is_empty()) {
            // Sums that a film shares stay unchanged
            Arc::make_mut(&mut tile.layers).add(layer, samples, &mut self.layer_scratch);
            samples.clear();
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
            Worker { emission_rays: EmissionRays::new(self.light_layers), ..Worker::new(tracer) }
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
