//! The pilot that learns the emission of useful light paths, and estimates their variance and time.

use super::guide::LightPathGuide;
use super::trace::{LightPathWalker, PathBatch, TraceInput, batches, trace};
use crate::integrators::exclusions::{self, Feature};
use crate::integrators::statistics::LightPathStats;
use crate::scene::RenderJob;
use lumiris_numbers::math::hash::pcg4d;
use rayon::prelude::*;
use std::time::Instant;

/// Seed of pilots.
const SEED: u32 = 0x6c_70_69_6c;
/// Limits of the number of pilot rays (one per pixel), and number of rays per light path of the pilot. They do not
/// depend on the number of samples: an image that is continued with more samples keeps its light paths.
const RAYS: [u64; 2] = [1 << 14, 1 << 20];
const RAYS_PER_PATH: u64 = 4;
/// Rounds of light paths.
const ROUNDS: u32 = 2;

/// Results of the pilot.
#[derive(Debug)]
pub struct LightPilot {
    pub(super) guide: LightPathGuide,
    pub(super) stats: LightPathStats,
    /// Light paths of the last round that reach the camera: squared unweighted contribution, and density relative to
    /// the density of a camera sample.
    moments: Vec<[f64; 2]>,
    /// Number and time (ns) of the light paths of the last round.
    round: (u64, f64),
    /// Time of the pilot (ns).
    nanoseconds: f64,
    pixels: f64,
}

impl LightPilot {
    /// Runs the pilot with 1/`divisor` of its paths; `None` if light paths are excluded, or none is useful.
    pub fn new(job: &RenderJob, divisor: u64) -> Option<Self> {
        if !exclusions::allows(job, Feature::LightPaths) {
            return None;
        }
        let (set, bounds) = (&job.world.scene.lights, job.world.scene.film.bounds);
        let rays = (bounds.area() as u64 / divisor).clamp(RAYS[0], RAYS[1]);
        let seed = |round: u32| pcg4d([SEED, round, 0, 0])[0];
        let mut stats = LightPathStats::default();

        // Locate metal and glass
        let everywhere = LightPathGuide::everywhere(set, rays as u32)?;
        let mut caustic_hits = everywhere.begin();
        let input = TraceInput::new(job, &everywhere);
        let of_batch = |walker: &mut LightPathWalker, batch: PathBatch| {
            let start = Instant::now();
            (walker.first_hits(&input, seed(batch.round), batch.paths), start.elapsed())
        };
        let hits: Vec<_> =
            batches(0, rays).collect::<Vec<_>>().into_par_iter().map_init(LightPathWalker::default, of_batch).collect();
        stats.rays += rays;
        for (hits, time) in &hits {
            hits.iter()
                .for_each(|hit| everywhere.add(&mut caustic_hits, hit.light, hit.d, hit.value.luminance().into()));
            stats.time += *time;
        }

        // Light paths over metal and glass that reach the camera
        let mut contributions = everywhere.begin();
        let mut guide = everywhere.learned(set, &caustic_hits)?;
        let (mut moments, mut of_round) = (Vec::new(), (0, 0.0));
        for round in 1..=ROUNDS {
            let batches: Vec<_> = batches(round, rays / RAYS_PER_PATH).collect();
            let (input, before) = (TraceInput::new(job, &guide), stats);
            let connections = trace(&input, &batches, seed, &mut stats);

            // Learn from their contributions
            moments.clear();
            for connection in connections.iter().flatten() {
                let value = f64::from(connection.value.luminance().abs());
                guide.add(&mut contributions, connection.light, connection.d, value);
                let weight = f64::from(connection.weight);
                let ratio = weight / (1.0 - weight).max(1e-9) / f64::from(guide.paths);
                moments.push([(value / weight).powi(2), ratio]);
            }
            of_round = (stats.paths - before.paths, (stats.time - before.time).as_secs_f64() * 1e9);
            guide = guide.learned(
                set,
                &if round < ROUNDS { contributions.mixed(&caustic_hits) } else { contributions.clone() },
            )?;
        }
        let nanoseconds = stats.time.as_secs_f64() * 1e9 * divisor as f64;
        Some(LightPilot { guide, stats, moments, round: of_round, nanoseconds, pixels: bounds.area() as f64 })
    }

    /// The learned distribution of light paths.
    pub(in crate::integrators) fn guide(&self) -> &LightPathGuide {
        &self.guide
    }

    /// Mean over pixels of the variance of a camera sample, for the light that both camera paths and light paths
    /// sample, with `per_sample` light paths per camera sample. With 0, camera paths carry all of it.
    pub fn variance(&self, per_sample: f64) -> f64 {
        let paths = per_sample * self.pixels;
        // ∫f²/(p + paths·q), estimated by light paths of the density q
        let moment = |[square, ratio]: &[f64; 2]| square * ratio / (1.0 + paths * ratio);
        self.moments.iter().map(moment).sum::<f64>() / (self.round.0.max(1) as f64 * self.pixels)
    }

    /// Time (ns) of light paths per camera sample, if there are `samples` camera samples.
    pub fn time(&self, per_sample: f64, samples: f64) -> f64 {
        if per_sample > 0.0 {
            per_sample * self.round.1 / self.round.0.max(1) as f64 + self.nanoseconds / samples
        } else {
            0.0
        }
    }
}
