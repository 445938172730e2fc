//! `lumiris render`

use super::UsageError;
use super::args::RenderArgs;
use super::part_args::{PART_TYPE, extension};
use super::parts::{self, FilmFile};
use super::plan_file::PlanFile;
use super::progress::{self, Bar};
use super::settings::{SetupTimes, load_job_of, plan, render_settings};
use super::stored::Stored;
use anyhow::{Context, bail};
use lumiris::film::Film;
use lumiris::imaging::oiio::{self, Part};
use lumiris::integrators::photon_map::MapStats;
use lumiris::render::output::{self, Aov};
use lumiris::render::{CacheReport, Continuation, RenderSettings, Rendering, go_on};
use lumiris::scene::{RenderJob, SampleCountMap};
use lumiris_formats::output::write_text;
use serde_json::json;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

/// File types for display-referred images.
const DISPLAY_TYPES: [&str; 6] = ["png", "jpg", "jpeg", "tif", "tiff", "tga"];
/// Exit code of a rendering that was stopped by Ctrl-C, as in shells.
pub(super) const INTERRUPTED: u8 = 130;

pub(super) fn run(args: &RenderArgs) -> anyhow::Result<ExitCode> {
    check_outputs(&args.output)?;
    parts::check(args)?;
    let stored = Stored::read(&args.parts)?;
    let mut args = args.clone();
    stored.as_ref().map_or(Ok(()), |stored| stored.complete(&mut args))?;
    let args = &args;
    let (mut job, setup, files) = load_job_of(&args.scene, stored.as_ref())?;
    parts::check_settings(args, job.settings())?;
    let asked = asked_aovs(args)?;
    let asks_for_ratio = asked.as_ref().is_some_and(|list| list.contains(&Aov::Ratio));
    let plan = plan(&args.scene, &mut job, asks_for_ratio, args.quiet)?;
    let outputs = outputs(args, &job);
    check_outputs(&outputs)?;

    let stop = Arc::new(AtomicBool::new(false));
    stop_at_ctrl_c(&stop)?;

    let bar = Bar::new(args.quiet);
    let time_limit = args.time.map(Duration::from_secs_f64);
    let needs = |is_shown: fn(&Aov) -> bool| asked.as_ref().is_none_or(|list| list.iter().any(is_shown));
    let mut settings = RenderSettings {
        time_limit,
        with_replicas: needs(|aov| *aov == Aov::Variance),
        with_features: needs(|aov| aov.is_feature()),
        ..render_settings(&args.scene, &job)
    };
    let mut film_file = FilmFile::new(args, (&job, &plan, &files), &mut settings, stored)?;
    let continuation = film_file.as_mut().map_or_else(Continuation::default, FilmFile::continuation);
    let rendering = go_on(&job, &settings, &stop, &|p| bar.update(p), continuation)?;
    bar.finish();

    for path in &outputs {
        match &mut film_file {
            Some(film_file) if extension(path) == PART_TYPE => film_file.write(path, &rendering)?,
            _ => write(args, (&job, &plan), &rendering, asked.as_deref(), path)?,
        }
    }
    if let Some(path) = &args.stats {
        let mut stats = stats(args, &job, &rendering, setup);
        stats["checkpoints"] = film_file.map_or(serde_json::Value::Null, |f| f.stats());
        let text = serde_json::to_string_pretty(&stats)?;
        write_text(path, &text).with_context(|| format!("cannot write {}", path.display()))?;
    }
    report(args, &rendering, &outputs);
    let interrupted = stop.load(Ordering::Relaxed);
    Ok(if interrupted { ExitCode::from(INTERRUPTED) } else { ExitCode::SUCCESS })
}

/// Ctrl-C sets `stop`, which ends a rendering in an orderly way; a second one ends the program.
pub(super) fn stop_at_ctrl_c(stop: &Arc<AtomicBool>) -> anyhow::Result<()> {
    let handler = Arc::clone(stop);
    ctrlc::set_handler(move || {
        if handler.swap(true, Ordering::Relaxed) {
            std::process::abort();
        }
    })
    .context("cannot watch for Ctrl-C")
}

