//! A rendering in progress: passes over all tiles, interrupted by checkpoints.

use super::cell_progress::CellProgress;
use super::continuation::{Continuation, TileObserver};
use super::control_variates;
use super::parts::{Checkpoints, PartError, StoredTile};
use super::phases::WorkerTimes;
use super::render_error::RenderError;
use super::render_settings::RenderSettings;
use super::rendering::{Progress, Rendering};
use super::tiles::{Tile, Tiles, add_records, bounds_of_tiles, film, replica_choice};
use super::worker::Workers;
use crate::direct::Estimator;
use crate::film::light_layers::PackedLayers;
use crate::film::packed::PackedSums;
use crate::film::replicas::ReplicaChoice;
use crate::film::{FeatureSet, Film, FilmTile, PixelBounds};
use crate::imaging::tiles::TileStore;
use crate::integrators::camera_sampler::CameraSampler;
use crate::integrators::cells::REPLICA_CELL;
use crate::integrators::{PathStats, Statistics, make_integrator, reuse};
use crate::planning::processor_time;
use crate::scene::{FilmSettings, RenderJob};
use rayon::prelude::*;
use std::ops::Range;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU32, AtomicU64, Ordering};
use std::time::{Duration, Instant};

/// Minimum time between two computations of the noise for observers of the progress. One takes as long as a few samples
/// per pixel.
const NOISE_INTERVAL: Duration = Duration::from_secs(1);
/// Minimum time between two computations of the noise, as a multiple of the time that one takes.
const NOISE_REST: u32 = 50;

/// A pass over all tiles.
pub(super) struct Pass<'a> {
    pub(super) samples: Range<u32>,
    /// The noise that observers of the progress receive.
    pub(super) noise: Option<f64>,
    pub(super) watch: Option<&'a TileObserver<'a>>,
    /// No tile starts after this time, when a checkpoint is due.
    pause: Option<Instant>,
}

impl Pass<'_> {
    /// True if the pass has to pause.
    pub(super) fn is_over(&self) -> bool {
        self.pause.is_some_and(|pause| Instant::now() >= pause)
    }
}

/// A rendering in progress.
pub(super) struct Run<'a> {
    pub(super) job: &'a RenderJob,
    pub(super) settings: &'a RenderSettings,
    /// True if pixels share paths. The unit of a pass is then a cell instead of a tile.
    pub(super) shares_paths: bool,
    /// Edge of tiles (pixels). Where pixels share paths, the edge of the cells that are estimated twice.
    pub(super) tile_size: u32,
    pub(super) stop: &'a AtomicBool,
    /// Texels that did not fit into memory.
    pub(super) texels: Option<&'a TileStore>,
    observe: &'a (dyn Fn(&Progress) + Sync),
    pub(super) camera: CameraSampler<'a>,
    pub(super) start: Instant,
    samples_done: AtomicU64,
    rays: AtomicU64,
    passes: AtomicU32,
}

impl<'a> Run<'a> {
    pub(super) fn new(
        job: &'a RenderJob,
        settings: &'a RenderSettings,
        stop: &'a AtomicBool,
        observe: &'a (dyn Fn(&Progress) + Sync),
    ) -> Self {
        let shares_paths = reuse::edge(job) > 1;
        Run {
            job,
            settings,
            shares_paths,
            // Replicas share paths within a tile
            tile_size: if shares_paths { REPLICA_CELL } else { settings.tile_size },
            stop,
            texels: job.world.scene.textures.store(),
            observe,
            camera: CameraSampler::new(job, settings.first_sample),
            start: Instant::now(),
            samples_done: AtomicU64::new(0),
            rays: AtomicU64::new(0),
            passes: AtomicU32::new(0),
        }
    }

