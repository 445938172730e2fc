//! The report on a finished rendering.

use super::args::RenderArgs;
use super::interrupt::is_stopped;
use super::laps::Laps;
use super::progress;
use super::settings::SetupTimes;
use lumiris::film::Summary;
use lumiris::film::image_noise::Reached;
use lumiris::render::Rendering;
use lumiris::scene::RenderJob;
use lumiris::settings::Settings;
use std::path::PathBuf;
use std::time::Duration;

/// Times of an image.
pub(super) struct Times {
    /// Times before the first sample.
    pub setup: SetupTimes,
    /// Time of denoising.
    pub denoising: Duration,
    /// Total time.
    pub all: Duration,
}

impl Times {
    /// The times before the first sample; only times of at least 0.05 s are shown.
    fn before(&self) -> String {
        let SetupTimes { load, build, prepare } = self.setup;
        let parts = [(load + build, "loading"), (prepare, "pilots")];
        let parts: Vec<String> = parts
            .into_iter()
            .filter(|(seconds, _)| *seconds >= 0.05)
            .map(|(seconds, of)| format!("{seconds:.1} s of it for {of}"))
            .collect();
        if parts.is_empty() { String::new() } else { format!(" ({})", parts.join(", ")) }
    }

    /// Explains a missed time limit (s); `None` if it was met within 3 %, or 0.5 s if that is more.
    fn late(&self, limit: f64) -> Option<String> {
        let is_late = |time: Duration| time.as_secs_f64() > limit + (0.03 * limit).max(0.5);
        let SetupTimes { load, build, .. } = self.setup;
        let reason = if load + build > limit {
            format!("loading took {:.1} s", load + build)
        } else if is_late(self.all.saturating_sub(self.denoising)) {
            "the last tiles, and writing, took longer".to_owned()
        } else {
            format!("denoising took {:.1} s, after the limit", self.denoising.as_secs_f64())
        };
        is_late(self.all).then(|| format!("{:.1} s more than --time: {reason}", self.all.as_secs_f64() - limit))
    }
}

/// Reason for the end of a rendering.
#[derive(Clone, Copy, PartialEq)]
enum Ended {
    /// All samples were taken.
    Complete,
    /// Ctrl-C or a signal.
    Stopped,
    /// The time limit.
    Time,
}

/// The share of blocks that reached the noise target, and the limits that kept the others above it.
fn reached_text(target: f32, spp: u32, reached: &Reached, ended: Ended) -> String {
    // All blocks
    let percent = |share: f64| format!("{} %", (share * 1000.0).round() / 10.0);
    let target = f64::from(target) * 100.0;
    let target = format!("{} %", (target * 1000.0).round() / 1000.0);
    if reached.reached >= 1.0 {
        return format!("target {target} reached in all blocks");
    }

    // Reasons for the other blocks
    let others = match ended {
        Ended::Complete => "are above it without having hit a limit: the pilot found less noise there",
        Ended::Stopped => "were stopped",
        Ended::Time => "hit the limit of --time",
    };
    let shares = [
        (reached.limited, format!("hit the limit of --spp ({spp} samples per pixel)")),
        (reached.others, others.to_owned()),
    ];
    let above: Vec<String> = shares
        .iter()
        .filter(|(share, _)| *share > 0.0)
        .map(|(share, text)| format!("{} {text}", percent(*share)))
        .collect();
    format!("target {target} reached in {} of blocks; {}", percent(reached.reached), above.join("; "))
}

