//! Efficiency of several settings on one scene: 1/(error × CPU time).
//!
//! Every setting renders the image with several seeds; settings take turns. What they leave to a pilot is chosen for the
//! first seed. CPU time is that of all threads, and includes
//! whatever the settings need before the first sample: light trees, photons, pilots. Unbiased images differ from the truth
//! by their variance only, so the error of an image is the variance between its seeds, per pixel and channel; the mean
//! over all settings and seeds says how bright a pixel is, for the relative error.
//!
//! Intervals are those of ±2 standard errors: of errors by the spread between blocks of the image, with the covariance of
//! the two that are compared, and of CPU times by the spread between seeds.

use super::plan::{Plan, Preparation, prepare};
use super::{RenderError, RenderSettings, processor_time, render};
use crate::film::{PixelBounds, PixelSums};
use crate::imaging::metrics::difference::DEFAULT_EPSILON;
use crate::lights::LightSamplerKind;
use crate::scene::RenderJob;
use crate::settings::{EstimatorKind, IntegratorKind, Settings};
use lumiris_numbers::estimators::stats::Welford;
use lumiris_numbers::math::luminance;
use serde::Serialize;
use std::sync::atomic::AtomicBool;

/// Blocks of the image along each axis, between which the error varies.
const BLOCKS: u32 = 16;
/// Pixels around one, in each direction, whose emission is compared with its own.
const EDGE_RADIUS: i64 = 2;
/// Camera samples per pixel of the emission.
const EDGE_SPP: u32 = 16;

/// Settings with the name that a report gives them.
#[derive(Clone, Debug)]
pub struct Case {
    /// Its name.
    pub name: String,
    /// The settings.
    pub settings: Settings,
}

/// An error, and the efficiency that follows.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Efficiency {
    /// Mean error of one image.
    pub error: f64,
    /// 1/(error × CPU time), relative to that of the first case.
    pub relative: f64,
    /// Interval of `relative`.
    pub interval: [f64; 2],
}

