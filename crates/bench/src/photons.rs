//! Speed of photon tracing, and of building and querying photon maps.

use lumiris::photons::{
    GatherPoint, GatherScratch, PhotonBudget, PhotonError, PhotonMap, Search, Tracing, trace_photons,
};
use lumiris::render::{RenderError, thread_pool};
use lumiris::scene::RenderJob;
use lumiris_numbers::estimators::stats::median;
use serde::Serialize;
use std::hint::black_box;
use std::time::Instant;

/// Photon paths per run.
const PATHS: u64 = 1 << 18;
/// Number of query points, at the positions of photons.
const QUERIES: usize = 1 << 14;

/// Results; times are medians over the runs.
#[derive(Clone, Debug, Serialize)]
pub struct PhotonReport {
    /// Photon paths per run.
    pub paths: u64,
    /// Photons at diffuse surfaces.
    pub photons: u64,
    /// Rays traced.
    pub rays: u64,
    /// Tracing: number of threads, and time (s).
    pub tracing: Vec<(usize, f64)>,
    /// Photons in the queried map.
    pub stored: usize,
    /// Bytes per photon of that map.
    pub bytes_per_photon: f64,
    /// Time to build it on all threads (s).
    pub build_seconds: f64,
    /// Kinds of queries, with their rates on one thread (1/s).
    pub queries: Vec<(&'static str, f64)>,
}

/// Traces photons on one thread and on `threads` threads (all cores if `None`), `runs` times each, and queries their
/// map.
pub fn measure_photons(job: &RenderJob, threads: Option<usize>, runs: u32) -> Result<PhotonReport, RenderError> {
    // Trace
    let one = thread_pool(Some(1))?;
    let all = thread_pool(threads)?;
    let budget = PhotonBudget::Paths(PATHS);
    let mut times = [Vec::new(), Vec::new()];
    let mut last = None;
    for run in 0..runs.max(1) {
        let tracing = Tracing { seed: run, ..Tracing::default() };
        for (pool, times) in [&one, &all].into_iter().zip(&mut times) {
            let traced = pool.install(|| trace_photons(job, &tracing, None, budget))?;
            times.push(traced.elapsed.as_secs_f64());
            last = Some(traced);
        }
    }
    let traced = last.unwrap_or_default();
    if traced.stored() == 0 {
        return Err(PhotonError::NothingStored { paths: PATHS, by_importance: false }.into());
    }
    let [alone, together] = times.map(median);
    let (photons, rays) = (traced.arrivals, traced.rays);

    let mut all_photons = traced.global;
    // Build the map
    all_photons.extend(traced.caustic);
    let mut builds = Vec::new();
    let mut map = PhotonMap::default();
    for _ in 0..runs.max(1) {
        let copy = all_photons.clone();
        let start = Instant::now();
        map = all.install(|| PhotonMap::new(copy));
        builds.push(start.elapsed().as_secs_f64());
    }

    // Query it
    let max_radius = job.lights.scene_radius;
    let nearest = |count| Search::Nearest { count, max_radius };
    let queries = [("50 nearest", nearest(50)), ("200 nearest", nearest(200))];
    Ok(PhotonReport {
        paths: PATHS,
        photons,
        rays,
        tracing: vec![(1, alone), (all.current_num_threads(), together)],
        stored: map.len(),
        bytes_per_photon: map.bytes() as f64 / map.len().max(1) as f64,
        build_seconds: median(builds),
        queries: queries.map(|(name, search)| (name, queries_per_second(&map, search, runs))).to_vec(),
    })
}

fn queries_per_second(map: &PhotonMap, search: Search, runs: u32) -> f64 {
    let stride = (map.len() / QUERIES).max(1);
    let places: Vec<GatherPoint> =
        map.photons().iter().step_by(stride).map(|p| GatherPoint::flat(p.p(), p.n())).collect();
    let mut scratch = GatherScratch::default();
    let mut times = Vec::new();
    for _ in 0..runs.max(1) {
        let start = Instant::now();
        places.iter().for_each(|at| {
            black_box(map.irradiance(at, search, &mut scratch));
        });
        times.push(start.elapsed().as_secs_f64());
    }
    places.len() as f64 / median(times).max(1e-12)
}
