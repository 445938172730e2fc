//! Parts of images and checkpoints: which samples of which pixels are rendered, and where their sums are stored.

use super::UsageError;
use super::args::{RenderArgs, SceneArgs};
use super::exr::CameraMatrices;
use super::part_args::is_part;
use super::plan_file::PlanFile;
use super::progress;
use super::stored::{AOV_NOTE, PLAN_NOTE, SCENE_NOTE, SECONDS_NOTE, Stored};
use anyhow::{Context, bail};
use lumiris::film::PixelBounds;
use lumiris::import::fingerprint::SceneFiles;
use lumiris::render::output::{self, Aov};
use lumiris::render::parts::{Checkpoints, FilmHeader, StoredTile, write_film};
use lumiris::render::plan::follows_from_times;
use lumiris::render::{Continuation, RenderSettings, Rendering, TileShare, depends_on_earlier_samples};
use lumiris::scene::RenderJob;
use lumiris::settings::{EstimatorKind, Settings};
use std::path::Path;
use std::time::Duration;

/// Rejects options that contradict each other.
pub(super) fn check(args: &RenderArgs) -> anyhow::Result<()> {
    let usage = |text: &str| Err(UsageError(text.to_owned()).into());
    let parts = &args.parts;
    let has_part_file = args.output.iter().any(|path| is_part(path));
    if parts.part.is_some() && !parts.is_by_tiles() && (parts.samples_from.is_some() || parts.samples_to.is_some()) {
        return usage("--part is a share of the samples: it cannot stand beside --samples-from and --samples-to");
    }
    if parts.part.is_some() && !has_part_file {
        return usage("--part needs an output for `lumiris merge`, such as -o image.1.part");
    }
    if parts.is_partial() && args.time.is_some() {
        return usage("parts of an image cannot be limited by --time: their samples would not be known");
    }
    let is_stored = parts.is_partial() || parts.checkpoint.is_some() || parts.resume.is_some();
    if args.frames.is_some() && (is_stored || has_part_file) {
        return usage("--frames cannot stand beside parts and checkpoints: render each frame by a command of its own");
    }
    if parts.is_partial() && !args.exr.cryptomatte.is_empty() {
        return usage("--cryptomatte needs the whole image, not a part");
    }
    for path in parts.checkpoint.iter().map(|(path, _)| path) {
        let folder = path.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
        if !folder.is_dir() {
            bail!("{}: folder {} does not exist", path.display(), folder.display());
        }
        if path.is_dir() {
            bail!("{} is a folder", path.display());
        }
    }
    Ok(())
}

/// Rejects settings by which an image cannot be divided.
pub(super) fn check_division(args: &RenderArgs, settings: &Settings) -> anyhow::Result<()> {
    let usage = |text: String| Err(UsageError(text).into());
    if settings.sampling.noise.is_some() {
        return usage("parts of an image cannot be limited by --noise: give a number of samples, --spp".to_owned());
    }
    let is_by_samples =
        !args.parts.is_by_tiles() || args.parts.samples_from.is_some() || args.parts.samples_to.is_some();
    if is_by_samples && depends_on_earlier_samples(settings) {
        let reason = "with a progressive estimator, samples depend on earlier ones of their pixel";
        return usage(format!("{reason}: divide the image with --part-by tiles"));
    }
    Ok(())
}

/// Rejects settings by which an image cannot be rendered in parts. Before a plan is made.
pub(super) fn check_settings(args: &RenderArgs, settings: &Settings, bounds: &PixelBounds) -> anyhow::Result<()> {
    let usage = |text: String| Err(UsageError(text).into());
    if !args.parts.is_partial() {
        return Ok(());
    }
    check_division(args, settings)?;
    if follows_from_times(settings, bounds) {
        let scene = args.scene.scene.display();
        let instead = match settings.integrator.estimator {
            EstimatorKind::Ris => "give a number of --proposals",
            _ => "name an estimator, such as `--estimator mis`",
        };
        return usage(format!(
            "what these settings leave open follows from measured times, and must be the same for all parts: make one plan \
             with `lumiris plan {scene} … -o plan.json`, and render all parts with `--plan plan.json`; or {instead}"
        ));
    }
    Ok(())
}

