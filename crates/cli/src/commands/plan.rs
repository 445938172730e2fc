//! `lumiris plan`: what a rendering leaves to measurements, as a file.

use super::args::SceneArgs;
use super::progress;
use super::settings::{Setup, load_job, plan};
use anyhow::Context;
use clap::Args;
use lumiris::render::auto::{AutoChoice, Trial};
use lumiris::render::plan::Preparation;
use lumiris::render::processor_time;
use lumiris_formats::output::{check_writable, write_text};
use std::path::PathBuf;
use std::process::ExitCode;

/// `lumiris plan`
#[derive(Args, Clone, Debug)]
pub(super) struct PlanArgs {
    #[command(flatten)]
    scene: SceneArgs,
    /// The plan (JSON), for `render --plan`
    #[arg(short, long, value_name = "FILE")]
    output: PathBuf,
}

pub(super) fn run(args: &PlanArgs) -> anyhow::Result<ExitCode> {
    check_writable(&args.output)?;
    let before = processor_time::of_process();
    let (mut job, Setup { given, .. }) = load_job(&args.scene)?;
    let loading = processor_time::of_process().saturating_sub(before);
    let file = plan(&args.scene, (&mut job, &given), &Preparation { loading, ..Preparation::default() }, true)?;
    write_text(&args.output, &serde_json::to_string_pretty(&file)?)
        .with_context(|| format!("cannot write {}", args.output.display()))?;
    if let Ok(auto) = serde_json::from_value::<AutoChoice>(file.auto.clone()) {
        progress::print(&table(&auto))?;
    }
    for (key, value) in &file.settings {
        progress::print(&format!("{key} = {value}"))?;
    }
    Ok(ExitCode::SUCCESS)
}

/// The pilot's measurements.
fn table(auto: &AutoChoice) -> String {
    const KINDS: [&str; 3] = ["light sample at the first vertex", "light sample at later ones", "BSDF sample"];
    let parts = |values: &[f64], part: &dyn Fn(f64, &str) -> String| -> String {
        let of_kinds = values.iter().skip(1).zip(KINDS).filter(|(value, _)| **value > 0.0);
        of_kinds.map(|(value, kind)| format!(" + {}", part(*value, kind))).collect()
    };
    let [a, v] = [&auto.cost, &auto.variance].map(|values| values.first().copied().unwrap_or(0.0));
    let times = parts(&auto.cost, &|b, kind| format!("{b:.0} per {kind}"));
    let variances = parts(&auto.variance, &|b, kind| format!("{b:.4}/n of a {kind}"));
    let trials = || auto.lights.iter().chain(auto.trials.iter().flatten()).chain(&auto.checked).chain(&auto.sharing);
    let width = trials().map(|trial| trial.name.chars().count()).max().unwrap_or(0).max(40);
    let mut text = format!(
        "time of a camera sample, in paths with its part of loading and pilots (ns): {a:.0}{times}\nrelative variance: {v:.4}{variances}\n\n{:<width$}{:>10}{:>12}{:>12}{:>8}\n",
        format!("{} pixels of 2 × {} samples in a round", auto.pixels, auto.spp),
        "ns",
        "variance",
        "efficiency",
        "±"
    );
    for Trial { name, nanoseconds, variance, efficiency, error } in trials() {
        let error = efficiency * error;
        text += &format!("{name:<width$}{nanoseconds:>10.0}{variance:>12.4}{efficiency:>12.2}{error:>8.2}\n");
    }
    text + &format!("chosen: {}", auto.chosen)
}
