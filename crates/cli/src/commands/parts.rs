//! Parts of images, checkpoints, and going on from them: options of `render`, and what becomes of them.

use super::UsageError;
use super::args::{RenderArgs, SceneArgs};
use super::plan_file::PlanFile;
use super::progress;
use super::render::extension;
use anyhow::{Context, bail};
use clap::Args;
use lumiris::import::fingerprint::SceneFiles;
use lumiris::render::output::{self, Aov};
use lumiris::render::parts::{Checkpoints, FilmHeader, FilmReader, StoredTile, write_film};
use lumiris::render::plan::follows_from_times;
use lumiris::render::{Continuation, RenderSettings, Rendering, TileShare, depends_on_earlier_samples};
use lumiris::scene::{AccelKind, RenderJob};
use lumiris::settings::Settings;
use lumiris::settings::table::rows;
use std::path::{Path, PathBuf};
use std::time::Duration;
use strum::{EnumString, IntoStaticStr, VariantNames};

/// File type of parts.
pub(super) const PART_TYPE: &str = "part";
/// Time between checkpoints, if none is given (s).
const CHECKPOINT_SECONDS: f64 = 60.0;
/// Note of the layers that the image is to have.
pub(super) const AOV_NOTE: &str = "aov";
/// Note of the path of the scene.
pub(super) const SCENE_NOTE: &str = "scene";
/// Note of the plan that was made for it.
pub(super) const PLAN_NOTE: &str = "plan";
/// Note of the time that it took.
pub(super) const SECONDS_NOTE: &str = "seconds";

/// What a part has of the image.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, EnumString, IntoStaticStr, VariantNames)]
#[strum(serialize_all = "kebab-case")]
pub(super) enum PartBy {
    /// A share of the samples of every pixel.
    #[default]
    Samples,
    /// All samples of a share of the pixels.
    Tiles,
}

/// Options of parts and checkpoints.
#[derive(Args, Clone, Debug)]
#[command(next_help_heading = "Parts and checkpoints")]
pub(super) struct PartArgs {
    /// Render the I-th of N parts of the image, for `lumiris merge`; the output is FILE.part
    #[arg(long, value_name = "I/N", value_parser = parse_part)]
    pub part: Option<[u32; 2]>,
    /// What a part has: `samples`, a share of the samples of every pixel, or `tiles`, all samples of a share of the pixels
    /// [default: samples]
    #[arg(long, value_name = "WHAT", requires = "part", value_parser = super::args::named::<PartBy>())]
    pub part_by: Option<PartBy>,
    /// First sample of every pixel, by its index [default: 0]
    #[arg(long, value_name = "A")]
    pub samples_from: Option<u32>,
    /// Index after the last sample of every pixel; may be more than --spp, by which footprints and pilots go [default:
    /// --spp]
    #[arg(long, value_name = "B", value_parser = clap::value_parser!(u32).range(1..))]
    pub samples_to: Option<u32>,
    /// Store everything that is needed to go on, every so many seconds [default: 60] and in the end
    #[arg(long, value_name = "FILE[,SECONDS]", value_parser = parse_checkpoint)]
    pub checkpoint: Option<(PathBuf, f64)>,
    /// Go on from a checkpoint or an unfinished part, with its settings; --spp may ask for more samples. If --checkpoint
    /// names the same file and there is none yet, start
    #[arg(long, value_name = "FILE")]
    pub resume: Option<PathBuf>,
}

impl PartArgs {
    /// True if it is not the whole image that is asked for.
    fn is_partial(&self) -> bool {
        self.part.is_some() || self.samples_from.is_some() || self.samples_to.is_some()
    }

    fn is_by_tiles(&self) -> bool {
        self.part_by == Some(PartBy::Tiles)
    }
}

