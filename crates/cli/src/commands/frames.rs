//! `lumiris render --frames`: the frames of an animation, one after the other.
//!
//! Files shared by several frames are read once (see [`FileCache`]). A frame that fails does not stop the others; a
//! table at the end lists the results.

use super::UsageError;
use super::args::RenderArgs;
use super::frame_list::{FrameList, has_number, numbered};
use super::interrupt::is_stopped;
use super::interrupt::{self, INTERRUPTED};
use super::pictures::are_complete;
use super::progress;
use super::render::{Rendered, Session, check, is_stop, render_one, write_stats};
use lumiris::import::cache::{FileCache, FileCounts};
use lumiris::import::is_gltf;
use serde_json::json;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::time::Instant;

/// Result of a frame.
enum Outcome {
    /// Rendered and written.
    Done(Rendered),
    /// Skipped, because its images exist.
    Skipped,
    /// Failed to load, render or write.
    Failed(String, Option<Rendered>),
    /// Not started before Ctrl-C.
    NotRendered,
}

struct Frame {
    number: u32,
    outcome: Outcome,
    files: FileCounts,
}

pub(super) fn run(args: &RenderArgs, list: &FrameList) -> anyhow::Result<ExitCode> {
    check_names(args)?;
    check(args)?;
    let _orderly = interrupt::orderly();
    let session = Session::start(args, FileCache::keeping())?;
    let mut frames = Vec::with_capacity(list.0.len());
    for (index, &number) in list.0.iter().enumerate() {
        let outcome = if is_stopped() {
            Outcome::NotRendered
        } else {
            if !args.quiet {
                progress::say(&format!("frame {number} ({} of {})", index + 1, list.0.len()));
            }
            render_frame(&of_frame(args, number), &session)
        };
        let files = session.files.end_scene();
        frames.push(Frame { number, outcome, files });
    }

    // Print the table; with `--quiet` only the failures
    let failed = frames.iter().filter(|f| matches!(f.outcome, Outcome::Failed(..))).count();
    let shown = frames.iter().filter(|f| !args.quiet || matches!(f.outcome, Outcome::Failed(..)));
    let rows: Vec<String> = shown.map(row).collect();
    if !rows.is_empty() {
        progress::say(&format!("{HEADER}\n{}", rows.join("\n")));
    }
    if let Some(path) = &args.stats {
        write_stats(path, &stats(&frames))?;
    }
    if failed > 0 {
        progress::say(&format!("lumiris: {failed} of {} frames failed", frames.len()));
        return Ok(ExitCode::from(3));
    }
    Ok(if is_stopped() { ExitCode::from(INTERRUPTED) } else { ExitCode::SUCCESS })
}

/// Requires #### in the names of scene, images and checkpoints. Otherwise all frames would be the same or overwrite
/// each other.
fn check_names(args: &RenderArgs) -> Result<(), UsageError> {
    let scene = Some(&args.scene.scene).filter(|scene| !is_animated(args, scene));
    let checkpoint = args.parts.checkpoint.as_ref().map(|checkpoint| &checkpoint.path);
    check_numbers(args.output.iter().chain(scene).chain(checkpoint).chain(&args.parts.resume))
}

/// The options of the first frame, after checking the names for all frames.
pub(super) fn first_of(args: &RenderArgs, list: &FrameList) -> Result<RenderArgs, UsageError> {
    check_names(args)?;
    Ok(of_frame(args, list.0.first().copied().unwrap_or(0)))
}

/// Refuses names without a placeholder for the frame number.
pub(super) fn check_numbers<'a>(mut names: impl Iterator<Item = &'a PathBuf>) -> Result<(), UsageError> {
    match names.find(|path| !has_number(path)) {
        Some(path) => Err(UsageError(format!("--frames: {} has no #### for the number of the frame", path.display()))),
        None => Ok(()),
    }
}

/// True if the frames are times of one glTF scene instead of separate scene files.
fn is_animated(args: &RenderArgs, scene: &Path) -> bool {
    is_gltf(scene) && !has_number(scene) && args.scene.time_in_scene.is_none()
}

/// The options of one frame.
fn of_frame(args: &RenderArgs, frame: u32) -> RenderArgs {
    let mut args = args.clone();
    if is_animated(&args, &args.scene.scene) {
        args.scene.time_in_scene = Some(frame as f32 / args.fps);
    }
    let checkpoint = args.parts.checkpoint.as_mut().map(|checkpoint| &mut checkpoint.path);
    let names = [&mut args.scene.scene].into_iter().chain(&mut args.output);
    names.chain(checkpoint).chain(&mut args.parts.resume).for_each(|path| *path = numbered(path, frame));
    args.scene.seed_by_frame = Some(frame).filter(|_| args.seed_per_frame);
    (args.frames, args.stats) = (None, None);
    args
}

fn render_frame(args: &RenderArgs, session: &Session) -> Outcome {
    if args.skip_existing && are_complete(&args.output) {
        return Outcome::Skipped;
    }
    match render_one(args, session, Instant::now()) {
        Ok(rendered) if rendered.misplaced.is_empty() => Outcome::Done(rendered),
        Ok(rendered) => Outcome::Failed(rendered.misplaced.join("; "), Some(rendered)),
        Err(error) if is_stop(&error) => Outcome::NotRendered,
        Err(error) => {
            let reason = format!("{error:#}");
            progress::say(&format!("lumiris: {reason}"));
            Outcome::Failed(reason, None)
        }
    }
}

const HEADER: &str = "   frame   seconds   noise  files read, shared";

fn row(frame: &Frame) -> String {
    let Frame { number, outcome, files } = frame;
    let rendered = |rendered: &Rendered, note: &str| {
        let files = format!("{}, {}", files.read, files.shared);
        let noise = progress::percent(rendered.noise);
        format!("{number:>8}{:>10.1}{noise:>9}  {files:<18}{note}", rendered.seconds)
    };
    let other = |text: &str| format!("{number:>8}  {text}");
    match outcome {
        Outcome::Done(made) => rendered(made, if made.complete { "" } else { "  stopped early" }).trim_end().to_owned(),
        Outcome::Skipped => other("is there already"),
        Outcome::Failed(reason, Some(made)) => rendered(made, &format!("  failed: {}", one_line(reason))),
        Outcome::Failed(reason, None) => other(&format!("failed: {}", one_line(reason))),
        Outcome::NotRendered => other("not rendered: stopped by Ctrl-C"),
    }
}

fn one_line(text: &str) -> String {
    text.split_whitespace().collect::<Vec<_>>().join(" ")
}

/// Statistics of all frames for `--stats`.
fn stats(frames: &[Frame]) -> serde_json::Value {
    let of_frame = |frame: &Frame| {
        let (result, reason, rendered) = match &frame.outcome {
            Outcome::Done(rendered) => ("done", None, Some(rendered)),
            Outcome::Skipped => ("skipped", None, None),
            Outcome::Failed(reason, rendered) => ("failed", Some(reason), rendered.as_ref()),
            Outcome::NotRendered => ("not rendered", None, None),
        };
        json!({
            "frame": frame.number, "result": result, "reason": reason,
            "files": { "read": frame.files.read, "shared": frame.files.shared },
            "stats": rendered.map(|r| &r.stats),
        })
    };
    json!({ "frames": frames.iter().map(of_frame).collect::<Vec<_>>() })
}
