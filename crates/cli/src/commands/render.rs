//! `lumiris render`

use super::UsageError;
use super::args::{RenderArgs, is_standard_input};
use super::denoise_args::{Denoised, denoise};
use super::interrupt::{self, During, INTERRUPTED};
use super::laps::{self, Laps};
use super::libraries::Loading;
use super::memory;
use super::part_args::is_part;
use super::parts;
use super::pictures::{Made, Written, check_outputs, is_exr, is_output, write_pictures};
use super::progress::{self, Bar, Clock};
use super::report::{Times, report};
use super::rescue::write_or_rescue;
use super::settings::{Setup, SetupTimes, complete, load_job_of, render_settings};
use crate::watch::{self, Canvas, Watch};
use anyhow::{Context, bail};
use lumiris::film::Film;
use lumiris::imaging::oidn::Denoiser;
use lumiris::imaging::tiles::TileCounts;
use lumiris::import::cache::FileCache;
use lumiris::integrators::MapStats;
use lumiris::integrators::{LightPathStats, light_layers};
use lumiris::planning::preparation::pilot_deadline;
use lumiris::planning::{Preparation, has_pilot};
use lumiris::render::FilmFile;
use lumiris::render::cryptomatte::cryptomattes;
use lumiris::render::memory::{Wanted, predict};
use lumiris::render::output::{self, Aov};
use lumiris::render::parts::Stored;
use lumiris::render::{CacheReport, Continuation, Progress, RenderError, RenderSettings, Rendering, TileShare, resume};
use lumiris::scene::RenderJob;
use lumiris::settings::{Given, IntegratorKind, IntegratorSettings};
use lumiris_formats::output::{check_writable, write_text};
use serde_json::json;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

/// State shared by all renderings of one run of the program.
pub(super) struct Session {
    /// Meshes and images shared by scenes.
    pub files: FileCache,
    /// The denoiser, if images are denoised.
    denoiser: Option<Denoiser>,
    /// Connections to viewers.
    watch: Watch,
}

/// Result of rendering an image.
pub(super) struct Rendered {
    /// Statistics.
    pub stats: serde_json::Value,
    /// Wall-clock time of loading, rendering and writing (s).
    pub seconds: f64,
    /// Mean relative standard error of the pixels.
    pub noise: f64,
    /// True if every pixel has all of its samples.
    pub complete: bool,
    /// Errors of files that could not be written to their destinations, with the paths of rescued copies.
    pub misplaced: Vec<String>,
}

/// Renders one image. `start` is the start of the program.
pub(super) fn run(args: &RenderArgs, start: Instant) -> anyhow::Result<ExitCode> {
    let _orderly = interrupt::orderly();
    let session = Session::start(args, FileCache::default())?;
    let mut rendered = match render_one(args, &session, start) {
        Err(error) if is_stop(&error) => {
            progress::say(&format!("{error}: nothing is written"));
            return Ok(ExitCode::from(INTERRUPTED));
        }
        result => result?,
    };
    if let Some(path) = &args.stats {
        rendered.misplaced.extend(write_stats(path, &rendered.stats).err().map(|e| format!("{e:#}")));
    }
    if !rendered.misplaced.is_empty() {
        bail!(rendered.misplaced.join("\nlumiris: "));
    }
    Ok(if interrupt::is_stopped() { ExitCode::from(INTERRUPTED) } else { ExitCode::SUCCESS })
}

/// True if a rendering was stopped before it had anything to write.
pub(super) fn is_stop(error: &anyhow::Error) -> bool {
    matches!(error.downcast_ref(), Some(RenderError::Stopped))
}

impl Session {
    /// Checks the options, opens the denoiser, and starts the viewers' connections.
    pub(super) fn start(args: &RenderArgs, files: FileCache) -> anyhow::Result<Self> {
        let _starting = interrupt::during(String::new());
        if !args.output.is_empty() {
            check_denoise(args, &args.output)?;
        }
        args.stats.as_deref().map_or(Ok(()), check_writable)?;
        memory::limit(args.memory_limit).into_iter().for_each(|limit| files.limit_memory(limit));
        let denoiser = args.denoise.open(args.scene.threads)?;
        let watch = Watch::start(&args.watch.places()?, progress::say)?;
        if let Some(address) = watch.page {
            progress::say(&format!("the image can be watched at http://{address}/"));
        }
        Ok(Session { files, denoiser, watch })
    }

