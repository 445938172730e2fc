//! Parameters of the preparation of an image: threads, deadline, observers, errors.

use crate::integrators::exclusions::Conflict;
use crate::settings::Settings;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::time::{Duration, Instant};

/// Maximum samples per pixel if only the time is given.
const MAX_SPP_FOR_TIME: u32 = 1 << 20;
/// Samples per pixel that pilots assume if the time is given: maximum, and samples of all pixels per second.
const PILOT_SPP_FOR_TIME: u32 = 64;
const PILOT_SAMPLES_PER_SECOND: f64 = (1 << 18) as f64;
/// Interval between checks of the deadline.
const TICK: Duration = Duration::from_millis(10);

/// Receives the name of the current stage, and the completed fraction if available. Called from worker threads.
pub type StageObserver<'a> = dyn Fn(&'static str, Option<f64>) + Sync + 'a;

/// Parameters of the preparation of an image.
#[derive(Clone, Copy)]
pub struct Preparation<'a> {
    /// Number of threads; all processors if `None`.
    pub threads: Option<usize>,
    /// True if the map of the best M/N is requested even if it is not used.
    pub ratio_map: bool,
    /// Time after which unfinished pilots are abandoned. The image then has settings that need none.
    pub deadline: Option<Instant>,
    /// Stops the preparation.
    pub stop: &'a AtomicBool,
    /// Receives the current stage.
    pub observe: &'a StageObserver<'a>,
}

impl Default for Preparation<'_> {
    fn default() -> Self {
        static NEVER: AtomicBool = AtomicBool::new(false);
        let observe = &|_: &'static str, _: Option<f64>| ();
        Preparation { threads: None, ratio_map: false, deadline: None, stop: &NEVER, observe }
    }
}

impl Preparation<'_> {
    /// Preparation on the given number of threads.
    pub fn on(threads: Option<usize>) -> Self {
        Preparation { threads, ..Preparation::default() }
    }

    /// Returns an error after a stop.
    pub(super) fn goes_on(&self) -> Result<(), PlanError> {
        if self.stop.load(Ordering::Relaxed) { Err(PlanError::Stopped) } else { Ok(()) }
    }

    /// Runs work that is stopped at the deadline as well.
    pub(super) fn until_deadline<T>(&self, work: impl FnOnce(&Preparation<'_>) -> T) -> T {
        let Some(deadline) = self.deadline else { return work(self) };
        let (is_done, stop) = (AtomicBool::new(false), AtomicBool::new(false));
        let watch = || {
            while !is_done.load(Ordering::Relaxed) && !stop.load(Ordering::Relaxed) {
                let is_over = self.stop.load(Ordering::Relaxed) || Instant::now() >= deadline;
                stop.store(is_over, Ordering::Relaxed);
                std::thread::sleep(TICK);
            }
        };
        std::thread::scope(|scope| {
            scope.spawn(watch);
            let result = work(&Preparation { stop: &stop, ..*self });
            is_done.store(true, Ordering::Relaxed);
            result
        })
    }
}

/// Reason why an image could not be prepared.
#[derive(Debug, thiserror::Error)]
pub enum PlanError {
    /// The threads could not be started.
    #[error(transparent)]
    Threads(#[from] ThreadError),
    /// The settings exclude a feature of the scene.
    #[error(transparent)]
    Features(#[from] Conflict),
    /// The preparation was stopped.
    #[error("stopped before the first sample")]
    Stopped,
}

/// Threads could not be started.
#[derive(Debug, thiserror::Error)]
#[error("cannot start {threads} threads: {cause}")]
pub struct ThreadError {
    threads: usize,
    cause: rayon::ThreadPoolBuildError,
}

/// A thread pool; one thread per core if no number is given.
pub fn thread_pool(threads: Option<usize>) -> Result<rayon::ThreadPool, ThreadError> {
    let threads = threads.unwrap_or_else(|| std::thread::available_parallelism().map_or(1, usize::from));
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
    pool.map_err(|cause| ThreadError { threads, cause })
}

/// A stage of the preparation, with progress by parts.
pub(super) struct Stage<'a> {
    how: &'a Preparation<'a>,
    name: &'static str,
    parts: usize,
    done: AtomicUsize,
}

impl<'a> Stage<'a> {
    /// Starts the stage.
    pub(super) fn new(how: &'a Preparation<'a>, name: &'static str, parts: usize) -> Self {
        (how.observe)(name, None);
        Stage { how, name, parts, done: AtomicUsize::new(0) }
    }

