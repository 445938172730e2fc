//! Builds the visibility cache before rendering, if the settings need it [Keller and Wald 2000, §3].
//!
//! Photon paths start at the lights that matter for the visible part of the scene. Importons emitted by the camera
//! choose lights by the light tree, and the chosen lights get most of the photon paths. Time and resolution of the
//! cache are therefore independent of the number of lights elsewhere.

use super::constants::{IMPORTON_DEPTH, IMPORTON_PATHS, PHOTON_PATHS, UNIFORM_FRACTION};
use crate::lights::{LightCtx, PathCount, PrimaryPhoton, SurfacePoint, VisibilityCache};
use crate::photons::{Photon, PhotonBudget, Tracing, importons, trace_photons};
use crate::scene::RenderJob;
use crate::settings::IntegratorKind;
use lumiris_numbers::math::hash::{pcg4d, unit_f32};

const IMPORTON_SEED: u32 = 0x6c69_6768;

/// Traces photons from the lights to the first surface, on all threads of the current pool. `None` if no photon
/// hits a surface; estimators then work without a cache.
pub fn build_visibility_cache(job: &RenderJob) -> Option<VisibilityCache> {
    // Choose lights at visible points
    let lights = &job.lights;
    let paths = job.settings().integrator.photons.visibility_photons.map_or(PHOTON_PATHS, u64::from);
    let visible = visible_points(job);
    let weights = weights_at(job, &visible);

    // Trace photons
    let tracing = Tracing {
        seed: job.settings().sampling.seed,
        max_depth: 0,
        max_global_depth: 0,
        floor: UNIFORM_FRACTION,
        light_weights: weights.as_deref(),
        ..Tracing::default()
    };
    let traced = trace_photons(job, &tracing, None, PhotonBudget::Paths(paths)).ok()?;
    let primary: Vec<PrimaryPhoton> = traced.global.iter().filter_map(primary_photon).collect();
    if primary.is_empty() {
        return None;
    }

    // Build the cache
    let distribution = tracing.light_distribution(lights)?;
    let paths = lights.lit.iter().map(|&light| PathCount { light, paths: paths as f32 * distribution.pmf(light) });
    Some(VisibilityCache::adapted(&visible, &primary, lights.scene_radius).with_paths(paths))
}

/// Points visible to the camera, directly or after bounces: where importons arrive.
pub(super) fn visible_points(job: &RenderJob) -> Vec<SurfacePoint> {
    let settings = job.settings();
    let depth = match settings.integrator.kind {
        IntegratorKind::Direct => 0,
        IntegratorKind::Path | IntegratorKind::IrradianceCache | IntegratorKind::PhotonMap => {
            settings.integrator.max_depth.saturating_sub(1).min(IMPORTON_DEPTH)
        }
    };
    let importons = importons(job, settings.sampling.seed, IMPORTON_PATHS, depth);
    importons.iter().map(surface_point).collect()
}

fn surface_point(photon: &Photon) -> SurfacePoint {
    SurfacePoint { p: photon.p(), n: photon.n() }
}

fn primary_photon(photon: &Photon) -> Option<PrimaryPhoton> {
    Some(PrimaryPhoton { at: surface_point(photon), light: photon.light()? })
}

/// How often the light tree chooses each light at the given points; `None` if it chooses none.
fn weights_at(job: &RenderJob, points: &[SurfacePoint]) -> Option<Vec<f32>> {
    let lights = &job.lights;
    let tree = lights.tree_choice();
    let mut weights = vec![0.0; lights.lights.len()];
    for (i, &SurfacePoint { p, n }) in (0..).zip(points) {
        let [u, ..] = pcg4d([i, job.settings().sampling.seed, IMPORTON_SEED, 0]).map(unit_f32);
        if let Some(choice) = tree.sample(&LightCtx::on(p, n), u) {
            weights[choice.light as usize] += 1.0;
        }
    }
    weights.iter().any(|&weight| weight > 0.0).then_some(weights)
}