/// What was measured of a case.
#[derive(Clone, Debug, Serialize)]
pub struct Row {
    /// Its name.
    pub name: String,
    /// Mean CPU time of an image (s).
    pub cpu_seconds: f64,
    /// Mean luminance over all pixels and seeds.
    pub mean: f64,
    /// By (x − r)²/(r² + 0.01).
    pub relmse: Efficiency,
    /// By (x − r)².
    pub mse: Efficiency,
    /// By (x − r)² without pixels at the edge of visible lights, which only camera samples resolve.
    pub masked_mse: Efficiency,
    /// The settings that were chosen because these left them open, by their names in metadata.
    pub chosen: Vec<(&'static str, String)>,
}

/// The images of a case.
#[derive(Default)]
struct Measured {
    /// What its settings are with the choices made for the first seed.
    planned: Option<Settings>,
    /// Processor time of these choices (s).
    pilot: f64,
    cpu: Vec<f64>,
    images: Vec<Vec<[f64; 3]>>,
    chosen: Vec<(&'static str, String)>,
}

/// Measures the cases with `seeds` seeds each, at least two. `observe` is told before each rendering.
pub fn measure_efficiency(
    job: &mut RenderJob,
    cases: &[Case],
    seeds: u32,
    render_settings: &RenderSettings,
    observe: &mut dyn FnMut(&str, u32),
) -> Result<Vec<Row>, RenderError> {
    let seeds = seeds.max(2);
    let mut measured: Vec<Measured> = cases.iter().map(|_| Measured::default()).collect();
    for seed in 0..seeds {
        for (case, measured) in cases.iter().zip(&mut measured) {
            observe(&case.name, seed);
            let mut settings = measured.planned.unwrap_or(case.settings);
            settings.sampling.seed = case.settings.sampling.seed.wrapping_add(seed);
            let start = processor_time::of_process();
            let (image, plan) = image(job, settings, render_settings)?;
            let cpu = (processor_time::of_process() - start).as_secs_f64();
            if measured.planned.is_none() {
                // What the pilot chose for one seed is used for all, and each image has its time
                measured.pilot = plan.auto.map_or(0.0, |auto| auto.seconds);
                measured.chosen = plan.chosen;
                measured.planned = Some(*job.settings());
                measured.cpu.push(cpu);
            } else {
                measured.cpu.push(cpu + measured.pilot);
            }
            measured.images.push(image);
        }
    }

    let bounds = job.world.scene.film.bounds;
    let pooled = pooled_mean(&measured, bounds.area());
    let keep = away_from_edges(&emission(job, &cases[0].settings, render_settings)?, &pooled, &bounds);
    let weights = Weights { pooled: &pooled, keep: &keep, bounds };
    let errors: Vec<Errors> = measured.iter().map(|m| weights.errors(&m.images)).collect();
    let rows = cases.iter().zip(&measured).zip(&errors).map(|((case, m), e)| {
        let compare = |of: fn(&Errors) -> &Vec<f64>| efficiency((of(e), &m.cpu), (of(&errors[0]), &measured[0].cpu));
        let means = m.images.iter().flatten().map(|&p| luminance(p));
        Row {
            name: case.name.clone(),
            cpu_seconds: mean(&m.cpu),
            mean: means.sum::<f64>() / (m.images.len() * bounds.area()).max(1) as f64,
            relmse: compare(|e| &e.relative),
            mse: compare(|e| &e.squared),
            masked_mse: compare(|e| &e.masked),
            chosen: m.chosen.clone(),
        }
    });
    Ok(rows.collect())
}

/// The image by these settings, with everything prepared anew.
fn image(
    job: &mut RenderJob,
    settings: Settings,
    render_settings: &RenderSettings,
) -> Result<(Vec<[f64; 3]>, Plan), RenderError> {
    job.reset(settings);
    let plan = prepare(job, &Preparation::on(render_settings.threads))?;
    let spp = job.pixel_samples.as_ref().map_or(job.settings().sampling.spp, |of_pixels| of_pixels.spp);
    let render_settings =
        RenderSettings { spp, with_features: false, with_replicas: false, time_limit: None, ..*render_settings };
    let rendering = render(job, &render_settings, &AtomicBool::new(false), &|_| ())?;
    Ok((rendering.film.pixels().iter().map(PixelSums::mean).collect(), plan))
}

/// What emits, as the camera sees it.
fn emission(
    job: &mut RenderJob,
    settings: &Settings,
    render_settings: &RenderSettings,
) -> Result<Vec<[f64; 3]>, RenderError> {
    let mut settings = *settings;
    settings.integrator.kind = IntegratorKind::Path;
    settings.integrator.max_depth = 0;
    settings.integrator.estimator = EstimatorKind::Mis;
    settings.integrator.light_sampler = LightSamplerKind::Power;
    settings.sampling.spp = EDGE_SPP;
    Ok(image(job, settings, render_settings)?.0)
}

fn pooled_mean(measured: &[Measured], area: usize) -> Vec<[f64; 3]> {
    let mut sum = vec![[0.0; 3]; area];
    let images = measured.iter().flat_map(|m| &m.images);
    let count = images.clone().count() as f64;
    for image in images {
        for (sum, x) in sum.iter_mut().zip(image) {
            (0..3).for_each(|c| sum[c] += x[c] / count);
        }
    }
    sum
}

/// Pixels around which the emission varies by no more than the mean of the image.
fn away_from_edges(emission: &[[f64; 3]], image: &[[f64; 3]], bounds: &PixelBounds) -> Vec<bool> {
    let mean = image.iter().map(|&p| luminance(p)).sum::<f64>() / image.len().max(1) as f64;
    let (width, height) = (i64::from(bounds.width()), i64::from(bounds.height()));
    let is_away = |i: usize| {
        let (x, y) = (i as i64 % width, i as i64 / width);
        let (mut min, mut max) = (f64::INFINITY, f64::NEG_INFINITY);
        for v in (y - EDGE_RADIUS).max(0)..(y + EDGE_RADIUS + 1).min(height) {
            for u in (x - EDGE_RADIUS).max(0)..(x + EDGE_RADIUS + 1).min(width) {
                let l = luminance(emission[(v * width + u) as usize]);
                (min, max) = (min.min(l), max.max(l));
            }
        }
        max - min <= mean
    };
    (0..image.len()).map(is_away).collect()
}

/// Sums of errors over the blocks of the image, divided by the number of values in all of it.
struct Errors {
    relative: Vec<f64>,
    squared: Vec<f64>,
    masked: Vec<f64>,
}

struct Weights<'a> {
    pooled: &'a [[f64; 3]],
    keep: &'a [bool],
    bounds: PixelBounds,
}

impl Weights<'_> {
    fn errors(&self, images: &[Vec<[f64; 3]>]) -> Errors {
        let (width, height) = (self.bounds.width(), self.bounds.height());
        let blocks = (BLOCKS * BLOCKS) as usize;
        let mut errors = Errors { relative: vec![0.0; blocks], squared: vec![0.0; blocks], masked: vec![0.0; blocks] };
        let kept = self.keep.iter().filter(|k| **k).count();
        for (i, r) in self.pooled.iter().enumerate() {
            let (x, y) = (i as u32 % width, i as u32 / width);
            let block = (y * BLOCKS / height * BLOCKS + x * BLOCKS / width) as usize;
            for c in 0..3 {
                let mut spread = Welford::default();
                images.iter().for_each(|image| spread.add(image[i][c]));
                let square = spread.variance() / (3 * self.pooled.len()) as f64;
                errors.squared[block] += square;
                errors.relative[block] += square / (r[c] * r[c] + DEFAULT_EPSILON);
                if self.keep[i] {
                    errors.masked[block] += square * self.pooled.len() as f64 / kept as f64;
                }
            }
        }
        errors
    }
}

