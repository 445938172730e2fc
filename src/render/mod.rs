//! Rendering: tiles × sample ranges on all cores, and the film that comes out.
//!
//! The image is a function of the scene, its settings, the seed and the sample range. A pixel's samples are drawn
//! by its coordinates and their index, traced independently of what else is in their batch, and added in the order
//! of their index; so neither threads, nor tiles, nor passes change a bit.

pub mod allocation;
pub mod auto;
pub mod bench;
pub mod bench_frame;
pub mod bench_photons;
mod camera_samples;
mod control_variates;
pub mod crosscheck;
pub mod cryptomatte;
pub mod efficiency;
pub mod noise;
pub mod output;
mod pilot_samples;
pub mod plan;
pub mod processor_time;
pub mod visibility_cache;
mod worker;

use crate::direct::{Estimator, Fits};
use crate::film::replicas::{Replica, replicas};
use crate::film::{Film, PixelBounds, PixelSums};
pub use crate::integrators::CacheReport;
use crate::integrators::path::CameraSample;
use crate::integrators::{MapStats, PathStats, Statistics, integrator};
use crate::photons::PhotonError;
use crate::scene::RenderJob;
use camera_samples::CameraSampler;
use lumiris_numbers::estimators::ocv::block_of;
use lumiris_numbers::math::hash::pcg4d;
use rayon::prelude::*;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::time::{Duration, Instant};
use worker::{AnyWorker, Workers};

/// Paths that are traced together: enough that stages run long, few enough that their data stays in the cache.
const BATCH_PATHS: usize = 4096;

/// Time between two determinations of the noise for those who observe the progress: it takes as long as a few samples
/// per pixel.
const NOISE_INTERVAL: Duration = Duration::from_secs(1);

/// Combined with the seed of the image to give that of replicas.
const REPLICA_SEED: u32 = 0x72_65_70_73;

/// How to render. Only the sample range affects the image.
#[derive(Clone, Copy, Debug)]
pub struct RenderSettings {
    /// Threads; all cores if `None`.
    pub threads: Option<usize>,
    /// Edge of a tile in pixels.
    pub tile_size: u32,
    /// First sample index.
    pub first_sample: u32,
    /// Samples per pixel from there on.
    pub spp: u32,
    /// Stops after the first pass that ends later than this.
    pub time_limit: Option<Duration>,
    /// Estimates some pixels twice, which gives the variance of pixel means; see [`crate::film::replicas`].
    pub with_replicas: bool,
    /// Whether the film holds features of the first surfaces: albedo, normal, depth, material and object.
    pub with_features: bool,
}

impl Default for RenderSettings {
    fn default() -> Self {
        RenderSettings {
            threads: None,
            tile_size: 16,
            first_sample: 0,
            spp: 1,
            time_limit: None,
            with_replicas: false,
            with_features: true,
        }
    }
}

/// Progress reported after every tile.
#[derive(Clone, Copy, Debug)]
pub struct Progress {
    /// Camera samples done, as if every pixel had the same number.
    pub samples_done: u64,
    /// Camera samples requested.
    pub samples_total: u64,
    /// Rays of all kinds traced so far.
    pub rays: u64,
    /// Time since the start.
    pub elapsed: Duration,
    /// Mean relative standard error of the pixels after the last pass for which it was determined, if there was one.
    pub noise: Option<f64>,
}

/// A finished or stopped rendering.
#[derive(Debug)]
pub struct Rendering {
    /// The film.
    pub film: Film,
    /// Counts and times, summed over threads.
    pub stats: PathStats,
    /// The irradiance cache, if there is one.
    pub cache: Option<CacheReport>,
    /// The photon maps, if there are any.
    pub photons: Option<MapStats>,
    /// Wall-clock time.
    pub elapsed: Duration,
    /// True if every pixel has all its samples.
    pub complete: bool,
    /// Threads used.
    pub threads: usize,
}

