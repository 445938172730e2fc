//! Builds the cache. The result does not depend on the number of threads.
//!
//! Camera samples request records in rounds, for coarse subsets of the pixels first: every 16th pixel, then the pixels
//! between, and so on. The second camera samples follow after the first samples of all pixels. A round has four steps:
//!
//! 1. All camera samples are traced in parallel, through mirrors and glass. A diffuse hit without a usable record from
//!    earlier rounds requests one.
//! 2. Sequentially, requests are dropped that a record of minimum radius at an accepted request would serve.
//! 3. The remaining records are computed in parallel.
//! 4. Sequentially, in the order of the pixels, they are added.
//!
//! So a round depends only on earlier rounds.

use super::cache::IrradianceCache;
use super::gather::{BATCH, Gatherer, RecordRequest};
use super::octree::Octree;
use super::record::{Range, Record};
use crate::direct::{Fits, ShadingPoint};
use crate::film::PixelBounds;
use crate::integrators::camera_sample::{CameraSample, CameraSamples};
use crate::integrators::integrator::{Cameras, Tracer};
use crate::integrators::path::{AtVertices, PathTracer, PathVertex, Shading};
use crate::integrators::statistics::{BuildStats, PathStats};
use crate::scene::RenderJob;
use crate::settings::Cached;
use lumiris_numbers::math::{Bounds3, Vec3};
use rayon::prelude::*;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Instant;

/// Pixel stride of the first round.
const COARSEST: u32 = 16;
/// Camera samples per pixel that request records.
const SAMPLES: u32 = 2;
/// Maximum error of a record that prevents another request. Rendering accepts errors up to 1.
const COVERED: f32 = 0.7;
/// Minimum throughput for requests at vertices behind mirrors and glass.
const WORTHWHILE: f32 = 0.2;
/// Camera samples traced together.
const CHUNK: usize = 1024;
/// Records computed before they are added. The number of records per round is not limited.
const MAX_AT_ONCE: usize = 1 << 14;

/// A cache, and the counts and times of its build.
pub(super) struct BuiltCache {
    pub(super) cache: IrradianceCache,
    pub(super) stats: BuildStats,
}

/// Builds the cache for the pixels of the image. `stop` ends the build early.
pub(super) fn build(job: &RenderJob, cameras: Cameras<'_>, stop: &AtomicBool) -> BuiltCache {
    let start = Instant::now();
    let world_bounds = job.world.scene.geometry.world_bounds();
    let mut cache = IrradianceCache::new(job.settings().integrator.cache, &world_bounds);
    let mut stats = BuildStats::default();
    if holds_nothing(job) {
        return BuiltCache { cache, stats };
    }
    for round in rounds() {
        if cache.is_full() || stop.load(Ordering::Relaxed) {
            break;
        }
        stats.rounds += 1;

        // Request records, and drop redundant requests
        let pixels = round.pixels(job.world.scene.film.bounds);
        stats.camera_samples += pixels.len() as u64;
        let wanted = ask(job, &cache, &pixels, &|pixel| cameras(pixel, round.sample), &mut stats.paths);
        let wanted: Vec<RecordRequest> =
            wanted.into_iter().map(|w| RecordRequest { key: w.key | round.sample << 16, ..w }).collect();
        let chosen = without_redundant(&wanted, &cache, &world_bounds);
        stats.dropped += (wanted.len() - chosen.len()) as u64;

        // Compute and add the others
        for part in chosen.chunks(MAX_AT_ONCE) {
            if cache.is_full() || stop.load(Ordering::Relaxed) {
                break;
            }
            gather(job, part, &mut stats.paths).into_iter().for_each(|r| cache.insert(r));
        }
    }
    stats.elapsed = start.elapsed();
    BuiltCache { cache, stats }
}

/// True if all records would be black.
fn holds_nothing(job: &RenderJob) -> bool {
    let settings = &job.settings().integrator;
    let min_depth = match settings.cache.cached {
        Cached::Indirect => 2,
        Cached::All => 1,
    };
    settings.max_depth < min_depth || job.lights.lights.is_empty()
}