/// What is stored of a rendering, and how it is called.
pub(super) struct FilmFile {
    header: FilmHeader,
    checkpoints: Option<Checkpoints>,
    stored: Option<Vec<StoredTile>>,
    keeps_sums: bool,
}

impl FilmFile {
    /// Sets which samples of which pixels are rendered; `None` if nothing is stored. Fails if the rendering cannot go on
    /// from what is stored.
    pub(super) fn new(
        args: &RenderArgs,
        (job, plan, files): (&RenderJob, &PlanFile, &SceneFiles),
        settings: &mut RenderSettings,
        stored: Option<Stored>,
    ) -> anyhow::Result<Option<FilmFile>> {
        let spp = settings.spp;
        extent(args, settings, stored.as_ref())?;
        let keeps_sums = args.output.iter().any(|path| is_part(path));
        if !keeps_sums && stored.is_none() && args.parts.checkpoint.is_none() {
            return Ok(None);
        }
        let fingerprint = files.fingerprint();
        let fingerprint = fingerprint.map_err(|(path, e)| anyhow::anyhow!("cannot read {}: {e}", path.display()))?;
        let described = [described(args, job, settings), notes(args, plan, job)?];
        let mut header = FilmHeader::new(job, settings, spp, fingerprint, described);
        if let Some(stored) = &stored {
            let mut differences = stored.header.differences_of_settings(&header);
            if stored.header.spp != header.spp {
                differences.push(format!("samples per pixel: {}, not {}", header.spp, stored.header.spp));
            }
            if !differences.is_empty() {
                let path = stored.path.display();
                bail!("{path} is of another scene or of other settings:\n  {}", differences.join("\n  "));
            }
            // What was measured then is not measured again
            let plan = stored.header.note(PLAN_NOTE).filter(|_| header.note(PLAN_NOTE).is_none());
            header.notes.extend(plan.map(|text| (PLAN_NOTE.to_owned(), text.to_owned())));
        }
        let checkpoints = args.parts.checkpoint.as_ref().map(|(path, seconds)| {
            Checkpoints::new(path.clone(), Duration::from_secs_f64(*seconds), header.clone(), progress::say)
        });
        Ok(Some(FilmFile { header, checkpoints, stored: stored.map(|s| s.tiles), keeps_sums }))
    }

    /// What the rendering goes on from.
    pub(super) fn continuation(&mut self) -> Continuation<'_> {
        let (stored, checkpoints) = (self.stored.take(), self.checkpoints.as_mut());
        Continuation { stored, checkpoints, keeps_sums: self.keeps_sums, ..Continuation::default() }
    }

    /// Notes how the rendering ended.
    pub(super) fn end(&mut self, rendering: &Rendering) {
        self.header.is_finished = rendering.complete;
        self.header.notes.push((SECONDS_NOTE.to_owned(), rendering.elapsed.as_secs_f64().to_string()));
    }

    /// Writes a part.
    pub(super) fn write(&self, path: &Path, rendering: &Rendering) -> anyhow::Result<()> {
        let sums = rendering.sums.as_ref().context("the sums of the image were not kept")?;
        Ok(write_film(path, &self.header, sums)?)
    }

    /// Numbers for `--stats`.
    pub(super) fn stats(&self) -> serde_json::Value {
        let of = |c: &Checkpoints| serde_json::json!({ "stored": c.stored, "seconds": c.waited.as_secs_f64() });
        self.checkpoints.as_ref().map_or(serde_json::Value::Null, of)
    }
}

