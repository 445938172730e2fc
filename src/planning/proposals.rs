//! The best number of proposals M for N samples of `ris` in each pixel [Talbot 2005, Eq. 4.3].
//!
//! The time of an estimate is the same in all pixels. M and N follow from the variances of the light in the pixel,
//! which a pilot estimates from proposals that are all traced. The times of proposals and samples are [`COSTS`], not
//! measured, so the choice depends on scene, settings and seed only.

use super::constants::{PILOT_PROPOSALS, PILOT_RADIUS, RIS_PILOT_SPP};
use super::preparation::Preparation;
use crate::direct::Fits;
use crate::film::PixelBounds;
use crate::integrators::CameraSamples;
use crate::integrators::PathTracer;
use crate::integrators::camera_sampler::CameraSampler;
use crate::scene::{RenderJob, SampleCountMap};
use crate::settings::ris::COSTS;
use crate::settings::{EstimatorKind, IntegratorKind, IntegratorSettings, Proposals, SampleCounts, Strata, Target};
use lumiris_numbers::estimators::ris::sample_counts::{Costs, MomentsEstimate, Variances, clamp_ratio, optimal_ratio};
use rayon::prelude::*;

/// Seed of the pilot. It must not use the random numbers of the image, whose samples would then depend on the choice.
const PILOT_SEED: u32 = 0x70_69_6c_6f;

/// Chooses M and N of each pixel, if the settings or `how` request it.
pub(super) fn choose(job: &mut RenderJob, how: &Preparation<'_>) {
    let settings = &job.settings().integrator;
    let is_wanted = settings.ris.proposals == Proposals::Optimal || how.ratio_map;
    if settings.estimator == EstimatorKind::Ris && is_wanted {
        let SampleCounts { samples, proposals } = settings.sample_counts();
        let time = f64::from(samples) * COSTS.t2 + f64::from(proposals) * COSTS.t1;
        job.sample_count_map = Some(sample_count_map(job, COSTS, time));
    }
}

/// The best M/N of each pixel for the time of an estimate, computed on the threads of the current pool.
pub fn sample_count_map(job: &RenderJob, costs: Costs, time: f64) -> SampleCountMap {
    let variances = pilot(job);
    let ratio = |v: &Option<Variances>| {
        let ratio = v.map_or(costs.robust_ratio(), |v| optimal_ratio(costs, v, time));
        clamp_ratio(ratio, costs, time)
    };
    SampleCountMap {
        bounds: job.world.scene.film.bounds,
        ratios: variances.iter().map(|v| ratio(v) as f32).collect(),
        t1: costs.t1,
        t2: costs.t2,
        time,
    }
}

/// V(f/p) and V(f/q) around each pixel, row by row; `None` where there is no surface to light.
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

    let camera = CameraSampler::new(job, 0);
    let mut tracer = PathTracer::default();
    let (mut samples, mut out) = (CameraSamples::default(), Vec::new());
    let mut sums = vec![MomentsEstimate::new(); row.area()];
    for (pixel, sum) in sums.iter_mut().enumerate() {
        samples.clear();
        let at = [row.x0 + pixel as u32, row.y0];
        samples.extend((0..RIS_PILOT_SPP).map(|s| camera.sample_of_seed(at, s, PILOT_SEED)));
        samples.sample_counts.fill(all);
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
