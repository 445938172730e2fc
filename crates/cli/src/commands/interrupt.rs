//! Ctrl-C, SIGTERM and SIGHUP.
//!
//! The first of them sets [`stop`], which ends a rendering in an orderly way, with the image so far. Whatever does not ask for
//! it, such as reading a scene, and has nothing to lose yet, is ended within half a second, together with the program, which
//! says what it was doing. The second one ends the program at once.

use super::progress;
use anyhow::Context;
use lumiris_formats::output::remove_temporary;
use signal_hook::consts::{SIGHUP, SIGINT, SIGTERM};
use signal_hook::iterator::Signals;
use signal_hook::low_level::exit;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

/// Exit code of a program that was stopped by Ctrl-C, as in shells.
pub(super) const INTERRUPTED: u8 = 130;
/// How long what asks for [`stop`] may take to end in an orderly way.
const GRACE: Duration = Duration::from_millis(500);

static STOP: AtomicBool = AtomicBool::new(false);
static ACTIVITY: Mutex<Activity> = Mutex::new(Activity::Abandoned(String::new()));

/// What the program does.
enum Activity {
    /// It ends in an orderly way by itself.
    Orderly,
    /// It can be ended at any time. What it is, such as `loading a.pbrt`; empty if that goes without saying.
    Abandoned(String),
}

/// The present activity until this is dropped; then the former one goes on.
pub(super) struct During(Activity);

impl Drop for During {
    fn drop(&mut self) {
        std::mem::swap(&mut *activity(), &mut self.0);
    }
}

fn activity() -> MutexGuard<'static, Activity> {
    ACTIVITY.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Begins what can be ended at any time.
pub(super) fn during(what: String) -> During {
    During(std::mem::replace(&mut *activity(), Activity::Abandoned(what)))
}

/// Begins what looks at [`stop`], or has results to write.
pub(super) fn orderly() -> During {
    During(std::mem::replace(&mut *activity(), Activity::Orderly))
}

/// True once the program is to end.
pub(super) fn stop() -> &'static AtomicBool {
    &STOP
}

/// Watches for signals from here on.
pub(super) fn watch() -> anyhow::Result<()> {
    let mut signals = Signals::new([SIGINT, SIGTERM, SIGHUP]).context("cannot watch for Ctrl-C")?;
    std::thread::spawn(move || {
        for _ in signals.forever() {
            if STOP.swap(true, Ordering::Relaxed) {
                end(&activity());
            }
            std::thread::spawn(abandon);
        }
    });
    Ok(())
}

/// Ends the program as soon as it does what can be abandoned, and has had time to end by itself.
fn abandon() {
    let start = Instant::now();
    loop {
        std::thread::sleep(Duration::from_millis(20));
        // Locked until the end: nothing is begun any more that should not be abandoned
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

/// Ends the program here and now, while other threads work on what their destructors must not take from them.
fn end(_: &MutexGuard<'_, Activity>) -> ! {
    progress::clear();
    remove_temporary();
    exit(INTERRUPTED.into())
}

/// True once Ctrl-C was pressed.
pub(super) fn is_stopped() -> bool {
    stop().load(Ordering::Relaxed)
}
