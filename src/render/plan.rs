//! Completes what the settings leave open until the scene is loaded: the visibility cache, and the number of proposals
//! M for N samples of `ris`.
//!
//! * `auto`: M/N is the most efficient by a model of time and variance, fitted to a pilot of the image ([`super::auto`]).
//!   Where the image is too small for one, M/N = T2/T1, so that both stages take the same time [Talbot 2005, Eq. 4.4]: T1, the
//!   time of a proposal, and T2, that of a sample, are measured on a few thousand camera rays.
//! * `optimal`: the same time per estimate, but M and N chosen in each pixel by the variances of its own light [Talbot
//!   2005, Eq. 4.3], which a pilot estimates from proposals that are all traced.
//!
//! Times vary from run to run; so the chosen counts are recorded in the image's metadata, and rendering with them gives
//! the same image to the bit.

use super::allocation::allocate;
use super::auto::{self, AutoChoice};
use super::control_pilot;
pub use super::preparation::Preparation;
use super::visibility_cache::build_visibility_cache;
use super::{RenderError, RenderSettings, Run, ThreadError, camera_batches};
use crate::direct::Fits;
use crate::film::PixelBounds;
use crate::integrators::path::CameraSample;
use crate::integrators::{PathTracer, Tracer, light_layers, light_paths, reuse, through_media};
use crate::scene::{RenderJob, SampleCountMap};
use crate::settings::table::rows;
use crate::settings::{
    Allocation, EstimatorKind, IntegratorKind, IntegratorSettings, Proposals, RisSettings, SampleCounts, Settings,
    StageTimes, Strata, Target,
};
use lumiris_numbers::estimators::ris::choice::{Costs, MomentsEstimate, Variances, clamp_ratio, optimal_ratio};
use lumiris_numbers::estimators::stats::median;
use rayon::prelude::*;
use std::sync::atomic::AtomicBool;
use std::time::{Duration, Instant};

/// Camera rays on which times are measured.
const TIMING_RAYS: usize = 8192;
/// Sample counts of the estimates that are timed: few and many.
const TIMING: [SampleCounts; 2] =
    [SampleCounts { samples: 1, proposals: 8 }, SampleCounts { samples: 5, proposals: 40 }];
/// Camera samples per pixel of the pilot, and its proposals per estimate, all of which are traced.
const PILOT_SPP: u32 = 2;
const PILOT_PROPOSALS: u32 = 32;
/// Variances are averaged over this many pixels to each side.
const PILOT_RADIUS: u32 = 2;
/// Seed of the pilot. It must not use the random numbers of the image, whose samples would then depend on the choice.
const PILOT_SEED: u32 = 0x70_69_6c_6f;

/// What was chosen for an image, as far as its settings left it open.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Plan {
    /// What the estimator `auto` is.
    pub auto: Option<AutoChoice>,
    /// M and N of `ris`.
    pub ris: Option<RisChoice>,
    /// The settings that were chosen, by their names in metadata: with these, rendering gives the same image to the bit.
    pub chosen: Vec<(&'static str, String)>,
    /// What the user should know of settings that have no effect.
    pub warnings: Vec<String>,
}

/// The measured times and the chosen counts.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RisChoice {
    /// Times of the stages.
    pub times: StageTimes,
    /// Sample counts; with `optimal` those that define the time of an estimate.
    pub sample_counts: SampleCounts,
}

