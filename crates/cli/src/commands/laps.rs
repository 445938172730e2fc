//! CPU time of the process, divided into consecutive phases without gaps.

use lumiris::planning::processor_time;
use lumiris::render::phases::Phase;
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::Duration;

/// Phases of an image.
#[derive(Clone, Debug, Default)]
pub(super) struct Laps {
    phases: Vec<Phase>,
    /// CPU time of the process at the end of the last phase.
    until: Duration,
}

/// Phases of the current image. The first phase begins with the process.
static LAPS: Mutex<Laps> = Mutex::new(Laps { phases: Vec::new(), until: Duration::ZERO });

fn laps() -> MutexGuard<'static, Laps> {
    LAPS.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Ends the phase that began at the end of the last one. `parts` are phases within it; their time is subtracted from
/// its own.
pub(super) fn end(name: &'static str, parts: &[Phase]) {
    let (mut laps, now) = (laps(), processor_time::of_process());
    let of_parts: Duration = parts.iter().map(|part| part.time).sum();
    let time = now.saturating_sub(laps.until).saturating_sub(of_parts);
    laps.phases.extend_from_slice(parts);
    laps.phases.push(Phase { name, time });
    laps.until = now;
}

/// Returns the phases of the finished image and clears them.
pub(super) fn take() -> Laps {
    let mut laps = laps();
    Laps { phases: std::mem::take(&mut laps.phases), until: laps.until }
}

impl Laps {
    /// Seconds by phase name; `all` is the CPU time of the process since its start.
    pub(super) fn json(&self) -> serde_json::Value {
        let entry = |phase: &Phase| (phase.name.to_owned(), phase.time.as_secs_f64().into());
        let all = ("all".to_owned(), self.until.as_secs_f64().into());
        serde_json::Value::Object(self.phases.iter().map(entry).chain([all]).collect())
    }

    /// The phases of at least 1 %, largest first: `CPU time 5.5 s: 29 % t1 propose, 20 % shade`.
    pub(super) fn text(&self) -> String {
        let sum: Duration = self.phases.iter().map(|phase| phase.time).sum();
        let share = |phase: &Phase| 100.0 * phase.time.as_secs_f64() / sum.as_secs_f64().max(1e-9);
        let mut phases: Vec<&Phase> = self.phases.iter().filter(|phase| share(phase) >= 1.0).collect();
        phases.sort_by_key(|phase| std::cmp::Reverse(phase.time));
        let shares = phases.iter().map(|phase| format!("{:.0} % {}", share(phase), phase.name.replace('_', " ")));
        format!("CPU time {:.1} s: {}", sum.as_secs_f64(), shares.collect::<Vec<_>>().join(", "))
    }
}
