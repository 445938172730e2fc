//! Speed of the stages on one thread: ray queries against bare Embree loops with the same rays, and the time per stage
//! of a rendering.
//!
//! The rays are recorded from a rendering: whole batches, spread evenly over the image. The renderer and the bare loop
//! alternate; one run of each is a turn. The time of a batch is the median over the turns, so that other load on the
//! machine matters little.

use lumiris::accel::embree::bare::{Bare, Packed};
use lumiris::accel::embree::{EmbreeAccel, EmbreeError};
use lumiris::accel::{Accel, Coherence, RayBatch};
use lumiris::direct::{Estimator, Fits};
use lumiris::geometry::AlphaSource;
use lumiris::integrators::CameraSamples;
use lumiris::integrators::path::Recording;
use lumiris::integrators::{PathStats, PathTracer, Tracer};
use lumiris::render::BATCH_PATHS;
use lumiris::render::measured_batches::camera_batches;
use lumiris::scene::RenderJob;
use lumiris::settings::IntegratorKind;
use lumiris_numbers::estimators::stats::median;
use lumiris_numbers::math::hash::HashStream;
use serde::Serialize;
use std::hint::black_box;
use std::sync::Arc;
use std::time::{Duration, Instant};

/// Seed of the shuffle.
const SHUFFLE: u32 = 0x5EED;

/// Measurements and their extent.
#[derive(Clone, Copy, Debug)]
pub struct BenchSettings {
    /// Measure first hits.
    pub intersect: bool,
    /// Measure the stages of a rendering, and the cost of a proposal.
    pub t1: bool,
    /// Measure shadow segments.
    pub t2: bool,
    /// Runs of each loop.
    pub runs: u32,
    /// Maximum number of camera rays.
    pub rays: usize,
    /// Rays per packet; `None` for the processor's best width.
    pub packet_width: Option<u32>,
    /// Edge of a tile in pixels.
    pub tile_size: u32,
}

/// Results.
#[derive(Clone, Debug, Serialize)]
pub struct Report {
    /// Camera rays.
    pub camera_rays: usize,
    /// Time to build the ray tracer and the structures of the bare loop, on all cores (s).
    pub build_seconds: Option<[f64; 2]>,
    /// First hits.
    pub intersect: Vec<RayCase>,
    /// Shadow segments.
    pub t2: Vec<RayCase>,
    /// Proposals.
    pub t1: Option<Proposals>,
    /// Times of the stages of a rendering of these camera rays, in order.
    pub stages: Vec<Stage>,
}

/// A ray query by the renderer and by the bare loop.
#[derive(Clone, Debug, Serialize)]
pub struct RayCase {
    /// Kind of rays.
    pub name: &'static str,
    /// Rays per packet.
    pub width: u32,
    /// Number of rays.
    pub rays: usize,
    /// Rays with a hit, by the renderer.
    pub hits: usize,
    /// Rays with a hit, by the bare loop.
    pub bare_hits: usize,
    /// Speed of the renderer (10⁶ rays/s), from the medians of its batches.
    pub mrays: f64,
    /// Speed of the bare loop (10⁶ rays/s), from the medians of its batches.
    pub bare_mrays: f64,
    /// The renderer's speed relative to the bare loop.
    pub ratio: f64,
    /// Median of the ratio of whole turns.
    pub turn_ratio: f64,
    /// The smallest and the largest ratio of a turn.
    pub turn_ratio_range: [f64; 2],
    /// Times of each turn (s): renderer, bare loop.
    pub seconds: Vec<[f64; 2]>,
}

/// Cost of a proposal of T1, median over the runs.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Proposals {
    /// Light samples.
    pub light_proposals: u64,
    /// BSDF samples.
    pub bsdf_proposals: u64,
    /// Time per light sample (ns).
    pub light_nanoseconds: Option<f64>,
    /// Time per BSDF sample (ns), including the search for the emitter.
    pub bsdf_nanoseconds: Option<f64>,
}

