//! Alternating measurement of methods on one scene: variance and time of each, in the same run.
//!
//! A *turn* renders the image once with each method, each with its own seed. The order of the methods rotates by one
//! from turn to turn, so that a machine that slows down affects all of them. The variance of a method is the variance
//! of its pixel estimates over the turns (luminance; unbiased; no reference image is needed), averaged over pixels. Its
//! time is the processor time of the rendering over all threads, which excludes other load on the machine. Times of two
//! methods are compared turn by turn, by the median of the ratios. Camera rays pass through pixel centres, so that the
//! variance is due to lighting and not to antialiasing.

use super::method::Method;
use super::{Observer, ReproduceError};
use lumiris::accel::{Accel, AccelStats, Bvh, Coherence, Hit, RayBatch};
use lumiris::film::Film;
use lumiris::film::filter::PixelFilter;
use lumiris::import::{LoadOptions, load};
use lumiris::lights::VisibilityCache;
use lumiris::planning::processor_time;
use lumiris::planning::proposals::sample_count_map;
use lumiris::render::{RenderError, RenderSettings, Rendering, render, thread_pool};
use lumiris::scene::{AccelKind, RenderJob};
use lumiris_numbers::estimators::ris::sample_counts::Costs;
use lumiris_numbers::estimators::stats::{Welford, median, z_test};
use lumiris_numbers::math::luminance;
use serde::Serialize;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

/// A ray tracer whose shadows can be disabled.
struct Shadows {
    inner: Box<dyn Accel>,
    cast: Arc<AtomicBool>,
}

impl Accel for Shadows {
    fn intersect(&self, rays: &RayBatch, coherence: Coherence, hits: &mut Vec<Option<Hit>>) {
        self.inner.intersect(rays, coherence, hits);
    }

    fn occluded(&self, rays: &RayBatch, coherence: Coherence, occluded: &mut Vec<bool>) {
        if self.cast.load(Ordering::Relaxed) {
            self.inner.occluded(rays, coherence, occluded);
        } else {
            occluded.clear();
            occluded.resize(rays.len(), false);
        }
    }

    fn stats(&self) -> AccelStats {
        self.inner.stats()
    }
}

/// Half the edge of the square around the pixel's centre through which camera rays pass, in pixels.
const CENTRE: f32 = 1e-3;

/// A scene that is ready to be rendered by many methods.
pub struct Stage {
    job: RenderJob,
    shadows: Arc<AtomicBool>,
    threads: Option<usize>,
    /// Number of bounces in the scene file.
    depth: u32,
}

/// The kind of image.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum View {
    /// Rays through the centres of pixels.
    Centres,
    /// Antialiased: rays over the whole area of each pixel.
    Antialiased,
    /// Rays through the centres, without shadows.
    Unshadowed,
}

/// The best allocation per pixel.
#[derive(Clone, Debug)]
pub struct PixelPlan {
    /// M/N of every pixel.
    pub ratios: Vec<f32>,
    /// Processor time of the pilot.
    pub seconds: f64,
}

impl Stage {
    /// Loads a scene for an image of `size` (width, height) pixels.
    pub fn load(path: &Path, size: [u32; 2], threads: Option<usize>) -> Result<Self, ReproduceError> {
        let options = LoadOptions { resolution: Some(size), ..LoadOptions::default() };
        let loaded = load(path, &options).map_err(|report| ReproduceError::Scene { path: path.to_owned(), report })?;
        let mut job = loaded.job(AccelKind::Embree, None)?;
        let cast = Arc::new(AtomicBool::new(true));
        let nothing: Box<dyn Accel> = Box::new(Bvh::new(Arc::default(), None));
        let inner = std::mem::replace(&mut job.world.accel, nothing);
        job.world.accel = Box::new(Shadows { inner, cast: Arc::clone(&cast) });
        let depth = job.settings().integrator.max_depth;
        Ok(Stage { job, shadows: cast, threads, depth })
    }

    /// The scene with the settings of the last method.
    pub fn job(&self) -> &RenderJob {
        &self.job
    }

    /// Sets the visibility cache of later renderings.
    pub fn set_visibility_cache(&mut self, visibility_cache: Option<VisibilityCache>) {
        self.job.lights.set_visibility_cache(visibility_cache);
    }

    /// Size of the image.
    pub fn size(&self) -> [u32; 2] {
        self.job.world.scene.film.resolution
    }

