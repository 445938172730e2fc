//! The rule by which the estimator `auto` chooses settings. Its inputs are [facts](super::facts) of the scene and no
//! measured times, so a scene has the same image on all machines.
//!
//! | scene | choice |
//! |---|---|
//! | direct light | `mis` with 8 samples |
//! | paths of ≤ 8 bounces among diffuse surfaces, indoors | 4 samples, 3 later, shared by 6 × 6 pixels, no roulette |
//! | the same, outdoors | 6 samples, 3 later, shared by 4 × 4 pixels, no roulette |
//! | longer paths among diffuse surfaces | 3 samples, 2 later, shared by 4 × 4 pixels |
//! | other paths, mostly of surfaces that are not diffuse | 8 samples, 3 of them from the BSDF, 2 later |
//! | sky and lamps | fraction of the light samples for the sky: its fraction of the light |
//! | 16 lights or more, three in four of their samples occluded | `contributing`, with 4 samples of direct light |
//! | metal or glass, and lamps | one light path per four camera samples |
//!
//! Evidence: [docs/measurements/efficiency](../../../docs/measurements/efficiency/README.md). Given settings stay.

use super::constants::{
    CONTRIBUTING_SAMPLES, DIRECT_SAMPLES, FEW_BOUNCES, GLOSSY_BSDF, INDOORS, LIGHT_PATHS, LONG, MANY_LIGHTS, MIN_PAIRS,
    MOST_HIDDEN, OPEN, OTHERS, OUTDOORS, SKY_FRACTIONS, UNSHARED,
};
use super::facts::Facts;
use super::visibility_cache::build_visibility_cache;
use crate::integrators::exclusions::{self, Feature};
use crate::scene::RenderJob;
use crate::settings::{Allocation, ContributingSettings, EstimatorKind, IntegratorKind, IntegratorSettings, Settings};

/// Chooses the open settings of `job` if its estimator is `auto`. Runs on the threads of the current pool.
pub(super) fn apply(job: &mut RenderJob) {
    let Settings { integrator: base, sampling } = *job.settings();
    if base.estimator != EstimatorKind::Auto {
        return;
    }
    job.change(|s| s.integrator.estimator = EstimatorKind::Mis);
    if sampling.allocation == Allocation::Auto {
        job.change(|s| s.sampling.allocation = Allocation::Adaptive);
    }
    if !matches!(base.kind, IntegratorKind::Direct | IntegratorKind::Path) {
        return;
    }
    // Emitting media are lights only if the path continues by the one BSDF sample
    if job.lights.samples_volumes() && base.bsdf_fraction.is_none() {
        job.change(|s| s.integrator.bsdf_fraction = Some(0.0));
    }
    let facts = Facts::of(job);
    let shares = sampling.allocation == Allocation::Auto && exclusions::allows(job, Feature::Sharing);
    job.change(|s| s.integrator = with_samples(&s.integrator, &facts, shares));
    if facts.lights >= MANY_LIGHTS && facts.hidden >= MOST_HIDDEN && !job.lights.samples_volumes() {
        choose_contributing(job, &base);
    }
    if base.light_paths.is_none()
        && job.world.scene.materials.make_caustics()
        && exclusions::allows(job, Feature::LightPaths)
    {
        job.change(|s| s.integrator.light_paths = Some(LIGHT_PATHS));
    }
}

/// `mis` with the sample counts for a scene with these facts, where they are open.
fn with_samples(settings: &IntegratorSettings, facts: &Facts, shares: bool) -> IntegratorSettings {
    let mut s = *settings;
    let is_mixed = facts.lights > 1 && facts.sky > 0.0 && facts.sky < 1.0;
    if is_mixed && s.infinite_fraction.is_none() {
        let off = |fraction: &f32| (f64::from(*fraction) - facts.sky).abs();
        s.infinite_fraction = SKY_FRACTIONS.into_iter().min_by(|a, b| off(a).total_cmp(&off(b)));
    }
    if s.depth() <= 1 {
        s.samples = s.samples.or(Some(DIRECT_SAMPLES));
        return s;
    }
    let has_pairs = facts.diffuse_pairs >= MIN_PAIRS;
    let is_long = s.depth() > FEW_BOUNCES;
    let is_outdoors = facts.sky > 0.0 && facts.open >= OPEN;
    let chosen = match (shares && has_pairs, is_long, is_outdoors) {
        (false, ..) => UNSHARED,
        (true, true, _) => LONG,
        (true, false, true) => OUTDOORS,
        (true, false, false) => INDOORS,
    };
    // The path continues by the one BSDF sample of later vertices
    if chosen == UNSHARED && s.samples.is_none() && s.later_samples.is_none() {
        s.bsdf_fraction = s.bsdf_fraction.or(Some(GLOSSY_BSDF));
    }
    s.samples = s.samples.or(Some(chosen.first));
    s.later_samples = s.later_samples.or(Some(chosen.later));
    s.path_reuse = s.path_reuse.or(Some(chosen.edge));
    // A shared path serves many pixels, so roulette does not pay
    let is_default = s.roulette_depth == IntegratorSettings::default().roulette_depth;
    if s.path_reuse.is_some_and(|edge| edge > 1) && !is_long && is_default {
        s.roulette_depth = None;
    }
    s
}

/// Chooses `contributing`, if it is possible and photons arrive. `base` are the given settings.
fn choose_contributing(job: &mut RenderJob, base: &IntegratorSettings) {
    let before = job.settings().integrator;
    let depth = before.depth();
    let s = IntegratorSettings { estimator: EstimatorKind::Contributing, ..before };
    if s.leaves_lights_out() || exclusions::refusal(job, &s).is_some() {
        return;
    }
    let Some(cache) = build_visibility_cache(job) else { return };
    job.lights.set_visibility_cache(Some(cache));
    let others = s.contributing.noncontributing_samples.or(Some(OTHERS[usize::from(depth > 1)]));
    let contributing = ContributingSettings { noncontributing_samples: others, ..s.contributing };
    let samples = if depth > 1 { s.samples } else { base.samples.or(Some(CONTRIBUTING_SAMPLES)) };
    job.change(|all| all.integrator = IntegratorSettings { contributing, samples, ..s });
}
