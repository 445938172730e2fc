//! Efficiency of several settings on one scene: 1/(error × CPU time).
//!
//! Every setting renders the image with several seeds, in alternation with the other settings. Choices of pilots are
//! made anew for each seed. CPU time is the total of all threads, including the preparation before the first sample:
//! light trees, photons, pilots.
//!
//! With two reference images a and b, the error of an image x is (x − a)(x − b), per pixel and channel. Its expectation
//! is the squared error of x, since the noise of a and of b are independent of x and of each other. The mean of a and b
//! is the pixel's brightness in the relative error. References use the same integrator, so that its bias, if any, is
//! not part of the error. Without references, the error is the variance between seeds, which assumes unbiased images;
//! the brightness is the mean over all settings and seeds.
//!
//! Choices of pilots differ between seeds, and with them both error and time. Efficiency is therefore the inverse of
//! the mean of error × time. Intervals are ±2 standard errors: from the spread of the products between blocks of the
//! image, with the covariance of the two settings that are compared, and from the spread between seeds.

use lumiris::film::{PixelBounds, PixelSums};
use lumiris::imaging::metrics::difference::DEFAULT_EPSILON;
use lumiris::lights::LightSamplerKind;
use lumiris::planning::processor_time;
use lumiris::planning::{Plan, Preparation, prepare};
use lumiris::render::{RenderError, RenderSettings, render};
use lumiris::scene::RenderJob;
use lumiris::settings::{EstimatorKind, IntegratorKind, SamplingSettings, Settings};
use lumiris_numbers::estimators::stats::Welford;
use lumiris_numbers::math::hash::pcg4d;
use lumiris_numbers::math::luminance;
use serde::Serialize;
use std::sync::atomic::AtomicBool;

/// Blocks of the image along each axis, for the spread of the error.
const BLOCKS: u32 = 16;
/// Radius (pixels) of the neighbourhood whose emission is compared with a pixel's.
const EDGE_RADIUS: i64 = 2;
/// Camera samples per pixel for the emission.
const EDGE_SPP: u32 = 16;
/// Constant that is hashed with the seed of an image to give the seeds of its references.
const REFERENCE_SEED: u32 = 0x7265_6665;

/// Colours of the pixels, row by row.
pub type Colors = Vec<[f64; 3]>;

/// Settings with their name in the report.
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
    /// 1/(error × CPU time), from the mean product over seeds, relative to the first case. NaN if either error is
    /// within two standard errors of 0.
    pub relative: f64,
    /// Interval of `relative`.
    pub interval: [f64; 2],
}

