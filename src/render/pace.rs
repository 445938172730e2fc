//! Lengths of passes within a time limit.
//!
//! When the time is over, tiles that have not started lack the samples of the last pass. To keep their number small,
//! passes become shorter towards the end: each takes half of the remaining time at the speed so far.

use std::time::Duration;

/// Fraction of the time limit that may remain unused if no whole pass fits into it.
const LEFT_OVER: f64 = 0.03;

/// Minimum extra time for tiles without a sample: an image with holes is of little use.
const GRACE: Duration = Duration::from_millis(500);

/// Time after which even tiles without a sample do not start.
pub(super) fn of_first_samples(limit: Duration) -> Duration {
    limit.saturating_add(GRACE.max(limit.mul_f64(LEFT_OVER)))
}

/// Samples per pixel of the next pass, at most `longest`, after `done` samples in the time `elapsed`; 0 if no pass
/// starts.
pub(super) fn pass_in_time(done: u32, elapsed: Duration, limit: Duration, longest: u32) -> u32 {
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