/// Sets which samples of which pixels are rendered.
fn extent(args: &RenderArgs, settings: &mut RenderSettings, stored: Option<&Stored>) -> anyhow::Result<()> {
    let (parts, spp) = (&args.parts, settings.spp);
    let usage = |text: String| Err(UsageError(text).into());
    (settings.skip, settings.spp) = (parts.samples_from.unwrap_or(0), parts.samples_to.unwrap_or(spp));
    if let Some([i, n]) = parts.part {
        if parts.is_by_tiles() {
            settings.share = Some(TileShare { index: i - 1, count: n });
        } else {
            let until = |i: u32| (u64::from(spp) * u64::from(i) / u64::from(n)) as u32;
            (settings.skip, settings.spp) = (until(i - 1), until(i));
            if spp < n {
                return usage(format!("{spp} samples per pixel cannot be {n} parts: divide with --part-by tiles"));
            }
        }
    }
    if let Some(stored) = stored {
        let header = &stored.header;
        let before = (header.samples.start, header.samples.end, header.share);
        if parts.is_partial() && before != (settings.skip, settings.spp, settings.share) {
            return usage(format!("{} is of another part of the image", stored.path.display()));
        }
        (settings.skip, settings.spp, settings.share) = before;
        // The samples of a part follow from those of the whole image, which --spp names
        let is_more = |n: &u32| !parts.is_partial() && *n != header.samples.end;
        if let Some(more) = args.scene.settings.count("spp").filter(is_more) {
            let is_first = header.samples.start == 0;
            let done = stored.tiles.iter().map(|t| t.done).max().unwrap_or(0);
            if !is_first || more < done {
                let path = stored.path.display();
                return usage(format!(
                    "{path} cannot go on to {more} samples: it has {done}, of {} to {}",
                    before.0, before.1
                ));
            }
            settings.spp = more;
        }
    }
    if settings.skip >= settings.spp {
        return usage(format!("there are no samples from {} to {}", settings.skip, settings.spp));
    }
    Ok(())
}

/// What parts of an image have in common.
fn described(args: &RenderArgs, job: &RenderJob, settings: &RenderSettings) -> Vec<(String, String)> {
    let mut entries = output::metadata(&job.world.scene.film, job.settings());
    entries.push(("lumiris:accel".to_owned(), <&str>::from(args.scene.accel).to_owned()));
    let layers = [(settings.with_features, "features"), (settings.with_replicas, "variance")];
    let layers: Vec<&str> = layers.into_iter().filter(|(has, _)| *has).map(|(_, name)| name).collect();
    entries.push(("layers".to_owned(), layers.join(" ")));
    // One entry for each name
    let mut joined: Vec<(String, String)> = Vec::new();
    for (key, value) in entries {
        match joined.iter_mut().find(|(other, _)| *other == key) {
            Some((_, values)) => *values = format!("{values}; {value}"),
            None => joined.push((key, value)),
        }
    }
    joined
}

/// What may differ between parts, and what going on needs.
fn notes(args: &RenderArgs, plan: &PlanFile, job: &RenderJob) -> anyhow::Result<Vec<(String, String)>> {
    let SceneArgs { scene, resolution, crop, environment, camera_auto, time_in_scene, box_filter, .. } = &args.scene;
    let mut notes = vec![(SCENE_NOTE, scene.display().to_string())];
    notes.extend(resolution.map(|[w, h]| ("resolution", format!("{w}x{h}"))));
    notes.extend(crop.map(|c| ("crop", c.map(|v| v.to_string()).join(","))));
    notes.extend(environment.as_ref().map(|path| ("environment", path.display().to_string())));
    notes.extend(camera_auto.then(|| ("camera_auto", "true".to_owned())));
    notes.extend(time_in_scene.map(|time| ("time_in_scene", time.to_string())));
    notes.extend(box_filter.then(|| ("box_filter", "true".to_owned())));
    notes.extend((!plan.settings.is_empty()).then(|| plan.text()).transpose()?.map(|text| (PLAN_NOTE, text)));
    let name = |aov: &Option<Aov>| aov.map_or("none", <&str>::from);
    notes.extend(args.aov.as_ref().map(|list| (AOV_NOTE, list.iter().map(name).collect::<Vec<_>>().join(","))));
    let mut notes: Vec<_> = notes.into_iter().map(|(key, value)| (key.to_owned(), value)).collect();
    notes.extend(CameraMatrices::of(&job.world.scene.camera).notes());
    Ok(notes)
}
