//! How an image is prepared, what ends that, and why it may fail.

use crate::integrators::features::Conflict;
use crate::settings::Settings;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::time::{Duration, Instant};

/// Maximum number of samples per pixel where the time alone is given.
const MAX_SPP_FOR_TIME: u32 = 1 << 20;
/// Samples per pixel that pilots are made for where time is given: at most, and as samples of all pixels for each second.
const PILOT_SPP_FOR_TIME: u32 = 64;
const PILOT_SAMPLES_PER_SECOND: f64 = (1 << 18) as f64;
/// How often somebody looks at the clock.
const TICK: Duration = Duration::from_millis(10);

/// Gets the name of what is under way, and the part of it that is done, if that is known; called from worker threads.
pub type StageObserver<'a> = dyn Fn(&'static str, Option<f64>) + Sync + 'a;

/// How an image is prepared.
#[derive(Clone, Copy)]
pub struct Preparation<'a> {
    /// Number of threads; all processors if `None`.
    pub threads: Option<usize>,
    /// True if the map of the best M/N is wanted even if it is not used.
    pub ratio_map: bool,
    /// When pilots that are not done are given up: the image has settings then that need none.
    pub deadline: Option<Instant>,
    /// True if trials of settings may replace the choice of the rule.
    pub tunes: bool,
    /// Told about how much processor time trials will take, once that is known.
    pub expect: &'a (dyn Fn(Duration) + Sync),
    /// Ends the preparation.
    pub stop: &'a AtomicBool,
    /// Told what is under way.
    pub observe: &'a StageObserver<'a>,
}

impl Default for Preparation<'_> {
    fn default() -> Self {
        static NEVER: AtomicBool = AtomicBool::new(false);
        let observe = &|_: &'static str, _: Option<f64>| ();
        Preparation {
            threads: None,
            ratio_map: false,
            tunes: false,
            expect: &|_| (),
            deadline: None,
            stop: &NEVER,
            observe,
        }
    }
}

impl Preparation<'_> {
    /// On so many threads.
    pub fn on(threads: Option<usize>) -> Self {
        Preparation { threads, ..Preparation::default() }
    }

    /// An error once it is to end.
    pub(super) fn goes_on(&self) -> Result<(), PlanError> {
        if self.stop.load(Ordering::Relaxed) { Err(PlanError::Stopped) } else { Ok(()) }
    }

    /// Does work that is told to stop at the deadline, too.
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

/// Why an image could not be prepared.
#[derive(Debug, thiserror::Error)]
pub enum PlanError {
    /// The threads could not be started.
    #[error(transparent)]
    Threads(#[from] ThreadError),
    /// The settings leave out something of the scene.
    #[error(transparent)]
    Features(#[from] Conflict),
    /// It was stopped.
    #[error("stopped before the first sample")]
    Stopped,
}

/// Why threads could not start.
#[derive(Debug, thiserror::Error)]
#[error("cannot start {threads} threads: {cause}")]
pub struct ThreadError {
    threads: usize,
    cause: rayon::ThreadPoolBuildError,
}

/// Threads, all cores if their number is not given.
pub fn thread_pool(threads: Option<usize>) -> Result<rayon::ThreadPool, ThreadError> {
    let threads = threads.unwrap_or_else(|| std::thread::available_parallelism().map_or(1, usize::from));
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
    pool.map_err(|cause| ThreadError { threads, cause })
}

/// Work that consists of so many parts.
pub(super) struct Stage<'a> {
    how: &'a Preparation<'a>,
    name: &'static str,
    parts: usize,
    done: AtomicUsize,
}

impl<'a> Stage<'a> {
    /// Begins it.
    pub(super) fn new(how: &'a Preparation<'a>, name: &'static str, parts: usize) -> Self {
        (how.observe)(name, None);
        Stage { how, name, parts, done: AtomicUsize::new(0) }
    }

    /// Some more parts are done.
    pub(super) fn add(&self, parts: usize) {
        let done = self.done.fetch_add(parts, Ordering::Relaxed) + parts;
        (self.how.observe)(self.name, Some((done as f64 / self.parts.max(1) as f64).min(1.0)));
    }
}

/// Completes settings of an image of so many pixels that is to be rendered in a time: the maximum number of samples per pixel,
/// unless `has_spp`, and the number that pilots are made for, unless it is given. Both follow from what is asked for, and not from
/// measured times, so that pilots and texture footprints are the same on every machine.
pub fn complete_for_time(settings: &mut Settings, has_spp: bool, time: Duration, pixels: usize) {
    let sampling = &mut settings.sampling;
    if !has_spp {
        sampling.spp = MAX_SPP_FOR_TIME;
    }
    let in_time = time.as_secs_f64() * PILOT_SAMPLES_PER_SECOND / pixels.max(1) as f64;
    let for_pilots = (in_time as u32).clamp(1, PILOT_SPP_FOR_TIME);
    sampling.pilot_spp = sampling.pilot_spp.or(Some(for_pilots).filter(|&spp| spp < sampling.spp));
}

/// When pilots are given up of an image that takes this time since its start: when half of what is left by now is over.
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
        // Not more than there are samples, and what is given stays
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
        let (stop, deadline) = (AtomicBool::new(true), Some(Instant::now() + Duration::from_secs(1000)));
        Preparation { deadline, stop: &stop, ..Preparation::default() }.until_deadline(ends);
        let result = Preparation { deadline, ..Preparation::default() }.until_deadline(|how| how.goes_on().is_ok());
        assert!(result, "work that is done is not told to stop");
    }
}
