//! Batches of camera samples as the renderer makes them in its first pass, spread over the image: for measurements.

use super::{BATCH_PATHS, RenderSettings, Run};
use crate::film::PixelBounds;
use crate::integrators::camera_samples;
use crate::integrators::path::CameraSample;
use crate::scene::RenderJob;
use std::ops::Range;
use std::sync::atomic::AtomicBool;

/// Its multiples modulo 1 are spread evenly.
const GOLDEN_RATIO: f64 = 0.618_033_988_749_895;

/// Nothing stops what is measured.
static STOP: AtomicBool = AtomicBool::new(false);

/// Batches of whole pixels of a pass.
pub struct Batches<'a> {
    run: Run<'a>,
    /// The pixels of each batch: of a tile, row by row.
    parts: Vec<(PixelBounds, Range<usize>)>,
    samples: Range<u32>,
    scratch: camera_samples::Scratch,
}

impl<'a> Batches<'a> {
    /// About `rays` camera samples together, of a rendering by these settings.
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

        // Not every k-th one: k may divide the number in a row of tiles, and the same columns would be taken
        let all: usize = parts.iter().map(|(_, pixels)| pixels.len() * per_pixel as usize).sum();
        let share = rays as f64 / all.max(1) as f64;
        let is_taken = |i: usize| (i as f64 * GOLDEN_RATIO).fract() < share;
        let parts = parts.into_iter().enumerate().filter(|&(i, _)| is_taken(i)).map(|(_, part)| part).collect();
        Batches { run, parts, samples: 0..per_pixel, scratch: camera_samples::Scratch::default() }
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

    /// Makes the camera samples of a batch; their fits are numbered from 0.
    pub fn camera_samples(&mut self, batch: usize, out: &mut Vec<CameraSample>) {
        let (tile, pixels) = &self.parts[batch];
        self.run.camera_samples(tile, pixels.clone(), &self.samples, &mut self.scratch, out);
        out.iter_mut().for_each(|sample| sample.fit -= pixels.start as u32);
    }
}

/// All batches of a rendering with tiles of this size, about `rays` camera samples together.
pub fn camera_batches(job: &RenderJob, tile_size: u32, rays: usize) -> Vec<Vec<CameraSample>> {
    let settings = RenderSettings { tile_size, spp: job.settings().sampling.spp, ..RenderSettings::default() };
    let mut batches = Batches::new(job, &settings, rays);
    let count = batches.count();
    let samples = |batch| {
        let mut out = Vec::new();
        batches.camera_samples(batch, &mut out);
        out
    };
    (0..count).map(samples).collect()
}
