//! Photon maps: speed of photon tracing in a scene, and of building and querying maps.
//!
//! `cargo bench --bench photons -- [scene.pbrt] [thousands of paths, default 200]`
#![allow(clippy::print_stdout, clippy::unwrap_used, missing_docs)]

use lumiris::import::{LoadOptions, load};
use lumiris::photons::{
    GatherPoint, GatherScratch, ImportanceSettings, Origin, Photon, PhotonBudget, PhotonMap, Search, Tracing,
    trace_importons, trace_photons,
};
use lumiris::scene::AccelKind;
use lumiris_numbers::math::{Rgb, Vec3};
use lumiris_test_support::random::{RngExt, pcg32};
use std::path::Path;
use std::time::Instant;

const PHOTONS: usize = 1_000_000;
const QUERIES: usize = 50_000;

/// Photons on a plane, or on the six faces of a box.
fn photons(faces: usize) -> Vec<Photon> {
    let mut stream = pcg32([1, 2, faces as u32]);
    let photon = |i: usize| {
        let [u, v] = stream.random::<[f32; 2]>();
        let (axis, side) = (i % faces / 2, (i % 2) as f32 * (faces / 6) as f32);
        let mut n = Vec3::ZERO;
        n[axis] = if side == 0.0 { 1.0 } else { -1.0 };
        let mut p = Vec3::splat(side);
        p[(axis + 1) % 3] = u;
        p[(axis + 2) % 3] = v;
        Photon::new(p, n, n, Rgb::WHITE, Origin::Diffuse)
    };
    (0..PHOTONS).map(photon).collect()
}

fn maps() {
    // Build
    for (name, faces) in [("a plane", 1), ("the faces of a box", 6)] {
        let photons = photons(faces);
        let copy = photons.clone();
        let start = Instant::now();
        let map = PhotonMap::new(copy);
        let build = start.elapsed().as_secs_f64();
        let places: Vec<GatherPoint> =
            (0..QUERIES).map(|i| &photons[i * 19]).map(|p| GatherPoint::flat(p.p(), p.n())).collect();
        println!("10⁶ photons on {name}: built in {:.0} ms, {:.1} bytes each", build * 1e3, map.bytes() as f64 / 1e6);

        // Query
        let mut scratch = GatherScratch::default();
        for (name, search) in [
            ("50 nearest", Search::Nearest { count: 50, max_radius: 0.1 }),
            ("200 nearest", Search::Nearest { count: 200, max_radius: 0.1 }),
            ("radius 0.004", Search::Radius(0.004)),
        ] {
            let start = Instant::now();
            let sum: f32 = places.iter().map(|at| map.irradiance(at, search, &mut scratch).g).sum();
            let rate = QUERIES as f64 / start.elapsed().as_secs_f64();
            println!("  {name}: {rate:.0} queries/s on one thread (mean {:.3e})", sum / QUERIES as f32);
        }
    }
}

fn tracing(path: &Path, paths: u64) {
    let loaded = load(path, &LoadOptions::default()).map_err(|d| d.to_string()).unwrap();
    let job = loaded.job(AccelKind::Embree, None).unwrap();
    // Photons, then importons and photons by importance
    for threads in [1, 2] {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| {
            let traced = trace_photons(&job, &Tracing::default(), None, PhotonBudget::Paths(paths)).unwrap();
            let seconds = traced.elapsed.as_secs_f64();
            println!(
                "{} on {threads} threads: {:.0} photons/s, {:.0} photon paths/s, {:.0} rays/s; {} global, {} caustic",
                path.display(),
                traced.arrivals_per_second(),
                traced.paths as f64 / seconds,
                traced.rays as f64 / seconds,
                traced.global.len(),
                traced.caustic.len(),
            );
            let start = Instant::now();
            let importance = trace_importons(&job, &ImportanceSettings::default()).unwrap();
            println!("  importance: {} importons in {:.2} s", importance.map().len(), start.elapsed().as_secs_f64());
            let by = trace_photons(&job, &Tracing::default(), Some(&importance), PhotonBudget::Paths(paths));
            let by = by.unwrap();
            println!("  with it: {:.0} photons/s, {} stored", by.arrivals_per_second(), by.stored());
        });
    }
}

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).filter(|a| !a.starts_with("--")).collect();
    maps();
    if let Some(path) = arguments.first() {
        let thousands = arguments.get(1).and_then(|a| a.parse().ok()).unwrap_or(200);
        tracing(Path::new(path), thousands * 1000);
    }
}