fn parse_part(text: &str) -> Result<[u32; 2], String> {
    let parsed = text.split_once('/').and_then(|(i, n)| Some([i.trim().parse().ok()?, n.trim().parse().ok()?]));
    match parsed {
        Some([i, n]) if 1 <= i && i <= n => Ok([i, n]),
        _ => Err("expected I/N with 1 <= I <= N, such as 3/8".to_owned()),
    }
}

fn parse_checkpoint(text: &str) -> Result<(PathBuf, f64), String> {
    let with_seconds = text.rsplit_once(',').and_then(|(path, seconds)| Some((path, seconds.trim().parse().ok()?)));
    match with_seconds {
        Some((path, seconds)) if seconds > 0.0 && f64::is_finite(seconds) && !path.is_empty() => {
            Ok((PathBuf::from(path), seconds))
        }
        Some(_) => Err("expected FILE or FILE,SECONDS with a positive number of seconds".to_owned()),
        None => Ok((PathBuf::from(text), CHECKPOINT_SECONDS)),
    }
}

/// The sums that a rendering goes on from.
pub(super) struct Stored {
    path: PathBuf,
    pub(super) header: FilmHeader,
    tiles: Vec<StoredTile>,
}

impl Stored {
    /// Those of `--resume`, if there are any.
    pub(super) fn read(args: &PartArgs) -> anyhow::Result<Option<Stored>> {
        let Some(path) = &args.resume else { return Ok(None) };
        let is_begun_here = args.checkpoint.as_ref().is_some_and(|(checkpoint, _)| checkpoint == path);
        if is_begun_here && !path.exists() {
            return Ok(None);
        }
        let reader = FilmReader::open(path)?;
        let header = reader.header().clone();
        Ok(Some(Stored { path: path.clone(), header, tiles: reader.all_tiles()? }))
    }

    /// The options by which it was rendered, where none are given now.
    pub(super) fn complete(&self, args: &mut RenderArgs) -> anyhow::Result<()> {
        let note = |name| self.header.note(name).filter(|text| !text.is_empty());
        let scene = &mut args.scene;
        let option = |name: &str| anyhow::anyhow!("{}: the stored {name} means nothing", self.path.display());
        if let (None, Some(text)) = (scene.resolution, note("resolution")) {
            scene.resolution = Some(super::args::parse_resolution(text).map_err(|_| option("resolution"))?);
        }
        if let (None, Some(text)) = (scene.crop, note("crop")) {
            scene.crop = Some(super::args::parse_crop(text).map_err(|_| option("crop window"))?);
        }
        if let (AccelKind::Embree, Some(accel)) = (scene.accel, self.header.setting("lumiris:accel")) {
            scene.accel = accel.parse().map_err(|_| option("ray tracer"))?;
        }
        scene.box_filter |= note("box_filter").is_some();
        if let (None, Some(list)) = (&args.aov, note(AOV_NOTE)) {
            let named = |name: &str| if name == "none" { Ok(None) } else { name.parse::<Aov>().map(Some) };
            args.aov =
                Some(list.split(',').map(named).collect::<Result<_, _>>().map_err(|_| option("list of layers"))?);
        }
        Ok(())
    }

    /// Applies its settings, in the order of the table. What it does not have does not apply.
    pub(super) fn apply(&self, settings: &mut Settings) -> anyhow::Result<()> {
        for row in rows() {
            if let Some(value) = self.header.setting(&format!("lumiris:{}", row.key)) {
                let set = row.set_text(settings, value);
                set.map_err(|e| {
                    anyhow::anyhow!("{}: `{}`: expected {e}, not `{value}`", self.path.display(), row.key)
                })?;
            }
        }
        Ok(())
    }

    /// The samples per pixel by which it was prepared.
    pub(super) fn spp(&self) -> anyhow::Result<u32> {
        let spp = self.header.setting("lumiris:spp").and_then(|text| text.parse().ok());
        spp.with_context(|| format!("{}: there is no number of samples", self.path.display()))
    }
}

