//! `lumiris merge`: parts of an image become the image.

use super::UsageError;
use super::exr::{CameraMatrices, ExrArgs};
use super::look::LookArgs;
use super::part_args::is_part;
use super::pictures::{Picture, Written, check_outputs, write_all};
use super::progress;
use super::stored::{AOV_NOTE, PLAN_NOTE, SCENE_NOTE, SECONDS_NOTE};
use anyhow::bail;
use clap::Args;
use lumiris::render::output::{Aov, default_aovs};
use lumiris::render::parts::FilmReader;
use lumiris::render::parts::merge::{Merged, merge, repeated};
use std::path::PathBuf;
use std::process::ExitCode;

/// `lumiris merge`
#[derive(Args, Clone, Debug)]
pub(super) struct MergeArgs {
    /// Parts that `lumiris render --part` has rendered, in any order; finished checkpoints are parts, too
    #[arg(required = true, value_name = "PART")]
    parts: Vec<PathBuf>,
    /// Output image; may be given several times, as for `render`
    #[arg(short, long, value_name = "FILE", required = true)]
    output: Vec<PathBuf>,
    /// Merge what there is if parts are missing, and say so in the metadata
    #[arg(long)]
    allow_missing: bool,
    #[command(flatten)]
    look: LookArgs,
    #[command(flatten)]
    exr: ExrArgs,
    /// Print only warnings and errors
    #[arg(short, long)]
    quiet: bool,
}

pub(super) fn run(args: &MergeArgs) -> anyhow::Result<ExitCode> {
    check_outputs(&args.output)?;
    if let Some(path) = args.output.iter().find(|path| is_part(path)) {
        return Err(UsageError(format!("{}: parts are merged to an image, such as image.exr", path.display())).into());
    }
    if let Some(path) = repeated(&args.parts) {
        return Err(UsageError(format!("{} is given twice", path.display())).into());
    }
    check_look(&args.look, &args.exr)?;
    let seconds = seconds(args)?;
    let merged = merge(&args.parts, args.allow_missing)?;
    let picture = Picture {
        film: &merged.film,
        look: &args.look,
        exr: &args.exr,
        aovs: aovs(&merged),
        sample_count_map: None,
        cryptomattes: &[],
        denoised: None,
        camera: CameraMatrices::from_notes(|name| merged.header.note(name)),
        seconds,
        metadata: metadata(&merged, seconds),
    };
    let Written { paths, misplaced } = write_all(&picture, &args.output);
    merged.missing.iter().for_each(|what| progress::say(&format!("warning: {what}: missing")));
    let summary = merged.film.summary();
    let invalid = summary.invalid;
    if invalid > 0 {
        progress::say(&format!("warning: {invalid} samples were not finite, or too bright, and were counted as black"));
    }
    if !args.quiet {
        let names: Vec<String> = paths.iter().map(|path| path.display().to_string()).collect();
        let noise = progress::percent(summary.relative_noise);
        let parts = if args.parts.len() == 1 { "1 part".to_owned() } else { format!("{} parts", args.parts.len()) };
        progress::say(&format!("{} from {parts}, noise {noise}", names.join(", ")));
    }
    if !misplaced.is_empty() {
        bail!(misplaced.join("\nlumiris: "));
    }
    Ok(ExitCode::SUCCESS)
}

/// Refuses what an image from parts cannot be.
pub(super) fn check_look(look: &LookArgs, exr: &ExrArgs) -> anyhow::Result<()> {
    look.check()?;
    exr.check()?;
    if !exr.cryptomatte.is_empty() {
        return Err(UsageError("--cryptomatte needs the scene: render the whole image with it".to_owned()).into());
    }
    Ok(())
}

/// Time that all parts took together (s).
fn seconds(args: &MergeArgs) -> anyhow::Result<f64> {
    let mut sum = 0.0;
    for path in &args.parts {
        let reader = FilmReader::open(path)?;
        sum += reader.header().note(SECONDS_NOTE).and_then(|text| text.parse::<f64>().ok()).unwrap_or(0.0);
    }
    Ok(sum)
}

/// The layers that the parts were rendered for.
fn aovs(merged: &Merged) -> Vec<Aov> {
    match merged.header.note(AOV_NOTE) {
        Some(list) => list.split(',').filter_map(|name| name.parse().ok()).filter(|aov| *aov != Aov::Ratio).collect(),
        None => default_aovs(&merged.film, false, merged.film.summary().has_records),
    }
}

/// Metadata as of an image that is rendered at once.
fn metadata(merged: &Merged, seconds: f64) -> Vec<(String, String)> {
    let settings = merged.header.settings.iter().filter(|(key, _)| key.starts_with("lumiris:")).cloned();
    let mut metadata: Vec<(String, String)> = settings.collect();
    let mut add = |key: &str, value: String| metadata.push((format!("lumiris:{key}"), value));
    add("scene", merged.header.note(SCENE_NOTE).unwrap_or_default().to_owned());
    if let Some(plan) = merged.header.note(PLAN_NOTE) {
        add("plan", plan.to_owned());
    }
    add("complete", merged.missing.is_empty().to_string());
    add("samples_done", merged.film.summary().samples_text("per pixel"));
    add("seconds", format!("{seconds:.3}"));
    if !merged.missing.is_empty() {
        add("missing", merged.missing.join("; "));
    }
    metadata
}
