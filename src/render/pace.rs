//! Lengths of passes, and the end of a rendering.
//!
//! When the time is over, tiles that have not started lack the samples of the last pass. To keep their number small,
//! passes become shorter towards the end: each takes half of the remaining time at the speed so far.

use super::run::Run;
use crate::direct::Estimator;
use crate::imaging::tiles::TileStore;
use lumiris_numbers::estimators::ocv::block_of;
use std::sync::atomic::Ordering;
use std::time::Duration;

/// Fraction of the time limit that may remain unused if no whole pass fits into it.
const LEFT_OVER: f64 = 0.03;

/// Minimum extra time for tiles without a sample: an image with holes is of little use.
const GRACE: Duration = Duration::from_millis(500);

/// Maximum camera samples of a tile in a pass. Reading and writing the sums of a pixel takes as long as adding several
/// samples, so short passes are inefficient.
const TILE_SAMPLES: u32 = 1 << 16;

impl Run<'_> {
    /// Samples per pixel of the next pass over all tiles: 1, 3, 12, 48, 64, 64, …, so that a whole image is available
    /// soon, and each pass before the longest quadruples the samples. Progressive estimators fit in blocks of samples;
    /// a pass does not exceed the block. `done` samples per pixel are rendered, `now` of them by this run.
    pub(super) fn next_pass(&self, done: u32, now: u32) -> u32 {
        let longest = done.saturating_mul(3).clamp(1, self.pass_length());
        let length = self.in_time(now, longest).unwrap_or(longest);
        if !Estimator::at_vertex(&self.job.settings().integrator, 0).is_progressive() {
            return length;
        }
        let block = block_of(done);
        length.min(block.first + block.len - done)
    }

    /// Samples per pixel of the longest pass.
    pub(super) fn pass_length(&self) -> u32 {
        (TILE_SAMPLES / self.tile_size.max(1).pow(2)).clamp(1, 64)
    }

    /// Samples per pixel of the next pass within the time limit, at most `longest`. `done` samples per pixel were
    /// rendered by this run.
    fn in_time(&self, done: u32, longest: u32) -> Option<u32> {
        let limit = self.settings.time_limit.filter(|_| done > 0)?;
        Some(pass_in_time(done, self.start.elapsed(), limit, longest))
    }

    /// True if no further pass starts, after `done` samples per pixel of this run.
    pub(super) fn stopped(&self, done: u32) -> bool {
        self.in_time(done, 1) == Some(0) || self.stops_at_once()
    }

    /// True if the time limit is reached.
    pub(super) fn is_late(&self) -> bool {
        self.settings.time_limit.is_some_and(|limit| self.start.elapsed() >= limit)
    }

    /// True if pixels whose next sample has the index `next` get no further samples because the time is over. For their
    /// first sample there is a grace period.
    pub(super) fn leaves(&self, next: u32) -> bool {
        let is_over = |limit| self.start.elapsed() >= of_first_samples(limit);
        self.is_late() && (next > self.begin() || self.settings.time_limit.is_some_and(is_over))
    }

    /// True if no further tile starts.
    pub(super) fn stops_at_once(&self) -> bool {
        self.stop.load(Ordering::Relaxed) || self.failure().is_some()
    }

    /// Reason why some samples are wrong, if any are.
    pub(super) fn failure(&self) -> Option<&str> {
        self.texels.and_then(TileStore::failure)
    }
}

/// Time after which even tiles without a sample do not start.
fn of_first_samples(limit: Duration) -> Duration {
    limit.saturating_add(GRACE.max(limit.mul_f64(LEFT_OVER)))
}

/// Samples per pixel of the next pass, at most `longest`, after `done` samples in the time `elapsed`; 0 if no pass
/// starts.
fn pass_in_time(done: u32, elapsed: Duration, limit: Duration, longest: u32) -> u32 {
    let left = limit.saturating_sub(elapsed).as_secs_f64();
    let fit = left * f64::from(done) / elapsed.as_secs_f64().max(1e-9);
    if fit < 1.0 && left <= LEFT_OVER * limit.as_secs_f64() {
        return 0;
    }
    ((0.5 * fit) as u32).clamp(1, longest.max(1))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Simulates a rendering in which the sample with index `i` takes `seconds(i)` for all pixels. Returns the number
    /// of samples and by how many seconds the last pass ends too late.
    fn rendered(limit: f64, seconds: impl Fn(u32) -> f64) -> (u32, f64) {
        let (mut done, mut elapsed) = (1, seconds(0));
        loop {
            let time = Duration::from_secs_f64;
            let length = pass_in_time(done, time(elapsed), time(limit), done.min(16));
            if length == 0 || elapsed >= limit {
                return (done, elapsed - limit);
            }
            elapsed += (done..done + length).map(&seconds).sum::<f64>();
            done += length;
        }
    }

    #[test]
    fn passes_end_where_the_time_does() {
        for (limit, of_sample) in [(2.0, 0.001), (2.0, 0.0371), (10.0, 0.21), (60.0, 0.7)] {
            let (done, late) = rendered(limit, |_| of_sample);
            let spare = LEFT_OVER * limit;
            assert!(late <= of_sample && late >= -spare, "{limit} s by {of_sample} s: {done} samples, {late} s late");
        }
        // If samples become slower, at most one is too many
        let (done, late) = rendered(10.0, |i| if i < 8 { 0.1 } else { 0.25 });
        assert!((-0.3..=0.25).contains(&late), "{done} samples, {late} s late");
    }

    #[test]
    fn a_pass_that_does_not_fit_is_begun_where_much_time_is_left() {
        let time = Duration::from_secs_f64;
        // A further sample takes one second
        assert_eq!(pass_in_time(3, time(3.0), time(3.5), 3), 1);
        assert_eq!(pass_in_time(50, time(50.0), time(50.5), 16), 0);
        assert_eq!(pass_in_time(3, time(3.0), time(3.0), 3), 0);
    }
}
