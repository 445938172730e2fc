//! Terminal output while the program runs; the only place that writes to the terminal.
#![allow(clippy::print_stdout, clippy::print_stderr)]

use anyhow::Context;
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use lumiris::film::noise::Noise;
use lumiris::render::Progress;
use std::collections::BTreeSet;
use std::io::{self, Write};
use std::sync::{Mutex, PoisonError};

/// Prints a line to standard error; that nobody reads it is no reason to lose a rendering.
pub(super) fn say(text: &str) {
    let _ = writeln!(std::io::stderr().lock(), "{text}");
}

/// Prints a line to standard error, unless it has been printed before, as for another frame.
pub(super) fn say_once(text: &str) {
    static SAID: Mutex<BTreeSet<String>> = Mutex::new(BTreeSet::new());
    if SAID.lock().unwrap_or_else(PoisonError::into_inner).insert(text.to_owned()) {
        say(text);
    }
}

/// Prints a line to standard output. A closed pipe is not an error: its reader, such as `head`, has all that it wants.
pub(super) fn print(text: &str) -> anyhow::Result<()> {
    let mut out = std::io::stdout().lock();
    printed(writeln!(out, "{text}").and_then(|()| out.flush()))
}

/// What became of printing.
pub(super) fn printed(result: io::Result<()>) -> anyhow::Result<()> {
    match result {
        Err(error) if error.kind() == io::ErrorKind::BrokenPipe => Ok(()),
        result => result.context("cannot write to the standard output"),
    }
}

/// A relative standard error as text; it is unknown where no pixel has two samples.
pub(super) fn percent(noise: f64) -> String {
    if noise.is_finite() { format!("{:.2} %", noise * 100.0) } else { "unknown".to_owned() }
}

/// The noise of an image as text.
pub(super) fn noise(noise: &Noise) -> String {
    let Noise { median, above_twice } = *noise;
    let share = if above_twice > 0.0 {
        format!(" ({:.1} % of the blocks above twice that)", 100.0 * above_twice)
    } else {
        String::new()
    };
    format!("noise {}{share}", percent(median))
}

/// A progress bar of a rendering: progress, time left, rays per second, noise.
pub(super) struct Bar(ProgressBar);

impl Bar {
    /// A bar, or nothing visible if `quiet`.
    pub(super) fn new(quiet: bool) -> Self {
        let target = if quiet { ProgressDrawTarget::hidden() } else { ProgressDrawTarget::stderr_with_hz(8) };
        let bar = ProgressBar::with_draw_target(Some(0), target);
        let style = ProgressStyle::with_template("{bar:30} {percent:>3} %  {elapsed} + {eta} left  {msg}");
        bar.set_style(style.unwrap_or_else(|_| ProgressStyle::default_bar()));
        Bar(bar)
    }

    /// Shows the progress of a rendering.
    pub(super) fn update(&self, progress: &Progress) {
        self.0.set_length(progress.samples_total);
        self.0.set_position(progress.samples_done);
        let rate = progress.rays as f64 / progress.elapsed.as_secs_f64().max(1e-9) * 1e-6;
        let noise = progress.noise.filter(|n| n.is_finite()).map(|n| format!("  noise {}", percent(n)));
        self.0.set_message(format!("{rate:.2} Mrays/s{}", noise.unwrap_or_default()));
    }

    /// Removes the bar.
    pub(super) fn finish(&self) {
        self.0.finish_and_clear();
    }
}
