//! Scenes and rays for the tests of both ray tracers.

use super::RayBatch;
use crate::geometry::reference_for_tests::random_point;
use crate::geometry::{
    AlphaSource, BilinearMesh, Curve, CurveKind, CurveSet, Geometry, GeometrySet, Group, Instance, Quadric,
    QuadricKind, Shape, TriangleMesh, Visibility,
};
use lumiris_numbers::math::{Affine3A, Quat, Ray, Vec2, Vec3};
use lumiris_test_support::random::{Pcg32, RngExt, pcg32};
use std::sync::Arc;

/// Opacities 0 and 0.4, stripes along u, and waves along x.
pub(super) struct Stripes;

impl AlphaSource for Stripes {
    fn alpha(&self, texture: u32, uv: Vec2, _: &crate::geometry::VertexValues, p: Vec3) -> f32 {
        match texture {
            0 => 0.0,
            1 => 0.4,
            2 => ((uv.x * 8.0) as i32 % 2) as f32,
            _ => (p.x * 4.0).sin() * 0.5 + 0.5,
        }
    }
}

/// Triangles from their corners, without shared vertices.
pub(super) fn separate_triangles(corners: Vec<Vec3>) -> TriangleMesh {
    let count = corners.len() as u32 / 3;
    TriangleMesh::new(corners, (0..count).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect()).unwrap()
}

/// Triangles at random positions.
pub(super) fn soup(s: &mut Pcg32, triangles: u32, size: f32) -> TriangleMesh {
    let mut corners = Vec::new();
    for _ in 0..triangles {
        let center = random_point(s);
        corners.extend((0..3).map(|_| center + random_point(s) * size));
    }
    separate_triangles(corners)
}

/// A closed surface of about 2·n² triangles with shared vertices.
pub(super) fn rippled_sphere(n: u32) -> TriangleMesh {
    use std::f32::consts::{PI, TAU};
    let point = |i: u32, j: u32| {
        let (theta, phi) = (PI * j as f32 / n as f32, TAU * (i % n) as f32 / n as f32);
        let d = Vec3::new(theta.sin() * phi.cos(), theta.sin() * phi.sin(), theta.cos());
        d * (1.0 + 0.05 * (d.x * 17.0).sin() * (d.y * 13.0).cos())
    };
    let positions = (0..=n).flat_map(|j| (0..n).map(move |i| point(i, j))).collect();
    let quad = |i: u32, j: u32| {
        let (a, b) = (j * n + i, j * n + (i + 1) % n);
        [[a, a + n, b + n], [a, b + n, b]]
    };
    TriangleMesh::new(positions, (0..n).flat_map(|j| (0..n).flat_map(move |i| quad(i, j))).collect()).unwrap()
}

pub(super) fn random_placement(s: &mut Pcg32) -> Affine3A {
    let rotation = Quat::from_axis_angle(random_point(s).normalize_or(Vec3::X), s.random::<f32>() * 6.0);
    let scale = Vec3::splat(0.3) + random_point(s).abs() * 0.5;
    Affine3A::from_scale_rotation_translation(scale, rotation, random_point(s) * 2.0)
}

pub(super) fn random_quadric(s: &mut Pcg32, kind: u32) -> Shape {
    let (radius, phi_max) = (0.3, 1.0 + 5.0 * s.random::<f32>());
    let kind = match kind % 3 {
        0 => QuadricKind::Sphere { radius, z_min: -0.3, z_max: 0.2, phi_max },
        1 => QuadricKind::Disk { height: 0.1, radius, inner_radius: 0.05, phi_max },
        _ => QuadricKind::Cylinder { radius, z_min: -0.5, z_max: 0.5, phi_max },
    };
    Shape::Quadric(Quadric::new(kind, random_placement(s), false))
}

pub(super) fn random_patches(s: &mut Pcg32, count: u32) -> Shape {
    let mut positions = Vec::new();
    for _ in 0..count {
        let center = random_point(s);
        positions.extend((0..4).map(|_| center + random_point(s) * 0.4));
    }
    let indices = (0..count).map(|i| [4 * i, 4 * i + 1, 4 * i + 2, 4 * i + 3]).collect();
    Shape::Bilinear(BilinearMesh { positions, indices, ..BilinearMesh::default() })
}

/// Shapes of all kinds, some with alpha or hidden from some rays, in the root and in instances with up to `samples`
/// time samples.
pub(super) fn mixed_scene(seed: u32, samples: usize) -> Arc<GeometrySet> {
    // Geometries
    let mut s = pcg32([seed, 77, 0]);
    let mut geometries = Vec::new();
    for k in 0..24_u32 {
        let shape = match k % 4 {
            0 => Shape::Mesh(soup(&mut s, 1 + 40 * (k % 5), 0.2)),
            1 => Shape::Mesh(rippled_sphere(8 + k)),
            2 => random_quadric(&mut s, k / 4),
            _ => random_patches(&mut s, 1 + k % 5),
        };
        let visibility = Visibility([3, 3, 1, 2, 0][k as usize * 7 % 5]);
        let alpha = [None, None, Some(0), Some(1), Some(2), Some(3)][k as usize * 5 % 6];
        geometries.push(Geometry { shape, alpha, visibility });
    }

    // Groups and moving instances
    let groups =
        vec![Group { geometries: (8..16).collect() }, Group { geometries: (16..24).collect() }, Group::default()];
    let instances = (0..9_u32)
        .map(|k| {
            let first = random_placement(&mut s);
            let moved = |i: usize| Affine3A::from_translation(Vec3::X * i as f32 * 0.4) * first;
            Instance { group: k % 3, world_from_group: (0..1 + k as usize % samples).map(moved).collect() }
        })
        .collect();
    Arc::new(GeometrySet {
        geometries,
        groups,
        root: Group { geometries: (0..8).collect() },
        instances,
        ..GeometrySet::default()
    })
}