/// A stage of a rendering.
#[derive(Clone, Debug, Serialize)]
pub struct Stage {
    /// Name.
    pub name: &'static str,
    /// Median time of a run (s).
    pub seconds: f64,
    /// Number of items: rays, points or proposals.
    pub items: u64,
}

/// Runs the measurements. The ray tracers of `job` are dropped before the bare loops run, so that a large scene is not
/// in memory three times.
pub fn measure(mut job: RenderJob, settings: &BenchSettings) -> Result<Report, EmbreeError> {
    let batches = camera_batches(&job, settings.tile_size, settings.rays);
    let camera_rays = batches.iter().map(CameraSamples::len).sum();
    let mut report = Report {
        camera_rays,
        build_seconds: None,
        intersect: Vec::new(),
        t2: Vec::new(),
        t1: None,
        stages: Vec::new(),
    };
    if settings.t1 {
        stages(&job, &batches, settings.runs, &mut report);
    }
    if !settings.intersect && !settings.t2 {
        return Ok(report);
    }

    // Rays of paths of two segments, and the shadow segments at their vertices
    job.change(|settings| (settings.integrator.kind, settings.integrator.max_depth) = (IntegratorKind::Path, 2));
    let recording = record(&job, &batches);
    let (geometry, textures) = (Arc::clone(&job.world.scene.geometry), Arc::clone(&job.world.scene.textures));
    drop(job);

    let alpha = Some(textures as Arc<dyn AlphaSource>);
    let accel = EmbreeAccel::new(Arc::clone(&geometry), alpha.clone(), settings.packet_width)?;
    let bare = Bare::new(geometry, alpha)?;
    report.build_seconds = Some([accel.stats().build_seconds, bare.build_time().as_secs_f64()]);
    let pair = Pair { accel, bare, runs: settings.runs };
    if settings.intersect {
        report.intersect = pair.first_hits(&recording)?;
    }
    if settings.t2 {
        report.t2 = pair.segments(&recording)?;
    }
    Ok(report)
}

fn record(job: &RenderJob, batches: &[CameraSamples]) -> Recording {
    let mut tracer = PathTracer::default();
    tracer.record();
    let (mut fits, mut out) = (Fits::default(), Vec::new());
    for samples in batches {
        tracer.trace(job, &job.settings().integrator, samples, &mut fits, &mut out);
    }
    tracer.take_recording()
}

/// Renders the batches several times, and reports the times of the stages.
fn stages(job: &RenderJob, batches: &[CameraSamples], runs: u32, report: &mut Report) {
    // Run, once without measuring
    let mut tracer = PathTracer::default();
    let mut out = Vec::new();
    let fits = batches.iter().flat_map(|samples| &samples.fit).map(|fit| fit + 1).max().unwrap_or(0) as usize;
    let mut fits = Estimator::at_vertex(&job.settings().integrator, 0).fits(job, fits);
    let mut one_run = || {
        let start = Instant::now();
        for samples in batches {
            tracer.trace(job, &job.settings().integrator, samples, &mut fits, &mut out);
            black_box(&out);
        }
        (start.elapsed(), tracer.take_stats())
    };
    one_run();
    let runs: Vec<(Duration, PathStats)> = (0..runs.max(1)).map(|_| one_run()).collect();

    // Medians
    let of = |time: &dyn Fn(&(Duration, PathStats)) -> Duration| median(runs.iter().map(|r| time(r).as_secs_f64()));
    let last = runs[runs.len() - 1].1;
    let (direct, points) = (last.direct, last.camera_rays + last.bounce_rays);
    let bsdf_proposals = direct.proposals - direct.light_proposals;
    let (t1_light, t1_bsdf) = (of(&|r| r.1.direct.t1_light), of(&|r| r.1.direct.t1 - r.1.direct.t1_light));
    let stage = |name, seconds, items| Stage { name, seconds, items };
    // Stages
    report.stages = vec![
        stage("camera rays", of(&|r| r.1.camera_time), last.camera_rays),
        stage("bounce rays", of(&|r| r.1.bounce_time), last.bounce_rays),
        stage("shade", of(&|r| r.1.shade_time), points),
        stage("T1 light samples", t1_light, direct.light_proposals),
        stage("T1 BSDF samples", t1_bsdf, bsdf_proposals),
        stage("select and resolve", of(&|r| r.1.direct.select), direct.proposals),
        stage("T2 shadow segments", of(&|r| r.1.direct.t2), direct.segments),
        stage("all", of(&|r| r.0), last.camera_rays),
    ];

    // Proposals
    let per = |seconds: f64, count: u64| (count > 0).then(|| seconds * 1e9 / count as f64);
    report.t1 = Some(Proposals {
        light_proposals: direct.light_proposals,
        bsdf_proposals,
        light_nanoseconds: per(t1_light, direct.light_proposals),
        bsdf_nanoseconds: per(t1_bsdf, bsdf_proposals),
    });
}

