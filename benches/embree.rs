//! Speed of the ray tracer against bare Embree loops with the same rays, on one thread.
//!
//! `cargo bench --bench embree -- [triangles in thousands, default 1000]`
//!
//! The scene is generated; `lumiris bench` does the same with the rays of a scene file.
#![allow(clippy::print_stdout, missing_docs)]

#[path = "support/sphere.rs"]
mod sphere;

use lumiris::accel::embree::bare::Bare;
use lumiris::accel::embree::{EmbreeAccel, EmbreeError};
use lumiris::accel::{Accel, Coherence, Hit, RayBatch};
use lumiris::geometry::{Geometry, GeometrySet, Group, Shape, TriangleMesh, Visibility};
use lumiris_bench::stages::{Pair, RayCase};
use lumiris_numbers::math::ray::offset_origin;
use lumiris_numbers::math::{Frame, Ray, Vec3, warp};
use lumiris_test_support::random::{RngExt, pcg32};
use sphere::displaced_sphere;
use std::sync::Arc;

const WIDTH: u32 = 8;
const SIDE: usize = 1024;
/// Rays per batch, as for a tile of pixels.
const BATCH: usize = 4096;
const RUNS: u32 = 9;

/// A sphere with ripples, of about `triangles` triangles.
fn rippled_sphere(triangles: usize) -> TriangleMesh {
    displaced_sphere(triangles, |n| 1.0 + 0.05 * (n.x * 37.0).sin() * (n.y * 41.0).sin() * (n.z * 31.0).sin())
}

/// Camera rays in tiles of 4 by 4 pixels.
fn camera_rays() -> RayBatch {
    let frame = Frame::from_z(Vec3::new(-2.5, -1.0, -0.8).normalize());
    let mut rays = RayBatch::default();
    for i in 0..SIDE * SIDE {
        let (tile, k) = (i / 16, i % 16);
        let at = |x: usize| (x as f32 + 0.5) / SIDE as f32 - 0.5;
        let (x, y) = (at(tile % (SIDE / 4) * 4 + k % 4), at(tile / (SIDE / 4) * 4 + k / 4));
        let d = frame.to_world(Vec3::new(x * 0.8, y * 0.8, 1.0).normalize());
        rays.push(&Ray { o: Vec3::new(2.5, 1.0, 0.8), d, t_max: f32::INFINITY, time: 0.0 });
    }
    rays
}

/// Eight rays from every eighth hit: to points of an area light, or cosine-distributed.
fn secondary_rays(set: &GeometrySet, rays: &RayBatch, hits: &[Option<Hit>], light: bool) -> RayBatch {
    let mut stream = pcg32([1, 2, 3]);
    let mut result = RayBatch::default();
    for (i, hit) in hits.iter().enumerate().filter(|(i, _)| i % 8 == 0) {
        let Some(hit) = hit else { continue };
        let surface = set.surface_hit(hit.geometry, hit.primitive, hit.instance, hit.uv, 0.0);
        let side = if surface.n.dot(rays.get(i).d) > 0.0 { -surface.n } else { surface.n };
        for k in 0..8 {
            let u = stream.random::<[f32; 2]>();
            let target = Vec3::new(3.0, -1.0 + (k % 4) as f32 * 0.25 + u[0] * 0.25, 2.0 + (k / 4) as f32 * 0.5);
            let bounce = Frame::from_z(side).to_world(warp::sample_cosine_hemisphere(u));
            let d = if light { target - surface.p } else { bounce };
            let o = offset_origin(surface.p, surface.p_error, surface.n, d);
            result.push(&Ray { o, d, t_max: if light { 0.999 } else { f32::INFINITY }, time: 0.0 });
        }
    }
    result
}

fn batches(rays: &RayBatch) -> Vec<RayBatch> {
    let mut result = Vec::new();
    for begin in (0..rays.len()).step_by(BATCH) {
        let mut batch = RayBatch::default();
        (begin..rays.len().min(begin + BATCH)).for_each(|i| batch.push(&rays.get(i)));
        result.push(batch);
    }
    result
}

/// Prints the result of a case.
fn print(case: Option<RayCase>) {
    let Some(RayCase { name, rays, mrays, bare_mrays, ratio, .. }) = case else { return };
    println!("{name:20} {rays:8} rays   bare {bare_mrays:6.2}   ours {mrays:6.2} Mrays/s   ours/bare {ratio:.3}");
}

fn main() -> Result<(), EmbreeError> {
    // Scene
    let thousands = std::env::args().skip(1).find_map(|a| a.parse::<usize>().ok()).unwrap_or(1000);
    let mesh = Shape::Mesh(rippled_sphere(thousands * 1000));
    let shape = Geometry { shape: mesh, alpha: None, visibility: Visibility::ALL };
    let root = Group { geometries: vec![0] };
    let set = Arc::new(GeometrySet { geometries: vec![shape], root, ..GeometrySet::default() });
    let accel = EmbreeAccel::new(Arc::clone(&set), None, Some(WIDTH))?;
    println!("{} triangles, {:?}", set.primitive_counts().triangles, accel.stats());

    // Rays
    let camera = camera_rays();
    let mut hits = Vec::new();
    accel.intersect(&camera, Coherence::Coherent, &mut hits);
    let shadow = secondary_rays(&set, &camera, &hits, true);
    let bounce = secondary_rays(&set, &camera, &hits, false);

    // Measurements
    let pair = Pair { accel, bare: Bare::new(set, None)?, runs: RUNS };
    print(pair.intersect("camera, coherent", &batches(&camera), Coherence::Coherent)?);
    print(pair.intersect("camera, single rays", &batches(&camera), Coherence::Incoherent)?);
    print(pair.occluded("shadow, packets", &batches(&shadow), WIDTH)?);
    print(pair.intersect("bounce, single rays", &batches(&bounce), Coherence::Incoherent)?);
    Ok(())
}