/// Reports on a rendering, unless `--quiet` is given.
pub(super) fn report(
    args: &RenderArgs,
    job: &RenderJob,
    rendering: &Rendering,
    times: &Times,
    laps: &Laps,
    outputs: &[PathBuf],
) {
    if args.quiet {
        return;
    }
    // Files, time, samples and noise
    let names: Vec<String> = outputs.iter().map(|p| p.display().to_string()).collect();
    let names = if names.is_empty() { "rendered".to_owned() } else { names.join(", ") };
    let summary = rendering.film.summary();
    let is_of_tiles = args.parts.part.is_some() && args.parts.is_by_tiles();
    let of = if is_of_tiles { Summary::samples_text_of_sampled } else { Summary::samples_text };
    let samples = of(summary, if summary.samples[1] == 1 { "sample per pixel" } else { "samples per pixel" });
    let partial = if rendering.complete { "" } else { " (stopped early)" };
    progress::say(&format!(
        "{names} after {:.1} s{}, {samples}{partial}, {}",
        times.all.as_secs_f64(),
        times.before(),
        progress::noise(&summary.noise)
    ));
    progress::say(&laps.text());

    // Noise target and time limit
    let Settings { sampling, .. } = job.settings();
    let reached = sampling.noise.and_then(|target| {
        let reached = Reached::of(&summary.blocks, target.into(), sampling.spp)?;
        let ended = if rendering.complete {
            Ended::Complete
        } else if is_stopped() {
            Ended::Stopped
        } else {
            Ended::Time
        };
        Some(reached_text(target, sampling.spp, &reached, ended))
    });
    let late = args.time.and_then(|limit| times.late(limit));
    let [all, sampled] = summary.pixels.map(|n| n as f64);
    let holes =
        format!("warning: --time was too short for a sample of {:.1} % of the pixels", 100.0 * (1.0 - sampled / all));
    let holes = Some(holes).filter(|_| args.time.is_some() && sampled < all && !is_stopped());
    reached.into_iter().chain(late).chain(holes).for_each(|text| progress::say(&text));

    // Caches
    if let Some(c) = &rendering.cache {
        progress::say(&format!(
            "irradiance cache: {} records in {:.1} s, {:.2} % cache misses in {} lookups",
            c.records,
            c.build.elapsed.as_secs_f64(),
            100.0 * c.lookups.misses as f64 / c.lookups.lookups.max(1) as f64,
            c.lookups.lookups
        ));
    }
    if let Some(p) = &rendering.photons {
        progress::say(&format!(
            "photon maps: {} global and {} caustic photons from {} photon paths in {:.1} s, {:.1} MB{}",
            p.global,
            p.caustic,
            p.paths,
            (p.tracing + p.sorting).as_secs_f64(),
            p.bytes as f64 * 1e-6,
            if p.maps > 1 { format!(", {} maps", p.maps) } else { String::new() }
        ));
    }

    // Invalid samples
    let invalid = summary.invalid;
    if invalid > 0 {
        progress::say(&format!("warning: {invalid} samples were not finite, or too bright, and were counted as black"));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn blocks_above_the_target_are_said_to_have_hit_a_limit_or_none() {
        let text =
            |reached, limited, others, ended| reached_text(0.02, 4096, &Reached { reached, limited, others }, ended);
        assert_eq!(text(1.0, 0.0, 0.0, Ended::Complete), "target 2 % reached in all blocks");
        let of_spp = "target 2 % reached in 96 % of blocks; 4 % hit the limit of --spp (4096 samples per pixel)";
        assert_eq!(text(0.96, 0.04, 0.0, Ended::Complete), of_spp);
        let of_time = "target 2 % reached in 12.5 % of blocks; 87.5 % hit the limit of --time";
        assert_eq!(text(0.125, 0.0, 0.875, Ended::Time), of_time);
        let of_none = "target 2 % reached in 99 % of blocks; 1 % are above it without having hit a limit: the pilot found less \
                       noise there";
        assert_eq!(text(0.99, 0.0, 0.01, Ended::Complete), of_none);
    }

    #[test]
    fn a_limit_that_did_not_hold_is_explained() {
        let setup = SetupTimes { load: 0.0, build: 0.0, prepare: 0.0 };
        let late = |load: f64, rendered: f64, denoising: f64| {
            let [rendered, denoising] = [rendered, denoising].map(Duration::from_secs_f64);
            let setup = SetupTimes { load, ..setup };
            Times { setup, denoising, all: rendered + denoising }.late(10.0)
        };
        assert_eq!(late(1.0, 10.2, 0.2), None);
        assert_eq!(late(1.0, 10.0, 3.1).unwrap(), "3.1 s more than --time: denoising took 3.1 s, after the limit");
        assert_eq!(late(11.0, 11.5, 0.0).unwrap(), "1.5 s more than --time: loading took 11.0 s");
        assert!(late(1.0, 13.0, 0.0).unwrap().contains("last tiles"));
    }
}