fn outputs(args: &RenderArgs, job: &RenderJob) -> Vec<PathBuf> {
    if !args.output.is_empty() {
        return args.output.clone();
    }
    let from_file = job.world.scene.film.file_name.as_ref().map(PathBuf::from);
    vec![from_file.unwrap_or_else(|| {
        let name = args.scene.scene.file_name().unwrap_or_default().to_string_lossy().into_owned();
        let stem = name.trim_end_matches(".gz").trim_end_matches(".pbrt").to_owned();
        PathBuf::from(stem + ".exr")
    })]
}

/// Rejects outputs that cannot be written, before time is spent on rendering.
pub(super) fn check_outputs(outputs: &[PathBuf]) -> anyhow::Result<()> {
    for path in outputs {
        let kind = extension(path);
        if kind != "exr" && kind != PART_TYPE && !DISPLAY_TYPES.contains(&kind.as_str()) {
            bail!("{}: the output format must be .exr, .{}", path.display(), DISPLAY_TYPES.join(", ."));
        }
        let folder = path.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
        if !folder.is_dir() {
            bail!("{}: folder {} does not exist", path.display(), folder.display());
        }
    }
    Ok(())
}

/// The AOVs that are asked for; `None` is the default.
fn asked_aovs(args: &RenderArgs) -> anyhow::Result<Option<Vec<Aov>>> {
    let Some(list) = &args.aov else { return Ok(None) };
    let aovs: Vec<Aov> = list.iter().copied().flatten().collect();
    if !aovs.is_empty() && aovs.len() < list.len() {
        return Err(UsageError("--aov none cannot stand beside other AOVs".to_owned()).into());
    }
    Ok(Some(aovs))
}

fn write(
    args: &RenderArgs,
    (job, plan): (&RenderJob, &PlanFile),
    rendering: &Rendering,
    asked: Option<&[Aov]>,
    path: &Path,
) -> anyhow::Result<()> {
    let film = &rendering.film;
    let mut metadata = output::metadata(&job.world.scene.film, job.settings());
    metadata.push(("lumiris:scene".to_owned(), args.scene.scene.display().to_string()));
    metadata.push(("lumiris:accel".to_owned(), <&str>::from(args.scene.accel).to_owned()));
    if !plan.settings.is_empty() {
        metadata.push(("lumiris:plan".to_owned(), plan.text()?));
    }
    metadata.push(("lumiris:complete".to_owned(), rendering.complete.to_string()));
    let done = || film.pixels.iter().map(|p| p.count);
    let range = format!("{} to {} per pixel", done().min().unwrap_or(0), done().max().unwrap_or(0));
    metadata.push(("lumiris:samples_done".to_owned(), range));
    metadata.push(("lumiris:seconds".to_owned(), format!("{:.3}", rendering.elapsed.as_secs_f64())));
    let aovs: Vec<Aov> = match asked {
        Some(list) => list.to_vec(),
        None => {
            let ratio = job.sample_count_map.as_ref().map(|_| Aov::Ratio);
            let records = rendering.cache.map(|_| Aov::Records);
            Aov::ALL.into_iter().chain(ratio).chain(records).collect()
        }
    };
    write_image(path, film, (&aovs, job.sample_count_map.as_ref()), args.exposure, metadata)
}

/// Writes an image: all channels or a tone-mapped one, as its name says.
pub(super) fn write_image(
    path: &Path,
    film: &Film,
    (aovs, sample_count_map): (&[Aov], Option<&SampleCountMap>),
    exposure: f32,
    metadata: Vec<(String, String)>,
) -> anyhow::Result<()> {
    let (width, height) = (film.bounds.width() as usize, film.bounds.height() as usize);
    let part = if extension(path) == "exr" {
        let channels = output::channels(film, aovs, sample_count_map);
        Part::linear(width, height, channels.names, channels.data)
    } else {
        let names = ["R", "G", "B"].map(str::to_owned).to_vec();
        Part::display(width, height, names, output::display(film, exposure))
    };
    let full = [film.resolution[0] as usize, film.resolution[1] as usize];
    let part = part.with_metadata(metadata).with_window([film.bounds.x0 as usize, film.bounds.y0 as usize], full);
    oiio::write_image(path, &[part])?;
    Ok(())
}

