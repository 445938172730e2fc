//! What light paths bring to the pixels, for some of the turns of an image.

use super::conditions::per_sample;
use super::guide::Guide;
use super::trace::{Scene, Seen, Walker};
use crate::film::{PixelBounds, PixelSample};
use crate::photons::path::BATCH;
use crate::scene::RenderJob;
use lumiris_numbers::math::Rgb;
use lumiris_numbers::math::hash::pcg4d;
use rayon::prelude::*;
use std::ops::Range;
use std::sync::Arc;
use std::time::{Duration, Instant};

/// Combined with the seed of the image to give those of light paths, and of the pilot.
const SEED: u32 = 0x6c_69_67_68;
const PILOT_SEED: u32 = 0x6c_70_69_6c;
/// Light paths of the image for each ray of the pilot, limits of the number of these, and rays for each of its light paths.
const SAMPLES_PER_RAY: u64 = 16;
const PILOT_RAYS: [u64; 2] = [1 << 14, 1 << 20];
const RAYS_PER_PATH: u64 = 4;
/// Rounds of light paths.
const ROUNDS: u32 = 2;
/// Light paths that are traced at a time, at most.
const MAX_PATHS: u64 = 1 << 23;

/// Counts and times of light paths.
#[derive(Clone, Copy, Debug, Default)]
pub struct LightPathStats {
    /// Light paths.
    pub paths: u64,
    /// Those that a pixel got.
    pub seen: u64,
    /// Rays and segments traced.
    pub rays: u64,
    /// Time (s), summed over threads.
    pub time: Duration,
}

/// A contribution to a pixel.
#[derive(Clone, Copy, Debug)]
struct Entry {
    x: u32,
    turn: u32,
    value: Rgb,
}

/// The contributions of light paths to the pixels of an image.
#[derive(Debug)]
pub(in crate::integrators) struct LightImage {
    pub(in crate::integrators) guide: Arc<Guide>,
    bounds: PixelBounds,
    /// Turns so far.
    served: u32,
    /// By row, pixel and turn.
    entries: Vec<Entry>,
    /// Where the entries of each row begin, and end.
    rows: Vec<u32>,
    /// One bit for each pixel that has entries.
    has_entries: Vec<u64>,
    pub(in crate::integrators) stats: LightPathStats,
}

impl LightImage {
    /// That of an image whose settings ask for light paths, and where a pilot finds some of use.
    pub(in crate::integrators) fn new(job: &RenderJob) -> Option<Self> {
        let bounds = job.world.scene.film.bounds;
        let paths = (f64::from(per_sample(job)) * bounds.area() as f64).round();
        if paths < 1.0 {
            return None;
        }
        let mut stats = LightPathStats::default();
        let guide = learn(job, &mut stats)?.with_paths(paths.min(f64::from(u32::MAX)) as u32);
        let rows = vec![0; bounds.height() as usize + 1];
        let has_entries = vec![0; bounds.area().div_ceil(64)];
        Some(LightImage { guide: Arc::new(guide), bounds, served: 0, entries: Vec::new(), rows, has_entries, stats })
    }

    /// Traces the light paths of the turns from `first` on: as many as before, and how many that is.
    pub(in crate::integrators) fn prepare(&mut self, job: &RenderJob, first: u32) -> u32 {
        let most = (MAX_PATHS / u64::from(self.guide.paths)).clamp(1, 1 << 16) as u32;
        let count = self.served.clamp(1, most);
        self.served += count;
        let seed = job.settings().sampling.seed;
        let paths = u64::from(self.guide.paths);
        let of_turn = |turn: u32| (turn, pcg4d([seed, SEED, turn, 0])[0]);
        let parts = (first..first.saturating_add(count)).flat_map(|turn| parts(paths).map(move |part| (turn, part)));
        let parts: Vec<(u32, Range<u64>)> = parts.collect();
        let scene = Scene::new(job, &self.guide);
        let found = trace(&scene, &parts, |turn| of_turn(turn).1, &mut self.stats);
        let factor = 1.0 / paths as f32;
        let mut all: Vec<(u32, Entry)> = Vec::with_capacity(found.iter().map(Vec::len).sum());
        for ((turn, _), seen) in parts.iter().zip(&found) {
            let entry = |s: &Seen| (s.pixel[1], Entry { x: s.pixel[0], turn: *turn, value: s.value * factor });
            all.extend(seen.iter().map(entry));
        }
        // Stable: what a pixel has of one turn is added in the order of the light paths
        all.par_sort_by_key(|(y, entry)| (*y, entry.x, entry.turn));
        self.has_entries.fill(0);
        for (y, entry) in &all {
            let place = self.place(entry.x, *y);
            self.has_entries[place / 64] |= 1 << (place % 64);
        }
        for (row, end) in self.rows.iter_mut().enumerate() {
            *end = all.partition_point(|(y, _)| ((*y - self.bounds.y0) as usize) < row) as u32;
        }
        self.entries.clear();
        self.entries.extend(all.into_iter().map(|(_, entry)| entry));
        count
    }