    pub(super) fn run(self, threads: usize, continuation: Continuation<'_>) -> Result<Rendering, RenderError> {
        // Prepare the integrator and the tiles
        let Continuation { stored, cells, mut checkpoints, keeps_sums, tells_noise, watch, passes } = continuation;
        let tells_noise = tells_noise || watch.is_some() || passes.is_some();
        let seed = self.job.settings().sampling.seed;
        let cameras = |pixel, sample| self.camera.sample_of_seed(pixel, sample, seed);
        let mut integrator = make_integrator(self.job, &cameras, self.stop)?;
        let mut tiles = self.tiles(stored, cells)?;

        let end = self.end();
        let begin = tiles.tiles.iter().map(|t| t.done).min().unwrap_or(end);
        let (mut first, mut noise, mut observed) = (begin, None, self.start + NOISE_INTERVAL);
        let (mut stats, mut times) = (PathStats::default(), WorkerTimes::default());

        // Trace passes. The integrator prepares for several of them at once
        while first < end && !self.stopped(first - begin) {
            let served = end.min(first.saturating_add(integrator.prepare(first)?));
            let workers = Workers::new(&*integrator, self.features(), self.settings.light_layers(self.job).len());
            while first < served && !self.stopped(first - begin) {
                let length = self.next_pass(first - self.settings.first_sample, first - begin);
                let samples = first..first.saturating_add(length).min(served);
                first = samples.end;
                let pass = Pass { samples, noise, watch, pause: None };
                stats.merge(&self.whole_pass(&workers, &mut tiles, pass, &mut checkpoints));
                self.passes.fetch_add(1, Ordering::Relaxed);
                if let (Some(passes), false) = (passes, self.stop.load(Ordering::Relaxed)) {
                    passes(&self.progress(self.samples_total(&tiles.tiles), noise));
                }

                // Compute the noise at intervals
                let now = Instant::now();
                if tells_noise && now >= observed && first < end && !self.is_late() {
                    noise = Some(self.median_noise(&tiles.tiles, &mut times));
                    observed = Instant::now() + NOISE_INTERVAL.max(now.elapsed() * NOISE_REST);
                }
            }
            times.merge(&workers.times());
        }

        // With lost texels, some samples are wrong: they are neither shown nor stored
        if let Some(failure) = self.failure() {
            return Err(RenderError::Texels(failure.to_owned()));
        }

        // Finish the film and the last checkpoint
        let complete = tiles.tiles.iter().all(|t| t.done >= end);
        let keeps_sums = keeps_sums || checkpoints.is_some();
        let phases = times.phases(&stats);
        let Statistics { paths: stats, cache, photons, light, records } = integrator.statistics(stats);
        add_records(&records, &mut tiles.tiles);
        let mut film = self.film(&tiles.tiles);
        control_variates::correct(&mut film, &tiles.tiles);
        if let Some(checkpoints) = checkpoints {
            checkpoints.finish(&tiles);
        }
        let sums = keeps_sums.then_some(tiles);
        let elapsed = self.start.elapsed();
        Ok(Rendering { film, stats, cache, photons, light, elapsed, phases, complete, threads, sums })
    }

    /// Camera samples requested for all tiles, as if every pixel had the same number.
    pub(super) fn samples_total(&self, tiles: &[Tile]) -> u64 {
        tiles.iter().map(|t| t.bounds.area() as u64).sum::<u64>() * u64::from(self.end() - self.begin())
    }

    /// The progress so far.
    fn progress(&self, samples_total: u64, noise: Option<f64>) -> Progress {
        Progress {
            samples_done: self.samples_done.load(Ordering::Relaxed),
            samples_total,
            rays: self.rays.load(Ordering::Relaxed),
            elapsed: self.start.elapsed(),
            passes: self.passes.load(Ordering::Relaxed),
            noise,
        }
    }

    /// Index after the last sample.
    pub(super) fn end(&self) -> u32 {
        self.settings.first_sample + self.settings.spp
    }