    /// Numbers of triangles and lights, for the page.
    pub fn facts(&self) -> [usize; 2] {
        let scene = &self.job.world.scene;
        [scene.geometry.primitive_counts().triangles, scene.lights.lights.len()]
    }

    fn set(&mut self, method: &Method) {
        self.job.change(|settings| method.apply(settings, self.depth));
    }

    /// Determines the best allocation of an estimate's time to proposals and samples in each pixel, by the renderer's
    /// own pilot.
    pub fn plan_per_pixel(&mut self, times: Costs, budget: f64) -> Result<PixelPlan, ReproduceError> {
        let start = processor_time::of_process();
        self.set(&Method { per_pixel: true, ..Method::ris(1, 1) });
        self.job.world.scene.film.filter = PixelFilter::Box { rx: CENTRE, ry: CENTRE };
        self.shadows.store(true, Ordering::Relaxed);
        let pool = thread_pool(self.threads).map_err(RenderError::from)?;
        let map = pool.install(|| sample_count_map(&self.job, times, budget));
        let seconds = processor_time::of_process().saturating_sub(start).as_secs_f64();
        let ratios = map.ratios.clone();
        self.job.sample_count_map = Some(map);
        Ok(PixelPlan { ratios, seconds })
    }

    /// Renders `spp` camera rays per pixel.
    pub fn render(
        &mut self,
        method: &Method,
        view: View,
        spp: u32,
        seed: u32,
        observer: Observer<'_>,
    ) -> Result<Rendering, ReproduceError> {
        self.set(method);
        let radius = if view == View::Antialiased { 0.5 } else { CENTRE };
        self.job.world.scene.film.filter = PixelFilter::Box { rx: radius, ry: radius };
        // The same footprint for short and long renderings, which estimate the same image
        self.job.change(|s| {
            (s.sampling.seed, s.sampling.spp, s.sampling.footprint_spp) = (seed, spp, Some(1));
        });
        self.shadows.store(view != View::Unshadowed, Ordering::Relaxed);
        let settings = RenderSettings { threads: self.threads, spp, ..RenderSettings::default() };
        let rendering = render(&self.job, &settings, observer.stop, &|_| ())?;
        if observer.stop.load(Ordering::Relaxed) { Err(ReproduceError::Stopped) } else { Ok(rendering) }
    }
}

/// Times of a rendering (s). Times of the stages are wall-clock times, summed over threads.
#[derive(Clone, Copy, Debug, Default, Serialize)]
pub struct Seconds {
    /// Processor time of all threads.
    pub processor: f64,
    /// Wall-clock time.
    pub wall: f64,
    /// Tracing camera rays.
    pub camera: f64,
    /// Hits, textures, materials.
    pub shade: f64,
    /// Proposals.
    pub t1: f64,
    /// Drawing samples from them, and summation.
    pub select: f64,
    /// Shadow segments.
    pub t2: f64,
}

impl Seconds {
    /// Times of a rendering with this processor time.
    fn new(rendering: &Rendering, processor: Duration) -> Self {
        let s = &rendering.stats;
        Seconds {
            processor: processor.as_secs_f64(),
            wall: rendering.elapsed.as_secs_f64(),
            camera: (s.camera_time + s.bounce_time).as_secs_f64(),
            shade: s.shade_time.as_secs_f64(),
            t1: s.direct.t1.as_secs_f64(),
            select: s.direct.select.as_secs_f64(),
            t2: s.direct.t2.as_secs_f64(),
        }
    }

    /// Direct lighting.
    pub fn direct(&self) -> f64 {
        self.t1 + self.select + self.t2
    }

    /// All stages.
    pub fn stages(&self) -> f64 {
        self.camera + self.shade + self.direct()
    }
}

/// A number and its standard error.
#[derive(Clone, Copy, Debug, Default, Serialize)]
pub struct Estimate {
    /// The number.
    pub value: f64,
    /// Its standard error.
    pub error: f64,
}

/// Measurements over the turns of a method.
#[derive(Clone, Debug)]
pub struct Measured {
    /// The method.
    pub method: Method,
    /// Luminance of every pixel, turn by turn.
    luminance: Vec<Vec<f32>>,
    /// Sum over the turns of the pixels' radiance.
    sum: Vec<[f64; 3]>,
    /// The image of the first turn.
    pub first: Vec<[f32; 3]>,
    /// Times, turn by turn.
    pub seconds: Vec<Seconds>,
    /// Shadow segments of all turns.
    pub segments: u64,
    /// Proposals of all turns.
    pub proposals: u64,
    /// Number of non-finite samples of all turns.
    pub invalid: u64,
}