/// Why a rendering ended without an image.
#[derive(Debug, thiserror::Error)]
pub enum RenderError {
    /// The threads could not be started.
    #[error(transparent)]
    Threads(#[from] ThreadError),
    /// The integrator could not prepare its photon maps.
    #[error(transparent)]
    Photons(#[from] PhotonError),
}

/// Why threads could not start.
#[derive(Debug, thiserror::Error)]
#[error("cannot start {threads} threads: {source}")]
pub struct ThreadError {
    threads: usize,
    source: rayon::ThreadPoolBuildError,
}

/// Renders. `stop` ends it after the tiles under way; `observe` is called from worker threads.
pub fn render(
    job: &RenderJob,
    settings: &RenderSettings,
    stop: &AtomicBool,
    observe: &(dyn Fn(&Progress) + Sync),
) -> Result<Rendering, RenderError> {
    render_watched(job, settings, stop, observe, None)
}

/// Gets the film of a tile that has new samples; called from worker threads.
pub type TileObserver<'a> = dyn Fn(&Film) + Sync + 'a;

/// [`render`], with somebody who watches the tiles.
pub fn render_watched(
    job: &RenderJob,
    settings: &RenderSettings,
    stop: &AtomicBool,
    observe: &(dyn Fn(&Progress) + Sync),
    watch: Option<&TileObserver<'_>>,
) -> Result<Rendering, RenderError> {
    let pool = thread_pool(settings.threads)?;
    let threads = pool.current_num_threads();
    pool.install(|| Run { watch, ..Run::new(job, settings, stop, observe) }.run(threads))
}

/// Threads, all cores if their number is not given.
pub fn thread_pool(threads: Option<usize>) -> Result<rayon::ThreadPool, ThreadError> {
    let threads = threads.unwrap_or_else(|| std::thread::available_parallelism().map_or(1, usize::from));
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
    pool.map_err(|source| ThreadError { threads, source })
}

/// Pixels of a tile.
type TilePart = (PixelBounds, std::ops::Range<usize>);

/// The pixels of batches as the renderer makes them in its first pass, spread over the image, about `rays` camera
/// samples together; and the range of samples of each.
fn batch_parts(run: &Run<'_>, rays: usize) -> (Vec<TilePart>, std::ops::Range<u32>) {
    let per_pixel = run.settings.spp.min(run.pass_length()).max(1);
    let pixels_per_batch = (BATCH_PATHS / per_pixel as usize).max(1);
    let tiles = run.job.world.scene.film.bounds.tiles(run.settings.tile_size);
    let parts: Vec<_> = tiles
        .iter()
        .flat_map(|tile| {
            let area = tile.area();
            (0..area).step_by(pixels_per_batch).map(move |p| (*tile, p..area.min(p + pixels_per_batch)))
        })
        .collect();

    // Every k-th batch
    let all: usize = parts.iter().map(|(_, pixels)| pixels.len() * per_pixel as usize).sum();
    let stride = all.div_ceil(rays.max(1)).max(1);
    (parts.into_iter().step_by(stride).collect(), 0..per_pixel)
}

/// Batches of camera samples as the renderer makes them in its first pass, spread over the image; about `rays`
/// together.
fn camera_batches(job: &RenderJob, tile_size: u32, rays: usize) -> Vec<Vec<CameraSample>> {
    let stop = AtomicBool::new(false);
    let settings = RenderSettings { tile_size, spp: job.settings().sampling.spp, ..RenderSettings::default() };
    let run = Run::new(job, &settings, &stop, &|_| ());
    let (parts, samples) = batch_parts(&run, rays);
    let mut scratch = camera_samples::Scratch::default();
    let chosen = parts.iter().map(|(tile, pixels)| {
        let mut batch = Vec::new();
        run.camera_samples(tile, pixels.clone(), &samples, &mut scratch, &mut batch);
        batch.iter_mut().for_each(|s| s.fit -= pixels.start as u32);
        batch
    });
    chosen.collect()
}

/// A tile with the sums of its pixels.
struct Tile {
    bounds: PixelBounds,
    sums: Vec<PixelSums>,
    replicas: Vec<Replica>,
    /// Those of its pixels one after the other, then those of its replicas.
    fits: Fits,
}

struct Run<'a> {
    job: &'a RenderJob,
    settings: &'a RenderSettings,
    stop: &'a AtomicBool,
    observe: &'a (dyn Fn(&Progress) + Sync),
    watch: Option<&'a TileObserver<'a>>,
    camera: CameraSampler<'a>,
    start: Instant,
    samples_done: AtomicU64,
    rays: AtomicU64,
}

impl<'a> Run<'a> {
    fn new(
        job: &'a RenderJob,
        settings: &'a RenderSettings,
        stop: &'a AtomicBool,
        observe: &'a (dyn Fn(&Progress) + Sync),
    ) -> Self {
        Run {
            job,
            settings,
            stop,
            observe,
            watch: None,
            camera: CameraSampler::new(job, settings.first_sample),
            start: Instant::now(),
            samples_done: AtomicU64::new(0),
            rays: AtomicU64::new(0),
        }
    }