fn stats(args: &RenderArgs, job: &RenderJob, rendering: &Rendering, setup: SetupTimes) -> serde_json::Value {
    let s = &rendering.stats;
    let d = &s.direct;
    let seconds = |t: Duration| t.as_secs_f64();
    let mrays = |count: u64, t: Duration| count as f64 / seconds(t).max(1e-12) * 1e-6;
    let accel = job.world.accel.stats();
    let metadata: serde_json::Map<_, _> =
        output::metadata(&job.world.scene.film, job.settings()).into_iter().map(|(k, v)| (k, v.into())).collect();
    json!({
        "scene": args.scene.scene.display().to_string(),
        "settings": metadata,
        "accel": <&str>::from(args.scene.accel),
        "threads": rendering.threads,
        "complete": rendering.complete,
        "invalid_samples": rendering.film.pixels.iter().map(|p| p.invalid).sum::<u64>(),
        "relative_noise": rendering.film.relative_noise(),
        "seconds": {
            "load": setup.load, "build": setup.build, "render": seconds(rendering.elapsed),
        },
        "thread_seconds": {
            "camera_rays": seconds(s.camera_time), "bounce_rays": seconds(s.bounce_time), "shade": seconds(s.shade_time),
            "t1_propose": seconds(d.t1), "select_resolve": seconds(d.select), "t2_trace": seconds(d.t2),
            "ocv_solve": seconds(d.solve),
        },
        "counts": {
            "replica_pixels": rendering.film.replicas.len(), "camera_rays": s.camera_rays, "bounce_rays": s.bounce_rays, "proposals": d.proposals,
            "emitter_rays": d.emitter_rays, "shadow_segments": d.segments,
            "ocv_systems": d.systems, "ocv_ill_conditioned": d.ill_conditioned,
        },
        "rates": {
            "camera_mrays_per_second": mrays(s.camera_rays, s.camera_time),
            "bounce_mrays_per_second": mrays(s.bounce_rays, s.bounce_time),
            "shadow_mrays_per_second": mrays(d.segments, d.t2),
            "nanoseconds_per_proposal": seconds(d.t1) * 1e9 / (d.proposals.max(1) as f64),
        },
        "memory": {
            "accel_bytes": accel.bytes, "accel_peak_bytes": accel.peak_bytes,
        },
        "photon_maps": rendering.photons.map(|p| photon_stats(&p)),
        "irradiance_cache": rendering.cache.map(|c| cache_stats(&c)),
    })
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

fn report(args: &RenderArgs, rendering: &Rendering, outputs: &[PathBuf]) {
    if args.quiet {
        return;
    }
    let names: Vec<String> = outputs.iter().map(|p| p.display().to_string()).collect();
    let spp = rendering.film.pixels.iter().map(|p| p.count).filter(|n| *n > 0).min().unwrap_or(0);
    let partial = if rendering.complete { "" } else { " (stopped early)" };
    progress::say(&format!(
        "{} after {:.1} s, {spp} samples per pixel{partial}, noise {:.2} %",
        names.join(", "),
        rendering.elapsed.as_secs_f64(),
        rendering.film.relative_noise() * 100.0
    ));
    if let Some(c) = &rendering.cache {
        progress::say(&format!(
            "irradiance cache: {} records in {:.1} s, {:.2} % cache misses in {} lookups",
            c.records,
            c.build.elapsed.as_secs_f64(),
            100.0 * c.lookups.misses as f64 / c.lookups.lookups.max(1) as f64,
            c.lookups.lookups
        ));
    }
    if let Some(p) = &rendering.photons {
        progress::say(&format!(
            "photon maps: {} global and {} caustic photons from {} photon paths in {:.1} s, {:.1} MB{}",
            p.global,
            p.caustic,
            p.paths,
            (p.tracing + p.sorting).as_secs_f64(),
            p.bytes as f64 * 1e-6,
            if p.maps > 1 { format!(", {} maps", p.maps) } else { String::new() }
        ));
    }
    let invalid: u64 = rendering.film.pixels.iter().map(|p| p.invalid).sum();
    if invalid > 0 {
        progress::say(&format!("warning: {invalid} samples were not finite, or too bright, and were counted as black"));
    }
}
