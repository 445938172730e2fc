//! Path tracing whose roulette knows what lies ahead: pilot paths find that before the image is rendered.
//!
//! Two paths each go through pixels spread over the image, with random numbers of their own, so that the image remains
//! unbiased. What such a path finds after it arrived at a vertex, by the throughput that it arrived with, is an estimate of
//! the radiance that is reflected there; the difference of the two paths gives the variance of a pixel. Costs are counts of
//! vertices and rays, not times: the image does not depend on how busy the computer is.

use super::arrivals::{Mode, Recorded};
use super::path::PathTracer;
use super::roulette::{PixelMeans, Roulette, Tail};
use super::segment::{CameraSample, PathStats};
use super::{Integrator, Statistics, Tracer};
use crate::direct::{Estimator, Fits};
use crate::film::{FeatureSet, PixelSample};
use crate::scene::RenderJob;
use crate::settings::IntegratorSettings;
use lumiris_numbers::math::hash::pcg4d;
use lumiris_numbers::math::{Rgb, Vec2};
use lumiris_numbers::samplers::{SampleStream, SamplerKind};
use rayon::prelude::*;
use std::sync::Arc;

/// Combined with the seed of the image to give that of the pilot.
const SEED: u32 = 0x70_69_6c_74;
/// Camera samples of the image per pilot path, and limits of the number of these.
const SAMPLES_PER_PATH: u64 = 32;
const PATHS: [u64; 2] = [1 << 12, 1 << 17];
/// The bounce before which roulette on throughput may end pilot paths.
const ROULETTE_DEPTH: u32 = 8;
/// Vertices of a path that have estimates of their own.
const MAX_VERTICES: u32 = 16;
/// Grid cells along the edge of a block of pixels.
const BLOCK: u32 = 4;
/// Cost of a vertex with its direct light, and of the ray to the next one.
const VERTEX_COST: f32 = 2.0;
const RAY_COST: f32 = 1.0;

/// Variance of the stratified samples of an image by that of independent ones. Calibrated: what it is varies with the
/// scene and the number of samples, and a third was best in most.
const STRATIFIED: f64 = 1.0 / 3.0;

/// Path tracing with roulette and splitting by a pilot.
#[derive(Debug)]
pub struct GuidedIntegrator {
    roulette: Arc<Roulette>,
    settings: IntegratorSettings,
    pilot: PathStats,
}

impl GuidedIntegrator {
    /// Traces the pilot.
    pub fn new(job: &RenderJob) -> Self {
        let (roulette, pilot) = learn(job);
        Self::with(job, roulette, pilot)
    }

    /// With what a pilot is supposed to have found.
    fn with(job: &RenderJob, roulette: Roulette, pilot: PathStats) -> Self {
        // Roulette on throughput is left to what the pilot found
        let settings = IntegratorSettings { roulette_depth: None, ..job.settings().integrator };
        GuidedIntegrator { roulette: Arc::new(roulette), settings, pilot }
    }

    /// The settings of paths by [`Self::path_tracer`].
    pub fn settings(&self) -> &IntegratorSettings {
        &self.settings
    }

    /// Traces paths that end and split by what the pilot found.
    pub fn path_tracer(&self, features: FeatureSet) -> PathTracer {
        let mut paths = PathTracer::new(features);
        paths.search.arrivals.mode = Mode::Guided(Arc::clone(&self.roulette));
        paths
    }
}

impl Integrator for GuidedIntegrator {
    fn tracer(&self, features: FeatureSet) -> Box<dyn Tracer + '_> {
        Box::new(GuidedTracer { settings: &self.settings, paths: self.path_tracer(features) })
    }

    fn statistics(&self, mut paths: PathStats) -> Statistics {
        paths.merge(&self.pilot);
        Statistics { paths, ..Statistics::default() }
    }
}

/// Traces with what the pilot found.
struct GuidedTracer<'a> {
    settings: &'a IntegratorSettings,
    paths: PathTracer,
}

impl Tracer for GuidedTracer<'_> {
    fn trace(&mut self, job: &RenderJob, samples: &[CameraSample], fits: &mut Fits, out: &mut Vec<PixelSample>) {
        self.paths.trace(job, self.settings, samples, fits, out);
    }

    fn keep_light_layers(&mut self, count: usize) {
        self.paths.keep_light_layers(count);
    }

    fn light_layers(&mut self) -> &mut [Rgb] {
        self.paths.light_layers()
    }

    fn take_stats(&mut self) -> PathStats {
        self.paths.take_stats()
    }
}

/// The grid of pixels through which pilot paths go.
struct Grid {
    /// Distance between pixels.
    edge: f64,
    columns: u32,
    rows: u32,
    seed: u32,
}

impl Grid {
    fn new(job: &RenderJob) -> Self {
        let (bounds, sampling) = (job.world.scene.film.bounds, &job.settings().sampling);
        let paths = (bounds.area() as u64 * u64::from(sampling.spp) / SAMPLES_PER_PATH).clamp(PATHS[0], PATHS[1]);
        let edge = (bounds.area() as f64 / (paths / 2) as f64).sqrt();
        let count = |pixels: u32| ((f64::from(pixels) / edge).ceil() as u32).max(1);
        let [seed, ..] = pcg4d([sampling.seed, SEED, 0, 0]);
        Grid { edge, columns: count(bounds.width()), rows: count(bounds.height()), seed }
    }