    /// The tiles, with their stored sums if there are any.
    fn tiles(&self, stored: Option<Vec<StoredTile>>, cells: CellProgress) -> Result<Tiles, PartError> {
        // Restore stored tiles, or begin with empty ones
        let replicas = replica_choice(self.job, self.settings);
        let bounds = self.job.world.scene.film.bounds;
        let tiles = match stored {
            Some(stored) => stored.into_iter().map(|s| s.restore(|b| self.tile(b, replicas))).collect(),
            None => {
                let bounds = bounds_of_tiles(&bounds, self.tile_size, self.settings.share);
                Ok(bounds.into_iter().map(|b| self.tile(b, replicas)).collect::<Vec<_>>())
            }
        }?;

        // Count the samples that are done already
        let done = |t: &Tile| t.bounds.area() as u64 * u64::from(t.done - self.begin());
        self.samples_done.store(tiles.iter().map(done).sum(), Ordering::Relaxed);
        let tiles = Tiles { tiles, cells };
        if self.has_cells(&tiles) { Ok(tiles) } else { Err(PartError::Sums("their cells are not the same")) }
    }

    /// Index of the first sample, after the skipped ones.
    pub(super) fn begin(&self) -> u32 {
        self.settings.first_sample + self.settings.skip.min(self.settings.spp)
    }

    /// Renders a pass. Pauses it when a checkpoint is due.
    fn whole_pass(
        &self,
        workers: &Workers<'_>,
        tiles: &mut Tiles,
        mut pass: Pass<'_>,
        checkpoints: &mut Option<&mut Checkpoints>,
    ) -> PathStats {
        let mut stats = PathStats::default();
        loop {
            // Trace until the pass is done or the next checkpoint is due
            pass.pause = checkpoints.as_ref().map(|c| c.due());
            stats.merge(&if self.shares_paths {
                self.pass_of_cells(workers, tiles, &pass)
            } else {
                self.pass(workers, &mut tiles.tiles, &pass)
            });

            // Store the checkpoint
            match checkpoints {
                Some(checkpoints) if checkpoints.due() <= Instant::now() && self.failure().is_none() => {
                    checkpoints.store(tiles);
                }
                _ => {}
            }
            if self.stops_at_once() || tiles.tiles.iter().all(|t| t.done >= pass.samples.end || self.leaves(t.done)) {
                return stats;
            }
        }
    }

    /// The features of the film. Fits over pixels need normals and materials even if no feature is requested.
    fn features(&self) -> FeatureSet {
        let is_over_pixels = Estimator::at_vertex(&self.job.settings().integrator, 0).is_over_pixels();
        match (self.settings.with_features, is_over_pixels) {
            (true, _) => FeatureSet::All,
            (false, true) => FeatureSet::NoAlbedo,
            (false, false) => FeatureSet::None,
        }
    }

    /// A tile without samples.
    fn tile(&self, bounds: PixelBounds, replicas: Option<ReplicaChoice>) -> Tile {
        let all = &self.job.world.scene.film.bounds;
        let replicas = replicas.map_or(Vec::new(), |choice| choice.of_tile(all, &bounds));
        let integrator = &self.job.settings().integrator;
        let fits = Estimator::at_vertex(integrator, 0).fits(self.job, bounds.area() + replicas.len());
        let layers = Arc::new(PackedLayers::new(self.settings.light_layers(self.job).len(), bounds.area()));
        Tile { bounds, done: self.begin(), sums: Arc::new(PackedSums::new(bounds.area())), layers, replicas, fits }
    }

    /// The film of all tiles.
    fn film(&self, tiles: &[Tile]) -> Film {
        let FilmSettings { resolution, bounds, .. } = self.job.world.scene.film;
        film(resolution, bounds, tiles, self.settings.light_layers(self.job))
    }

    /// Median noise of the image so far. The time that it takes is added to `times`.
    fn median_noise(&self, tiles: &[Tile], times: &mut WorkerTimes) -> f64 {
        let start = processor_time::of_process();
        let noise = self.film(tiles).summary().noise.median;
        times.noise += processor_time::of_process().saturating_sub(start);
        noise
    }

    /// The film of one tile.
    pub(super) fn film_of(&self, tile: &Tile) -> Film {
        let pixels = FilmTile { bounds: tile.bounds, sums: Arc::clone(&tile.sums), layers: Arc::default() };
        Film::new(self.job.world.scene.film.resolution, tile.bounds, vec![pixels], Vec::new())
    }