/// A traced batch.
struct Traced {
    time: Duration,
    /// Rays that hit something.
    hits: usize,
}

/// The renderer's tracer and the bare loop over the same scene.
pub struct Pair {
    /// The renderer's tracer.
    pub accel: EmbreeAccel,
    /// The bare Embree loop.
    pub bare: Bare,
    /// Number of turns.
    pub runs: u32,
}

impl Pair {
    fn first_hits(&self, recording: &Recording) -> Result<Vec<RayCase>, EmbreeError> {
        let cases = [
            self.intersect("camera rays", &recording.camera, Coherence::Coherent)?,
            self.intersect("bounce rays", &recording.bounces, Coherence::Incoherent)?,
        ];
        Ok(cases.into_iter().flatten().collect())
    }

    fn segments(&self, recording: &Recording) -> Result<Vec<RayCase>, EmbreeError> {
        let native = self.accel.packet_width(Coherence::Packets);
        let mut cases = vec![self.occluded("shadow segments", &recording.segments, native)?];
        for width in [1, 4, 8, 16].into_iter().filter(|&w| w != native) {
            cases.push(self.occluded("shadow segments", &recording.segments, width)?);
        }
        cases.push(self.occluded("shuffled segments", &shuffled(&recording.segments), native)?);
        cases.push(self.occluded("segments of bounces", &recording.bounce_segments, native)?);
        Ok(cases.into_iter().flatten().collect())
    }

    /// First hits of batches of rays, in packets of the tracer's width; `None` without rays.
    pub fn intersect(
        &self,
        name: &'static str,
        batches: &[RayBatch],
        coherence: Coherence,
    ) -> Result<Option<RayCase>, EmbreeError> {
        // The bare loop gets the same packet width and coherence flag
        let coherent = coherence == Coherence::Coherent;
        let width = self.accel.packet_width(coherence);
        let mut hits = Vec::new();
        let ours = |rays: &RayBatch| {
            let time = time(|| self.accel.intersect(rays, coherence, &mut hits));
            Ok(Traced { time, hits: hits.iter().flatten().count() })
        };
        let bare = |rays: &RayBatch| {
            let mut packed = Packed::first(rays, width)?;
            let time = time(|| self.bare.trace(&mut packed, coherent));
            Ok(Traced { time, hits: packed.hits() })
        };
        self.compare(name, width, batches, ours, bare)
    }

    /// Occlusion of batches of segments in packets of `width`; `None` without segments.
    pub fn occluded(
        &self,
        name: &'static str,
        batches: &[RayBatch],
        width: u32,
    ) -> Result<Option<RayCase>, EmbreeError> {
        let accel = self.accel.with_packet_width(width)?;
        let mut occluded = Vec::new();
        let ours = |rays: &RayBatch| {
            let time = time(|| accel.occluded(rays, Coherence::Packets, &mut occluded));
            Ok(Traced { time, hits: occluded.iter().filter(|&&o| o).count() })
        };
        let bare = |rays: &RayBatch| {
            let mut packed = Packed::any(rays, width)?;
            let time = time(|| self.bare.trace(&mut packed, false));
            Ok(Traced { time, hits: packed.hits() })
        };
        self.compare(name, width, batches, ours, bare)
    }

