//! A mesh for benchmarks.

use lumiris::geometry::TriangleMesh;
use lumiris_numbers::math::Vec3;
use std::f32::consts::{PI, TAU};

/// A latitude–longitude sphere of about `triangles` triangles; `radius` is a function of the unit normal.
pub(crate) fn displaced_sphere(triangles: usize, radius: impl Fn(Vec3) -> f32) -> TriangleMesh {
    let rows = ((triangles / 4) as f32).sqrt() as u32;
    let columns = rows * 2;
    let point = |i: u32, j: u32| {
        let (theta, phi) = (PI * (j as f32 + 0.5) / (rows as f32 + 1.0), TAU * (i % columns) as f32 / columns as f32);
        let n = Vec3::new(theta.sin() * phi.cos(), theta.sin() * phi.sin(), theta.cos());
        n * radius(n)
    };
    let point = &point;
    let positions = (0..=rows).flat_map(|j| (0..columns).map(move |i| point(i, j))).collect();
    let quad = |i: u32, j: u32| {
        let (i1, a) = ((i + 1) % columns, j * columns);
        let b = a + columns;
        [[a + i, b + i, b + i1], [a + i, b + i1, a + i1]]
    };
    let indices = (0..rows).flat_map(|j| (0..columns).flat_map(move |i| quad(i, j))).collect();
    TriangleMesh::new(positions, indices).expect("indices are in range")
}