    /// Adds the samples of a pass to every tile that does not have them yet.
    fn pass(&self, workers: &Workers<'_>, tiles: &mut [Tile], pass: &Pass<'_>) -> PathStats {
        let total = self.samples_total(tiles);
        tiles
            .par_iter_mut()
            .with_max_len(1)
            .map(|tile| {
                // Skip the samples that the tile has
                let samples = tile.done.max(pass.samples.start)..pass.samples.end;
                if samples.is_empty() || pass.is_over() || self.stops_at_once() || self.leaves(tile.done) {
                    return PathStats::default();
                }

                // Trace the rest
                let stats = workers.with_one(|worker| self.render_tile(worker, tile, samples.clone()));
                tile.done = samples.end;

                // Notify observers
                if let Some(watch) = pass.watch {
                    watch(&self.film_of(tile));
                }
                let done = tile.bounds.area() as u64 * u64::from(samples.end - samples.start);
                self.note(&stats, done, total, pass.noise);
                stats
            })
            .sum()
    }

    /// Counts finished samples, and notifies observers of the progress.
    pub(super) fn note(&self, stats: &PathStats, samples: u64, total: u64, noise: Option<f64>) {
        let rays = stats.camera_rays + stats.bounce_rays + stats.direct.emitter_rays + stats.direct.segments;
        self.samples_done.fetch_add(samples, Ordering::Relaxed);
        self.rays.fetch_add(rays, Ordering::Relaxed);
        (self.observe)(&self.progress(total, noise));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::imaging::oiio::{Part, write_image};
    use crate::import::cache::FileCache;
    use crate::import::{LoadOptions, load_text};
    use crate::render::parts::FilmHeader;
    use crate::render::resume;
    use crate::scene::AccelKind;

    const FLOOR: &str = r#"
LookAt 0 0 2  0 0 0  0 1 0
Camera "perspective" "float fov" 50
Film "rgb" "integer xresolution" 8 "integer yresolution" 8
WorldBegin
LightSource "infinite" "rgb L" [ 1 1 1 ]
Texture "t" "spectrum" "imagemap" "string filename" "t.png" "float uscale" 0.01 "float vscale" 0.01
Material "diffuse" "texture reflectance" "t"
Shape "bilinearmesh" "point3 P" [ -9 -9 0  9 -9 0  -9 9 0  9 9 0 ]
"#;

    #[test]
    fn what_is_rendered_with_lost_texels_is_neither_an_image_nor_a_checkpoint() {
        // A texture that exceeds the memory limit
        let folder = tempfile::tempdir().unwrap();
        let names = ["R", "G", "B"].map(str::to_owned).to_vec();
        write_image(&folder.path().join("t.png"), &[Part::display(200, 200, names, vec![0.5; 120_000])]).unwrap();
        for is_lost in [false, true] {
            // Render with all texels, then with some lost
            let files = FileCache::default();
            files.limit_textures(1000);
            let loaded = load_text(FLOOR, "floor", folder.path(), &LoadOptions::default(), &files).unwrap();
            let job = loaded.job(AccelKind::Bvh, None).unwrap();
            if is_lost {
                job.world.scene.textures.store().unwrap().lose(0);
            }

            // There is an image and a checkpoint only if no texel was lost
            let settings = RenderSettings { spp: 16, ..RenderSettings::default() };
            let (path, header) =
                (folder.path().join("c.film"), FilmHeader::new(&job, &settings, 16, 0, [Vec::new(), Vec::new()]));
            let mut checkpoints = Checkpoints::new(path.clone(), Duration::ZERO, header, |_| ());
            let continuation = Continuation { checkpoints: Some(&mut checkpoints), ..Continuation::default() };
            let outcome = resume(&job, &settings, &AtomicBool::new(false), &|_| (), continuation);
            assert_eq!(matches!(outcome, Err(RenderError::Texels(_))), is_lost);
            assert_eq!((outcome.is_ok(), path.exists()), (!is_lost, !is_lost));
            let _ = std::fs::remove_file(path);
        }
    }
}