    /// Adds completed parts.
    pub(super) fn add(&self, parts: usize) {
        let done = self.done.fetch_add(parts, Ordering::Relaxed) + parts;
        (self.how.observe)(self.name, Some((done as f64 / self.parts.max(1) as f64).min(1.0)));
    }
}

/// Completes settings of an image with `pixels` pixels and a time limit. Sets the maximum number of samples per pixel
/// unless `has_spp`, and the number that pilots assume unless it is given. Both follow from the request, not from
/// measured times, so pilots and texture footprints are the same on every machine.
pub fn complete_for_time(settings: &mut Settings, has_spp: bool, time: Duration, pixels: usize) {
    let sampling = &mut settings.sampling;
    if !has_spp {
        sampling.spp = MAX_SPP_FOR_TIME;
    }
    let in_time = time.as_secs_f64() * PILOT_SAMPLES_PER_SECOND / pixels.max(1) as f64;
    let for_pilots = (in_time as u32).clamp(1, PILOT_SPP_FOR_TIME);
    sampling.pilot_spp = sampling.pilot_spp.or(Some(for_pilots).filter(|&spp| spp < sampling.spp));
}

/// Time at which pilots are abandoned: after half of the time that is left now.
pub fn pilot_deadline(start: Instant, limit: Duration) -> Option<Instant> {
    Instant::now().checked_add(limit.saturating_sub(start.elapsed()) / 2)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pilots_within_a_time_follow_from_what_is_asked_for() {
        let completed = |spp: Option<u32>, pilot_spp: Option<u32>, seconds: f64, pixels: usize| {
            let mut settings = Settings::default();
            settings.sampling.spp = spp.unwrap_or(16);
            settings.sampling.pilot_spp = pilot_spp;
            complete_for_time(&mut settings, spp.is_some(), Duration::from_secs_f64(seconds), pixels);
            (settings.sampling.spp, settings.sampling.pilot_spp, settings.sampling.footprint())
        };
        assert_eq!(completed(None, None, 60.0, 1 << 16), (MAX_SPP_FOR_TIME, Some(64), 0.125));
        assert_eq!(completed(None, None, 40.0, 1 << 20), (MAX_SPP_FOR_TIME, Some(10), 0.125));
        assert_eq!(completed(None, None, 1e-6, 1 << 20).1, Some(1));
        // No more than the given samples, and given values stay
        assert_eq!(completed(Some(16), None, 60.0, 1 << 16), (16, None, 0.25));
        assert_eq!(completed(Some(1000), Some(300), 60.0, 1 << 16).1, Some(300));
    }

    #[test]
    fn work_is_told_to_stop_at_the_deadline_or_before() {
        let ends = |how: &Preparation<'_>| {
            while how.goes_on().is_ok() {
                std::thread::yield_now();
            }
        };
        Preparation { deadline: Some(Instant::now()), ..Preparation::default() }.until_deadline(ends);
        let stop = AtomicBool::new(true);
        let deadline = Some(Instant::now() + Duration::from_secs(1000));
        Preparation { deadline, stop: &stop, ..Preparation::default() }.until_deadline(ends);
        let result = Preparation { deadline, ..Preparation::default() }.until_deadline(|how| how.goes_on().is_ok());
        assert!(result, "work that is done is not told to stop");
    }
}
