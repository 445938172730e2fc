//! From typed options to a world that is ready to render.

use super::args::{SamplesArg, SceneArgs};
use super::progress;
use anyhow::{Context, bail};
use lumiris::film::filter::PixelFilter;
use lumiris::import::{LoadOptions, load};
use lumiris::render::RenderSettings;
use lumiris::render::plan::prepare;
use lumiris::scene::{IntegratorKind, Proposals, Scene, Split, StageTimes, World};
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
    let i = &mut scene.integrator;
    if let Some(kind) = args.integrator {
        i.kind = kind.value();
    }
    if let Some(depth) = args.max_depth {
        i.max_depth = depth;
    } else if i.kind == IntegratorKind::Direct {
        i.max_depth = 1;
    }
    if let Some(estimator) = args.estimator {
        i.estimator = estimator.value();
    }
    if let Some(samples) = args.samples {
        i.samples = match samples {
            SamplesArg::Fixed(n) => Some(n),
            SamplesArg::Auto => None,
        };
    }
    if let Some(proposals) = args.proposals {
        i.ris.proposals = proposals;
    }
    if let Some(strata) = args.strata {
        i.ris.strata = strata.value();
    }
    if let Some(points) = args.proposal_points {
        i.ris.points = points.value();
    }
    if let Some(target) = args.target {
        i.ris.target = target.value();
    }
    if let Some(times) = args.stage_times {
        i.ris.stage_times = Some(times);
    }
    if let Some(form) = args.ocv {
        i.ocv.form = form.value();
    }
    if let Some(form) = args.optimal_mis {
        i.optimal_mis = form.value();
    }
    if let Some(form) = args.correlated {
        i.correlated.form = form.value();
    }
    if let Some(technique) = args.technique {
        i.correlated.technique = technique.value();
    }
    if let Some(rest) = args.rest_samples {
        i.contributing.rest_samples = rest;
    }
    if let Some(components) = args.components {
        i.ocv.components = Some(components);
    }
    if let Some(share) = args.bsdf_share {
        i.bsdf_share = share;
    }
    if let Some(cached) = args.cached {
        i.cache.cached = cached.value();
    }
    if let Some(error) = args.cache_error {
        i.cache.error = error;
    }
    if let Some(radius) = args.cache_radius {
        i.cache.radius = radius;
    }
    if let Some(samples) = args.cache_samples {
        i.cache.samples = samples;
    }
    if let Some(passes) = args.cache_passes {
        i.cache.passes = passes;
    }
    args.photons.apply(&mut i.photons);
    if let Some(heuristic) = args.heuristic {
        i.heuristic = Some(heuristic.value());
    }
    if let Some(choice) = args.light_choice {
        i.light_choice = choice.value();
        scene.lights.set_kind(i.light_choice);
    }
    if let Some(proposals) = args.bsdf_proposals {
        i.bsdf_proposals = proposals;
    }
    if let Some(density) = args.bsdf_density {
        i.bsdf_density = density.value();
        scene.materials.set_proposal_density(i.bsdf_density);
    }
    if let Some(spp) = args.spp {
        scene.sampling.spp = spp;
    }
    if let Some(sampler) = args.sampler {
        scene.sampling.sampler = sampler.value();
    }
    if let Some(seed) = args.seed {
        scene.sampling.seed = seed;
    }
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
    let world = World::new(scene, args.accel.value(), args.packet_width)
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