    #[inline]
    fn place(&self, x: u32, y: u32) -> usize {
        (y - self.bounds.y0) as usize * self.bounds.width() as usize + (x - self.bounds.x0) as usize
    }

    /// Adds to camera samples, given by pixel and turn, what their pixels have of that turn.
    pub(in crate::integrators) fn add(&self, samples: impl Iterator<Item = ([u32; 2], u32)>, out: &mut [PixelSample]) {
        for (([x, y], turn), out) in samples.zip(out) {
            let place = self.place(x, y);
            if self.has_entries[place / 64] >> (place % 64) & 1 == 0 {
                continue;
            }
            let row = (y - self.bounds.y0) as usize;
            let row = &self.entries[self.rows[row] as usize..self.rows[row + 1] as usize];
            let turn = turn & TURN;
            let begin = row.partition_point(|entry| (entry.x, entry.turn) < (x, turn));
            let own = row[begin..].iter().take_while(|entry| (entry.x, entry.turn) == (x, turn));
            out.radiance += own.map(|entry| entry.value).sum::<Rgb>();
        }
    }
}

/// The bits of a turn beside those which count the samples of a pixel in it, see [`crate::scene::PixelSamples::turn`].
const TURN: u32 = (1 << 20) - 1;

/// Batches of so many light paths.
fn parts(paths: u64) -> impl Iterator<Item = Range<u64>> {
    (0..paths.div_ceil(BATCH)).map(move |i| i * BATCH..((i + 1) * BATCH).min(paths))
}

/// Traces batches of light paths; what the camera sees of each, in their order.
fn trace(
    scene: &Scene<'_>,
    parts: &[(u32, Range<u64>)],
    seed: impl Fn(u32) -> u32 + Sync,
    stats: &mut LightPathStats,
) -> Vec<Vec<Seen>> {
    let one = |walker: &mut Walker, (turn, part): &(u32, Range<u64>)| {
        let start = Instant::now();
        walker.traced = 0;
        walker.trace(scene, seed(*turn), part.clone());
        (walker.seen.clone(), walker.traced, start.elapsed())
    };
    let all: Vec<_> = parts.par_iter().with_max_len(1).map_init(Walker::default, one).collect();
    stats.paths += parts.iter().map(|(_, part)| part.end - part.start).sum::<u64>();
    all.into_iter()
        .map(|(seen, rays, time)| {
            stats.seen += seen.len() as u64;
            stats.rays += rays;
            stats.time += time;
            seen
        })
        .collect()
}

/// Finds by a pilot where light paths of use begin; `None` if it found none.
fn learn(job: &RenderJob, stats: &mut LightPathStats) -> Option<Guide> {
    let (set, bounds) = (&job.world.scene.lights, job.world.scene.film.bounds);
    let samples = bounds.area() as u64 * u64::from(job.settings().sampling.spp);
    let rays = (samples / SAMPLES_PER_RAY).clamp(PILOT_RAYS[0], PILOT_RAYS[1]);
    let seed = |round: u32| pcg4d([PILOT_SEED, round, 0, 0])[0];

    // Where metal and glass are
    let everywhere = Guide::everywhere(set, rays as u32)?;
    let mut bundling = everywhere.begin();
    let scene = Scene::new(job, &everywhere);
    let of_part = |walker: &mut Walker, part: Range<u64>| walker.first_hits(&scene, seed(0), part);
    let hits: Vec<_> = parts(rays).collect::<Vec<_>>().into_par_iter().map_init(Walker::default, of_part).collect();
    stats.rays += rays;
    for hit in hits.iter().flatten() {
        everywhere.add(&mut bundling, hit.light, hit.d, f64::from(hit.value.luminance()));
    }

    // What is seen of the light that they send on
    let mut found = everywhere.begin();
    let mut guide = everywhere.learned(set, &bundling)?;
    for round in 1..=ROUNDS {
        let parts: Vec<_> = parts(rays / RAYS_PER_PATH).map(|part| (round, part)).collect();
        let scene = Scene::new(job, &guide);
        let seen = trace(&scene, &parts, seed, stats);
        for seen in seen.iter().flatten() {
            guide.add(&mut found, seen.light, seen.d, f64::from(seen.value.luminance().abs()));
        }
        guide = guide.learned(set, &if round < ROUNDS { found.mixed(&bundling) } else { found.clone() })?;
    }
    Some(guide)
}
