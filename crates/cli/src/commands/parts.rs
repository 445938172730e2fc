//! Parts and checkpoints: conversion of command-line options to the renderer's.

use super::UsageError;
use super::args::RenderArgs;
use super::part_args::{PartArgs, is_part};
use super::progress;
use lumiris::import::fingerprint::SceneFiles;
use lumiris::render::RenderSettings;
use lumiris::render::parts::{Asked, Checkpoints, Extent, ExtentError, Stored};
use lumiris::render::{FilmFile, Storage};
use lumiris::scene::RenderJob;
use lumiris::settings::Settings;
use lumiris_formats::output::check_destination;
use std::time::Duration;

impl From<ExtentError> for UsageError {
    fn from(error: ExtentError) -> Self {
        UsageError(error.to_string())
    }
}

/// The requested part of the image.
fn extent(parts: &PartArgs) -> Extent {
    Extent {
        part: parts.part,
        is_by_tiles: parts.is_by_tiles(),
        samples_from: parts.samples_from,
        samples_to: parts.samples_to,
    }
}

/// Rejects options that contradict each other.
pub(super) fn check(args: &RenderArgs) -> anyhow::Result<()> {
    let usage = |text: &str| Err(UsageError(text.to_owned()).into());
    let parts = &args.parts;
    extent(parts).check(args.time.is_some()).map_err(UsageError::from)?;
    if parts.part.is_some() && !args.output.iter().any(|path| is_part(path)) {
        return usage("--part needs an output for `lumiris merge`, such as -o image.1.part");
    }
    if parts.is_partial() && !args.exr.cryptomatte.is_empty() {
        return usage("--cryptomatte needs the whole image, not a part");
    }
    // The names of frames are not expanded yet
    let checkpoint = parts.checkpoint.as_ref().filter(|_| args.frames.is_none());
    checkpoint.map_or(Ok(()), |checkpoint| check_destination(&checkpoint.path).map(drop))?;
    Ok(())
}

/// Rejects settings with which an image cannot be divided.
pub(super) fn check_division(args: &RenderArgs, settings: &Settings) -> Result<(), UsageError> {
    Ok(extent(&args.parts).check_division(settings)?)
}

/// Rejects settings with which the requested part cannot be rendered.
pub(super) fn check_settings(args: &RenderArgs, settings: &Settings) -> Result<(), UsageError> {
    Ok(extent(&args.parts).check_settings(settings)?)
}

/// The stored state to resume from, if any.
pub(super) fn stored(args: &PartArgs) -> anyhow::Result<Option<Stored>> {
    let checkpoint = args.checkpoint.as_ref().map(|checkpoint| checkpoint.path.as_path());
    let stored = args.resume.as_ref().map(|path| Stored::read(path, checkpoint)).transpose()?;
    Ok(stored.flatten())
}

/// Fills in missing options from the stored state.
pub(super) fn complete(args: &mut RenderArgs, stored: &Stored) -> anyhow::Result<()> {
    let mut asked = asked(args);
    asked.complete(stored)?;
    let scene = &mut args.scene;
    (scene.box_filter, scene.accel) = (asked.box_filter, asked.accel);
    (scene.resolution, scene.crop, scene.time_in_scene) = (asked.load.resolution, asked.load.crop, asked.load.time);
    (scene.environment, scene.scene_in_file) = (asked.load.environment, asked.load.scene);
    (scene.camera, scene.camera_auto) = (asked.load.camera, asked.load.camera_auto);
    scene.light_units = asked.load.light_units;
    let list = |aovs: Vec<_>| if aovs.is_empty() { vec![None] } else { aovs.into_iter().map(Some).collect() };
    args.aov = asked.aovs.map(list);
    Ok(())
}

/// The requested options, except settings.
fn asked(args: &RenderArgs) -> Asked {
    let scene = &args.scene;
    Asked {
        scene: scene.scene.display().to_string(),
        load: scene.load_options(),
        box_filter: scene.box_filter,
        accel: scene.accel,
        aovs: args.aov.as_ref().map(|list| list.iter().copied().flatten().collect()),
    }
}

/// Sets the sample and pixel range of the rendering. Returns `None` if nothing will be stored. Fails if the rendering
/// cannot be resumed from the stored state.
pub(super) fn film_file(
    args: &RenderArgs,
    job: &RenderJob,
    files: &SceneFiles,
    settings: &mut RenderSettings,
    stored: Option<Stored>,
) -> anyhow::Result<Option<FilmFile>> {
    let spp = settings.spp;
    let more = args.scene.settings.count("spp");
    extent(&args.parts).apply(settings, stored.as_ref(), more).map_err(UsageError::from)?;
    let keeps_sums = args.output.iter().any(|path| is_part(path));
    if !keeps_sums && stored.is_none() && args.parts.checkpoint.is_none() {
        return Ok(None);
    }
    let checkpoint = args.parts.checkpoint.as_ref();
    let checkpoint = checkpoint.map(|c| (c.path.clone(), Duration::from_secs_f64(c.seconds)));
    let storage = Storage { checkpoint, keeps_sums, stored };
    Ok(Some(FilmFile::new(&asked(args), job, files, settings, spp, storage, progress::say)?))
}

/// Checkpoint statistics for `--stats`.
pub(super) fn stats(film_file: Option<&FilmFile>) -> serde_json::Value {
    let of = |c: &Checkpoints| serde_json::json!({ "stored": c.stored, "seconds": c.waited.as_secs_f64() });
    film_file.and_then(FilmFile::checkpoints).map_or(serde_json::Value::Null, of)
}