/// A subset of the pixels: x and y are `offset` modulo `stride`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Round {
    stride: u32,
    offset: [u32; 2],
    sample: u32,
}

/// All rounds: every pixel once for each of [`SAMPLES`] samples, coarse to fine.
fn rounds() -> Vec<Round> {
    let mut rounds = vec![Round { stride: COARSEST, offset: [0, 0], sample: 0 }];
    let mut stride = COARSEST;
    while stride > 1 {
        let half = stride / 2;
        rounds.extend([[half, half], [half, 0], [0, half]].map(|offset| Round { stride, offset, sample: 0 }));
        stride = half;
    }
    rounds.extend((1..SAMPLES).map(|sample| Round { stride: 1, offset: [0, 0], sample }));
    rounds
}

impl Round {
    /// The pixels, row by row.
    fn pixels(&self, bounds: PixelBounds) -> Vec<[u32; 2]> {
        let along = |from: u32, to: u32, offset: u32| {
            (from..to).filter(move |v| (v - from) % self.stride == offset % self.stride)
        };
        let rows = along(bounds.y0, bounds.y1, self.offset[1]);
        rows.flat_map(|y| along(bounds.x0, bounds.x1, self.offset[0]).map(move |x| [x, y])).collect()
    }
}

/// The records requested by the camera samples of some pixels, in the order of the pixels.
fn ask(
    job: &RenderJob,
    cache: &IrradianceCache,
    pixels: &[[u32; 2]],
    camera: &(dyn Fn([u32; 2]) -> CameraSample + Sync),
    stats: &mut PathStats,
) -> Vec<RecordRequest> {
    let parts: Vec<(Vec<RecordRequest>, PathStats)> = pixels
        .par_chunks(CHUNK)
        .map_init(PathTracer::default, |paths, pixels| {
            let samples: CameraSamples = pixels.iter().map(|&pixel| camera(pixel)).collect();
            (ask_chunk(job, cache, pixels, &samples, paths), paths.take_stats())
        })
        .collect();
    parts.iter().for_each(|(_, s)| stats.merge(s));
    parts.into_iter().flat_map(|(wanted, _)| wanted).collect()
}

/// Requests records at hits of camera paths without a usable record, and follows the paths through mirrors and glass.
fn ask_chunk(
    job: &RenderJob,
    cache: &IrradianceCache,
    pixels: &[[u32; 2]],
    samples: &CameraSamples,
    paths: &mut PathTracer,
) -> Vec<RecordRequest> {
    let (mut wanted, mut out) = (Vec::new(), Vec::new());
    let mut ask = |vertex: u32, v: &PathVertex<'_, '_>| {
        let (path, point) = (v.path, &v.point);
        let sample = path.sample as usize;
        let min = WORTHWHILE * samples.weight[sample].abs();
        let is_worthwhile = !(path.beta.map(f32::abs).max_component() < min);
        let sides = (0..).zip(unserved_sides(cache, point)).filter(|_| is_worthwhile);
        wanted.extend(sides.filter_map(|(side, ns)| Some((side, ns?))).map(|(side, ns)| RecordRequest {
            p: point.p,
            p_error: point.p_error,
            n: point.bsdf.n,
            ns,
            time: v.ray.time,
            pixel_width: pixel_width(path.width, point.p),
            spread: path.spread,
            pixel: pixels[sample],
            key: vertex << 1 | side,
        }));
        is_worthwhile
    };
    let own: &mut AtVertices<'_> = &mut |found, _| {
        found.each().map(|v| Shading { direct: None, next: ask(found.vertex, &v).then_some(v.point.bsdf) }).collect()
    };
    (paths.search.only_reflected, paths.only_specular) = (true, true);
    paths.search.start(job, samples, &mut out);
    paths.follow(job, &job.settings().integrator, Some(own), samples, &mut Fits::default(), &mut out);
    // The requests are in the order of the vertices
    wanted.sort_by_key(|w: &RecordRequest| [w.pixel[1], w.pixel[0]]);
    wanted
}

