//! Conversion of command-line options to a render job.

use super::UsageError;
use super::args::{SceneArgs, is_standard_input};
use super::frame_list::seed_of_frame;
use super::interrupt;
use super::laps;
use super::memory::MemoryLimit;
use super::pictures::is_picture;
use super::progress;
use anyhow::{Context, bail};
use lumiris::film::filter::PixelFilter;
use lumiris::import::cache::FileCache;
use lumiris::import::fingerprint::SceneFiles;
use lumiris::import::{Loaded, is_gltf, load_text, load_with};
use lumiris::planning::allocation::complete_for_noise;
use lumiris::planning::preparation::complete_for_time;
use lumiris::planning::{Preparation, prepare};
use lumiris::render::parts::Stored;
use lumiris::render::{RenderError, RenderSettings};
use lumiris::scene::RenderJob;
use lumiris::settings::Given;
use lumiris_formats::source::read_bytes;
use std::io;
use std::path::Path;
use std::sync::OnceLock;
use std::time::{Duration, Instant};

/// Times before the first ray is traced (s).
#[derive(Clone, Copy, Debug)]
pub(super) struct SetupTimes {
    /// Reading files.
    pub load: f64,
    /// Building ray tracers.
    pub build: f64,
    /// Pilots, and other choices for open settings.
    pub prepare: f64,
}

/// Loads the scene and applies the options; prints warnings. Files in `files` are not read again. Options take
/// precedence over the settings of the stored state. `time` is the time limit of the image.
pub(super) fn load_scene(
    args: &SceneArgs,
    files: &FileCache,
    stored: Option<&Stored>,
    time: Option<Duration>,
) -> anyhow::Result<Loaded> {
    check_scene(args)?;
    let _loading = interrupt::during(format!("loading {}", args.name()));
    progress::stage(&format!("reading {}", args.name()), None);
    match args.texture_memory {
        Some(MemoryLimit::Bytes(bytes)) => files.limit_textures(bytes),
        Some(MemoryLimit::Off) => files.limit_textures(u64::MAX),
        None => {}
    }
    if let Some(folder) = &args.texture_cache {
        files.cache_textures(folder).with_context(|| format!("--texture-cache {}", folder.display()))?;
    }
    let options = args.load_options();
    let read = if is_standard_input(&args.scene) {
        let text = standard_input().context("the standard input cannot be read")?;
        load_text(text, "<stdin>", Path::new(""), &options, files)
    } else {
        load_with(&args.scene, &options, files)
    };
    let mut loaded = match read {
        Ok(loaded) => loaded,
        Err(diagnostics) => {
            progress::say(diagnostics.to_string().trim_end());
            bail!("{} could not be loaded", args.name());
        }
    };
    let warnings = loaded.warnings.to_string();
    if !warnings.is_empty() {
        progress::say(warnings.trim_end());
    }
    // Applied after the stored settings, so that differences from them are detected
    if let Some(stored) = stored {
        stored.apply(&mut loaded.settings)?;
    }
    args.settings.apply(&mut loaded.settings);
    loaded.given.extend(args.settings.given());
    let has_spp = args.settings.has("spp");
    if let Some(time) = time.filter(|_| stored.is_none()) {
        complete_for_time(&mut loaded.settings, has_spp, time, loaded.scene.film.bounds.area());
    }
    complete_for_noise(&mut loaded.settings, has_spp).map_err(|needs| UsageError(format!("--noise {needs}")))?;
    // Additional samples use the same preparation as the first ones
    if let Some(stored) = stored {
        loaded.settings.sampling.spp = stored.spp()?;
    }
    // The stored settings already contain the frame's
    if let Some(frame) = args.seed_by_frame.filter(|_| stored.is_none() || args.settings.has("seed")) {
        loaded.settings.sampling.seed = seed_of_frame(loaded.settings.sampling.seed, frame);
    }
    if args.box_filter {
        loaded.scene.film.filter = PixelFilter::Box { rx: 0.5, ry: 0.5 };
    }
    if loaded.settings.integrator.leaves_lights_out() {
        progress::say("warning: without samples on non-contributing lights, direct light is biased");
    }
    Ok(loaded)
}

/// Returns the whole standard input. Commands may load it more than once.
fn standard_input() -> io::Result<&'static str> {
    static TEXT: OnceLock<String> = OnceLock::new();
    if let Some(text) = TEXT.get() {
        return Ok(text);
    }
    let bytes = read_bytes(io::stdin().lock(), 0)?;
    if bytes.starts_with(b"glTF") || bytes.trim_ascii_start().starts_with(b"{") {
        return Err(io::Error::new(io::ErrorKind::InvalidData, "it is glTF, which is read from files"));
    }
    // Comments need not be UTF-8
    let text = String::from_utf8_lossy(&bytes).into_owned();
    Ok(TEXT.get_or_init(|| text))
}

