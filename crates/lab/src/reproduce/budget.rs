//! A time budget.

use std::time::{Duration, Instant};

/// A time budget that is divided among parts.
#[derive(Clone, Copy, Debug)]
pub struct Budget {
    start: Instant,
    total: Duration,
    /// Weights of the remaining parts; the weights of all parts add up to 100.
    left: f64,
}

impl Budget {
    /// Starts now.
    pub fn new(total: Duration) -> Self {
        Budget { start: Instant::now(), total, left: 100.0 }
    }

    /// Elapsed time.
    pub fn elapsed(&self) -> Duration {
        self.start.elapsed()
    }

    /// Time for the next part, whose weight is `weight` of 100: its fraction of the remaining time.
    pub fn share(&mut self, weight: f64) -> Duration {
        let share = (weight / self.left.max(1e-9)).clamp(0.0, 1.0);
        self.left -= weight;
        self.total.saturating_sub(self.elapsed()).mul_f64(share)
    }
}
