//! `lumiris plan`: stores the choices that settings leave to measurements.

use super::args::SceneArgs;
use super::interrupt;
use super::progress;
use super::settings::{Setup, load_job, plan};
use super::trials::{expect_trials, table};
use anyhow::Context;
use clap::Args;
use lumiris::planning::Preparation;
use lumiris::planning::tune::Tuning;
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
    let Setup { mut job, given, .. } = load_job(&args.scene)?;
    let expect = |time| expect_trials(time, false);
    let how = Preparation { tunes: true, expect: &expect, stop: interrupt::stop(), ..Preparation::default() };
    let file = plan(&args.scene, &mut job, &given, &how, true)?;
    write_text(&args.output, &serde_json::to_string_pretty(&file)?)
        .with_context(|| format!("cannot write {}", args.output.display()))?;
    if let Ok(Some(tuning)) = serde_json::from_value::<Option<Tuning>>(file.tuning.clone()) {
        progress::print(&table(&tuning))?;
    }
    progress::print(&job.settings().summary())?;
    Ok(ExitCode::SUCCESS)
}
