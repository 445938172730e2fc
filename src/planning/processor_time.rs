//! CPU time, which excludes the time of other programs.

use rustix::time::{ClockId, clock_gettime};
use std::time::Duration;

fn time(clock: ClockId) -> Duration {
    let t = clock_gettime(clock);
    Duration::new(u64::try_from(t.tv_sec).unwrap_or(0), u32::try_from(t.tv_nsec).unwrap_or(0))
}

/// CPU time of this process so far, including finished threads.
pub fn of_process() -> Duration {
    time(ClockId::ProcessCPUTime)
}

/// CPU time of this thread so far.
pub fn of_thread() -> Duration {
    time(ClockId::ThreadCPUTime)
}
