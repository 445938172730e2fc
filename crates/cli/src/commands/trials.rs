//! Messages about trials of settings.

use super::progress;
use lumiris::planning::tune::{Trial, Tuning};
use std::time::Duration;

/// Announces the expected time of the trials.
pub(super) fn expect_trials(processor_time: Duration, is_quiet: bool) {
    if !is_quiet {
        let threads = std::thread::available_parallelism().map_or(1, usize::from) as f64;
        progress::say(&format!("trying settings: about {:.0} s", (processor_time.as_secs_f64() / threads).max(1.0)));
    }
}

/// Result of the trials in one line.
pub(super) fn outcome(tuning: &Tuning) -> String {
    let Tuning { gain, error, is_taken, seconds, .. } = tuning;
    let kept = if *is_taken { "taken" } else { "less than a tenth: the rule's settings are kept" };
    format!(
        "trials found {gain:.2} ± {:.2} times the efficiency of the rule, {kept} ({seconds:.0} CPU s)",
        gain * error
    )
}

/// Table of all trials.
pub(super) fn table(tuning: &Tuning) -> String {
    let width = tuning.trials.iter().map(|trial| trial.name.chars().count()).max().unwrap_or(0);
    let mut text = format!("{:<width$}{:>10}{:>12}{:>8}\n", "settings", "ns", "efficiency", "±");
    for Trial { name, nanoseconds, efficiency, error } in &tuning.trials {
        text += &format!("{name:<width$}{nanoseconds:>10.0}{efficiency:>12.2}{:>8.2}\n", efficiency * error);
    }
    text + &outcome(tuning)
}