/// Rejects files that are no scenes, and options for the other kind of scene.
fn check_scene(args: &SceneArgs) -> anyhow::Result<()> {
    let path = args.scene.display();
    if is_picture(&args.scene) {
        return Err(
            UsageError(format!("{path} is an image, not a scene: `lumiris info {path}` shows its settings")).into()
        );
    }
    if let Some(what) = mesh_kind(&args.scene) {
        return Err(UsageError(format!("{path} is a mesh, not a scene: {what}")).into());
    }
    if let Some(option) = args.load_options().of_gltf().filter(|_| !is_gltf(&args.scene)) {
        let text = format!(
            "{option} is for glTF scenes: environment, camera, lights and time of a pbrt scene, such as {path}, are in \
             its file"
        );
        return Err(UsageError(text).into());
    }
    Ok(())
}

/// Advice on using a mesh file; `None` if the extension is no mesh format's.
fn mesh_kind(path: &Path) -> Option<&'static str> {
    let extension = path.extension()?.to_str()?.to_ascii_lowercase();
    match extension.as_str() {
        "ply" => Some("`Shape \"plymesh\" \"string filename\" \"…\"` in a .pbrt file places it"),
        "obj" | "stl" | "fbx" | "usd" | "usda" | "usdc" => Some("convert it to PLY for a .pbrt file, or to glTF"),
        _ => None,
    }
}

/// A loaded scene.
pub(super) struct Setup {
    /// The job.
    pub job: RenderJob,
    /// Setup times.
    pub times: SetupTimes,
    /// The files of the scene.
    pub files: SceneFiles,
    /// The settings given by options or by the scene.
    pub given: Given,
}

/// Loads the scene and builds its ray tracers.
pub(super) fn load_job(args: &SceneArgs) -> anyhow::Result<Setup> {
    load_job_of(args, &FileCache::default(), None, None)
}

/// Loads the scene and builds its ray tracers, with the settings of the stored state and the time limit of the image.
/// Files in `files` are not read again.
pub(super) fn load_job_of(
    args: &SceneArgs,
    files: &FileCache,
    stored: Option<&Stored>,
    time: Option<Duration>,
) -> anyhow::Result<Setup> {
    // Load
    laps::end("start", &[]);
    let start = Instant::now();
    let mut loaded = load_scene(args, files, stored, time)?;
    let (files, given) = (std::mem::take(&mut loaded.files), std::mem::take(&mut loaded.given));
    let load = start.elapsed().as_secs_f64();
    laps::end("load", &[]);

    // Build the ray tracers
    let start = Instant::now();
    let _building = interrupt::during(format!("building the ray tracers of {}", args.name()));
    progress::stage("building the ray tracers", None);
    let job = loaded
        .job(args.accel, args.packet_width)
        .with_context(|| format!("cannot build the ray tracer of {}", args.scene.display()))?;
    laps::end("build", &[]);
    let times = SetupTimes { load, build: start.elapsed().as_secs_f64(), prepare: 0.0 };
    Ok(Setup { job, times, files, given })
}

/// Makes the choices that the settings leave open, with `--threads` threads. Prints them unless `quiet`. Warns of given
/// settings that have no effect.
pub(super) fn complete(
    args: &SceneArgs,
    job: &mut RenderJob,
    given: &Given,
    how: &Preparation<'_>,
    quiet: bool,
) -> anyhow::Result<()> {
    // Choose
    let _preparing = interrupt::during(format!("completing the settings of {}", args.name()));
    let asked = *job.settings();
    let how = Preparation { threads: args.threads.map(|t| t as usize), observe: &progress::stage, ..*how };
    let plan = prepare(job, &how).map_err(RenderError::from)?;

    // Print the choices and warnings
    if !quiet {
        progress::say_once(&job.settings().summary());
    }
    plan.warnings.iter().for_each(|warning| progress::say(&format!("warning: {warning}")));
    for line in given.without_effect(&asked, job.settings()) {
        progress::say_once(&format!("warning: {line}"));
    }
    Ok(())
}

/// Render settings from the options.
pub(super) fn render_settings(args: &SceneArgs, job: &RenderJob) -> RenderSettings {
    RenderSettings {
        threads: args.threads.map(|t| t as usize),
        tile_size: args.tile_size,
        spp: job.pixel_samples.as_ref().map_or(job.settings().sampling.spp, |of_pixels| of_pixels.spp),
        ..RenderSettings::default()
    }
}
