//! From typed options to a world that is ready to render.

use super::args::SceneArgs;
use super::progress;
use anyhow::{Context, bail};
use lumiris::film::filter::PixelFilter;
use lumiris::import::{LoadOptions, load};
use lumiris::render::RenderSettings;
use lumiris::render::plan::prepare;
use lumiris::scene::{Scene, World};
use lumiris::settings::{Proposals, Split, StageTimes};
use std::time::Instant;

/// Seconds of what happens before the first ray.
#[derive(Clone, Copy, Debug)]
pub struct SetupTimes {
    /// Reading files.
    pub load: f64,
    /// Building ray tracers.
    pub build: f64,
}

/// Loads the scene and applies the options; warnings are printed unless `quiet`.
pub fn load_scene(args: &SceneArgs) -> anyhow::Result<Scene> {
    let options = LoadOptions { resolution: args.resolution, crop: args.crop };
    let loaded = match load(&args.scene, &options) {
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
    let mut scene = loaded.scene;
    apply(args, &mut scene);
    if scene.integrator.leaves_lights_out() {
        progress::say("warning: without samples on the lights that no photon came from, direct light is biased");
    }
    Ok(scene)
}

fn apply(args: &SceneArgs, scene: &mut Scene) {
    let mut settings = scene.settings();
    args.settings.apply(&mut settings);
    scene.set(settings);
    if args.box_filter {
        scene.film.filter = PixelFilter::Box { rx: 0.5, ry: 0.5 };
    }
}

/// Loads the scene and builds its ray tracers.
pub fn load_world(args: &SceneArgs) -> anyhow::Result<(World, SetupTimes)> {
    let start = Instant::now();
    let scene = load_scene(args)?;
    let load = start.elapsed().as_secs_f64();
    let start = Instant::now();
    let world = World::new(scene, args.accel, args.packet_width)
        .with_context(|| format!("cannot build the ray tracer of {}", args.scene.display()))?;
    Ok((world, SetupTimes { load, build: start.elapsed().as_secs_f64() }))
}

/// Chooses the numbers of samples and proposals that are still open, and says what it chose unless `quiet`.
pub fn plan(args: &SceneArgs, world: &mut World, ratio_map: bool, quiet: bool) -> anyhow::Result<()> {
    let threads = args.threads.map(|t| t as usize);
    if let (Some(plan), false) = (prepare(world, threads, ratio_map)?, quiet) {
        let Split { samples, proposals } = plan.split;
        let StageTimes { t1, t2 } = plan.times;
        let by_pixel =
            if world.scene.integrator.ris.proposals == Proposals::Optimal { ", split anew in each pixel" } else { "" };
        progress::say(&format!(
            "ris: {samples} of {proposals} proposals are traced{by_pixel} (a proposal takes {t1} ns, a sample {t2} ns)"
        ));
    }
    Ok(())
}

/// How the options say to render.
pub fn render_settings(args: &SceneArgs, world: &World) -> RenderSettings {
    RenderSettings {
        threads: args.threads.map(|t| t as usize),
        tile_size: args.tile_size,
        spp: world.scene.sampling.spp,
        ..RenderSettings::default()
    }
}
