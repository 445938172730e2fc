//! Processor time of a rendering by phases.
//!
//! Stages of a batch are measured by the clock on the wall, and a whole tile by the processor time of its thread as well: what
//! other programs took of a tile is taken off all of its stages alike.

use crate::integrators::PathStats;
use crate::planning::processor_time;
use std::time::{Duration, Instant};

/// A phase, and its processor time.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Phase {
    /// Which.
    pub name: &'static str,
    /// Processor time (user and system), summed over threads.
    pub time: Duration,
}

/// Where the time of workers goes, by the clock.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct WorkerTimes {
    /// Making camera samples.
    pub(super) camera_samples: Duration,
    /// Tracing them.
    pub(super) tracing: Duration,
    /// Sums of pixels.
    pub(super) film: Duration,
    /// All of it.
    all: Duration,
    /// Processor time of that.
    processor: Duration,
    /// Processor time for the noise of the image so far.
    pub(super) noise: Duration,
}

impl WorkerTimes {
    /// Times some work.
    pub(super) fn of<R>(work: impl FnOnce() -> R) -> (R, Self) {
        // Threads wait where the system is called, which must not be between the readings of the clock
        let processor = processor_time::of_thread();
        let start = Instant::now();
        let result = work();
        let all = start.elapsed();
        let processor = processor_time::of_thread().saturating_sub(processor);
        (result, WorkerTimes { all, processor, ..WorkerTimes::default() })
    }

    /// Adds other times.
    pub(super) fn merge(&mut self, other: &WorkerTimes) {
        self.camera_samples += other.camera_samples;
        self.tracing += other.tracing;
        self.film += other.film;
        self.all += other.all;
        self.processor += other.processor;
        self.noise += other.noise;
    }

    /// The phases of workers with these statistics. What tracing takes beside its stages is the time of `paths`.
    pub(super) fn phases(&self, stats: &PathStats) -> Vec<Phase> {
        let paths = stats.beside_stages(self.tracing);
        let others = [("paths", paths), ("camera_samples", self.camera_samples), ("film", self.film)];
        let scale = self.processor.as_secs_f64() / self.all.as_secs_f64().max(1e-9);
        let of_tiles =
            stats.stages().into_iter().chain(others).map(|(name, time)| Phase { name, time: time.mul_f64(scale) });
        of_tiles.chain([Phase { name: "noise", time: self.noise }]).collect()
    }
}
