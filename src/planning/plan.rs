//! Completes the open settings of a job: the steps in their order, and the record of the choices.

use super::preparation::{PlanError, Preparation, thread_pool};
use super::visibility_cache::build_visibility_cache;
use super::{allocation, proposals, rule};
use crate::integrators::exclusions::{self, OPTIONAL};
use crate::scene::RenderJob;
use crate::settings::table::rows;
use crate::settings::{Allocation, EstimatorKind, Settings};

/// Choices made for an image where its settings were open.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Plan {
    /// The chosen settings, by their names in metadata. Rendering with them gives a bit-identical image.
    pub chosen: Vec<(&'static str, String)>,
    /// Warnings about settings without effect.
    pub warnings: Vec<String>,
}

/// Completes the open settings of `job`. Fails if no image is possible.
pub fn prepare(job: &mut RenderJob, how: &Preparation<'_>) -> Result<Plan, PlanError> {
    if let Some(conflict) = exclusions::refusal(job, &job.settings().integrator) {
        return Err(conflict.into());
    }
    let open = *job.settings();
    let mut plan = match how.until_deadline(|how| complete(job, how)) {
        Err(PlanError::Stopped) if how.goes_on().is_ok() => {
            job.change(|s| (s.sampling.allocation, s.sampling.noise) = (Allocation::Uniform, None));
            let plan = complete(job, how)?;
            let given_up = "the pilots did not finish in time: all pixels have the same number of samples".to_owned();
            Plan { warnings: [vec![given_up], plan.warnings].concat(), ..plan }
        }
        result => result?,
    };
    plan.chosen = chosen(&open, job.settings());
    Ok(plan)
}

/// True if settings ask for pilots, which take a part of the time of the image.
pub fn has_pilot(settings: &Settings) -> bool {
    let sampling = &settings.sampling;
    settings.integrator.estimator == EstimatorKind::Auto
        || sampling.allocation == Allocation::Adaptive
        || sampling.noise.is_some()
}

/// Makes the choices, but does not record them in the plan.
fn complete(job: &mut RenderJob, how: &Preparation<'_>) -> Result<Plan, PlanError> {
    let pool = thread_pool(how.threads)?;
    (how.observe)("measuring facts of the scene", None);
    pool.install(|| rule::apply(job));
    if job.settings().sampling.allocation == Allocation::Auto {
        job.change(|s| s.sampling.allocation = Allocation::Uniform);
    }
    if job.settings().integrator.uses_visibility_cache() && job.lights.visibility_cache().is_none() {
        (how.observe)("building the visibility cache", None);
        let cache = pool.install(|| build_visibility_cache(job));
        job.lights.set_visibility_cache(cache);
    }
    how.goes_on()?;
    pool.install(|| proposals::choose(job, how));
    job.pixel_samples = pool.install(|| allocation::allocate(job, how))?;
    Ok(Plan { chosen: Vec::new(), warnings: warnings(job) })
}

/// Warnings about requested features that the scene does not allow. Settings that do not apply are reported elsewhere.
fn warnings(job: &RenderJob) -> Vec<String> {
    let settings = &job.settings().integrator;
    let applies = |flag: &str| rows().any(|row| row.flag == flag && row.applies.to(job.settings()));
    let wanted = OPTIONAL.iter().filter(|(feature, flag, _)| feature.is_wanted(job, settings) && applies(flag));
    let warning =
        |(feature, _, without): &_| Some(format!("{without}: {}", exclusions::conflict(job, settings, *feature)?));
    wanted.filter_map(warning).collect()
}

/// Settings that differ from `before`, by value or by their record in metadata. A choice whose record equals the record
/// of the open setting is included: otherwise it would be open again.
fn chosen(before: &Settings, after: &Settings) -> Vec<(&'static str, String)> {
    let recorded: Vec<_> = before.recorded().collect();
    let is_set = |key: &str| rows().any(|row| row.key == key && (row.get)(before) != (row.get)(after));
    let is_chosen = |entry: &(&str, _)| !recorded.contains(entry) || is_set(entry.0);
    after.recorded().filter(is_chosen).map(|(key, value)| (key, value.to_string())).collect()
}