/// Completes what the settings of `job` leave open, or says why there can be no image.
pub fn prepare(job: &mut RenderJob, how: &Preparation<'_>) -> Result<Plan, RenderError> {
    if let Some(obstacle) = through_media::obstacle(job) {
        return Err(RenderError::Media(obstacle));
    }
    let pool = super::thread_pool(how.threads)?;
    let (before, bounds) = (*job.settings(), job.world.scene.film.bounds);
    if let Some(limit) = how.time_limit.filter(|_| has_pilot(&before, &bounds) && before.sampling.pilot_spp.is_none()) {
        let spp = pool.install(|| samples_in(job, limit));
        job.change(|s| s.sampling.pilot_spp = Some(spp).filter(|&spp| spp < s.sampling.spp));
    }
    let auto = pool.install(|| auto::choose(job, how))?;
    if job.settings().sampling.allocation == Allocation::Auto {
        let is_adaptive = auto.is_some();
        let allocation = if is_adaptive { Allocation::Adaptive } else { Allocation::Uniform };
        job.change(|s| s.sampling.allocation = allocation);
    }
    let settings = job.settings().integrator;
    if settings.uses_visibility_cache() && job.lights.visibility_cache().is_none() {
        let visibility_cache = pool.install(|| build_visibility_cache(job));
        job.lights.set_visibility_cache(visibility_cache.map(|(visibility_cache, _)| visibility_cache));
    }
    pool.install(|| control_pilot::choose(job, how.stop));
    how.goes_on()?;
    let ris = choose_proposals(job, how)?;
    job.pixel_samples = pool.install(|| allocate(job, how.stop));
    how.goes_on()?;
    // Settings that do not apply are said to have no effect where they are given
    let applies = |flag| rows().any(|row| row.flag == flag && row.applies.to(job.settings()));
    let shares_paths = job.settings().integrator.path_reuse.is_some_and(|edge| edge > 1) && applies("path-reuse");
    let obstacle = reuse::obstacle(job).filter(|_| shares_paths);
    let unshared = obstacle.map(|reason| format!("pixels do not share paths: {reason}"));
    let wants_light_paths = job.settings().integrator.light_paths.is_some_and(|n| n > 0.0) && applies("light-paths");
    let obstacle = light_paths::obstacle(job).filter(|_| wants_light_paths);
    let without_light_paths = obstacle.map(|reason| format!("there are no light paths: {reason}"));
    let obstacle = light_layers::obstacle(job).filter(|_| light_layers::is_wanted(job));
    let without_layers = obstacle.map(|reason| format!("light groups have no layers: {reason}"));
    let warnings = unshared.into_iter().chain(without_light_paths).chain(without_layers).collect();
    Ok(Plan { auto, ris, chosen: chosen(&before, job.settings()), warnings })
}

/// True if [`prepare`] makes choices that follow from measured times, for an image with these pixels.
pub fn follows_from_times(settings: &Settings, bounds: &PixelBounds) -> bool {
    auto::is_measured(settings, bounds) || measures_proposals(&settings.integrator)
}

/// True if the number of proposals of `ris` follows from measured times.
fn measures_proposals(settings: &IntegratorSettings) -> bool {
    let is_open = !matches!(settings.ris.proposals, Proposals::Fixed(_)) && settings.ris.stage_times.is_none();
    settings.estimator == EstimatorKind::Ris && is_open
}

/// True if settings ask for pilots, which take a part of the time of the image.
fn has_pilot(settings: &Settings, bounds: &PixelBounds) -> bool {
    let sampling = &settings.sampling;
    settings.integrator.estimator == EstimatorKind::Auto
        || measures_proposals(&settings.integrator)
        || control_pilot::is_open(settings, bounds)
        || sampling.allocation == Allocation::Adaptive
        || sampling.noise.is_some()
}

/// Samples per pixel for which there is time, about, on the threads of the current pool: as long as those of `mis` take.
fn samples_in(job: &RenderJob, limit: Duration) -> u32 {
    let batches = camera_batches(job, RenderSettings::default().tile_size, TIMING_RAYS);
    let settings = IntegratorSettings { estimator: EstimatorKind::Mis, ..job.settings().integrator };
    let trace = || {
        rayon::broadcast(|_| {
            let (mut tracer, mut out) = (PathTracer::default(), Vec::new());
            batches.iter().for_each(|batch| tracer.trace(job, &settings, batch, &mut Fits::default(), &mut out));
        })
    };
    // The first turn fills caches
    let threads = trace().len();
    let start = Instant::now();
    trace();
    let samples = threads as f64 * batches.iter().map(Vec::len).sum::<usize>() as f64;
    let per_second = samples / start.elapsed().as_secs_f64().max(1e-9);
    ((limit.as_secs_f64() * per_second / job.world.scene.film.bounds.area().max(1) as f64) as u32).max(1)
}

/// The settings that differ, either as they are set or by what is recorded of them: where something was open and the choice is
/// what is recorded of open settings, too, it would be measured again.
fn chosen(before: &Settings, after: &Settings) -> Vec<(&'static str, String)> {
    let recorded: Vec<_> = before.recorded().collect();
    let is_set = |key: &str| rows().any(|row| row.key == key && (row.get)(before) != (row.get)(after));
    let is_chosen = |entry: &(&str, _)| !recorded.contains(entry) || is_set(entry.0);
    after.recorded().filter(is_chosen).map(|(key, value)| (key, value.to_string())).collect()
}