/// Normals of the sides of a diffuse surface without a usable record. Side 0 is the side of the viewer, if it
/// reflects; side 1 the other one, if it transmits.
fn unserved_sides(cache: &IrradianceCache, v: &ShadingPoint<'_>) -> [Option<Vec3>; 2] {
    let Some(part) = v.bsdf.lambertian(v.wo) else { return [None; 2] };
    let ns = v.viewer_normal();
    [(part.reflectance, ns), (part.transmittance, -ns)].map(|(albedo, ns)| {
        let asks = !albedo.is_black() && !cache.serves(v.p, ns, COVERED);
        asks.then_some(ns)
    })
}

/// Pixel width at `p`, at least the resolution of positions.
fn pixel_width(width: f32, p: Vec3) -> f32 {
    width.max(1e-6 * p.abs().max_element()).max(1e-30)
}

/// Removes requests that a record of minimum radius at an earlier request would serve.
fn without_redundant(wanted: &[RecordRequest], cache: &IrradianceCache, bounds: &Bounds3) -> Vec<RecordRequest> {
    let settings = cache.settings();
    let mut chosen: Vec<RecordRequest> = Vec::new();
    let mut ranges: Vec<Range> = Vec::new();
    let mut tree = Octree::new(bounds);
    for w in wanted {
        let mut is_served = false;
        tree.at_point(w.p, |id| is_served |= ranges[id as usize].error(settings.error, w.p, w.ns) <= COVERED);
        if !is_served {
            let reach = settings.radius[0] * w.pixel_width;
            tree.insert(ranges.len() as u32, w.p, reach);
            ranges.push(Range { p: w.p, n: w.ns, reach });
            chosen.push(*w);
        }
    }
    chosen
}

/// Computes the requested records, in their order.
fn gather(job: &RenderJob, wanted: &[RecordRequest], stats: &mut PathStats) -> Vec<Record> {
    let parts: Vec<(Vec<Record>, PathStats)> = wanted
        .par_chunks(BATCH)
        .map_init(Gatherer::default, |gatherer, wanted| (gatherer.records(job, wanted), gatherer.take_stats()))
        .collect();
    parts.iter().for_each(|(_, s)| stats.merge(s));
    parts.into_iter().flat_map(|(records, _)| records).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::settings::IrradianceCacheSettings;

    #[test]
    fn rounds_take_every_pixel_once_for_each_sample() {
        let bounds = PixelBounds { x0: 3, x1: 40, y0: 5, y1: 23 };
        for sample in 0..SAMPLES {
            let mut counts = vec![0; bounds.area()];
            for round in rounds().iter().filter(|r| r.sample == sample) {
                round.pixels(bounds).iter().for_each(|&pixel| counts[bounds.index_of(pixel)] += 1);
            }
            assert!(counts.iter().all(|&c| c == 1), "sample {sample}");
        }
    }

    #[test]
    fn a_point_beside_an_accepted_one_is_dropped() {
        let at = |x: f32, ns: Vec3| RecordRequest {
            p: Vec3::new(x, 0.0, 0.0),
            p_error: Vec3::ZERO,
            n: Vec3::Z,
            ns,
            time: 0.0,
            pixel_width: 0.01,
            spread: 0.0,
            pixel: [0, 0],
            key: 0,
        };
        let bounds = Bounds3 { min: Vec3::splat(-1.0), max: Vec3::splat(1.0) };
        let settings = IrradianceCacheSettings { radius: [1.5, 20.0], ..Default::default() };
        let cache = IrradianceCache::new(settings, &bounds);
        // 1.5 pixels of 0.01 times 0.7
        let wanted = [at(0.0, Vec3::Z), at(0.0, -Vec3::Z), at(0.010, Vec3::Z), at(0.011, Vec3::Z), at(0.02, Vec3::Z)];
        let chosen = without_redundant(&wanted, &cache, &bounds);
        let places: Vec<_> = chosen.iter().map(|w| (w.p.x, w.ns.z)).collect();
        assert_eq!(places, [(0.0, 1.0), (0.0, -1.0), (0.011, 1.0)]);
    }
}