    /// The denoised image, if requested, or an error message.
    fn denoised(&self, film: &Film) -> Result<Option<Denoised>, String> {
        let Some(denoiser) = &self.denoiser else { return Ok(None) };
        progress::stage("denoising", None);
        denoise(denoiser, film, true).map(Some)
    }
}

/// Renders an image and writes it. `start` is the start of its time. Files that could not be written are not an error,
/// but listed in the result.
pub(super) fn render_one(args: &RenderArgs, session: &Session, start: Instant) -> anyhow::Result<Rendered> {
    let preparing = interrupt::during(format!("preparing {}", args.scene.name()));
    check_outputs(&args.output)?;
    let stored = parts::stored(&args.parts)?;
    let mut args = args.clone();
    stored.as_ref().map_or(Ok(()), |stored| parts::complete(&mut args, stored))?;
    let args = &args;
    let asked = check(args)?;
    let clock = Clock { start, limit: args.time.map(Duration::from_secs_f64) };
    let bar = Bar::new(args.quiet, clock);
    let Setup { mut job, times, files, given } =
        load_job_of(&args.scene, &session.files, stored.as_ref(), clock.limit)?;
    parts::check_settings(args, job.settings())?;
    let outputs = outputs(args, &job);
    let kept = Kept {
        asked: asked.as_deref(),
        has_exr: outputs.iter().any(|path| is_exr(path)),
        has_sums: stored.is_some() || args.parts.checkpoint.is_some() || outputs.iter().any(|path| is_part(path)),
    };
    check_memory(args, &job, &kept)?;
    if args.denoise.denoise && job.settings().integrator.path_reuse.is_none() {
        // A denoiser would keep noise that is correlated between pixels
        job.change(|s| s.integrator.path_reuse = Some(1));
    }
    let settings = settings_of(args, &job, &kept);
    let canvas = session.watch.begin(&name_of(args), &job.world.scene.film, settings.with_features);
    if let (Some(canvas), true) = (&canvas, has_pilot(job.settings())) {
        watch::preview(canvas, &job, &settings, interrupt::stop())?;
    }
    let begin = Instant::now();
    choose(args, &mut job, &given, stored.as_ref(), &kept, &clock)?;
    if let Some(canvas) = &canvas {
        let _ = canvas.summary.set(job.settings().summary());
    }
    let setup = SetupTimes { prepare: begin.elapsed().as_secs_f64(), ..times };
    if args.output.is_empty() {
        check_outputs(&outputs)?;
    }
    check_denoise(args, &outputs)?;
    args.output_options.check(&outputs);
    let mut settings = settings_of(args, &job, &kept);
    if !settings.with_light_layers && kept.needs(LIGHT_GROUPS) && light_layers::count(&job) > 0 && !args.quiet {
        progress::say_once("note: only EXR files have the layers of light groups: -o image.exr");
    }
    let mut film_file = parts::film_file(args, &job, &files, &mut settings, stored)?;
    settings.time_limit = clock.left();
    let continuation = film_file.as_mut().map_or_else(Continuation::default, FilmFile::continuation);
    laps::end("prepare", &[]);
    let loading = Loading::begin(outputs.iter().any(|path| !is_part(path)));
    let rendering = render_shown(&job, &settings, canvas.as_ref(), &bar, continuation, preparing)?;
    session.files.take_texture_warnings().iter().for_each(|warning| progress::say(&format!("warning: {warning}")));
    laps::end("passes", &[&rendering.phases[..], &[loading.end()]].concat());
    if interrupt::is_stopped() && rendering.film.summary().samples[1] == 0 {
        return Err(RenderError::Stopped.into());
    }

    // Only EXR files store Cryptomattes
    let kinds = if kept.has_exr { &args.exr.cryptomatte[..] } else { &[] };
    let cryptomattes = cryptomattes(&job, &settings, &rendering.film, kinds)?;
    let begin = Instant::now();
    let denoised = session.denoised(&rendering.film);
    let denoising = begin.elapsed();
    let not_denoised = denoised.as_ref().err().cloned();
    let made = Made {
        args,
        job: &job,
        rendering: &rendering,
        asked: asked.as_deref(),
        cryptomattes,
        denoised: denoised.ok().flatten(),
        is_interrupted: interrupt::is_stopped(),
    };
    let mut written = write_results(&made, film_file.as_mut(), outputs)?;
    written.misplaced.extend(not_denoised);
    drop(bar);
    laps::end("output", &[]);
    let laps = laps::take();
    let times = Times { setup, denoising, all: start.elapsed() };
    report(args, &job, &rendering, &times, &laps, &written.paths);
    let mut stats = stats(args, &job, &rendering, setup, &laps);
    stats["checkpoints"] = parts::stats(film_file.as_ref());
    Ok(Rendered {
        stats,
        seconds: times.all.as_secs_f64(),
        noise: rendering.film.summary().noise.median,
        complete: rendering.complete,
        misplaced: written.misplaced,
    })
}