/// A curve that is fine or wide, nearly straight or strongly bent, possibly of no width at one or both ends.
fn random_curve(s: &mut Pcg32, k: u32) -> Curve {
    let (start, step) = (random_point(s), random_point(s) * 0.3);
    let bend = [0.01, 0.1, 1.0][k as usize % 3];
    let points = std::array::from_fn(|i| start + step * i as f32 + random_point(s) * bend);
    let width = [0.3, 0.03, 0.003][(k / 3) as usize % 3];
    Curve { points, width: [[1.0, 0.5], [1.0, 0.0], [0.0, 1.0], [0.0, 0.0]][(k / 9) as usize % 4].map(|w| w * width) }
}

fn random_curves(s: &mut Pcg32, kind: CurveKind, count: u32) -> CurveSet {
    let curves = (0..count).map(|k| random_curve(s, k)).collect();
    let normals = (0..count).map(|_| [0; 2].map(|_| random_point(s).normalize_or(Vec3::X))).collect();
    CurveSet::new(kind, curves, normals).unwrap()
}

/// Curves of all kinds, and triangles between them, in the root and in instances with up to `samples` time samples.
/// Some have alpha or are hidden from some rays.
pub(super) fn curve_scene(seed: u32, samples: usize) -> Arc<GeometrySet> {
    // Geometries
    let mut s = pcg32([seed, 78, 0]);
    let mut geometries = Vec::new();
    for k in 0..8 {
        let shape = match k % 4 {
            0 => Shape::Curves(random_curves(&mut s, CurveKind::Flat, 36)),
            1 => Shape::Curves(random_curves(&mut s, CurveKind::Cylinder, 1 + 7 * k)),
            2 => Shape::Curves(random_curves(&mut s, CurveKind::Ribbon, 36)),
            _ => Shape::Mesh(soup(&mut s, 30, 0.2)),
        };
        let visibility = Visibility([3, 3, 1, 3, 2, 3, 3, 3][k as usize]);
        geometries.push(Geometry { shape, alpha: [None, None, Some(1), Some(2)][k as usize / 2], visibility });
    }

    // Instances
    let groups = vec![Group { geometries: vec![4, 5, 6] }, Group { geometries: vec![0, 3] }];
    let instances = (0..4_u32).map(|k| {
        let first = random_placement(&mut s);
        let moved = |i: usize| Affine3A::from_translation(Vec3::X * i as f32 * 0.4) * first;
        Instance { group: k % 2, world_from_group: (0..1 + k as usize % samples).map(moved).collect() }
    });
    let instances = instances.collect();
    let root = Group { geometries: vec![0, 1, 2, 3, 7] };
    Arc::new(GeometrySet { geometries, groups, root, instances, ..GeometrySet::default() })
}

/// Rays at random, at points within the width of a curve in the root, along its tangent, and from its surface.
pub(super) fn curve_rays(set: &GeometrySet, count: usize, seed: u32) -> RayBatch {
    let mut s = pcg32([seed, 8, 8]);
    let mut rays = random_rays(count / 4, seed);
    let sets = set.geometries[..3].iter().filter_map(|g| if let Shape::Curves(c) = &g.shape { Some(c) } else { None });
    let curves: Vec<Curve> = sets.flat_map(|set| set.curves()).copied().collect();
    for k in rays.len()..count {
        let curve = curves[(s.random::<f32>() * curves.len() as f32) as usize % curves.len()];
        let (u, [p0, p1, p2, p3]) = (s.random::<f32>(), curve.points);
        let (a, b) = (p0.lerp(p1, u).lerp(p1.lerp(p2, u), u), p1.lerp(p2, u).lerp(p2.lerp(p3, u), u));
        let p = a.lerp(b, u);
        let beside = p + random_point(&mut s) * curve.width_at(u);
        let far = 10.0_f32.powf(s.random::<f32>() * 4.0 - 1.0);
        let (o, d) = match k % 4 {
            0 | 1 => (beside + random_point(&mut s) * far, beside),
            2 => (beside - (b - a) * far, beside + random_point(&mut s) * curve.width_at(u) * 0.1),
            _ => (beside, beside + random_point(&mut s)),
        };
        let t_max = if k % 5 == 0 { 2.0 * s.random::<f32>() } else { f32::INFINITY };
        rays.push(&Ray { o, d: d - o, t_max, time: s.random::<f32>() });
    }
    rays
}

pub(super) fn random_rays(count: usize, seed: u32) -> RayBatch {
    let mut s = pcg32([seed, 5, 5]);
    let mut rays = RayBatch::default();
    for k in 0..count {
        let o = random_point(&mut s) * 3.0;
        let mut d = random_point(&mut s) * 2.0 - o;
        if k % 10 == 0 {
            d = Vec3::ZERO.with_x(if k % 20 == 0 { 1.0 } else { -1.0 });
        }
        let t_max = if k % 3 == 0 { s.random::<f32>() * 1.5 } else { f32::INFINITY };
        rays.push(&Ray { o, d, t_max, time: s.random::<f32>() });
    }
    rays
}