impl Measured {
    fn new(method: Method) -> Self {
        Measured {
            method,
            luminance: Vec::new(),
            sum: Vec::new(),
            first: Vec::new(),
            seconds: Vec::new(),
            segments: 0,
            proposals: 0,
            invalid: 0,
        }
    }

    /// Adds a turn.
    fn add(&mut self, rendering: &Rendering, processor: Duration) {
        let means = radiance(&rendering.film);
        self.segments += rendering.stats.direct.segments;
        self.proposals += rendering.stats.direct.proposals;
        self.invalid += rendering.film.summary().invalid;
        if self.first.is_empty() {
            self.first = means.iter().map(|p| p.map(|v| v as f32)).collect();
            self.sum = vec![[0.0; 3]; means.len()];
        }
        for (sum, mean) in self.sum.iter_mut().zip(&means) {
            (0..3).for_each(|c| sum[c] += mean[c]);
        }
        self.luminance.push(means.iter().map(|&p| luminance(p) as f32).collect());
        self.seconds.push(Seconds::new(rendering, processor));
    }

    /// Luminance of every pixel, turn by turn.
    pub fn luminances(&self) -> &[Vec<f32>] {
        &self.luminance
    }

    /// Mean radiance of every pixel over the turns.
    pub fn mean_radiance(&self) -> Vec<[f64; 3]> {
        let turns = self.turns().max(1) as f64;
        self.sum.iter().map(|p| p.map(|v| v / turns)).collect()
    }

    /// Grey images with these luminances and zero times.
    #[cfg(test)]
    pub fn from_luminances(method: Method, turns: Vec<Vec<f32>>) -> Self {
        let mut m = Measured::new(method);
        m.sum = vec![[0.0; 3]; turns.first().map_or(0, Vec::len)];
        for turn in &turns {
            m.sum.iter_mut().zip(turn).for_each(|(s, &v)| *s = s.map(|x| x + f64::from(v)));
            m.seconds.push(Seconds::default());
        }
        m.luminance = turns;
        m
    }

    /// Number of turns.
    pub fn turns(&self) -> usize {
        self.luminance.len()
    }

    /// Variance of every pixel's estimate (luminance).
    pub fn variance_map(&self) -> Vec<f64> {
        let moments = |i: usize| {
            let mut w = Welford::new();
            self.luminance.iter().for_each(|turn| w.add(f64::from(turn[i])));
            w.variance()
        };
        (0..self.sum.len()).map(moments).collect()
    }

    /// Mean over the pixels of `mask` (all without one) of the variance of the pixel's estimate. Its standard error is
    /// estimated from the differences between turns.
    pub fn variance(&self, mask: Option<&[bool]>) -> Estimate {
        let turns = self.turns() as f64;
        let chosen: Vec<usize> = (0..self.sum.len()).filter(|&i| mask.is_none_or(|m| m[i])).collect();
        let mean = |i: usize| self.luminance.iter().map(|t| f64::from(t[i])).sum::<f64>() / turns;
        let means: Vec<f64> = chosen.iter().map(|&i| mean(i)).collect();
        let mut over_turns = Welford::new();
        for turn in &self.luminance {
            let squares = chosen.iter().zip(&means).map(|(&i, m)| (f64::from(turn[i]) - m).powi(2));
            over_turns.add(squares.sum::<f64>() / chosen.len().max(1) as f64 * turns / (turns - 1.0).max(1.0));
        }
        Estimate { value: over_turns.mean(), error: over_turns.standard_error() }
    }

    /// Mean luminance of the image, and its standard error from the variances of the pixels.
    pub fn mean(&self) -> Estimate {
        let (turns, pixels) = (self.turns() as f64, self.sum.len().max(1) as f64);
        let value = self.sum.iter().map(|&p| luminance(p)).sum::<f64>() / (turns * pixels);
        Estimate { value, error: (self.variance(None).value / (turns * pixels)).sqrt() }
    }

    /// Median over the turns of a time.
    pub fn median_seconds(&self, of: impl Fn(&Seconds) -> f64) -> f64 {
        median(self.seconds.iter().map(of))
    }

    /// Time relative to another method: the median over the turns.
    pub fn time_ratio(&self, base: &Measured) -> f64 {
        median(self.seconds.iter().zip(&base.seconds).map(|(a, b)| a.processor / b.processor.max(1e-12)))
    }