/// Rejects options that contradict each other.
pub(super) fn check(args: &RenderArgs) -> anyhow::Result<()> {
    let usage = |text: &str| Err(UsageError(text.to_owned()).into());
    let parts = &args.parts;
    let has_part_file = args.output.iter().any(|path| extension(path) == PART_TYPE);
    if parts.part.is_some() && !parts.is_by_tiles() && (parts.samples_from.is_some() || parts.samples_to.is_some()) {
        return usage("--part is a share of the samples: it cannot stand beside --samples-from and --samples-to");
    }
    if parts.part.is_some() && !has_part_file {
        return usage("--part needs an output for `lumiris merge`, such as -o image.1.part");
    }
    if parts.is_partial() && args.time.is_some() {
        return usage("parts of an image cannot be limited by --time: their samples would not be known");
    }
    if parts.resume.is_some() && args.scene.plan.is_some() {
        return usage("--resume goes on with the plan of its file: leave --plan out");
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

/// Rejects settings by which an image cannot be rendered in parts. Before a plan is made.
pub(super) fn check_settings(args: &RenderArgs, settings: &Settings) -> anyhow::Result<()> {
    let usage = |text: String| Err(UsageError(text).into());
    if !args.parts.is_partial() {
        return Ok(());
    }
    if settings.sampling.noise.is_some() {
        return usage("parts of an image cannot be limited by --noise: give a number of samples, --spp".to_owned());
    }
    let is_by_samples =
        !args.parts.is_by_tiles() || args.parts.samples_from.is_some() || args.parts.samples_to.is_some();
    if is_by_samples && depends_on_earlier_samples(settings) {
        let reason = "with a progressive estimator, samples depend on earlier ones of their pixel";
        return usage(format!("{reason}: divide the image with --part-by tiles"));
    }
    if follows_from_times(settings) {
        let scene = args.scene.scene.display();
        return usage(format!(
            "what these settings leave open follows from measured times, and must be the same for all parts: make one plan \
             with `lumiris plan {scene} … -o plan.json`, and render all parts with `--plan plan.json`"
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
        let keeps_sums = args.output.iter().any(|path| extension(path) == PART_TYPE);
        if !keeps_sums && stored.is_none() && args.parts.checkpoint.is_none() {
            return Ok(None);
        }
        let fingerprint = files.fingerprint();
        let fingerprint = fingerprint.map_err(|(path, e)| anyhow::anyhow!("cannot read {}: {e}", path.display()))?;
        let described = (described(args, job, settings), notes(args, plan)?);
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
        Continuation { stored, checkpoints, keeps_sums: self.keeps_sums }
    }

    /// Writes a part.
    pub(super) fn write(&mut self, path: &Path, rendering: &Rendering) -> anyhow::Result<()> {
        self.header.is_finished = rendering.complete;
        self.header.notes.push((SECONDS_NOTE.to_owned(), rendering.elapsed.as_secs_f64().to_string()));
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
        if let Some(more) = args.scene.settings.count("spp").filter(|n| *n != header.samples.end) {
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
fn notes(args: &RenderArgs, plan: &PlanFile) -> anyhow::Result<Vec<(String, String)>> {
    let SceneArgs { scene, resolution, crop, box_filter, .. } = &args.scene;
    let mut notes = vec![(SCENE_NOTE, scene.display().to_string())];
    notes.extend(resolution.map(|[w, h]| ("resolution", format!("{w}x{h}"))));
    notes.extend(crop.map(|c| ("crop", c.map(|v| v.to_string()).join(","))));
    notes.extend(box_filter.then(|| ("box_filter", "true".to_owned())));
    notes.extend((!plan.settings.is_empty()).then(|| plan.text()).transpose()?.map(|text| (PLAN_NOTE, text)));
    let name = |aov: &Option<Aov>| aov.map_or("none", <&str>::from);
    notes.extend(args.aov.as_ref().map(|list| (AOV_NOTE, list.iter().map(name).collect::<Vec<_>>().join(","))));
    Ok(notes.into_iter().map(|(key, value)| (key.to_owned(), value)).collect())
}
