//! Entry points: renders a job from its first sample, or from the sums of an earlier rendering.

use super::continuation::Continuation;
use super::render_error::RenderError;
use super::render_settings::RenderSettings;
use super::rendering::{Progress, Rendering};
use super::run::Run;
use crate::integrators::exclusions::{self, Feature};
use crate::integrators::reuse;
use crate::planning::preparation::thread_pool;
use crate::scene::RenderJob;
use std::sync::atomic::AtomicBool;

/// Renders a job. `stop` ends the rendering after the current tiles. `observe` is called from worker threads.
pub fn render(
    job: &RenderJob,
    settings: &RenderSettings,
    stop: &AtomicBool,
    observe: &(dyn Fn(&Progress) + Sync),
) -> Result<Rendering, RenderError> {
    resume(job, settings, stop, observe, Continuation::default())
}

/// Like [`render`], but resumes from the sums of an earlier rendering.
pub fn resume(
    job: &RenderJob,
    settings: &RenderSettings,
    stop: &AtomicBool,
    observe: &(dyn Fn(&Progress) + Sync),
    continuation: Continuation<'_>,
) -> Result<Rendering, RenderError> {
    let is_divided = settings.share.is_some() && reuse::edge(job) > 1;
    let division = is_divided.then(|| exclusions::between(Feature::Sharing, Feature::TileShare)).flatten();
    if let Some(conflict) = exclusions::refusal(job, &job.settings().integrator).or(division) {
        return Err(conflict.into());
    }

    // Render in a thread pool of this rendering
    let pool = thread_pool(settings.threads)?;
    let threads = pool.current_num_threads();
    pool.install(|| Run::new(job, settings, stop, observe).run(threads, continuation))
}