/// Makes the choices that the settings leave open.
fn choose(
    args: &RenderArgs,
    job: &mut RenderJob,
    given: &Given,
    stored: Option<&Stored>,
    kept: &Kept<'_>,
    clock: &Clock,
) -> anyhow::Result<()> {
    // A continued rendering uses the stored pilots
    let limit = clock.limit.filter(|_| stored.is_none());
    let deadline = limit.and_then(|limit| pilot_deadline(clock.start, limit));
    let ratio_map = kept.asked.is_some_and(|list| list.contains(&Aov::Ratio));
    let how = Preparation { ratio_map, deadline, stop: interrupt::stop(), ..Preparation::default() };
    complete(&args.scene, job, given, &how, args.quiet)
}

/// True for the layers of light groups.
const LIGHT_GROUPS: fn(&Aov) -> bool = |aov| *aov == Aov::LightGroups;

/// What the outputs of an image store.
struct Kept<'a> {
    /// The requested AOVs; all if `None`.
    asked: Option<&'a [Aov]>,
    /// True if one is an EXR file.
    has_exr: bool,
    /// True if one has sums, which are a part or a checkpoint.
    has_sums: bool,
}

impl Kept<'_> {
    fn needs(&self, is_shown: fn(&Aov) -> bool) -> bool {
        self.asked.is_none_or(|list| list.iter().any(is_shown))
    }
}

/// The render settings for the requested AOVs.
fn settings_of(args: &RenderArgs, job: &RenderJob, kept: &Kept<'_>) -> RenderSettings {
    RenderSettings {
        time_limit: args.time.map(Duration::from_secs_f64),
        with_replicas: kept.needs(|aov| *aov == Aov::Variance),
        with_features: args.denoise.denoise || kept.needs(|aov| aov.is_feature()),
        with_light_layers: kept.has_sums || kept.has_exr && kept.needs(LIGHT_GROUPS),
        ..render_settings(&args.scene, job)
    }
}

/// Refuses an image that does not fit in memory.
fn check_memory(args: &RenderArgs, job: &RenderJob, kept: &Kept<'_>) -> anyhow::Result<()> {
    let mut render = settings_of(args, job, kept);
    if let Some([i, n]) = args.parts.part.filter(|_| args.parts.is_by_tiles()) {
        render.share = Some(TileShare { index: i - 1, count: n });
    }
    let cryptomattes = &args.exr.cryptomatte[..];
    let wanted = Wanted { render: &render, cryptomattes, is_denoised: args.denoise.denoise };
    memory::check(args.memory_limit, &predict(job, &wanted))
}

/// Writes the images and parts of a rendering.
fn write_results(made: &Made<'_>, film_file: Option<&mut FilmFile>, outputs: Vec<PathBuf>) -> anyhow::Result<Written> {
    progress::stage("writing", None);
    let (part_files, images): (Vec<PathBuf>, Vec<PathBuf>) = outputs.into_iter().partition(|path| is_part(path));
    let mut written = write_pictures(made, &images)?;
    if let Some(film_file) = film_file.filter(|_| !part_files.is_empty()) {
        film_file.end(made.rendering);
        let write = |path: &Path| Ok(film_file.write(path, made.rendering)?);
        part_files.into_iter().for_each(|path| written.write(path, write));
    }
    Ok(written)
}

/// Refuses to denoise parts, and `--denoise` without an EXR output, since the noisy image would be lost.
fn check_denoise(args: &RenderArgs, outputs: &[PathBuf]) -> Result<(), UsageError> {
    if args.denoise.denoise && args.parts.part.is_some() {
        let text = "--denoise needs the whole image: merge the parts with `lumiris merge --denoise`";
        return Err(UsageError(text.to_owned()));
    }
    args.denoise.check(outputs)
}