    fn run(self, threads: usize) -> Result<Rendering, RenderError> {
        let bounds = self.job.world.scene.film.bounds;
        let seed = self.job.settings().sampling.seed;
        let cameras = |pixel, sample| self.camera.sample_of_seed(pixel, sample, seed);
        let mut integrator = integrator(self.job, &cameras, self.stop)?;
        let wants_replicas = self.wants_replicas() && !integrator.shares_noise();
        let tiles = bounds.tiles(self.settings.tile_size);
        let mut tiles: Vec<Tile> = tiles.into_iter().map(|b| self.tile(b, wants_replicas)).collect();

        let end = self.settings.first_sample + self.settings.spp;
        let (mut noise, mut observed) = (None, self.start);
        let mut stats = PathStats::default();
        let mut first = self.settings.first_sample;
        while first < end && !self.stopped() {
            let served = end.min(first.saturating_add(integrator.prepare(first)?));
            let workers = Workers::new(&*integrator, self.settings.with_features || self.is_over_pixels());
            while first < served && !self.stopped() {
                let length = self.next_pass(first - self.settings.first_sample);
                let samples = first..(first + length).min(served);
                stats.merge(&self.pass(&workers, &mut tiles, samples.clone(), noise));
                first = samples.end;
                if observed.elapsed() >= NOISE_INTERVAL {
                    noise = Some(self.film(&tiles).relative_noise());
                    observed = Instant::now();
                }
            }
        }

        let mut film = self.film(&tiles);
        control_variates::correct(&mut film, &tiles, position);
        let Statistics { paths: stats, cache, photons } = integrator.statistics(stats, &mut film);
        let complete = film.pixels.iter().enumerate().all(|(i, p)| p.count == self.samples_wanted(i));
        Ok(Rendering { film, stats, cache, photons, elapsed: self.start.elapsed(), complete, threads })
    }

    /// True if replicas are requested and tell anything.
    fn wants_replicas(&self) -> bool {
        let has_independent_samples = self.job.settings().sampling.sampler.has_independent_samples();
        self.settings.with_replicas && (!has_independent_samples || self.is_over_pixels())
    }

    /// True if pixels are corrected by what is fitted to others, which needs the features of all.
    fn is_over_pixels(&self) -> bool {
        Estimator::at_vertex(&self.job.settings().integrator, 0).is_over_pixels()
    }

    /// A tile without samples.
    fn tile(&self, bounds: PixelBounds, wants_replicas: bool) -> Tile {
        let all = &self.job.world.scene.film.bounds;
        let replicas = if wants_replicas { replicas(all, &bounds) } else { Vec::new() };
        let integrator = &self.job.settings().integrator;
        let fits = Estimator::at_vertex(integrator, 0).fits(self.job, bounds.area() + replicas.len());
        Tile { bounds, sums: vec![PixelSums::default(); bounds.area()], replicas, fits }
    }

    /// The film of all tiles.
    fn film(&self, tiles: &[Tile]) -> Film {
        let mut film = Film::new(self.job.world.scene.film.resolution, self.job.world.scene.film.bounds);
        tiles.iter().for_each(|t| film.set_tile(&t.bounds, &t.sums, &t.replicas));
        film.replicas.sort_unstable_by_key(|r| r.pixel);
        film
    }

