//! `lumiris merge`: merges the parts of an image.

use super::UsageError;
use super::denoise_args::{self, DenoiseArgs, Denoised};
use super::exr::ExrArgs;
use super::frame_list::{FrameList, numbered, parse_frames};
use super::frames::check_numbers;
use super::look::LookArgs;
use super::output_options::OutputOptions;
use super::part_args::is_part;
use super::pictures::{Picture, Written, check_outputs, write_all};
use super::progress;
use anyhow::bail;
use clap::Args;
use lumiris::imaging::oidn::Denoiser;
use lumiris::render::parts::CameraMatrices;
use lumiris::render::parts::merge::{Merged, merge, repeated};
use std::path::PathBuf;
use std::process::ExitCode;

/// `lumiris merge`
#[derive(Args, Clone, Debug)]
pub(super) struct MergeArgs {
    // First, because later fields take their values from the command line
    #[command(flatten)]
    output_options: OutputOptions,
    /// Parts rendered by `lumiris render --part`, in any order; finished checkpoints are parts, too
    #[arg(required = true, value_name = "PART")]
    parts: Vec<PathBuf>,
    /// Output image; may be given several times, as for `render`
    #[arg(short, long, value_name = "FILE", required = true)]
    output: Vec<PathBuf>,
    /// Frames of an animation, such as 1-48: `####` in PARTs and FILEs becomes the frame number
    #[arg(long, value_name = "LIST", value_parser = parse_frames)]
    frames: Option<FrameList>,
    /// Merge although parts are missing, and note it in the metadata; all listed files must exist
    #[arg(long)]
    allow_missing: bool,
    #[command(flatten)]
    look: LookArgs,
    #[command(flatten)]
    exr: ExrArgs,
    #[command(flatten)]
    denoise: DenoiseArgs,
    /// Print only warnings and errors
    #[arg(short, long)]
    quiet: bool,
}

pub(super) fn run(args: &MergeArgs) -> anyhow::Result<ExitCode> {
    check_look(&args.look, &args.exr)?;
    args.denoise.check(&args.output)?;
    let denoiser = args.denoise.open(None)?;
    let Some(frames) = &args.frames else {
        merge_one(args, denoiser.as_ref())?;
        return Ok(ExitCode::SUCCESS);
    };

    // A frame that fails does not stop the others
    check_numbers(args.output.iter().chain(&args.parts))?;
    let mut failed = 0;
    for &frame in &frames.0 {
        let mut of_frame = args.clone();
        of_frame.parts.iter_mut().chain(&mut of_frame.output).for_each(|path| *path = numbered(path, frame));
        if let Err(error) = merge_one(&of_frame, denoiser.as_ref()) {
            progress::say(&format!("lumiris: frame {frame}: {error:#}"));
            failed += 1;
        }
    }
    if failed > 0 {
        bail!("{failed} of {} frames failed", frames.0.len());
    }
    Ok(ExitCode::SUCCESS)
}

/// Merges the parts of one image.
fn merge_one(args: &MergeArgs, denoiser: Option<&Denoiser>) -> anyhow::Result<()> {
    // Check the arguments
    check_outputs(&args.output)?;
    if let Some(path) = args.output.iter().find(|path| is_part(path)) {
        return Err(UsageError(format!("{}: parts are merged to an image, such as image.exr", path.display())).into());
    }
    if let Some(path) = repeated(&args.parts) {
        return Err(UsageError(format!("{} is given twice", path.display())).into());
    }
    args.output_options.check(&args.output);
    let absent: Vec<_> = args.parts.iter().filter(|path| matches!(path.try_exists(), Ok(false))).collect();
    if let [first, _, ..] = absent[..] {
        bail!("{} of {} parts do not exist, the first is {}", absent.len(), args.parts.len(), first.display());
    }

    // Merge and denoise
    let merged = merge(&args.parts, args.allow_missing)?;
    let denoised = denoiser.map(|denoiser| denoise(denoiser, &merged)).transpose();
    let (denoised, not_denoised) = (denoised.as_ref().ok().and_then(Option::as_ref), denoised.as_ref().err());
    let picture = Picture {
        film: &merged.film,
        look: &args.look,
        exr: &args.exr,
        aovs: merged.aovs(),
        sample_count_map: None,
        cryptomattes: &[],
        denoised,
        camera: CameraMatrices::from_notes(|name| merged.header.note(name)),
        seconds: merged.seconds,
        metadata: merged.metadata(),
    };

    // Write the image
    let Written { paths, mut misplaced } = write_all(&picture, &args.output);
    misplaced.extend(not_denoised.cloned());
    report(args, &merged, &paths);
    if !misplaced.is_empty() {
        bail!(misplaced.join("\nlumiris: "));
    }
    Ok(())
}

/// The denoised image, or an error message: a failure does not lose the merged image.
fn denoise(denoiser: &Denoiser, merged: &Merged) -> Result<Denoised, String> {
    if !merged.has_features() {
        progress::say("warning: the parts have neither albedo nor normal: denoised by colour, which loses detail");
    }
    denoise_args::denoise(denoiser, &merged.film, merged.has_features())
}

/// Reports missing parts, invalid samples and the noise.
fn report(args: &MergeArgs, merged: &Merged, paths: &[PathBuf]) {
    merged.missing.iter().for_each(|what| progress::say(&format!("warning: {what}: missing")));
    let summary = merged.film.summary();
    let invalid = summary.invalid;
    if invalid > 0 {
        progress::say(&format!("warning: {invalid} samples were not finite, or too bright, and were counted as black"));
    }
    if !args.quiet {
        let names: Vec<String> = paths.iter().map(|path| path.display().to_string()).collect();
        let noise = progress::noise(&summary.noise);
        let parts = if args.parts.len() == 1 { "1 part".to_owned() } else { format!("{} parts", args.parts.len()) };
        progress::say(&format!("{} from {parts}, {noise}", names.join(", ")));
    }
}

/// Refuses options that a merged image does not support.
pub(super) fn check_look(look: &LookArgs, exr: &ExrArgs) -> anyhow::Result<()> {
    look.check()?;
    exr.check()?;
    if !exr.cryptomatte.is_empty() {
        return Err(UsageError("--cryptomatte needs the scene: render the whole image with it".to_owned()).into());
    }
    Ok(())
}