    /// Alternates between both, after one turn that is not measured. Batches are copied just before they are traced, as
    /// in the renderer; the copy is not part of the time.
    fn compare(
        &self,
        name: &'static str,
        width: u32,
        batches: &[RayBatch],
        mut ours: impl FnMut(&RayBatch) -> Result<Traced, EmbreeError>,
        mut bare: impl FnMut(&RayBatch) -> Result<Traced, EmbreeError>,
    ) -> Result<Option<RayCase>, EmbreeError> {
        type Trace<'a> = &'a mut dyn FnMut(&RayBatch) -> Result<Traced, EmbreeError>;
        let turn = |trace: Trace<'_>| -> Result<(Vec<f64>, usize), EmbreeError> {
            let (mut seconds, mut all_hits) = (Vec::with_capacity(batches.len()), 0);
            for batch in batches {
                let Traced { time, hits } = trace(black_box(&batch.clone()))?;
                seconds.push(time.as_secs_f64());
                all_hits += hits;
            }
            Ok((seconds, all_hits))
        };
        let rays: usize = batches.iter().map(RayBatch::len).sum();
        if rays == 0 {
            return Ok(None);
        }
        let (hits, bare_hits) = (turn(&mut ours)?.1, turn(&mut bare)?.1);
        let mut turns = Vec::new();
        for _ in 0..self.runs.max(1) {
            turns.push([turn(&mut ours)?.0, turn(&mut bare)?.0]);
        }

        // The sum over batches of the median over turns, so that occasional interruptions do not count
        let of_batch = |slot: usize, batch: usize| median(turns.iter().map(|turn| turn[slot][batch]));
        let [ours, bare] = [0, 1].map(|slot| (0..batches.len()).map(|b| of_batch(slot, b)).sum::<f64>().max(1e-9));
        let seconds: Vec<[f64; 2]> =
            turns.iter().map(|turn| [0, 1].map(|slot| turn[slot].iter().sum::<f64>().max(1e-9))).collect();
        let ratios: Vec<f64> = seconds.iter().map(|[ours, bare]| bare / ours).collect();
        let mrays = |seconds: f64| rays as f64 * 1e-6 / seconds;
        Ok(Some(RayCase {
            name,
            width,
            rays,
            hits,
            bare_hits,
            mrays: mrays(ours),
            bare_mrays: mrays(bare),
            ratio: bare / ours,
            turn_ratio: median(ratios.iter().copied()),
            turn_ratio_range: [
                ratios.iter().copied().fold(f64::MAX, f64::min),
                ratios.iter().copied().fold(0.0, f64::max),
            ],
            seconds,
        }))
    }
}

fn time(run: impl FnOnce()) -> Duration {
    let start = Instant::now();
    run();
    start.elapsed()
}

/// All rays of the batches in random order, in batches of the renderer's size.
fn shuffled(batches: &[RayBatch]) -> Vec<RayBatch> {
    let places = batches.iter().enumerate().flat_map(|(b, batch)| (0..batch.len()).map(move |i| (b, i)));
    let mut order: Vec<(usize, usize)> = places.collect();
    let mut stream = HashStream::new([SHUFFLE, 0, 0]);
    for i in (1..order.len()).rev() {
        let j = (stream.next_2d()[0] * (i + 1) as f32) as usize;
        order.swap(i, j.min(i));
    }
    let batch_of = |places: &[(usize, usize)]| {
        let mut batch = RayBatch::default();
        places.iter().for_each(|&(b, i)| batch.push(&batches[b].get(i)));
        batch
    };
    order.chunks(BATCH_PATHS).map(batch_of).collect()
}