    /// The film of one tile.
    fn film_of(&self, tile: &Tile) -> Film {
        let mut film = Film::new(self.job.world.scene.film.resolution, tile.bounds);
        film.set_tile(&tile.bounds, &tile.sums, &[]);
        film
    }

    /// Samples per pixel of the next pass over all tiles: 1, 1, 2, 4, …, so that there is a whole image soon. It lies
    /// within a block of what is fitted in blocks.
    fn next_pass(&self, done: u32) -> u32 {
        let length = self.samples_in_time(done).min(done.clamp(1, self.pass_length()));
        if !Estimator::at_vertex(&self.job.settings().integrator, 0).is_progressive() {
            return length;
        }
        let block = block_of(done);
        length.min(block.first + block.len - done)
    }

    /// Samples per pixel of the longest pass.
    fn pass_length(&self) -> u32 {
        (BATCH_PATHS as u32 / self.settings.tile_size.max(1).pow(2)).clamp(1, 64)
    }

    /// Samples per pixel that fit into the time that is left, at the speed so far; at least one.
    fn samples_in_time(&self, done: u32) -> u32 {
        let Some(limit) = self.settings.time_limit.filter(|_| done > 0) else { return u32::MAX };
        let elapsed = self.start.elapsed();
        let left = limit.saturating_sub(elapsed).as_secs_f64();
        ((left * f64::from(done) / elapsed.as_secs_f64().max(1e-9)) as u32).max(1)
    }

    fn stopped(&self) -> bool {
        let late = self.settings.time_limit.is_some_and(|limit| self.start.elapsed() >= limit);
        late || self.stop.load(Ordering::Relaxed)
    }

    /// Adds the samples of a range to every tile.
    fn pass(
        &self,
        workers: &Workers<'_>,
        tiles: &mut [Tile],
        samples: std::ops::Range<u32>,
        noise: Option<f64>,
    ) -> PathStats {
        tiles
            .par_iter_mut()
            .with_max_len(1)
            .map(|tile| {
                if self.stop.load(Ordering::Relaxed) {
                    return PathStats::default();
                }
                let stats = workers.with_one(|worker| self.render_tile(worker, tile, samples.clone()));
                if let Some(watch) = self.watch {
                    watch(&self.film_of(tile));
                }
                let rays = stats.camera_rays + stats.bounce_rays + stats.direct.emitter_rays + stats.direct.segments;
                let done = tile.bounds.area() as u64 * u64::from(samples.end - samples.start);
                (self.observe)(&Progress {
                    samples_done: self.samples_done.fetch_add(done, Ordering::Relaxed) + done,
                    samples_total: self.job.world.scene.film.bounds.area() as u64 * u64::from(self.settings.spp),
                    rays: self.rays.fetch_add(rays, Ordering::Relaxed) + rays,
                    elapsed: self.start.elapsed(),
                    noise,
                });
                stats
            })
            .reduce(PathStats::default, |mut a, b| {
                a.merge(&b);
                a
            })
    }

    /// Adds the samples of a range to one tile, in batches of whole pixels.
    fn render_tile(&self, worker: &mut AnyWorker<'_>, tile: &mut Tile, samples: std::ops::Range<u32>) -> PathStats {
        let bounds = tile.bounds;
        let mut ill_conditioned = 0;
        let settings = &self.job.settings().integrator;
        let done = samples.start - self.settings.first_sample;
        let start = Instant::now();
        let begins_block =
            Estimator::at_vertex(settings, 0).is_progressive() && done > 0 && block_of(done).first == done;
        if begins_block {
            ill_conditioned = tile.fits.solve();
        }
        let solve = start.elapsed();
        let mut first = 0;
        while first < tile.sums.len() {
            let pixels = self.batch_of_pixels(&bounds, first, &samples);
            first = pixels.end;
            self.camera_samples(&bounds, pixels.clone(), &samples, &mut worker.scratch, &mut worker.samples);
            worker.tracer.trace(self.job, &worker.samples, &mut tile.fits, &mut worker.results);
            let mut results = worker.results.iter();
            for index in pixels {
                let count = self.samples_of(position(&bounds, index as u32), &samples).len();
                results.by_ref().take(count).for_each(|r| tile.sums[index].add(r));
            }
        }
        self.render_replicas(worker, tile, samples);
        let mut stats = worker.tracer.take_stats();
        if begins_block {
            let direct = &mut stats.direct;
            direct.systems += (tile.sums.len() + tile.replicas.len()) as u64;
            direct.ill_conditioned += ill_conditioned;
            direct.solve += solve;
            direct.select += solve;
        }
        stats
    }

