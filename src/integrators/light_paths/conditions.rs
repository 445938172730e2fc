//! Which images light paths help to render.

use crate::direct::Estimator;
use crate::integrators::light_layers;
use crate::lights::Light;
use crate::scene::RenderJob;
use crate::settings::{IntegratorKind, IntegratorSettings};

/// Why light paths cannot help to render this image.
pub fn obstacle(job: &RenderJob) -> Option<&'static str> {
    obstacle_of(job, &job.settings().integrator)
}

/// Why they cannot with these settings.
pub fn obstacle_of(job: &RenderJob, settings: &IntegratorSettings) -> Option<&'static str> {
    let scene = &job.world.scene;
    let is_cut_out = scene.geometry.geometries.iter().any(|g| g.alpha.is_some());
    let has_motion = scene.geometry.has_motion() || scene.camera.is_moving();
    let has_area_lights =
        scene.lights.lit.iter().any(|&light| matches!(scene.lights.lights[light as usize], Light::Area(_)));
    let reasons = [
        (settings.kind != IntegratorKind::Path, "only the integrator path has camera paths to share with them"),
        (settings.depth() < 3, "paths of less than three bounces leave nothing to them"),
        (!extends_by_sample(settings), "they share light with mis of one BSDF sample only"),
        (!has_area_lights, "there are no area lights"),
        (!scene.camera.projects(), "only a perspective camera knows where it sees a point"),
        (scene.film.filter.sampler().is_point(), "the pixel filter has no extent"),
        (!scene.media.is_empty(), "there are media"),
        (job.shadows_pass(), "there are surfaces that rays may pass"),
        (scene.materials.has_dispersion(), "paths may have wavelengths"),
        (light_layers::count(job) > 0, "light groups have layers (--light-groups none: they have not)"),
        (has_motion || is_cut_out, "what a ray meets varies with time or is cut out at random"),
    ];
    reasons.into_iter().find(|(holds, _)| *holds).map(|(_, reason)| reason)
}

/// True if the BSDF sample of each vertex beyond the first is the next segment of the path, which finds the emitters.
fn extends_by_sample(settings: &IntegratorSettings) -> bool {
    (1..settings.depth().saturating_sub(1)).all(|vertex| match Estimator::at_vertex(settings, vertex) {
        Estimator::Mis(mis) => mis.samples >= 2 && mis.has_one_bsdf_sample(mis.samples),
        _ => false,
    })
}

/// Light paths per camera sample; 0 where there are none.
pub fn per_sample(job: &RenderJob) -> f32 {
    let wanted = job.settings().integrator.light_paths.unwrap_or(0.0);
    if wanted > 0.0 && obstacle(job).is_none() { wanted } else { 0.0 }
}
