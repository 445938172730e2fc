//! Batches of camera samples as in the first pass of the renderer, spread over the image. Used for measurements.

use super::render_settings::RenderSettings;
use super::run::Run;
use crate::film::PixelBounds;
use crate::integrators::CameraSamples;
use crate::integrators::camera_sampler;
use crate::integrators::path::BATCH_PATHS;
use crate::scene::RenderJob;
use std::ops::Range;
use std::sync::atomic::AtomicBool;

/// Its multiples modulo 1 are evenly distributed.
const GOLDEN_RATIO: f64 = 0.618_033_988_749_895;

/// Measurements are never stopped.
static STOP: AtomicBool = AtomicBool::new(false);

/// Batches of whole pixels in one pass.
pub struct Batches<'a> {
    run: Run<'a>,
    /// Tile and pixel range of each batch; pixels are numbered row by row in the tile.
    parts: Vec<(PixelBounds, Range<usize>)>,
    samples: Range<u32>,
    scratch: camera_sampler::Scratch,
}

impl<'a> Batches<'a> {
    /// Selects batches of a rendering with these settings, with about `rays` camera samples in total.
    pub fn new(job: &'a RenderJob, settings: &'a RenderSettings, rays: usize) -> Self {
        let run = Run::new(job, settings, &STOP, &|_| ());
        let per_pixel = settings.spp.min(run.pass_length()).max(1);
        let pixels_per_batch = (BATCH_PATHS / per_pixel as usize).max(1);
        let tiles = job.world.scene.film.bounds.tiles(run.tile_size);
        let parts: Vec<_> = tiles
            .iter()
            .flat_map(|tile| {
                let area = tile.area();
                (0..area).step_by(pixels_per_batch).map(move |p| (*tile, p..area.min(p + pixels_per_batch)))
            })
            .collect();

        // Every k-th batch would always have the same columns if k divides the number of tiles in a row
        let all: usize = parts.iter().map(|(_, pixels)| pixels.len() * per_pixel as usize).sum();
        let share = rays as f64 / all.max(1) as f64;
        let is_taken = |i: usize| (i as f64 * GOLDEN_RATIO).fract() < share;
        let parts = parts.into_iter().enumerate().filter(|&(i, _)| is_taken(i)).map(|(_, part)| part).collect();
        Batches { run, parts, samples: 0..per_pixel, scratch: camera_sampler::Scratch::default() }
    }

    /// Number of batches.
    pub fn count(&self) -> usize {
        self.parts.len()
    }

    /// Number of pixels of a batch.
    pub fn pixels(&self, batch: usize) -> usize {
        self.parts[batch].1.len()
    }

    /// Camera samples per pixel.
    pub fn samples_per_pixel(&self) -> usize {
        self.samples.len()
    }

    /// Draws the camera samples of a batch. Their fits are numbered from 0.
    pub fn camera_samples(&mut self, batch: usize, out: &mut CameraSamples) {
        let (tile, pixels) = &self.parts[batch];
        self.run.camera_samples(tile, pixels.clone(), &self.samples, &mut self.scratch, out);
        out.fit.iter_mut().for_each(|fit| *fit -= pixels.start as u32);
    }
}

/// Batches of a rendering with this tile size, with about `rays` camera samples in total.
pub fn camera_batches(job: &RenderJob, tile_size: u32, rays: usize) -> Vec<CameraSamples> {
    let settings = RenderSettings { tile_size, spp: job.settings().sampling.spp, ..RenderSettings::default() };
    let mut batches = Batches::new(job, &settings, rays);
    let count = batches.count();
    let samples = |batch| {
        let mut out = CameraSamples::default();
        batches.camera_samples(batch, &mut out);
        out
    };
    (0..count).map(samples).collect()
}
