//! Cost of a frame per camera sample on one thread, and the share of pure ray tracing: a bare Embree loop over exactly
//! the traced rays, in their order, in packets of the best width for each kind of ray.
//!
//! Whole batches, spread over the image, are rendered from the camera samples to the film. The renderer and the bare
//! loop alternate; one run of each is a turn.

use lumiris::accel::RayBatch;
use lumiris::accel::embree::EmbreeError;
use lumiris::accel::embree::bare::{Bare, Packed};
use lumiris::direct::Estimator;
use lumiris::film::PixelSample;
use lumiris::film::accumulator::PixelAccumulator;
use lumiris::film::packed::PackedSums;
use lumiris::geometry::AlphaSource;
use lumiris::integrators::CameraSamples;
use lumiris::integrators::path::Recording;
use lumiris::integrators::{PathStats, PathTracer, Tracer};
use lumiris::render::RenderSettings;
use lumiris::render::measured_batches::Batches;
use lumiris::scene::RenderJob;
use lumiris_numbers::estimators::stats::median;
use serde::Serialize;
use std::hint::black_box;
use std::sync::Arc;
use std::time::{Duration, Instant};

/// The cost of a frame.
#[derive(Clone, Debug, Serialize)]
pub struct FrameReport {
    /// Camera samples per turn.
    pub camera_samples: usize,
    /// Median time of the renderer per camera sample (ns).
    pub ns_per_camera_sample: f64,
    /// Median time of the bare loops per camera sample (ns).
    pub bare_trace_ns_per_camera_sample: f64,
    /// Time of the bare loops over the time of the renderer.
    pub tracing_share: f64,
    /// Time per camera sample of all stages. `paths` is the time of path tracing outside its other stages.
    pub stages: Vec<FrameStage>,
    /// The traced rays.
    pub rays: Vec<BareRays>,
    /// Time per camera sample (ns) of each turn: renderer, bare loops.
    pub turns: Vec<[f64; 2]>,
}

/// A stage of the renderer.
#[derive(Clone, Debug, Serialize)]
pub struct FrameStage {
    /// Name.
    pub name: &'static str,
    /// Median time (ns per camera sample).
    pub ns_per_camera_sample: f64,
}

/// Rays of one kind in the bare loop.
#[derive(Clone, Debug, Serialize)]
pub struct BareRays {
    /// Kind of rays.
    pub name: &'static str,
    /// Rays per camera sample.
    pub per_camera_sample: f64,
    /// Rays per packet.
    pub width: u32,
    /// Time of the bare loop per ray (ns), median of the turns.
    pub ns_per_ray: f64,
}

/// Batches of one kind of ray, with the fastest options of the bare loop.
struct Kind<'a> {
    name: &'static str,
    batches: &'a [RayBatch],
    is_occlusion: bool,
    width: u32,
    coherent: bool,
}

impl Kind<'_> {
    fn rays(&self) -> usize {
        self.batches.iter().map(RayBatch::len).sum()
    }

    /// Time of the bare loop over all rays, without packing.
    fn time(&self, bare: &Bare) -> Result<Duration, EmbreeError> {
        let mut sum = Duration::ZERO;
        for rays in self.batches {
            let pack = if self.is_occlusion { Packed::any } else { Packed::first };
            let mut packed = pack(rays, self.width)?;
            let start = Instant::now();
            bare.trace(&mut packed, self.coherent);
            sum += start.elapsed();
            black_box(&packed);
        }
        Ok(sum)
    }

    /// Chooses the fastest packet width and coherence flag.
    fn calibrate(&mut self, bare: &Bare) -> Result<(), EmbreeError> {
        let mut best = (Duration::MAX, self.width, self.coherent);
        for (width, coherent) in [(1, false), (4, false), (8, false), (16, false), (4, true), (8, true), (16, true)] {
            (self.width, self.coherent) = (width, coherent);
            let time = self.time(bare)?.min(self.time(bare)?);
            if time < best.0 {
                best = (time, width, coherent);
            }
        }
        (self.width, self.coherent) = (best.1, best.2);
        Ok(())
    }
}