    /// The pixels of a tile from index `first` on that have a batch of samples in a pass; at least one pixel.
    fn batch_of_pixels(&self, tile: &PixelBounds, first: usize, pass: &std::ops::Range<u32>) -> std::ops::Range<usize> {
        let (mut end, mut paths) = (first, 0);
        while end < tile.area() {
            paths += self.samples_of(position(tile, end as u32), pass).len();
            if paths > BATCH_PATHS && end > first {
                break;
            }
            end += 1;
        }
        first..end
    }

    /// Adds the samples of a pass to the replicas of a tile.
    fn render_replicas(&self, worker: &mut AnyWorker<'_>, tile: &mut Tile, pass: std::ops::Range<u32>) {
        let seed = pcg4d([self.job.settings().sampling.seed, REPLICA_SEED, 0, 0])[0];
        let samples_of = |r: &Replica| self.samples_of(position(&tile.bounds, r.pixel), &pass);
        let mut fits = tile.bounds.area() as u32..;
        let longest = tile.replicas.iter().map(|r| samples_of(r).len()).max().unwrap_or(0);
        for replicas in tile.replicas.chunks_mut((BATCH_PATHS / longest.max(1)).max(1)) {
            worker.samples.clear();
            let pixels = replicas.iter().zip(&mut fits);
            let pixels = pixels.map(|(r, fit)| (fit, position(&tile.bounds, r.pixel), samples_of(r)));
            self.camera.samples(pixels, seed, &mut worker.scratch, &mut worker.samples);
            worker.tracer.trace(self.job, &worker.samples, &mut tile.fits, &mut worker.results);
            let mut results = worker.results.iter();
            for replica in replicas {
                results.by_ref().take(samples_of(replica).len()).for_each(|r| replica.add(r));
            }
        }
    }

    /// The camera samples of some pixels of a tile, which are counted row by row, in a pass.
    fn camera_samples(
        &self,
        tile: &PixelBounds,
        pixels: std::ops::Range<usize>,
        pass: &std::ops::Range<u32>,
        scratch: &mut camera_samples::Scratch,
        out: &mut Vec<CameraSample>,
    ) {
        out.clear();
        let pixels = pixels.map(|index| {
            let pixel = position(tile, index as u32);
            (index as u32, pixel, self.samples_of(pixel, pass))
        });
        self.camera.samples(pixels, self.job.settings().sampling.seed, scratch, out);
    }

    /// The samples that a pass has of a pixel.
    #[inline]
    fn samples_of(&self, pixel: [u32; 2], pass: &std::ops::Range<u32>) -> std::ops::Range<u32> {
        let Some(of_pixels) = &self.job.pixel_samples else { return pass.clone() };
        let first = self.settings.first_sample;
        let [start, end] = [pass.start, pass.end].map(|i| first + of_pixels.until(pixel, i - first));
        start..end
    }

    /// The number of samples of a pixel of the film by the end.
    fn samples_wanted(&self, index: usize) -> u64 {
        let bounds = &self.job.world.scene.film.bounds;
        let pixel = position(bounds, index as u32);
        let first = self.settings.first_sample;
        self.samples_of(pixel, &(first..first + self.settings.spp)).len() as u64
    }
}

/// Coordinates of the pixel of a tile with the given index, row by row.
fn position(tile: &PixelBounds, index: u32) -> [u32; 2] {
    [tile.x0 + index % tile.width(), tile.y0 + index / tile.width()]
}
