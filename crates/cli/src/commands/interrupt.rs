//! Ctrl-C, SIGTERM and SIGHUP.
//!
//! The first signal sets [`stop`], which ends a rendering in an orderly way: the image so far is written. Activities
//! that do not poll `stop` and have nothing to lose, such as reading a scene, are ended within half a second together
//! with the program, with a message that names the activity. The second signal ends the program at once, unless it comes
//! together with the first: `timeout` and job schedulers signal a process, and then its group.

use super::progress;
use anyhow::Context;
use lumiris_formats::output::remove_temporary;
use signal_hook::consts::{SIGHUP, SIGINT, SIGTERM};
use signal_hook::iterator::Signals;
use signal_hook::low_level::exit;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

/// Exit code after Ctrl-C, as in shells.
pub(super) const INTERRUPTED: u8 = 130;
/// Time for an activity that polls [`stop`] to end in an orderly way.
const GRACE: Duration = Duration::from_millis(500);

/// Signals within this time are one.
const TOGETHER: Duration = Duration::from_millis(100);

static STOP: AtomicBool = AtomicBool::new(false);
static ACTIVITY: Mutex<Activity> = Mutex::new(Activity::Abandoned(String::new()));

/// The current activity of the program.
enum Activity {
    /// Polls [`stop`] and ends by itself.
    Orderly,
    /// Can be ended at any time. The text names it in messages, such as `loading a.pbrt`; empty for no name.
    Abandoned(String),
}

/// Guard of the current activity. Dropping it restores the previous one.
pub(super) struct During(Activity);

impl Drop for During {
    fn drop(&mut self) {
        std::mem::swap(&mut *activity(), &mut self.0);
    }
}

fn activity() -> MutexGuard<'static, Activity> {
    ACTIVITY.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Begins an activity that can be ended at any time.
pub(super) fn during(what: String) -> During {
    During(std::mem::replace(&mut *activity(), Activity::Abandoned(what)))
}

/// Begins an activity that polls [`stop`] or has results to write.
pub(super) fn orderly() -> During {
    During(std::mem::replace(&mut *activity(), Activity::Orderly))
}

/// Flag that is true once the program must end.
pub(super) fn stop() -> &'static AtomicBool {
    &STOP
}

/// Starts a thread that waits for signals.
pub(super) fn watch() -> anyhow::Result<()> {
    let mut signals = Signals::new([SIGINT, SIGTERM, SIGHUP]).context("cannot watch for Ctrl-C")?;
    std::thread::spawn(move || {
        let mut first: Option<Instant> = None;
        for _ in signals.forever() {
            match first {
                None => {
                    first = Some(Instant::now());
                    STOP.store(true, Ordering::Relaxed);
                    std::thread::spawn(abandon);
                }
                Some(first) if first.elapsed() >= TOGETHER => end(&activity()),
                Some(_) => {}
            }
        }
    });
    Ok(())
}

/// Ends the program as soon as its activity can be abandoned and the grace time is over.
fn abandon() {
    let start = Instant::now();
    loop {
        std::thread::sleep(Duration::from_millis(20));
        // The lock is held to the end, so that no orderly activity can begin
        let activity = activity();
        if let Activity::Abandoned(what) = &*activity
            && start.elapsed() >= GRACE
        {
            let doing = if what.is_empty() { String::new() } else { format!(" while {what}") };
            progress::say(&format!("lumiris: stopped{doing}"));
            end(&activity);
        }
    }
}

/// Ends the program without running destructors, since other threads still use their data.
fn end(_: &MutexGuard<'_, Activity>) -> ! {
    progress::clear();
    remove_temporary();
    exit(INTERRUPTED.into())
}

/// True once a signal was received.
pub(super) fn is_stopped() -> bool {
    stop().load(Ordering::Relaxed)
}