/// Measures `turns` turns with about `rays` camera samples each.
pub fn measure_frame(job: &RenderJob, tile_size: u32, rays: usize, turns: u32) -> Result<FrameReport, EmbreeError> {
    // Batches
    let settings = RenderSettings { tile_size, spp: job.settings().sampling.spp, ..RenderSettings::default() };
    let batches = Batches::new(job, &settings, rays);
    let pixels = (0..batches.count()).map(|batch| batches.pixels(batch)).sum::<usize>();
    let camera_samples = pixels * batches.samples_per_pixel();

    // Record the rays
    let (tracer, samples, results, packed, times) = Default::default();
    let mut frame = Frame { job, batches, tracer, samples, results, packed, times };
    let recording = frame.record();

    // Calibrate the bare loop
    let (geometry, textures) = (Arc::clone(&job.world.scene.geometry), Arc::clone(&job.world.scene.textures));
    let bare = Bare::new(geometry, Some(textures as Arc<dyn AlphaSource>))?;
    let mut kinds = kinds(&recording);
    for kind in &mut kinds {
        kind.calibrate(&bare)?;
    }

    let per_sample = |time: Duration| time.as_secs_f64() * 1e9 / camera_samples.max(1) as f64;
    // Alternate between renderer and bare loop
    let mut stats: Vec<(PathStats, Times)> = Vec::new();
    let (mut both, mut of_kinds) = (Vec::new(), vec![Vec::new(); kinds.len()]);
    for _ in 0..turns.max(1) {
        let start = Instant::now();
        frame.render();
        let ours = start.elapsed();
        stats.push((frame.tracer.take_stats(), std::mem::take(&mut frame.times)));
        let mut sum = Duration::ZERO;
        for (kind, times) in kinds.iter().zip(&mut of_kinds) {
            let time = kind.time(&bare)?;
            sum += time;
            times.push(time.as_secs_f64() * 1e9 / kind.rays().max(1) as f64);
        }
        both.push([per_sample(ours), per_sample(sum)]);
    }

    // Medians
    let [ours, traced] = [0, 1].map(|slot| median(both.iter().map(|turn| turn[slot])));
    let rays = kinds.iter().zip(&of_kinds).map(|(kind, times)| BareRays {
        name: kind.name,
        per_camera_sample: kind.rays() as f64 / camera_samples.max(1) as f64,
        width: kind.width,
        ns_per_ray: median(times.iter().copied()),
    });
    Ok(FrameReport {
        camera_samples,
        ns_per_camera_sample: ours,
        bare_trace_ns_per_camera_sample: traced,
        tracing_share: traced / ours,
        stages: stages(&stats, per_sample),
        rays: rays.collect(),
        turns: both,
    })
}

/// Median times of the stages over all turns. `per_sample` divides a time by the number of camera samples.
fn stages(turns: &[(PathStats, Times)], per_sample: impl Fn(Duration) -> f64) -> Vec<FrameStage> {
    let stage = |name, of: &dyn Fn(&PathStats, &Times) -> Duration| FrameStage {
        name,
        ns_per_camera_sample: median(turns.iter().map(|(stats, times)| per_sample(of(stats, times)))),
    };
    let tracing = PathStats::default().stages();
    let tracing = tracing.iter().enumerate().map(|(i, (name, _))| stage(name, &|s, _| s.stages()[i].1));
    let mut stages = vec![stage("camera_samples", &|_, times| times.camera_samples)];
    stages.extend(tracing);
    stages.push(stage("paths", &|s, times| s.beside_stages(times.tracing)));
    stages.push(stage("film", &|_, times| times.film));
    stages
}

fn kinds(recording: &Recording) -> Vec<Kind<'_>> {
    let kind = |name, batches, is_occlusion| Kind { name, batches, is_occlusion, width: 1, coherent: false };
    let all = [
        kind("camera_rays", &recording.camera[..], false),
        kind("bounce_rays", &recording.bounces, false),
        kind("segments", &recording.segments, true),
        kind("bounce_segments", &recording.bounce_segments, true),
    ];
    all.into_iter().filter(|kind| kind.rays() > 0).collect()
}

/// Times of a turn.
#[derive(Default)]
struct Times {
    camera_samples: Duration,
    tracing: Duration,
    film: Duration,
}

/// The renderer on one thread, with its buffers.
struct Frame<'a> {
    job: &'a RenderJob,
    batches: Batches<'a>,
    tracer: PathTracer,
    samples: CameraSamples,
    results: Vec<PixelSample>,
    /// Packed sums of a batch, and scratch memory for packing.
    packed: (PackedSums, Vec<u8>),
    times: Times,
}

impl Frame<'_> {
    /// Renders once without counting, and returns the rays.
    fn record(&mut self) -> Recording {
        self.tracer.record();
        self.render();
        self.tracer.take_stats();
        self.times = Times::default();
        self.tracer.take_recording()
    }

    /// Renders the batches, from camera samples to sums of pixels.
    fn render(&mut self) {
        // From camera samples to packed sums, with the time of each step
        let integrator = &self.job.settings().integrator;
        for batch in 0..self.batches.count() {
            let start = Instant::now();
            self.batches.camera_samples(batch, &mut self.samples);
            self.times.camera_samples += start.elapsed();

            let start = Instant::now();
            let pixels = self.batches.pixels(batch);
            let mut fits = Estimator::at_vertex(integrator, 0).fits(self.job, pixels);
            self.tracer.trace(self.job, integrator, &self.samples, &mut fits, &mut self.results);
            self.times.tracing += start.elapsed();

            let start = Instant::now();
            let mut sums = vec![PixelAccumulator::default(); pixels];
            for (pixel, results) in sums.iter_mut().zip(self.results.chunks(self.batches.samples_per_pixel())) {
                pixel.add_all(0, results);
            }
            let (packed, scratch) = &mut self.packed;
            packed.set(&sums, scratch);
            black_box(packed);
            self.times.film += start.elapsed();
        }
    }
}