/// Results of a case.
#[derive(Clone, Debug, Serialize)]
pub struct Row {
    /// Its name.
    pub name: String,
    /// Mean CPU time of an image (s).
    pub cpu_seconds: f64,
    /// Mean luminance over all pixels and seeds.
    pub mean: f64,
    /// With the error (x − r)²/(r² + 0.01).
    pub relmse: Efficiency,
    /// With the error (x − r)².
    pub mse: Efficiency,
    /// With the error (x − r)², without pixels at the edge of visible lights, which only camera samples resolve.
    pub masked_mse: Efficiency,
    /// The choices for each seed of settings that the case leaves open, by their metadata names.
    pub chosen: Vec<Vec<(&'static str, String)>>,
}

/// The images of a case.
#[derive(Default)]
struct Measured {
    cpu: Vec<f64>,
    images: Vec<Colors>,
    chosen: Vec<Vec<(&'static str, String)>>,
}

/// Measures the cases with `seeds` seeds each (at least two), against two references by [`reference_image`] if given.
/// `observe` is called before each rendering.
pub fn measure_efficiency(
    job: &mut RenderJob,
    cases: &[Case],
    seeds: u32,
    references: Option<&[Colors; 2]>,
    render_settings: &RenderSettings,
    observe: &mut dyn FnMut(&str, u32),
) -> Result<Vec<Row>, RenderError> {
    // Render, alternating between the cases
    let mut measured: Vec<Measured> = cases.iter().map(|_| Measured::default()).collect();
    for seed in 0..seeds.max(2) {
        for (case, measured) in cases.iter().zip(&mut measured) {
            observe(&case.name, seed);
            let mut settings = case.settings;
            settings.sampling.seed = settings.sampling.seed.wrapping_add(seed);
            let start = processor_time::of_process();
            let plan = prepare_anew(job, settings, render_settings)?;
            let image = image(job, render_settings)?;
            measured.cpu.push((processor_time::of_process() - start).as_secs_f64());
            measured.chosen.push(plan.chosen);
            measured.images.push(image);
        }
    }

    let bounds = job.world.scene.film.bounds;
    // Errors
    let mean_image = match references {
        Some(references) => mean_of(references.iter(), bounds.area()),
        None => mean_of(measured.iter().flat_map(|m| &m.images), bounds.area()),
    };
    let weights = Weights::new(job, &cases[0].settings, mean_image, references, render_settings)?;
    let errors: Vec<Vec<Errors>> = measured.iter().map(|m| weights.errors(&m.images)).collect();

    // Rows
    let rows = cases.iter().zip(&measured).zip(&errors).map(|((case, m), e)| {
        let compare = |of: fn(&Errors) -> &Vec<f64>| {
            let seeds = |m: &Measured, errors: &[Errors]| -> Vec<Inefficiency> {
                let both = errors.iter().zip(&m.cpu);
                both.map(|(errors, cpu)| Inefficiency { errors: of(errors).clone(), cpu: *cpu }).collect()
            };
            efficiency(&seeds(m, e), &seeds(&measured[0], &errors[0]))
        };
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

/// Screening pass: the efficiency of each case relative to the best, by relMSE, masked MSE and MSE, from one image of
/// `spp` samples per pixel. Its seed is none of the seeds that [`measure_efficiency`] uses for the same number of
/// seeds. The result is 1 if the error is below the noise of the references.
pub fn first_look(
    job: &mut RenderJob,
    cases: &[Case],
    [spp, seeds]: [u32; 2],
    references: &[Colors; 2],
    render_settings: &RenderSettings,
    observe: &mut dyn FnMut(&str, u32),
) -> Result<Vec<[f64; 3]>, RenderError> {
    // Weights of pixels
    let Some(first) = cases.first() else { return Ok(Vec::new()) };
    let mean_image = mean_of(references.iter(), job.world.scene.film.bounds.area());
    let weights = Weights::new(job, &first.settings, mean_image, Some(references), render_settings)?;

    // Error × time of each case
    let look = |case: &Case| {
        observe(&case.name, seeds);
        let mut settings = case.settings;
        settings.sampling.seed = settings.sampling.seed.wrapping_add(seeds);
        settings.sampling.spp = spp;
        let start = processor_time::of_process();
        prepare_anew(job, settings, render_settings)?;
        let image = image(job, render_settings)?;
        let cpu = (processor_time::of_process() - start).as_secs_f64();
        let errors = weights.errors(&[image]);
        Ok([&errors[0].relative, &errors[0].masked, &errors[0].squared].map(|e| e.iter().sum::<f64>() * cpu))
    };
    let inefficiencies: Vec<[f64; 3]> = cases.iter().map(look).collect::<Result<_, RenderError>>()?;
    Ok(relative_to_the_least(&inefficiencies))
}

/// For each component, the smallest positive value divided by the value; 1 for values that are not positive.
fn relative_to_the_least<const N: usize>(values: &[[f64; N]]) -> Vec<[f64; N]> {
    let least: [f64; N] =
        std::array::from_fn(|k| values.iter().map(|v| v[k]).filter(|v| *v > 0.0).fold(f64::INFINITY, f64::min));
    values.iter().map(|v| std::array::from_fn(|k| if v[k] > 0.0 { least[k] / v[k] } else { 1.0 })).collect()
}

/// Settings of one of two references. The image's expectation is the same as with `base`, texture footprints included;
/// the random numbers are different.
pub fn reference_settings(base: &Settings, spp: u32, index: u32) -> Settings {
    let mut settings = *base;
    settings.integrator.estimator = EstimatorKind::Auto;
    settings.sampling = SamplingSettings {
        spp,
        noise: None,
        footprint_spp: Some(base.sampling.footprint_spp()),
        seed: pcg4d([base.sampling.seed, REFERENCE_SEED, index, 0])[0],
        ..base.sampling
    };
    settings
}

/// Renders a reference with [`reference_settings`], rounded to single precision as in files.
pub fn reference_image(
    job: &mut RenderJob,
    settings: Settings,
    render_settings: &RenderSettings,
) -> Result<Colors, RenderError> {
    prepare_anew(job, settings, render_settings)?;
    let image = image(job, render_settings)?;
    Ok(image.into_iter().map(|color| color.map(|v| f64::from(v as f32))).collect())
}

/// Prepares an image, with all choices made anew.
fn prepare_anew(
    job: &mut RenderJob,
    settings: Settings,
    render_settings: &RenderSettings,
) -> Result<Plan, RenderError> {
    job.reset(settings);
    Ok(prepare(job, &Preparation::on(render_settings.threads))?)
}

/// Renders a prepared image.
fn image(job: &RenderJob, render_settings: &RenderSettings) -> Result<Colors, RenderError> {
    let spp = job.pixel_samples.as_ref().map_or(job.settings().sampling.spp, |of_pixels| of_pixels.spp);
    let render_settings = RenderSettings {
        spp,
        with_features: false,
        with_replicas: false,
        with_light_layers: false,
        time_limit: None,
        ..*render_settings
    };
    let rendering = render(job, &render_settings, &AtomicBool::new(false), &|_| ())?;
    Ok(rendering.film.pixels().iter().map(PixelSums::mean).collect())
}

/// Renders the directly visible emission.
fn emission(job: &mut RenderJob, settings: &Settings, render_settings: &RenderSettings) -> Result<Colors, RenderError> {
    let mut settings = *settings;
    settings.integrator.kind = IntegratorKind::Path;
    settings.integrator.max_depth = 0;
    settings.integrator.estimator = EstimatorKind::Mis;
    settings.integrator.light_sampler = LightSamplerKind::Power;
    settings.sampling.spp = EDGE_SPP;
    prepare_anew(job, settings, render_settings)?;
    image(job, render_settings)
}

fn mean_of<'a>(images: impl Iterator<Item = &'a Colors> + Clone, area: usize) -> Colors {
    let mut sum = vec![[0.0; 3]; area];
    let count = images.clone().count() as f64;
    for image in images {
        for (sum, x) in sum.iter_mut().zip(image) {
            (0..3).for_each(|c| sum[c] += x[c] / count);
        }
    }
    sum
}

/// True for pixels around which the emission varies by no more than the mean of the image.
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
#[derive(Clone)]
struct Errors {
    relative: Vec<f64>,
    squared: Vec<f64>,
    masked: Vec<f64>,
}

struct Weights<'a> {
    mean: Colors,
    /// Pixels that count in the masked MSE.
    is_away: Vec<bool>,
    references: Option<&'a [Colors; 2]>,
    bounds: PixelBounds,
}

impl<'a> Weights<'a> {
    fn new(
        job: &mut RenderJob,
        settings: &Settings,
        mean: Colors,
        references: Option<&'a [Colors; 2]>,
        render_settings: &RenderSettings,
    ) -> Result<Self, RenderError> {
        let bounds = job.world.scene.film.bounds;
        let is_away = away_from_edges(&emission(job, settings, render_settings)?, &mean, &bounds);
        Ok(Weights { mean, is_away, references, bounds })
    }

    /// Errors of each image. Without references, all images have the same expected error.
    fn errors(&self, images: &[Colors]) -> Vec<Errors> {
        if let Some([a, b]) = self.references {
            let of = |x: &Colors| self.sums(|i, c| (x[i][c] - a[i][c]) * (x[i][c] - b[i][c]));
            return images.iter().map(of).collect();
        }
        let variance = |i: usize, c: usize| images.iter().map(|image| image[i][c]).collect::<Welford>().variance();
        vec![self.sums(variance); images.len()]
    }

    /// Block sums of `square(pixel, channel)` with the three weightings.
    fn sums(&self, square: impl Fn(usize, usize) -> f64) -> Errors {
        let (width, height) = (self.bounds.width(), self.bounds.height());
        let blocks = (BLOCKS * BLOCKS) as usize;
        let mut errors = Errors { relative: vec![0.0; blocks], squared: vec![0.0; blocks], masked: vec![0.0; blocks] };
        let kept = self.is_away.iter().filter(|k| **k).count();
        for (i, r) in self.mean.iter().enumerate() {
            let (x, y) = (i as u32 % width, i as u32 / width);
            let block = (y * BLOCKS / height * BLOCKS + x * BLOCKS / width) as usize;
            for c in 0..3 {
                let square = square(i, c) / (3 * self.mean.len()) as f64;
                errors.squared[block] += square;
                errors.relative[block] += square / (r[c] * r[c] + DEFAULT_EPSILON);
                if self.is_away[i] {
                    errors.masked[block] += square * self.mean.len() as f64 / kept as f64;
                }
            }
        }
        errors
    }
}

/// Results of one seed: errors by block of the image, and CPU time (s).
#[derive(Clone)]
struct Inefficiency {
    errors: Vec<f64>,
    cpu: f64,
}

impl Inefficiency {
    fn error(&self) -> f64 {
        self.errors.iter().sum()
    }
}

/// Efficiency of a case relative to another one, from the results of all seeds.
fn efficiency(case: &[Inefficiency], base: &[Inefficiency]) -> Efficiency {
    let error = mean_by(case, Inefficiency::error);
    let [of_case, of_base] = [case, base].map(|seeds| -> Vec<f64> {
        (0..seeds[0].errors.len()).map(|block| mean_by(seeds, |s| s.errors[block] * s.cpu)).collect()
    });
    if !is_known(&of_case) || !is_known(&of_base) {
        return Efficiency { error, relative: f64::NAN, interval: [f64::NAN; 2] };
    }
    // Standard error of the logarithm of the ratio, from the spread over blocks and over seeds
    let [sum, base_sum] = [&of_case, &of_base].map(|blocks| blocks.iter().sum::<f64>());
    let terms: Vec<f64> = of_case.iter().zip(&of_base).map(|(e, b)| b / base_sum - e / sum).collect();
    let n = terms.len() as f64;
    let of_blocks = terms.iter().map(|t| t * t).sum::<f64>() * n / (n - 1.0);
    let of_seed = |(s, b): (&Inefficiency, &Inefficiency)| (b.error() * b.cpu / (s.error() * s.cpu)).ln();
    let of_seeds: Welford = case.iter().zip(base).map(of_seed).collect();
    let standard_error = (of_blocks + of_seeds.standard_error().powi(2)).sqrt();
    let (relative, factor) = (base_sum / sum, (2.0 * standard_error).exp());
    Efficiency { error, relative, interval: [relative / factor, relative * factor] }
}

/// True if an error, given by blocks, is at least two standard errors above 0. The logarithm of a smaller error has no
/// interval.
fn is_known(errors: &[f64]) -> bool {
    let spread: Welford = errors.iter().copied().collect();
    spread.mean() > 2.0 * spread.standard_error()
}

fn mean(values: &[f64]) -> f64 {
    mean_by(values, |x| *x)
}

fn mean_by<T>(values: &[T], of: impl Fn(&T) -> f64) -> f64 {
    values.iter().map(of).sum::<f64>() / values.len().max(1) as f64
}

#[cfg(test)]
mod tests {
    use super::*;
    use lumiris_test_support::random::{normal, pcg32};

    /// Results of seeds with these errors in each of two blocks, and these times.
    fn seeds<const N: usize>(errors: [f64; N], cpu: [f64; N]) -> Vec<Inefficiency> {
        let of = |(error, cpu)| Inefficiency { errors: vec![error; 2], cpu };
        errors.into_iter().zip(cpu).map(of).collect()
    }

    #[test]
    fn half_the_error_in_half_the_time_is_four_times_as_efficient() {
        let base = seeds([2.0; 2], [6.0; 2]);
        let e = efficiency(&seeds([1.0; 2], [3.0; 2]), &base);
        assert_eq!((e.error, e.relative), (2.0, 4.0));
        assert!(e.interval.iter().all(|v| (v - 4.0).abs() < 1e-9), "nothing varies: {:?}", e.interval);
        let e = efficiency(&seeds([1.0; 2], [3.0, 4.0]), &base);
        assert!(e.interval[0] < 3.0 && e.interval[1] > 3.9, "times vary: {:?}", e.interval);
        let e = efficiency(&seeds([0.5, 2.0], [6.0, 1.5]), &base);
        assert!((e.relative - 4.0).abs() < 1e-9, "the time of one plan is not that of the other: {}", e.relative);
        assert!(e.interval.iter().all(|v| (v - 4.0).abs() < 1e-9), "{:?}", e.interval);
    }

    #[test]
    fn the_interval_holds_the_ratio_of_errors_as_often_as_it_says() {
        let mut s = pcg32([11, 3, 1]);
        // Errors of two seeds: squares of normal numbers; one case has half the variance
        let mut normal = || normal(&mut s);
        let inside = (0..400).filter(|_| {
            let base: Vec<f64> = (0..256).map(|_| (0..4).map(|_| normal().powi(2)).sum()).collect();
            let errors: Vec<f64> = (0..256).map(|_| 0.5 * (0..4).map(|_| normal().powi(2)).sum::<f64>()).collect();
            let [case, base] = [errors, base].map(|errors| vec![Inefficiency { errors, cpu: 1.0 }; 2]);
            let e = efficiency(&case, &base);
            (e.interval[0]..e.interval[1]).contains(&2.0)
        });
        let inside = inside.count();
        assert!((365..=396).contains(&inside), "{inside} of 400, 382 expected");
    }

    /// Images of 40 × 40 pixels with normal noise around 1 + bias.
    fn noisy(seed: u32, count: usize, deviation: f64, bias: f64) -> Vec<Colors> {
        let mut s = pcg32([seed, 7, 2]);
        let mut image = || (0..1600).map(|_| [0; 3].map(|_| 1.0 + bias + deviation * normal(&mut s))).collect();
        (0..count).map(|_| image()).collect()
    }

    #[test]
    fn noise_of_references_drops_out_and_bias_does_not() {
        let bounds = PixelBounds { x0: 0, x1: 40, y0: 0, y1: 40 };
        let references: [Colors; 2] = noisy(1, 2, 0.1, 0.0).try_into().expect("two");
        let mean = mean_of(references.iter(), 1600);
        let of = |references: Option<&[Colors; 2]>, images: &[Colors]| -> f64 {
            let weights = Weights { mean: mean.clone(), is_away: vec![true; 1600], references, bounds };
            mean_by(&weights.errors(images), |errors| errors.squared.iter().sum())
        };
        // With the same reference twice the error would be five times as large. The standard error is the product of
        // both references' noise: 0.1²/√4800 = 6 % of 0.05²
        let unbiased = noisy(2, 4, 0.05, 0.0);
        assert!((of(Some(&references), &unbiased) / 0.0025 - 1.0).abs() < 0.2);
        assert!((of(None, &unbiased) / 0.0025 - 1.0).abs() < 0.05, "a standard error is 1.2 %");
        // The variance between seeds does not contain bias
        let biased = noisy(3, 4, 0.05, 0.1);
        assert!((of(Some(&references), &biased) / 0.0125 - 1.0).abs() < 0.1);
        assert!((of(None, &biased) / 0.0025 - 1.0).abs() < 0.05);
    }

    #[test]
    fn an_error_within_the_noise_of_references_has_no_efficiency() {
        let known: Vec<f64> = (0..256).map(|i| 1.0 + f64::from(i % 3)).collect();
        let unknown: Vec<f64> = (0..256).map(|i| if i % 2 == 0 { 1.01 } else { -1.0 }).collect();
        let of = |errors: &[f64], base: &[f64]| {
            let [case, base] = [errors, base].map(|errors| vec![Inefficiency { errors: errors.to_vec(), cpu: 1.0 }; 2]);
            efficiency(&case, &base).relative
        };
        assert_eq!(of(&known, &known), 1.0);
        assert!(of(&unknown, &known).is_nan() && of(&known, &unknown).is_nan());
        assert!(of(&[0.0; 256], &known).is_nan());
    }

    #[test]
    fn a_first_look_compares_with_the_best_by_each_error() {
        let of = relative_to_the_least(&[[4.0, 1.0], [2.0, -1.0], [8.0, 5.0]]);
        assert_eq!(of, [[0.5, 1.0], [1.0, 1.0], [0.25, 0.2]], "below zero is noise, and less than all others");
        assert_eq!(relative_to_the_least(&[[0.0], [-1.0]]), [[1.0]; 2]);
    }

    #[test]
    fn references_have_the_expectation_of_the_image_and_other_random_numbers() {
        let mut base = Settings::default();
        (base.sampling.spp, base.sampling.noise) = (16, Some(0.1));
        let [a, b] = [0, 1].map(|index| reference_settings(&base, 1024, index));
        assert_eq!((a.sampling.spp, a.sampling.noise, a.sampling.footprint()), (1024, None, base.sampling.footprint()));
        let seeds = [base.sampling.seed, a.sampling.seed, b.sampling.seed];
        assert!(seeds[1] != seeds[2] && seeds[1..].iter().all(|seed| seed.abs_diff(seeds[0]) > 1000), "{seeds:?}");
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