/// Renders, and sends the image to viewers if there are any. Ctrl-C is orderly from the first sample on, since there is
/// then an image to lose.
fn render_shown(
    job: &RenderJob,
    settings: &RenderSettings,
    canvas: Option<&Arc<Canvas>>,
    bar: &Bar,
    continuation: Continuation<'_>,
    preparing: During,
) -> anyhow::Result<Rendering> {
    // Progress; the first call ends the activity that can be abandoned
    progress::stage(before_samples(&job.settings().integrator), None);
    let preparing = Mutex::new(Some(preparing));
    let observe = |progress: &Progress| {
        drop(preparing.lock().unwrap_or_else(PoisonError::into_inner).take());
        bar.update(progress);
        watch::observe(canvas, progress);
    };
    let continuation = Continuation { tells_noise: bar.is_visible(), ..continuation };
    // Without viewers
    let Some(shown) = canvas else { return Ok(resume(job, settings, interrupt::stop(), &observe, continuation)?) };

    // With viewers: send the tiles, and the final film
    let set_tile = |tile: &Film| shown.set_tile(tile);
    let watched = Continuation { watch: Some(&set_tile), ..continuation };
    let rendering = resume(job, settings, interrupt::stop(), &observe, watched)?;
    shown.finish(&rendering.film);
    Ok(rendering)
}

/// Name of the stage before the first sample.
fn before_samples(settings: &IntegratorSettings) -> &'static str {
    match settings.kind {
        IntegratorKind::PhotonMap => "tracing photons",
        IntegratorKind::IrradianceCache => "filling the irradiance cache",
        _ if settings.light_paths.is_some_and(|paths| paths > 0.0) => "tracing light paths",
        _ => "beginning",
    }
}

/// Name of the image for viewers: the file name of its scene.
fn name_of(args: &RenderArgs) -> String {
    args.scene.scene.file_name().unwrap_or_default().to_string_lossy().into_owned()
}

/// Writes statistics.
pub(super) fn write_stats(path: &Path, stats: &serde_json::Value) -> anyhow::Result<()> {
    let text = serde_json::to_string_pretty(stats)?;
    write_or_rescue(path, |path| write_text(path, &text).with_context(|| format!("cannot write {}", path.display())))
}

fn outputs(args: &RenderArgs, job: &RenderJob) -> Vec<PathBuf> {
    // The given outputs
    if !args.output.is_empty() {
        return args.output.clone();
    }

    // The name in the scene file; a type that cannot be written becomes EXR
    let from_file = job.world.scene.film.file_name.as_ref().map(PathBuf::from);
    let from_file = from_file.map(|path| {
        if is_output(&path) {
            return path;
        }
        let exr = path.with_extension("exr");
        if !args.quiet {
            progress::say(&format!("note: {} becomes {}", path.display(), exr.display()));
        }
        exr
    });

    // The name of the scene
    vec![from_file.unwrap_or_else(|| {
        let scene = &args.scene.scene;
        let scene = if is_standard_input(scene) { Path::new("stdin") } else { scene };
        let name = scene.file_name().unwrap_or_default().to_string_lossy().into_owned();
        let stem = name.trim_end_matches(".gz").trim_end_matches(".pbrt").to_owned();
        PathBuf::from(stem + ".exr")
    })]
}

/// Refuses impossible options. Returns the requested AOVs.
pub(super) fn check(args: &RenderArgs) -> anyhow::Result<Option<Vec<Aov>>> {
    args.look.check()?;
    args.exr.check()?;
    parts::check(args)?;
    asked_aovs(args)
}

/// The requested AOVs; `None` for the default.
fn asked_aovs(args: &RenderArgs) -> anyhow::Result<Option<Vec<Aov>>> {
    let Some(list) = &args.aov else { return Ok(None) };
    let aovs: Vec<Aov> = list.iter().copied().flatten().collect();
    if !aovs.is_empty() && aovs.len() < list.len() {
        return Err(UsageError("--aov none cannot stand beside other AOVs".to_owned()).into());
    }
    Ok(Some(aovs))
}