    /// The pair of camera samples of a cell.
    fn pair(&self, job: &RenderJob, settings: &IntegratorSettings, [column, row]: [u32; 2]) -> [CameraSample; 2] {
        let scene = &job.world.scene;
        let bounds = scene.film.bounds;
        let stream = |sample| SampleStream::new(SamplerKind::Independent, [column, row], sample, self.seed);
        let [ux, uy] = stream(0).domain(0).draw::<2>();
        let place = |i: u32, u: f32, first: u32, end: u32| {
            (first + ((f64::from(i) + f64::from(u)) * self.edge) as u32).min(end.max(1) - 1)
        };
        let pixel = [place(column, ux, bounds.x0, bounds.x1), place(row, uy, bounds.y0, bounds.y1)];
        [1, 2].map(|sample| {
            let stream = stream(sample);
            let [fx, fy, lx, ly] = stream.domain(0).draw::<4>();
            let [time] = stream.domain(1).draw::<1>();
            let film = Vec2::new(pixel[0] as f32 + fx, pixel[1] as f32 + fy);
            let ray = scene.camera.ray(film, [lx, ly], time);
            let weight = ray.weight * scene.film.scale;
            let sample_counts = settings.sample_counts();
            CameraSample {
                ray,
                weight,
                stream,
                direct: stream,
                sample_counts,
                turn: sample,
                fit: 0,
                pixel,
                is_replica: false,
            }
        })
    }
}

/// What pilot paths of a row found.
struct Row {
    /// Pixel and radiance of each path; two in succession are a pair.
    paths: Vec<([u32; 2], Rgb)>,
    /// By vertex.
    tails: Vec<Vec<Tail>>,
    /// Sum over the paths.
    cost: f64,
    stats: PathStats,
}

/// Traces the paths of a row of the grid.
fn trace_row(tracer: &mut PathTracer, job: &RenderJob, settings: &IntegratorSettings, grid: &Grid, row: u32) -> Row {
    let samples: Vec<CameraSample> =
        (0..grid.columns).flat_map(|column| grid.pair(job, settings, [column, row])).collect();
    let mut out = Vec::new();
    tracer.search.arrivals.mode = Mode::Recorded(Vec::new());
    tracer.trace(job, settings, &samples, &mut Fits::default(), &mut out);
    let Mode::Recorded(arrivals) = std::mem::take(&mut tracer.search.arrivals.mode) else { unreachable!("set above") };

    let mut lengths = vec![0_u32; samples.len()];
    arrivals.iter().for_each(|a| lengths[a.sample as usize] += 1);
    let depth = settings.depth();
    let cost = |length: u32, vertex: u32| {
        let rays = length.min(depth - 1).saturating_sub(vertex);
        (length - vertex) as f32 * VERTEX_COST + rays as f32 * RAY_COST
    };
    let mut tails = vec![Vec::new(); depth.min(MAX_VERTICES) as usize];
    let last = tails.len().saturating_sub(1);
    for a in &arrivals {
        let l = reflected(a, out[a.sample as usize].radiance);
        let length = lengths[a.sample as usize];
        if l.is_finite() && length > a.vertex {
            let tail = Tail { p: a.p, n: a.n, l, cost: cost(length, a.vertex) };
            tails[(a.vertex as usize).min(last)].push(tail);
        }
    }
    let paths = samples.iter().zip(&out).map(|(s, o)| (s.pixel, o.radiance)).collect();
    let costs = lengths.iter().map(|&length| if length > 0 { cost(length, 0) } else { 0.0 } + RAY_COST);
    Row { paths, tails, cost: costs.map(f64::from).sum(), stats: tracer.take_stats() }
}

/// The estimate of the radiance that is reflected where a path has arrived, which found `total` in the end.
fn reflected(arrival: &Recorded, total: Rgb) -> Rgb {
    let found = total - arrival.before;
    let per_channel = |c: usize| if arrival.beta[c] == 0.0 { 0.0 } else { found[c] / arrival.beta[c] };
    Rgb::from_array([0, 1, 2].map(per_channel))
}

