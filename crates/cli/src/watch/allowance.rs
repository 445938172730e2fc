//! CPU time of threads that serve viewers: bounded, so that rendering keeps the rest of the machine.

use lumiris::planning::processor_time;
use std::time::{Duration, Instant};

/// Share of the machine's CPU time.
const SHARE: f64 = 0.03;
/// CPU time that can be saved up (s).
const SAVED: f64 = 0.25;

/// CPU-time budget of the thread that created it.
#[derive(Debug)]
pub(super) struct Allowance {
    /// CPU time per second.
    share: f64,
    /// Remaining CPU time (s); negative if overdrawn.
    left: f64,
    at: Instant,
    /// CPU time of the thread at `at`.
    taken: Duration,
}

impl Allowance {
    pub(super) fn new() -> Self {
        let processors = std::thread::available_parallelism().map_or(1, usize::from);
        let taken = processor_time::of_thread();
        Allowance { share: SHARE * processors as f64, left: SAVED, at: Instant::now(), taken }
    }

    /// Time for which the thread must sleep now.
    pub(super) fn rest(&mut self) -> Duration {
        let (now, taken) = (Instant::now(), processor_time::of_thread());
        let earned = (now - self.at).as_secs_f64() * self.share;
        self.left = (self.left + earned - taken.saturating_sub(self.taken).as_secs_f64()).min(SAVED);
        (self.at, self.taken) = (now, taken);
        Duration::from_secs_f64((-self.left).max(0.0) / self.share)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_thread_that_is_always_busy_has_its_share_and_what_it_has_saved() {
        let mut allowance = Allowance { share: 0.5, left: 0.05, ..Allowance::new() };
        let (start, before) = (Instant::now(), processor_time::of_thread());
        while start.elapsed() < Duration::from_millis(300) {
            let begin = processor_time::of_thread();
            while processor_time::of_thread() - begin < Duration::from_millis(2) {}
            std::thread::sleep(allowance.rest());
        }
        let (elapsed, taken) = (start.elapsed().as_secs_f64(), (processor_time::of_thread() - before).as_secs_f64());
        // The last 2 ms, and the resolution of the clock
        assert!(taken <= 0.05 + 0.5 * elapsed + 0.004, "{taken} s in {elapsed} s");
    }
}
