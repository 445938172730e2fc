//! Terminal output. No other module writes to the terminal.
#![allow(clippy::print_stdout, clippy::print_stderr)]

use anyhow::Context;
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use lumiris::film::image_noise::Noise;
use lumiris::render::Progress;
use std::collections::BTreeSet;
use std::io::{self, Write};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

/// Prints a line to standard error. Errors are ignored: a closed terminal is no reason to lose a rendering.
pub(super) fn say(text: &str) {
    let print = || drop(writeln!(std::io::stderr().lock(), "{text}"));
    match &*line() {
        Some(line) => line.bar.suspend(print),
        None => print(),
    }
}

/// Prints a line to standard error, unless it has been printed before, for example for another frame.
pub(super) fn say_once(text: &str) {
    static SAID: Mutex<BTreeSet<String>> = Mutex::new(BTreeSet::new());
    if SAID.lock().unwrap_or_else(PoisonError::into_inner).insert(text.to_owned()) {
        say(text);
    }
}

/// Prints a line to standard output. A closed pipe is not an error: its reader, such as `head`, has read enough.
pub(super) fn print(text: &str) -> anyhow::Result<()> {
    let mut out = std::io::stdout().lock();
    printed(writeln!(out, "{text}").and_then(|()| out.flush()))
}

/// The result of printing, in which a closed pipe is no error.
pub(super) fn printed(result: io::Result<()>) -> anyhow::Result<()> {
    match result {
        Err(error) if error.kind() == io::ErrorKind::BrokenPipe => Ok(()),
        result => result.context("cannot write to the standard output"),
    }
}

/// A relative standard error as text; "unknown" if no pixel has two samples.
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

/// The current progress line. There is at most one.
static LINE: Mutex<Option<Line>> = Mutex::new(None);

fn line() -> MutexGuard<'static, Option<Line>> {
    LINE.lock().unwrap_or_else(PoisonError::into_inner)
}

/// A progress line: the stage, its completed share and the remaining time.
struct Line {
    bar: ProgressBar,
    /// Name and start of the stage.
    stage: (String, Instant),
    clock: Clock,
}

/// Start and time limit of the work.
#[derive(Clone, Copy)]
pub(super) struct Clock {
    /// Start.
    pub start: Instant,
    /// Time limit, if any.
    pub limit: Option<Duration>,
}

impl Clock {
    /// Time until the limit.
    pub(super) fn left(&self) -> Option<Duration> {
        Some(self.limit?.saturating_sub(self.start.elapsed()))
    }
}

impl Line {
    /// Begins a stage, unless it is the current one.
    fn begin(&mut self, name: &str) {
        if self.stage.0 != name {
            self.stage = (name.to_owned(), Instant::now());
            self.bar.reset_elapsed();
            self.bar.set_message(String::new());
            self.set_style("{spinner} {prefix}  {elapsed}");
            self.bar.set_prefix(name.to_owned());
            self.bar.tick();
        }
    }

    fn set_style(&self, template: &str) {
        self.bar.set_style(ProgressStyle::with_template(template).unwrap_or_else(|_| ProgressStyle::default_bar()));
    }

    /// Shows the completed share of the stage.
    fn show(&mut self, done: f64, text: &str) {
        let elapsed = self.stage.1.elapsed();
        if self.bar.message().is_empty() {
            self.set_style("{bar:30} {percent:>3} %  {prefix}{msg}");
            self.bar.set_length(BAR_LENGTH);
        }
        let left = left(elapsed, done).into_iter().chain(self.clock.left()).min();
        let left = left.map_or(String::new(), |left| format!("  {} left", span(left)));
        self.bar.set_position((done * BAR_LENGTH as f64) as u64);
        self.bar.set_message(format!("  {}{left}{text}", span(elapsed)));
    }
}

/// Number of positions of a bar.
const BAR_LENGTH: u64 = 1000;
/// Update interval of the spinner, for stages without a completed share.
const TICK: Duration = Duration::from_millis(125);
/// The remaining time is estimated from this completed share on, or from this elapsed time on.
const KNOWN: (f64, Duration) = (0.02, Duration::from_secs(2));

