//! Contributions of light paths to the pixels, for some steps of share groups.

use super::guide::LightPathGuide;
use super::per_sample::per_sample;
use super::pilot::LightPilot;
use super::trace::{CameraConnection, PathBatch, TraceInput, batches, trace};
use crate::film::{PixelBounds, PixelSample};
use crate::integrators::camera_sample::CameraSamples;
use crate::integrators::statistics::LightPathStats;
use crate::scene::{PixelSamples, RenderJob};
use lumiris_numbers::math::Rgb;
use lumiris_numbers::math::hash::pcg4d;
use rayon::prelude::*;
use std::f32::consts::SQRT_2;
use std::sync::Arc;

/// Combined with the seed of the image for the seeds of light paths.
const SEED: u32 = 0x6c_69_67_68;
/// Maximum number of light paths traced at a time.
const MAX_PATHS: u64 = 1 << 21;

/// A contribution to a pixel.
#[derive(Clone, Copy, Debug)]
struct Entry {
    x: u32,
    /// Step of the share group.
    step: u32,
    value: Rgb,
}

/// The contributions of light paths to the pixels of an image.
#[derive(Debug)]
pub(in crate::integrators) struct LightImage {
    pub(in crate::integrators) guide: Arc<LightPathGuide>,
    bounds: PixelBounds,
    /// Number of steps so far.
    served: u32,
    /// By row, pixel and step.
    entries: Vec<Entry>,
    /// Start of the entries of each row, followed by the end of the last row.
    rows: Vec<u32>,
    /// One bit for each pixel that has entries.
    has_entries: Vec<u64>,
    pub(in crate::integrators) stats: LightPathStats,
}

impl LightImage {
    /// `None` if light paths are disabled, or if the pilot finds no useful ones.
    pub(in crate::integrators) fn new(job: &RenderJob) -> Option<Self> {
        let bounds = job.world.scene.film.bounds;
        let paths = (f64::from(per_sample(job)) * bounds.area() as f64).round();
        if paths < 1.0 {
            return None;
        }
        let pilot = LightPilot::new(job, 1)?;
        let guide = pilot.guide.with_paths(paths.min(f64::from(u32::MAX)) as u32);
        let stats = pilot.stats;
        let rows = vec![0; bounds.height() as usize + 1];
        let has_entries = vec![0; bounds.area().div_ceil(64)];
        Some(LightImage { guide: Arc::new(guide), bounds, served: 0, entries: Vec::new(), rows, has_entries, stats })
    }

    /// Traces the light paths of the steps from `first` on. The number of steps equals the number traced so far,
    /// within limits. Returns it.
    pub(in crate::integrators) fn prepare(&mut self, job: &RenderJob, first: u32) -> u32 {
        let most = (MAX_PATHS / u64::from(self.guide.paths)).clamp(1, 1 << 16) as u32;
        let count = self.served.clamp(1, most);
        self.served += count;

        // Trace one set of light paths per step
        let seed = job.settings().sampling.seed;
        let paths = u64::from(self.guide.paths);
        let seed_of = |step: u32| pcg4d([seed, SEED, step, 0])[0];
        let batches: Vec<PathBatch> =
            (first..first.saturating_add(count)).flat_map(|step| batches(step, paths)).collect();
        let input = TraceInput::new(job, &self.guide);
        let connections = trace(&input, &batches, seed_of, &mut self.stats);

        // Sort the contributions by row, pixel and step
        let factor = 1.0 / paths as f32;
        let mut all: Vec<(u32, Entry)> = Vec::with_capacity(connections.iter().map(Vec::len).sum());
        for (batch, connections) in batches.iter().zip(&connections) {
            let step = PixelSamples::step(batch.round);
            let entry = |c: &CameraConnection| (c.pixel[1], Entry { x: c.pixel[0], step, value: c.value * factor });
            all.extend(connections.iter().map(entry));
        }
        // The sort is stable: the contributions of one step to a pixel are added in the order of the light paths
        all.par_sort_by_key(|(y, entry)| (*y, entry.x, entry.step));

        // Index of pixels and rows
        self.has_entries.fill(0);
        for (y, entry) in &all {
            let index = self.bounds.index_of([entry.x, *y]);
            self.has_entries[index / 64] |= 1 << (index % 64);
        }
        for (row, end) in self.rows.iter_mut().enumerate() {
            *end = all.partition_point(|(y, _)| ((*y - self.bounds.y0) as usize) < row) as u32;
        }
        self.entries.clear();
        self.entries.extend(all.into_iter().map(|(_, entry)| entry));
        count
    }

    /// Adds the contributions of light paths to camera samples.
    pub(in crate::integrators) fn add(&self, samples: &CameraSamples, out: &mut [PixelSample]) {
        for ((&[x, y], &share_group), out) in samples.pixel.iter().zip(&samples.share_group).zip(out) {
            let index = self.bounds.index_of([x, y]);
            if self.has_entries[index / 64] >> (index % 64) & 1 == 0 {
                continue;
            }

            // Find the entries of the pixel at this step
            let row = (y - self.bounds.y0) as usize;
            let row = &self.entries[self.rows[row] as usize..self.rows[row + 1] as usize];
            let step = PixelSamples::step(share_group);
            let begin = row.partition_point(|entry| (entry.x, entry.step) < (x, step));
            let own = row[begin..].iter().take_while(|entry| (entry.x, entry.step) == (x, step));

            // A replica also gets a signed contribution, from which the variance is estimated
            let light = own.map(|entry| entry.value).sum::<Rgb>();
            out.radiance += light;
            if samples.are_replicas {
                out.offset = light * sign(step) * SQRT_2;
            }
        }
    }
}

/// The sign s of a step in a replica. The variance of a pixel is estimated from the difference of replica and
/// pixel, but both use the same light paths. So the difference is made up: Σ e (1 + √2 s)/n and Σ e/n differ by √2 Σ s
/// e/n. Half its square is the variance of Σ e/n on average, if the signs are balanced. So two consecutive steps have
/// opposite signs, in random order. Pixels with samples in few of the steps have random signs, and overestimate the
/// variance.
fn sign(step: u32) -> f32 {
    let [of_pair, ..] = pcg4d([step >> 1, SEED, 1, 0]);
    if (of_pair ^ step) & 1 == 1 { 1.0 } else { -1.0 }
}