/// Traces the pilot.
fn learn(job: &RenderJob) -> (Roulette, PathStats) {
    let all = &job.settings().integrator;
    let settings = IntegratorSettings { roulette_depth: Some(ROULETTE_DEPTH), ..Estimator::without_fits(all, 0) };
    let grid = Grid::new(job);
    let rows: Vec<Row> = (0..grid.rows)
        .into_par_iter()
        .map_init(|| PathTracer::new(FeatureSet::None), |tracer, row| trace_row(tracer, job, &settings, &grid, row))
        .collect();

    // Means of the image
    let mut pixels = PixelMeans::new(job.world.scene.film.bounds, (grid.edge * f64::from(BLOCK)).ceil() as u32);
    for (pixel, l) in rows.iter().flat_map(|row| &row.paths).filter(|(_, l)| l.is_finite()) {
        pixels.add(*pixel, *l);
    }
    pixels.finish();

    // Relative variance and cost of a camera sample
    let pairs = || rows.iter().flat_map(|row| row.paths.chunks_exact(2));
    let variance = |pair: &[([u32; 2], Rgb)]| {
        let d = pair[0].1 - pair[1].1;
        f64::from((d * d * pixels.weight(pair[0].0)).average()) / 2.0
    };
    let variance: f64 = pairs().map(variance).filter(|v| v.is_finite()).sum::<f64>() / pairs().count().max(1) as f64;
    let count: usize = rows.iter().map(|row| row.paths.len()).sum();
    let cost = rows.iter().map(|row| row.cost).sum::<f64>() / count.max(1) as f64;
    let cost_by_variance = if variance > 0.0 { (cost / (variance * STRATIFIED)) as f32 } else { 0.0 };

    let mut stats = PathStats::default();
    let mut tails: Vec<Vec<Tail>> = vec![Vec::new(); settings.depth().min(MAX_VERTICES) as usize];
    for row in rows {
        stats.merge(&row.stats);
        tails.iter_mut().zip(row.tails).for_each(|(all, tails)| all.extend(tails));
    }
    let (_, radius) = job.world.scene.geometry.world_bounds().bounding_sphere();
    (Roulette::new(all, tails, radius, (pixels, cost_by_variance)), stats)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::import::{LoadOptions, load};
    use crate::scene::AccelKind;
    use crate::settings::RouletteKind;
    use lumiris_numbers::math::Vec3;
    use std::path::Path;

    const SAMPLES: u32 = 1 << 15;

    /// Moments that have nothing to do with the scene: many paths in one half of it, few in the other.
    fn wrong(job: &RenderJob) -> GuidedIntegrator {
        let tail = |i: u32| {
            let u = SampleStream::new(SamplerKind::Independent, [i, 0], 0, 5).draw::<3>();
            let p = Vec3::from_array(u) * 4.0 - 2.0;
            let l = if p.x + p.y > 0.0 { 1.3 * (i % 2) as f32 } else { 0.001 };
            Tail { p, n: [Vec3::X, -Vec3::Z][(i / 2 % 2) as usize], l: Rgb::splat(l), cost: 1.0 }
        };
        let settings = &job.settings().integrator;
        let tails = vec![(0..4096).map(tail).collect(); settings.depth() as usize];
        let mut pixels = PixelMeans::new(job.world.scene.film.bounds, 4);
        pixels.finish();
        GuidedIntegrator::with(job, Roulette::new(settings, tails, 2.0, (pixels, 1.0)), PathStats::default())
    }

    /// Each channel's mean is compared at the level 10⁻⁵, 12 of them; a bias of 5 % would be found with a probability
    /// above 0.99.
    #[test]
    fn what_a_pilot_found_does_not_bias_the_image_though_it_is_wrong() {
        let answers = [
            ("furnace-box-3", [0.9375, 0.664_062_5, 1.367_187_5]),
            ("furnace-closed-4", [0.96875, 0.666_015_6, 1.525_390_6]),
        ];
        for (name, answer) in answers {
            for kind in [RouletteKind::Efficiency, RouletteKind::Adjoint] {
                let path =
                    Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/analytic").join(name).with_extension("pbrt");
                let mut loaded = load(&path, &LoadOptions::default()).map_err(|d| d.to_string()).unwrap();
                loaded.settings.integrator.roulette = kind;
                let job = loaded.job(AccelKind::Embree, None).unwrap();
                let guided = wrong(&job);
                let grid = Grid { edge: 0.02, columns: SAMPLES / 2, rows: 1, seed: 3 };
                let mut tracer = guided.path_tracer(FeatureSet::None);
                let (mut out, mut l) = (Vec::new(), Vec::new());
                for first in (0..grid.columns).step_by(2048) {
                    let pairs = (first..first + 2048).flat_map(|i| grid.pair(&job, guided.settings(), [i, 0]));
                    let samples: Vec<CameraSample> = pairs.collect();
                    tracer.trace(&job, guided.settings(), &samples, &mut Fits::default(), &mut out);
                    l.extend(out.iter().map(|o| o.radiance));
                }
                for (c, answer) in answer.into_iter().enumerate() {
                    let n = l.len() as f64;
                    let mean = l.iter().map(|l| f64::from(l[c])).sum::<f64>() / n;
                    let variance = l.iter().map(|l| (f64::from(l[c]) - mean).powi(2)).sum::<f64>() / (n - 1.0);
                    let error = (variance / n).sqrt();
                    assert!(error > 0.0 && 7.0 * error < 0.05 * answer, "{name} {kind:?}: noise {error}");
                    assert!((mean - answer).abs() < 4.42 * error, "{name} {kind:?}: {mean} ± {error}, not {answer}");
                }
                // Paths both end and split
                let vertices = tracer.take_stats().direct.proposals;
                assert!(vertices != u64::from(SAMPLES) * u64::from(guided.settings().depth()), "{vertices}");
            }
        }
    }
}
