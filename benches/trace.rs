//! Speed of the BVH on one thread, on a generated displaced sphere.
//!
//! `cargo bench --bench trace -- [triangles in thousands, default 1000] [rays in thousands, default 1000]`
#![allow(clippy::print_stdout, missing_docs)]

#[path = "support/sphere.rs"]
mod sphere;

use lumiris::accel::{Accel, Bvh, Coherence, Hit, RayBatch};
use lumiris::geometry::{Geometry, GeometrySet, Group, Shape, TriangleMesh, Visibility};
use lumiris_numbers::math::ray::offset_origin;
use lumiris_numbers::math::{Frame, Ray, Vec3, warp};
use lumiris_test_support::random::{RngExt, pcg32};
use sphere::displaced_sphere;
use std::sync::Arc;
use std::time::Instant;

/// A sphere with ripples, of about `triangles` triangles.
fn rippled_sphere(triangles: usize) -> TriangleMesh {
    displaced_sphere(triangles, |n| {
        let ripple = (n.x * 37.0).sin() * (n.y * 41.0).sin() * (n.z * 31.0).sin();
        1.0 + 0.05 * ripple + 0.01 * ((n.x * 250.0).sin() * (n.z * 230.0).cos())
    })
}

fn camera_rays(count: usize) -> RayBatch {
    let width = (count as f32).sqrt() as usize;
    let mut rays = RayBatch::default();
    let frame = Frame::from_z(Vec3::new(-2.5, -1.0, -0.8).normalize());
    for (x, y) in (0..width * width).map(|i| (i % width, i / width)) {
        let at = |k: usize| (k as f32 + 0.5) / width as f32 - 0.5;
        let d = frame.to_world(Vec3::new(at(x) * 0.8, at(y) * 0.8, 1.0).normalize());
        rays.push(&Ray { o: Vec3::new(2.5, 1.0, 0.8), d, t_max: f32::INFINITY, time: 0.0 });
    }
    rays
}

/// Cosine-distributed rays from the hits, alternating between outward and inward.
fn bounce_rays(set: &GeometrySet, rays: &RayBatch, hits: &[Option<Hit>]) -> RayBatch {
    let mut stream = pcg32([1, 2, 3]);
    let mut bounces = RayBatch::default();
    for (i, hit) in hits.iter().enumerate() {
        let Some(hit) = hit else { continue };
        let surface = set.surface_hit(hit.geometry, hit.primitive, hit.instance, hit.uv, 0.0);
        let side = if surface.n.dot(rays.get(i).d) > 0.0 { surface.n } else { -surface.n };
        let side = if i % 2 == 0 { side } else { -side };
        let d = Frame::from_z(side).to_world(warp::sample_cosine_hemisphere(stream.random::<[f32; 2]>()));
        let o = offset_origin(surface.p, surface.p_error, surface.n, d);
        bounces.push(&Ray { o, d, t_max: f32::INFINITY, time: 0.0 });
    }
    bounces
}

/// Prints the rate over chunks of rays, using the best of several runs per chunk to reduce the influence of other load.
fn measure(name: &str, rays: &RayBatch, mut trace: impl FnMut(&RayBatch) -> usize) {
    const CHUNK: usize = 10_000;
    let (mut seconds, mut found) = (0.0, 0);
    for start in (0..rays.len()).step_by(CHUNK) {
        let mut chunk = RayBatch::default();
        (start..rays.len().min(start + CHUNK)).for_each(|i| chunk.push(&rays.get(i)));
        let mut best = (f64::INFINITY, 0);
        for _ in 0..5 {
            let start = Instant::now();
            let found = trace(&chunk);
            best = (best.0.min(start.elapsed().as_secs_f64()), found);
        }
        seconds += best.0;
        found += best.1;
    }
    let rate = rays.len() as f64 / seconds * 1e-6;
    println!("{name:28} {rate:7.3} Mrays/s, {:.1} % hit", 100.0 * found as f64 / rays.len() as f64);
}

fn main() {
    // Scene
    let numbers: Vec<usize> = std::env::args().filter_map(|a| a.parse().ok()).collect();
    let thousands = |i: usize| numbers.get(i).copied().unwrap_or(1000) * 1000;
    let shape = Shape::Mesh(rippled_sphere(thousands(0)));
    let set = Arc::new(GeometrySet {
        geometries: vec![Geometry { shape, alpha: None, visibility: Visibility::ALL }],
        root: Group { geometries: vec![0] },
        ..GeometrySet::default()
    });
    let bvh = Bvh::new(Arc::clone(&set), None);
    let (triangles, stats) = (set.primitive_counts().triangles, bvh.stats());
    let per_triangle = stats.bytes as f64 / triangles as f64;
    println!("{triangles} triangles, build {:.3} s, {per_triangle:.1} B each", stats.build_seconds);

    // Rays
    let camera = camera_rays(thousands(1));
    let mut hits = Vec::new();
    bvh.intersect(&camera, Coherence::Coherent, &mut hits);
    let bounces = bounce_rays(&set, &camera, &hits);

    // Measurements
    for (name, rays) in [("camera", &camera), ("bounce", &bounces)] {
        measure(&format!("bvh {name} closest"), rays, |rays| {
            bvh.intersect(rays, Coherence::Incoherent, &mut hits);
            hits.iter().flatten().count()
        });
        let mut occluded = Vec::new();
        measure(&format!("bvh {name} occluded"), rays, |rays| {
            bvh.occluded(rays, Coherence::Incoherent, &mut occluded);
            occluded.iter().filter(|&&o| o).count()
        });
    }
}