/// Chooses M and N of `ris`, if they are open.
fn choose_proposals(job: &mut RenderJob, how: &Preparation<'_>) -> Result<Option<RisChoice>, RenderError> {
    let Preparation { threads, ratio_map, .. } = *how;
    let settings = job.settings().integrator;
    let is_open = !matches!(settings.ris.proposals, Proposals::Fixed(_));
    if settings.estimator != EstimatorKind::Ris || !is_open && !ratio_map {
        return Ok(None);
    }

    // By a pilot, or times alone; without light they do not matter
    let is_open = settings.ris.proposals == Proposals::Auto && settings.ris.stage_times.is_none();
    let pool = super::thread_pool(threads)?;
    let by_pilot = if is_open { pool.install(|| auto::proposals(job, how))? } else { None };
    let times = by_pilot.map(|(_, times)| times).or(settings.ris.stage_times).or_else(|| measure(job));
    let times = times.unwrap_or(StageTimes { t1: 1.0, t2: 1.0 });

    // Numbers
    let is_optimal = settings.ris.proposals == Proposals::Optimal;
    let by_times = IntegratorSettings { ris: RisSettings { stage_times: Some(times), ..settings.ris }, ..settings }
        .sample_counts();
    let sample_counts = by_pilot.map_or(by_times, |(proposals, _)| SampleCounts { proposals, ..by_times });
    job.change(|s| {
        s.integrator.ris.stage_times = Some(times);
        s.integrator.samples = Some(sample_counts.samples);
        if !is_optimal {
            s.integrator.ris.proposals = Proposals::Fixed(sample_counts.proposals);
        }
    });
    job.sample_count_map = None;
    if is_optimal || ratio_map {
        job.sample_count_map = Some(sample_count_map(job, threads, times, sample_counts)?);
    }
    Ok(Some(RisChoice { times, sample_counts }))
}

/// Fits a + M·T1 and b + N·T2 to the times of few and of many proposals and samples; `None` if there was nothing to
/// light.
fn measure(job: &RenderJob) -> Option<StageTimes> {
    let [few, many] = vertex_times(job)?;
    let [m0, m1] = TIMING.map(|sample_counts| f64::from(sample_counts.proposals));
    let [n0, n1] = TIMING.map(|sample_counts| f64::from(sample_counts.samples));
    Some(StageTimes { t1: rounded((many[0] - few[0]) / (m1 - m0)), t2: rounded((many[1] - few[1]) / (n1 - n0)) })
}

/// Nanoseconds per vertex of both stages for each entry of [`TIMING`], which alternate on this thread: medians over
/// batches of camera rays. `None` if there was nothing to light.
fn vertex_times(job: &RenderJob) -> Option<[[f64; 2]; 2]> {
    let batches = camera_batches(job, RenderSettings::default().tile_size, TIMING_RAYS);
    let mut tracer = PathTracer::default();
    let (mut samples, mut out) = (Vec::new(), Vec::new());
    let mut measured: [[Vec<f64>; 2]; 2] = Default::default();
    // The first turn fills caches
    for turn in 0..4 {
        for batch in batches.iter().flat_map(|b| b.chunks(1024)) {
            for (sample_counts, [t1, t2]) in TIMING.into_iter().zip(&mut measured) {
                let mut settings = job.settings().integrator;
                settings.samples = Some(sample_counts.samples);
                settings.ris.proposals = Proposals::Fixed(sample_counts.proposals);
                samples.clear();
                samples.extend(batch.iter().map(|s| CameraSample { sample_counts, ..*s }));
                tracer.trace(job, &settings, &samples, &mut Fits::default(), &mut out);
                let stats = tracer.take_stats();
                let d = stats.direct;
                let vertices = d.proposals / u64::from(sample_counts.proposals);
                if turn == 0 || vertices == 0 || d.segments == 0 {
                    continue;
                }
                let per_vertex = |time: Duration| time.as_nanos() as f64 / vertices as f64;
                t1.push(per_vertex(d.t1));
                t2.push(per_vertex(d.select + d.t2));
            }
        }
    }
    let is_lit = measured.iter().all(|m| !m[0].is_empty());
    is_lit.then(|| measured.map(|stages| stages.map(median)))
}

/// A time rounded to tenths of nanoseconds, at least one: the printed times are those used.
fn rounded(nanoseconds: f64) -> f64 {
    (nanoseconds * 10.0).round().max(1.0) / 10.0
}