fn stats(
    args: &RenderArgs,
    job: &RenderJob,
    rendering: &Rendering,
    setup: SetupTimes,
    laps: &Laps,
) -> serde_json::Value {
    // Times and settings
    let s = &rendering.stats;
    let d = &s.direct;
    let textures = &job.world.scene.textures;
    let seconds = |t: Duration| t.as_secs_f64();
    let times = s.stages().into_iter().chain([("ocv_solve", d.solve)]);
    let thread_seconds: serde_json::Map<_, _> = times.map(|(name, time)| (name.into(), seconds(time).into())).collect();
    let mrays = |count: u64, t: Duration| count as f64 / seconds(t).max(1e-12) * 1e-6;
    let accel = job.world.accel.stats();
    let metadata: serde_json::Map<_, _> =
        output::metadata(&job.world.scene.film, job.settings()).into_iter().map(|(k, v)| (k, v.into())).collect();

    // Report
    json!({
        "scene": args.scene.scene.display().to_string(),
        "settings": metadata,
        "accel": <&str>::from(args.scene.accel),
        "threads": rendering.threads,
        "complete": rendering.complete,
        "invalid_samples": rendering.film.summary().invalid,
        "relative_noise": rendering.film.summary().noise.median,
        "blocks_above_twice_the_noise": rendering.film.summary().noise.above_twice,
        "seconds": {
            "load": setup.load, "build": setup.build, "prepare": setup.prepare, "render": seconds(rendering.elapsed),
        },
        "cpu_seconds": laps.json(),
        "thread_seconds": thread_seconds,
        "counts": {
            "replica_pixels": rendering.film.replicas().len(),
            "camera_rays": s.camera_rays, "bounce_rays": s.bounce_rays, "proposals": d.proposals,
            "emitter_rays": d.emitter_rays, "shadow_segments": d.segments,
            "medium_collisions": s.collisions + d.collisions,
            "ocv_systems": d.systems, "ocv_ill_conditioned": d.ill_conditioned,
        },
        "rates": {
            "camera_mrays_per_second": mrays(s.camera_rays, s.camera_time),
            "bounce_mrays_per_second": mrays(s.bounce_rays, s.bounce_time),
            "shadow_mrays_per_second": mrays(d.segments, d.t2),
            "nanoseconds_per_proposal": seconds(d.t1) * 1e9 / (d.proposals.max(1) as f64),
        },
        "memory": {
            "film_bytes": rendering.film.bytes(), "accel_bytes": accel.bytes, "accel_peak_bytes": accel.peak_bytes,
            "texture_bytes": textures.bytes(),
            "texture_tiles": textures.store().map(|store| tile_counts(store.counts())),
        },
        "photon_maps": rendering.photons.map(|p| photon_stats(&p)),
        "light_paths": rendering.light.map(|l| light_path_stats(&l)),
        "irradiance_cache": rendering.cache.map(|c| cache_stats(&c)),
    })
}

fn tile_counts(TileCounts { stored, read, held }: TileCounts) -> serde_json::Value {
    json!({ "stored_bytes": stored, "tiles_read": read, "held_bytes": held })
}

fn light_path_stats(l: &LightPathStats) -> serde_json::Value {
    json!({ "paths": l.paths, "seen": l.connected, "rays": l.rays, "thread_seconds": l.time.as_secs_f64() })
}

fn photon_stats(p: &MapStats) -> serde_json::Value {
    let seconds = p.tracing.as_secs_f64();
    json!({
        "maps": p.maps,
        "photon_paths": p.paths,
        "global_photons": p.global,
        "caustic_photons": p.caustic,
        "importons": p.importons,
        "bytes": p.bytes,
        "trace_seconds": seconds,
        "sort_seconds": p.sorting.as_secs_f64(),
        "photons_per_second": (p.global + p.caustic) as f64 / seconds.max(1e-12),
        "photon_paths_per_second": p.paths as f64 / seconds.max(1e-12),
    })
}

fn cache_stats(c: &CacheReport) -> serde_json::Value {
    json!({
        "records": c.records,
        "record_bytes": c.bytes,
        "build_seconds": c.build.elapsed.as_secs_f64(),
        "build_rounds": c.build.rounds,
        "build_camera_samples": c.build.camera_samples,
        "dropped_points": c.build.dropped,
        "build_rays": c.build.paths.camera_rays + c.build.paths.bounce_rays + c.build.paths.direct.segments,
        "lookups": c.lookups.lookups,
        "misses": c.lookups.misses,
    })
}
