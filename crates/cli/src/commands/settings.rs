//! From command-line options to a render job.

use super::args::SceneArgs;
use super::progress;
use anyhow::{Context, bail};
use lumiris::film::filter::PixelFilter;
use lumiris::import::{LoadOptions, Loaded, load};
use lumiris::render::RenderSettings;
use lumiris::render::plan::prepare;
use lumiris::scene::RenderJob;
use lumiris::settings::{Proposals, SampleCounts, StageTimes};
use std::time::Instant;

/// Times before the first ray is traced (s).
#[derive(Clone, Copy, Debug)]
pub(super) struct SetupTimes {
    /// Reading files.
    pub load: f64,
    /// Building ray tracers.
    pub build: f64,
}

/// Loads the scene and applies the options; prints warnings.
fn load_scene(args: &SceneArgs) -> anyhow::Result<Loaded> {
    let options = LoadOptions { resolution: args.resolution, crop: args.crop };
    let mut loaded = match load(&args.scene, &options) {
        Ok(loaded) => loaded,
        Err(diagnostics) => {
            progress::say(diagnostics.to_string().trim_end());
            bail!("{} could not be loaded", args.scene.display());
        }
    };
    let warnings = loaded.warnings.to_string();
    if !warnings.is_empty() {
        progress::say(warnings.trim_end());
    }
    args.settings.apply(&mut loaded.settings);
    if args.box_filter {
        loaded.scene.film.filter = PixelFilter::Box { rx: 0.5, ry: 0.5 };
    }
    if loaded.settings.integrator.leaves_lights_out() {
        progress::say("warning: without samples on non-contributing lights, direct light is biased");
    }
    Ok(loaded)
}

/// Loads the scene and builds its ray tracers.
pub(super) fn load_job(args: &SceneArgs) -> anyhow::Result<(RenderJob, SetupTimes)> {
    let start = Instant::now();
    let loaded = load_scene(args)?;
    let load = start.elapsed().as_secs_f64();
    let start = Instant::now();
    let job = loaded
        .job(args.accel, args.packet_width)
        .with_context(|| format!("cannot build the ray tracer of {}", args.scene.display()))?;
    Ok((job, SetupTimes { load, build: start.elapsed().as_secs_f64() }))
}

/// Chooses the sample counts that are still open, and prints them unless `quiet`.
pub(super) fn plan(args: &SceneArgs, job: &mut RenderJob, ratio_map: bool, quiet: bool) -> anyhow::Result<()> {
    let threads = args.threads.map(|t| t as usize);
    if let (Some(plan), false) = (prepare(job, threads, ratio_map)?, quiet) {
        let SampleCounts { samples, proposals } = plan.sample_counts;
        let StageTimes { t1, t2 } = plan.times;
        let is_optimal = job.settings().integrator.ris.proposals == Proposals::Optimal;
        let by_pixel = if is_optimal { ", chosen anew in each pixel" } else { "" };
        progress::say(&format!(
            "ris: {samples} of {proposals} proposals are traced{by_pixel} (a proposal takes {t1} ns, a sample {t2} ns)"
        ));
    }
    Ok(())
}

/// Render settings from the options.
pub(super) fn render_settings(args: &SceneArgs, job: &RenderJob) -> RenderSettings {
    RenderSettings {
        threads: args.threads.map(|t| t as usize),
        tile_size: args.tile_size,
        spp: job.settings().sampling.spp,
        ..RenderSettings::default()
    }
}