/// Remaining time at the mean speed so far; `None` if it is too early for an estimate.
fn left(elapsed: Duration, done: f64) -> Option<Duration> {
    let is_known = done > 0.0 && (done >= KNOWN.0 || elapsed >= KNOWN.1);
    let rest = || Duration::try_from_secs_f64(elapsed.as_secs_f64() * (1.0 / done - 1.0).max(0.0)).ok();
    is_known.then(rest).flatten()
}

/// A time as text: "12 s", "3 min" or "2 h 10 min".
fn span(time: Duration) -> String {
    let seconds = time.as_secs_f64().round() as u64;
    let minutes = (seconds + 30) / 60;
    match (seconds, minutes) {
        (..100, _) => format!("{seconds} s"),
        (_, ..100) => format!("{minutes} min"),
        _ => format!("{} h {} min", minutes / 60, minutes % 60),
    }
}

/// Begins a stage or shows its completed share. Does nothing unless there is a [`Bar`].
pub(super) fn stage(name: &str, done: Option<f64>) {
    if let Some(line) = &mut *line() {
        line.begin(name);
        if let Some(done) = done {
            line.show(done, "");
        }
    }
}

/// Removes the line, for example before the program ends.
pub(super) fn clear() {
    if let Some(line) = &*line() {
        line.bar.finish_and_clear();
    }
}

/// Guard of the progress line.
pub(super) struct Bar(());

impl Bar {
    /// Shows the line, unless `quiet` is true or standard error is no terminal.
    pub(super) fn new(quiet: bool, clock: Clock) -> Self {
        let target = if quiet { ProgressDrawTarget::hidden() } else { ProgressDrawTarget::stderr_with_hz(8) };
        let bar = ProgressBar::with_draw_target(None, target);
        bar.enable_steady_tick(TICK);
        *line() = Some(Line { bar, stage: (String::new(), clock.start), clock });
        Bar(())
    }

    /// True if the line is drawn.
    pub(super) fn is_visible(&self) -> bool {
        line().as_ref().is_some_and(|line| !line.bar.is_hidden())
    }

    /// Shows the progress of a rendering: the completed share of its samples or of its time, whichever is larger.
    pub(super) fn update(&self, progress: &Progress) {
        let Some(line) = &mut *line() else { return };
        line.begin("rendering");
        let of_samples = progress.samples_done as f64 / progress.samples_total.max(1) as f64;
        let of_time = line.clock.limit.map(|limit| line.clock.start.elapsed().as_secs_f64() / limit.as_secs_f64());
        let done = of_samples.max(of_time.unwrap_or(0.0)).min(1.0);
        let rate = progress.rays as f64 / progress.elapsed.as_secs_f64().max(1e-9) * 1e-6;
        let noise = progress.noise.filter(|n| n.is_finite()).map(|n| format!("  noise {}", percent(n)));
        line.show(done, &format!("  {rate:.2} Mrays/s{}", noise.unwrap_or_default()));
    }
}

impl Drop for Bar {
    fn drop(&mut self) {
        clear();
        *line() = None;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_are_words_that_are_read_at_once() {
        let texts =
            [0.4, 12.3, 99.4, 100.0, 200.0, 5970.0, 7800.0, 200_000.0].map(|s| span(Duration::from_secs_f64(s)));
        let expected = ["0 s", "12 s", "99 s", "2 min", "3 min", "1 h 40 min", "2 h 10 min", "55 h 33 min"];
        assert_eq!(texts, expected);
    }

    #[test]
    fn the_time_that_is_left_follows_from_the_work_that_is_done() {
        let seconds = Duration::from_secs_f64;
        assert_eq!(left(seconds(0.5), 0.019), None, "too little is done to tell");
        assert_eq!(left(seconds(5.0), 0.0), None);
        assert_eq!(left(seconds(0.5), 0.02), Some(seconds(24.5)));
        assert_eq!(left(seconds(2.0), 0.001), Some(seconds(1998.0)));
        assert_eq!(left(seconds(9.0), 1.0), Some(seconds(0.0)));
    }
}