/// Efficiency of the errors by block and CPU times of one case, relative to those of another.
fn efficiency((errors, cpu): (&[f64], &[f64]), (base, base_cpu): (&[f64], &[f64])) -> Efficiency {
    let (error, base_error) = (errors.iter().sum::<f64>(), base.iter().sum::<f64>());
    // Standard error of log(base_error/error): of a sum over blocks
    let terms: Vec<f64> = errors.iter().zip(base).map(|(e, b)| b / base_error - e / error).collect();
    let n = terms.len() as f64;
    let of_errors = terms.iter().map(|t| t * t).sum::<f64>() * n / (n - 1.0);
    let mut times = Welford::default();
    cpu.iter().zip(base_cpu).for_each(|(t, b)| times.add((b / t).ln()));
    let standard_error = (of_errors + times.standard_error().powi(2)).sqrt();
    let relative = base_error * mean(base_cpu) / (error * mean(cpu));
    let factor = (2.0 * standard_error).exp();
    Efficiency { error, relative, interval: [relative / factor, relative * factor] }
}

fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len().max(1) as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn half_the_error_in_half_the_time_is_four_times_as_efficient() {
        let base = vec![2.0; 256];
        let e = efficiency((&vec![1.0; 256], &[3.0, 3.0]), (&base, &[6.0, 6.0]));
        assert_eq!((e.error, e.relative), (256.0, 4.0));
        assert!(e.interval.iter().all(|v| (v - 4.0).abs() < 1e-9), "nothing varies: {:?}", e.interval);
        let e = efficiency((&vec![1.0; 256], &[3.0, 4.0]), (&base, &[6.0, 6.0]));
        assert!(e.interval[0] < 3.2 && e.interval[1] > 3.6, "times vary: {:?}", e.interval);
    }

    #[test]
    fn the_interval_holds_the_ratio_of_errors_as_often_as_it_says() {
        use lumiris_test_support::random::{RngExt, pcg32};
        let mut s = pcg32([11, 3, 1]);
        // Errors of two seeds: squares of normal numbers, of which one case has half the variance
        let mut normal = || {
            let [a, b] = s.random::<[f32; 2]>().map(f64::from);
            (-2.0 * (1.0 - a).ln()).sqrt() * (std::f64::consts::TAU * b).cos()
        };
        let inside = (0..400).filter(|_| {
            let base: Vec<f64> = (0..256).map(|_| (0..4).map(|_| normal().powi(2)).sum()).collect();
            let errors: Vec<f64> = (0..256).map(|_| 0.5 * (0..4).map(|_| normal().powi(2)).sum::<f64>()).collect();
            let e = efficiency((&errors, &[1.0, 1.0]), (&base, &[1.0, 1.0]));
            (e.interval[0]..e.interval[1]).contains(&2.0)
        });
        let inside = inside.count();
        assert!((365..=396).contains(&inside), "{inside} of 400, 382 expected");
    }

    #[test]
    fn edges_of_emitters_are_left_out_and_what_is_far_from_them_is_not() {
        let bounds = PixelBounds { x0: 0, x1: 20, y0: 0, y1: 1 };
        let emission: Vec<[f64; 3]> = (0..20).map(|x| [if x < 8 { 5.0 } else { 0.0 }; 3]).collect();
        let keep = away_from_edges(&emission, &vec![[1.0; 3]; 20], &bounds);
        let left_out: Vec<usize> = (0..20).filter(|&i| !keep[i]).collect();
        assert_eq!(left_out, [6, 7, 8, 9]);
    }
}
