//! How pilots are made before an image, and what ends them.

use super::RenderError;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

/// How an image is prepared.
#[derive(Clone, Copy, Debug)]
pub struct Preparation<'a> {
    /// Number of threads; all processors if `None`.
    pub threads: Option<usize>,
    /// True if the map of the best M/N is wanted even if it is not used.
    pub ratio_map: bool,
    /// The time that preparation and rendering may take: pilots are not made for more samples than that is enough for.
    pub time_limit: Option<Duration>,
    /// Processor time that the image took before, as of loading its scene: efficiency is that of all its time.
    pub loading: Duration,
    /// Ends the preparation.
    pub stop: &'a AtomicBool,
}

impl Default for Preparation<'_> {
    fn default() -> Self {
        static NEVER: AtomicBool = AtomicBool::new(false);
        Preparation { threads: None, ratio_map: false, time_limit: None, loading: Duration::ZERO, stop: &NEVER }
    }
}

impl Preparation<'_> {
    /// On so many threads.
    pub fn on(threads: Option<usize>) -> Self {
        Preparation { threads, ..Preparation::default() }
    }

    /// An error once it is to end.
    pub(super) fn goes_on(&self) -> Result<(), RenderError> {
        if self.stop.load(Ordering::Relaxed) { Err(RenderError::Stopped) } else { Ok(()) }
    }
}
