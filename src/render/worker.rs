//! What one thread holds: an integrator of each kind, with its buffers and counts.

use super::camera_samples;
use crate::direct::Fits;
use crate::film::PixelSample;
use crate::integrators::irradiance_cache::{IrradianceCache, LookupStats};
use crate::integrators::path::{CameraSample, Recording};
use crate::integrators::photon_map::PhotonMaps;
use crate::integrators::{CacheIntegrator, PathIntegrator, PathStats, PhotonMapIntegrator};
use crate::scene::RenderJob;

/// Counts of one worker.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct WorkerStats {
    pub(super) paths: PathStats,
    pub(super) lookups: LookupStats,
}

impl WorkerStats {
    pub(super) fn merge(&mut self, other: &WorkerStats) {
        self.paths.merge(&other.paths);
        self.lookups.merge(&other.lookups);
    }
}

/// Buffers of one thread.
#[derive(Default)]
pub(super) struct Worker {
    integrator: PathIntegrator,
    with_cache: CacheIntegrator,
    with_photons: PhotonMapIntegrator,
    pub(super) samples: Vec<CameraSample>,
    pub(super) scratch: camera_samples::Scratch,
    pub(super) results: Vec<PixelSample>,
}

impl Worker {
    /// A worker that determines the features of first surfaces, or does not.
    pub(super) fn new(with_features: bool) -> Self {
        let mut worker = Worker::default();
        worker.integrator.omits_features = !with_features;
        worker.with_cache.omit_features(!with_features);
        worker.with_photons.omit_features(!with_features);
        worker
    }

    /// Traces `samples` into `results`.
    pub(super) fn trace(
        &mut self,
        job: &RenderJob,
        (cache, maps): (Option<&IrradianceCache>, Option<&PhotonMaps>),
        fits: &mut Fits,
    ) {
        let (samples, results) = (&self.samples, &mut self.results);
        match (cache, maps) {
            (Some(cache), _) => self.with_cache.trace(job, cache, samples, fits, results),
            (None, Some(maps)) => self.with_photons.trace(job, maps, samples, fits, results),
            (None, None) => self.integrator.trace(job, &job.settings().integrator, samples, fits, results),
        }
    }

    /// Records the rays of paths from now on, or does not.
    pub(super) fn record(&mut self, on: bool) {
        self.integrator.recording = on.then(Recording::default);
    }

    /// The rays that were recorded.
    pub(super) fn take_recording(&mut self) -> Recording {
        self.integrator.recording.take().unwrap_or_default()
    }

    pub(super) fn take_stats(&mut self) -> WorkerStats {
        let (mut paths, lookups) = self.with_cache.take_stats();
        paths.merge(&self.with_photons.take_stats());
        paths.merge(&self.integrator.take_stats());
        WorkerStats { paths, lookups }
    }
}