/// The best M/N of each pixel for the time of an estimate with `sample_counts`.
fn sample_count_map(
    job: &RenderJob,
    threads: Option<usize>,
    times: StageTimes,
    sample_counts: SampleCounts,
) -> Result<SampleCountMap, ThreadError> {
    let pool = super::thread_pool(threads)?;
    let costs = Costs { t1: times.t1, t2: times.t2 };
    let time = f64::from(sample_counts.samples) * costs.t2 + f64::from(sample_counts.proposals) * costs.t1;
    let variances = pool.install(|| pilot(job));
    let bounds = job.world.scene.film.bounds;
    let ratio = |v: &Option<Variances>| {
        let ratio = v.map_or(costs.robust_ratio(), |v| optimal_ratio(costs, v, time));
        clamp_ratio(ratio, costs, time)
    };
    Ok(SampleCountMap {
        bounds,
        ratios: variances.iter().map(|v| ratio(v) as f32).collect(),
        t1: costs.t1,
        t2: costs.t2,
        time,
    })
}

/// V(f/p) and V(f/q) around each pixel, row by row; `None` where there is nothing to light.
fn pilot(job: &RenderJob) -> Vec<Option<Variances>> {
    // Moments of each pixel
    let bounds = job.world.scene.film.bounds;
    let rows: Vec<Vec<MomentsEstimate>> = (bounds.y0..bounds.y1)
        .into_par_iter()
        .map(|y| pilot_row(job, &PixelBounds { y0: y, y1: y + 1, ..bounds }))
        .collect();

    // Sums over neighbours
    let radius = PILOT_RADIUS as usize;
    let (width, height) = (bounds.width() as usize, bounds.height() as usize);
    let window = |i: usize, len: usize| i.saturating_sub(radius)..(i + radius + 1).min(len);
    (0..height)
        .into_par_iter()
        .flat_map_iter(|y| {
            let rows = &rows;
            (0..width).map(move |x| {
                let mut sum = MomentsEstimate::new();
                for row in &rows[window(y, height)] {
                    row[window(x, width)].iter().for_each(|m| sum.merge(m));
                }
                let v = sum.moments()?.variances();
                let is_useful = v.proposals.is_finite() && v.samples.is_finite() && v.proposals > 0.0;
                is_useful.then_some(v)
            })
        })
        .collect()
}

fn pilot_row(job: &RenderJob, row: &PixelBounds) -> Vec<MomentsEstimate> {
    let all = SampleCounts { samples: PILOT_PROPOSALS, proposals: PILOT_PROPOSALS };
    let mut settings = IntegratorSettings {
        kind: IntegratorKind::Direct,
        max_depth: 1,
        samples: Some(all.samples),
        ..job.settings().integrator
    };
    settings.ris.proposals = Proposals::Fixed(all.proposals);
    settings.ris.strata = Strata::Proposals;
    settings.ris.target = Target::Fgl;

    let (stop, render) = (AtomicBool::new(false), RenderSettings::default());
    let run = Run::new(job, &render, &stop, &|_| ());
    let mut tracer = PathTracer::default();
    let (mut samples, mut out) = (Vec::<CameraSample>::new(), Vec::new());
    let mut sums = vec![MomentsEstimate::new(); row.area()];
    for (pixel, sum) in sums.iter_mut().enumerate() {
        samples.clear();
        let at = [row.x0 + pixel as u32, row.y0];
        samples.extend((0..PILOT_SPP).map(|s| run.camera.sample_of_seed(at, s, PILOT_SEED)));
        samples.iter_mut().for_each(|s| s.sample_counts = all);
        tracer.outcomes = Some(Vec::new());
        tracer.trace(job, &settings, &samples, &mut Fits::default(), &mut out);
        let outcomes = tracer.outcomes.take().unwrap_or_default();
        let m = f64::from(PILOT_PROPOSALS);
        for o in &outcomes {
            sum.add(o.contribution.to_array().map(|c| f64::from(c) * m), f64::from(o.unshadowed.luminance()) * m);
        }
        // Zero-valued proposals count as well
        let lit = out.iter().filter(|r| r.features.is_some()).count() * PILOT_PROPOSALS as usize;
        (outcomes.len()..lit).for_each(|_| sum.add([0.0; 3], 0.0));
    }
    sums
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_choice_that_is_the_default_is_a_choice() {
        let mut open = Settings::default();
        open.integrator.estimator = EstimatorKind::Ris;
        let mut after = open;
        let counts = open.integrator.sample_counts();
        after.integrator.ris.proposals = Proposals::Fixed(counts.proposals);
        assert_eq!(chosen(&open, &after), [("proposals", counts.proposals.to_string())]);
        after.integrator.ris.proposals = Proposals::Fixed(counts.proposals + 1);
        assert_eq!(chosen(&open, &after), [("proposals", (counts.proposals + 1).to_string())]);
        assert_eq!(chosen(&after, &after), []);
    }
}
