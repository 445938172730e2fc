//! CPU time of a rendering by phase.
//!
//! The stages of a batch are measured in wall-clock time, and a whole tile in CPU time of its thread as well. The ratio
//! of both scales all stages of the tiles, which removes the time taken by other programs. The program prints them
//! (`commands/laps.rs`).

use crate::integrators::PathStats;
use crate::planning::processor_time;
use std::time::{Duration, Instant};

/// A phase and its CPU time.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Phase {
    /// Name of the phase.
    pub name: &'static str,
    /// CPU time (user and system), summed over threads.
    pub time: Duration,
}

/// Wall-clock times of workers, by stage.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct WorkerTimes {
    /// Generation of camera samples.
    pub(super) camera_samples: Duration,
    /// Tracing.
    pub(super) tracing: Duration,
    /// Sums of pixels.
    pub(super) film: Duration,
    /// Total wall-clock time of tiles.
    all: Duration,
    /// CPU time of the same tiles.
    processor: Duration,
    /// CPU time for the noise of the image so far.
    pub(super) noise: Duration,
}

impl WorkerTimes {
    /// Runs `work` and measures its time.
    pub(super) fn of<R>(work: impl FnOnce() -> R) -> (R, Self) {
        // CPU times are read by system calls, in which a thread may wait: outside the wall-clock interval
        let processor = processor_time::of_thread();
        let start = Instant::now();
        let result = work();
        let all = start.elapsed();
        let processor = processor_time::of_thread().saturating_sub(processor);
        (result, WorkerTimes { all, processor, ..WorkerTimes::default() })
    }

    /// Adds the times of another worker.
    pub(super) fn merge(&mut self, other: &WorkerTimes) {
        self.camera_samples += other.camera_samples;
        self.tracing += other.tracing;
        self.film += other.film;
        self.all += other.all;
        self.processor += other.processor;
        self.noise += other.noise;
    }

    /// The phases of workers with these statistics. Tracing time outside the stages counts as `paths`.
    pub(super) fn phases(&self, stats: &PathStats) -> Vec<Phase> {
        let paths = stats.beside_stages(self.tracing);
        let others = [("paths", paths), ("camera_samples", self.camera_samples), ("film", self.film)];
        let scale = self.processor.as_secs_f64() / self.all.as_secs_f64().max(1e-9);
        let of_tiles =
            stats.stages().into_iter().chain(others).map(|(name, time)| Phase { name, time: time.mul_f64(scale) });
        of_tiles.chain([Phase { name: "noise", time: self.noise }]).collect()
    }
}