    /// Variance at equal time, relative to another method, over the pixels of `mask`.
    pub fn at_equal_time(&self, base: &Measured, mask: Option<&[bool]>) -> Estimate {
        let (a, b) = (self.variance(mask), base.variance(mask));
        if !(a.value > 0.0 && b.value > 0.0) {
            return Estimate::default();
        }
        let value = a.value / b.value * self.time_ratio(base);
        Estimate { value, error: value * (a.error / a.value).hypot(b.error / b.value) }
    }
}

/// Probability that the mean of a method differs from the mean of all others (weighted by their errors) at least as
/// much as measured, if all have the same expectation.
pub fn same_mean(all: &[Measured], method: usize) -> f64 {
    let (mut weights, mut sum) = (0.0, 0.0);
    for (_, m) in all.iter().enumerate().filter(|(i, _)| *i != method) {
        let mean = m.mean();
        let weight = 1.0 / mean.error.powi(2).max(1e-300);
        weights += weight;
        sum += weight * mean.value;
    }
    let own = all[method].mean();
    if weights == 0.0 { 1.0 } else { z_test(own.value, sum / weights, own.error.hypot(weights.sqrt().recip())).p_value }
}

/// Mean radiance of every pixel.
pub fn radiance(film: &Film) -> Vec<[f64; 3]> {
    film.pixels().iter().map(|p| p.mean()).collect()
}

/// Renders `turns` turns of all methods; the seeds of each method start at `first_seed`.
pub fn turns(
    stage: &mut Stage,
    methods: &[Method],
    view: View,
    spp: u32,
    turns: std::ops::Range<u32>,
    observer: Observer<'_>,
) -> Result<Vec<Measured>, ReproduceError> {
    // The order of the methods rotates by one from turn to turn
    let count = methods.len() as u32;
    let mut measured: Vec<Measured> = methods.iter().map(|&m| Measured::new(m)).collect();
    for turn in turns {
        for k in 0..count {
            let i = (k + turn) % count;
            let seed = 1 + turn * count + i;
            let m = &mut measured[i as usize];
            let start = processor_time::of_process();
            let rendering = stage.render(&m.method, view, spp, seed, observer)?;
            m.add(&rendering, processor_time::of_process().saturating_sub(start));
        }
    }
    Ok(measured)
}

/// The mean image of all turns of all methods, each with the same weight.
pub fn reference(all: &[Measured]) -> Vec<[f64; 3]> {
    let pixels = all.first().map_or(0, |m| m.sum.len());
    let turns: usize = all.iter().map(Measured::turns).sum();
    let mean = |i: usize| {
        let mut p = [0.0; 3];
        all.iter().for_each(|m| (0..3).for_each(|c| p[c] += m.sum[i][c]));
        p.map(|v| v / turns.max(1) as f64)
    };
    (0..pixels).map(mean).collect()
}

/// Size (width, height) of an image with the aspect ratio of `shape`, whose longer edge has `size` pixels.
pub(super) fn scaled(shape: [u32; 2], size: u32) -> [u32; 2] {
    let longer = shape[0].max(shape[1]).max(1);
    shape.map(|s| (s * size / longer).max(1))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn measured(turns: &[[f32; 2]], seconds: f64) -> Measured {
        let mut m = Measured::from_luminances(Method::mc(1), turns.iter().map(|t| t.to_vec()).collect());
        m.seconds.iter_mut().for_each(|s| s.processor = seconds);
        m
    }

    #[test]
    fn variance_is_the_unbiased_variance_over_turns_averaged_over_pixels() {
        let m = measured(&[[1.0, 0.0], [2.0, 4.0], [6.0, 2.0]], 1.0);
        assert_eq!(m.variance_map(), [7.0, 4.0]);
        assert!((m.variance(None).value - 5.5).abs() < 1e-12);
        assert!((m.variance(Some(&[false, true])).value - 4.0).abs() < 1e-12);
        assert!((m.mean().value - 2.5).abs() < 1e-6);
        assert!((m.mean().error - (5.5_f64 / 6.0).sqrt()).abs() < 1e-12);
    }

    #[test]
    fn a_method_of_half_the_variance_and_half_the_time_has_a_quarter_at_equal_time() {
        let a = measured(&[[1.0, 1.0], [3.0, 3.0]], 1.0);
        let r = 0.5_f32.sqrt();
        let b = measured(&[[2.0 - r, 2.0 - r], [2.0 + r, 2.0 + r]], 0.5);
        assert!((b.at_equal_time(&a, None).value - 0.25).abs() < 1e-6);
        assert!(same_mean(&[a, b], 0) > 0.9);
    }
}
