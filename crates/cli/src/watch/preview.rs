//! A preview before the pilots run.

use super::canvas::Canvas;
use lumiris::film::Film;
use lumiris::render::{Continuation, RenderError, RenderSettings, resume};
use lumiris::scene::RenderJob;
use lumiris::settings::IntegratorKind;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

/// Maximum time of the preview.
const LONGEST: Duration = Duration::from_millis(500);
/// Inverse of the preview's maximum share of the image's time limit.
const PART: u32 = 20;

/// Shows tiles with one sample per pixel, until the time is over. They are not part of the image.
pub(crate) fn preview(
    canvas: &Arc<Canvas>,
    job: &RenderJob,
    settings: &RenderSettings,
    stop: &AtomicBool,
) -> Result<(), RenderError> {
    // Other integrators need longer preparations
    if !matches!(job.settings().integrator.kind, IntegratorKind::Direct | IntegratorKind::Path) {
        return Ok(());
    }
    let (start, is_over) = (Instant::now(), AtomicBool::new(false));
    let time = settings.time_limit.map_or(LONGEST, |limit| LONGEST.min(limit / PART));
    let set_tile = |tile: &Film| {
        canvas.set_tile(tile);
        if start.elapsed() >= time || stop.load(Ordering::Relaxed) {
            is_over.store(true, Ordering::Relaxed);
        }
    };
    let first = RenderSettings { spp: 1, skip: 0, share: None, time_limit: None, ..*settings };
    let watched = Continuation { watch: Some(&set_tile), ..Continuation::default() };
    resume(job, &first, &is_over, &|_| (), watched).map(drop)
}
