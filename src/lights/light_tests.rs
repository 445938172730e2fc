//! The sampling routine of every area light compared with its pdf, and with irradiances in closed form.

use super::{AreaLight, AreaShape, DistantLight, Emission, Light, LightCtx, LightHit, area_lights_of};
use crate::geometry::{BilinearMesh, Quadric, QuadricKind, Shape, TriangleMesh};
use lumiris_numbers::math::warp::{invert_uniform_triangle, sample_uniform_triangle};
use lumiris_numbers::math::{Affine3A, Mat3, Quat, Rgb, Vec2, Vec3};
use lumiris_test_support::random::{RngExt, pcg32};
use lumiris_test_support::{Moments, assert_chi_squared};
use std::f64::consts::PI;

pub(super) const CELLS: usize = 16;

/// A light with a map of the unit square onto its surface: point, normal and area per unit of the square.
pub(super) struct Surface {
    pub(super) light: AreaLight,
    pub(super) point: Box<dyn Fn([f32; 2]) -> Vec3>,
    pub(super) invert: Box<dyn Fn(Vec3) -> [f32; 2]>,
}

pub(super) fn light_of(shape: &Shape) -> AreaLight {
    let emission = Emission { two_sided: true, ..Emission::constant(Rgb::WHITE) };
    let mut out = area_lights_of(shape, &emission);
    assert_eq!(out.lights.len(), 1);
    out.lights.remove(0)
}

pub(super) fn triangle_surface(p: [Vec3; 3]) -> Surface {
    let mesh = TriangleMesh::new(p.to_vec(), vec![[0, 1, 2]]).unwrap();
    let point = move |u: [f32; 2]| {
        let [a, b] = sample_uniform_triangle(u);
        p[0] * a + p[1] * b + p[2] * (1.0 - a - b)
    };
    let invert = move |q: Vec3| {
        let n = (p[1] - p[0]).cross(p[2] - p[0]);
        let part = |i: usize, j: usize| (p[i] - q).cross(p[j] - q).dot(n) / n.length_squared();
        invert_uniform_triangle([part(1, 2).max(0.0), part(2, 0).max(0.0)])
    };
    Surface { light: light_of(&Shape::Mesh(mesh)), point: Box::new(point), invert: Box::new(invert) }
}

pub(super) fn rectangle_mesh(corner: Vec3, x: Vec3, y: Vec3) -> Shape {
    let p = vec![corner, corner + x, corner + x + y, corner + y];
    Shape::Mesh(TriangleMesh::new(p, vec![[0, 1, 2], [0, 2, 3]]).unwrap())
}

pub(super) fn rectangle_surface(corner: Vec3, x: Vec3, y: Vec3) -> Surface {
    let light = light_of(&rectangle_mesh(corner, x, y));
    assert!(matches!(light.shape, AreaShape::Rectangle(_)));
    let invert = move |p: Vec3| [(p - corner).dot(x) / x.length_squared(), (p - corner).dot(y) / y.length_squared()];
    Surface { light, point: Box::new(move |[u, v]| corner + x * u + y * v), invert: Box::new(invert) }
}

pub(super) fn patch_surface(corners: [Vec3; 4]) -> Surface {
    let mesh = BilinearMesh { positions: corners.to_vec(), indices: vec![[0, 1, 2, 3]], ..BilinearMesh::default() };
    let light = light_of(&Shape::Bilinear(mesh));
    let AreaShape::Patch(patch) = light.shape.clone() else { panic!("a patch is expected") };
    let point = move |[u, v]: [f32; 2]| corners[0].lerp(corners[1], u).lerp(corners[2].lerp(corners[3], u), v);
    Surface { light, point: Box::new(point), invert: Box::new(move |p| patch.invert(p).to_array()) }
}

pub(super) fn quadric(kind: QuadricKind, placement: Affine3A) -> Quadric {
    Quadric::new(kind, placement, false)
}

/// Coordinates (z or squared radius, φ), both scaled to their ranges.
pub(super) fn quadric_surface(kind: QuadricKind, placement: Affine3A) -> Surface {
    let light = light_of(&Shape::Quadric(quadric(kind, placement)));
    let inverse = placement.inverse();

    // From coordinates to points
    let point = move |[u, v]: [f32; 2]| {
        let local = match kind {
            QuadricKind::Sphere { radius, z_min, z_max, phi_max } => {
                let z = z_min + (z_max - z_min) * u;
                (Vec2::from_angle(phi_max * v) * (radius * radius - z * z).max(0.0).sqrt()).extend(z)
            }
            QuadricKind::Disk { height, radius, inner_radius, phi_max } => {
                let r2 = inner_radius * inner_radius + u * (radius * radius - inner_radius * inner_radius);
                (Vec2::from_angle(phi_max * v) * r2.sqrt()).extend(height)
            }
            QuadricKind::Cylinder { radius, z_min, z_max, phi_max } => {
                (Vec2::from_angle(phi_max * v) * radius).extend(z_min + (z_max - z_min) * u)
            }
        };
        placement.transform_point3(local)
    };

    // From points to coordinates
    let invert = move |p: Vec3| {
        let p = inverse.transform_point3(p);
        let phi = lumiris_numbers::math::warp::azimuth(p);
        match kind {
            QuadricKind::Sphere { z_min, z_max, phi_max, .. } | QuadricKind::Cylinder { z_min, z_max, phi_max, .. } => {
                [(p.z - z_min) / (z_max - z_min), phi / phi_max]
            }
            QuadricKind::Disk { radius, inner_radius, phi_max, .. } => {
                let r2 = p.truncate().length_squared() - inner_radius * inner_radius;
                [r2 / (radius * radius - inner_radius * inner_radius), phi / phi_max]
            }
        }
    };
    Surface { light, point: Box::new(point), invert: Box::new(invert) }
}

impl Surface {
    /// ∂p/∂u × ∂p/∂v by central differences in f64 of the positions.
    pub(super) fn area_vector(&self, [u, v]: [f32; 2]) -> glam::DVec3 {
        let h = 1e-3;
        let at = |u: f32, v: f32| (self.point)([u, v]).as_dvec3();
        let (du, dv) = (at(u + h, v) - at(u - h, v), at(u, v + h) - at(u, v - h));
        du.cross(dv) / (4.0 * f64::from(h) * f64::from(h))
    }

    /// The sphere is sampled by its visible cap only.
    fn is_sampled(&self, from: Vec3, p: Vec3) -> bool {
        match &self.light.shape {
            AreaShape::Quadric(q) => q.pdf_is_visible(from, p),
            AreaShape::Triangle(_) | AreaShape::Rectangle(_) | AreaShape::Patch(_) => true,
        }
    }

    /// Probability of the cells of a grid over the surface, by the density of the light.
    fn cell_probabilities(&self, from: Vec3, sub: usize) -> Vec<f64> {
        let n = CELLS * sub;
        let mut cells = vec![0.0; CELLS * CELLS];
        for i in 0..n * n {
            let u = [(i % n) as f32 + 0.5, (i / n) as f32 + 0.5].map(|x| x / n as f32);
            let p = (self.point)(u);
            if !self.is_sampled(from, p) {
                continue;
            }
            let area = self.area_vector(u);
            let d = p.as_dvec3() - from.as_dvec3();
            let n_unit = area.normalize().as_vec3();
            let hit = LightHit { t: d.length() as f32, p, n: n_unit, uv: Vec2::ZERO };
            let pdf = f64::from(self.light.pdf_li(&LightCtx::at(from), d.normalize().as_vec3(), &hit));
            let solid_angle = area.dot(d).abs() / d.length().powi(3) / (n * n) as f64;
            cells[(i / n) / sub * CELLS + (i % n) / sub] += pdf * solid_angle;
        }
        cells
    }

    /// χ² test of sampled points against the density, and the integral of the density against 1.
    fn check(&self, name: &str, from: Vec3) {
        let expected = self.cell_probabilities(from, 24);
        let total: f64 = expected.iter().sum();
        assert!((total - 1.0).abs() < 0.01, "{name} from {from}: the density integrates to {total}");
        let mut stream = pcg32([name.len() as u32, from.x.to_bits(), from.z.to_bits()]);
        let count = 100_000;
        let mut observed = vec![0.0; CELLS * CELLS];
        for _ in 0..count {
            let s = self.light.sample_li(&LightCtx::at(from), stream.random::<[f32; 2]>()).unwrap();
            assert!((s.wi.length() - 1.0).abs() < 1e-5 && s.pdf > 0.0 && s.pdf.is_finite());
            let along = from + s.wi * s.t;
            assert!((along - s.p).length() <= 2e-5 * (s.t + s.p.length()), "{name}: {along} {}", s.p);
            let hit = LightHit { t: s.t, p: s.p, n: s.n, uv: Vec2::ZERO };
            let pdf = self.light.pdf_li(&LightCtx::at(from), s.wi, &hit);
            // At grazing angles the density depends on the last digits of the point.
            let tolerance = 5e-4 + 1e-5 / s.n.dot(s.wi).abs();
            assert!((pdf - s.pdf).abs() <= tolerance * s.pdf, "{name} from {from}: {pdf} {}", s.pdf);
            let cell = (self.invert)(s.p).map(|x| ((x * CELLS as f32).max(0.0) as usize).min(CELLS - 1));
            observed[cell[1] * CELLS + cell[0]] += 1.0;
        }
        let expected: Vec<f64> = expected.iter().map(|e| (e / total * f64::from(count)).max(0.05)).collect();
        assert_chi_squared(&observed, &expected, 1e-6);
    }
}

pub(super) fn placement() -> Affine3A {
    Affine3A::from_rotation_translation(
        Quat::from_euler(glam::EulerRot::XYZ, 0.3, 1.1, -0.7),
        Vec3::new(1.0, -2.0, 0.5),
    )
}

pub(super) fn squash() -> Affine3A {
    placement() * Affine3A::from_scale(Vec3::new(1.0, -0.5, 2.0))
}

#[test]
fn triangles_follow_their_density() {
    let s = triangle_surface([Vec3::new(0.0, 0.0, 1.0), Vec3::new(2.0, 0.0, 1.5), Vec3::new(0.5, 1.5, 1.0)]);
    for from in [Vec3::ZERO, Vec3::new(1.0, 0.5, 0.6), Vec3::new(-30.0, 20.0, 5.0), Vec3::new(4.0, 1.0, 1.6)] {
        s.check("triangle", from);
    }
}

#[test]
fn rectangles_follow_their_density_near_far_and_grazing() {
    let r = placement();
    let s = rectangle_surface(
        r.transform_point3(Vec3::ZERO),
        r.transform_vector3(Vec3::new(2.0, 0.0, 0.0)),
        r.transform_vector3(Vec3::new(0.0, 1.0, 0.0)),
    );
    let at = |x, y, z| r.transform_point3(Vec3::new(x, y, z));

    // Inside and outside of the projection, near the plane, and beyond the limit of uniform sampling
    for from in [
        at(1.0, 0.5, 1.0),
        at(0.3, 0.8, -0.1),
        at(-1.0, 2.0, 3.0),
        at(3.0, 0.5, 0.05),
        at(-2.0, -2.0, 0.01),
        at(30.0, 1.0, 20.0),
        at(300.0, 0.0, 500.0),
        at(1.0, 0.5, -2000.0),
    ] {
        s.check("rectangle", from);
    }
}

#[test]
fn the_solid_angle_of_rectangles_is_exact() {
    let AreaShape::Rectangle(r) =
        light_of(&rectangle_mesh(Vec3::new(-1.0, -1.0, 1.0), Vec3::X * 2.0, Vec3::Y * 2.0)).shape
    else {
        panic!()
    };
    // A face of the cube about the origin subtends a sixth of the sphere.
    assert!((f64::from(r.solid_angle(Vec3::ZERO).unwrap()) - 4.0 * PI / 6.0).abs() < 1e-6);
    // Near its middle it subtends almost a hemisphere; far away, less than the threshold of solid-angle sampling.
    let near = f64::from(r.solid_angle(Vec3::new(0.0, 0.0, 0.999)).unwrap());
    assert!((near - (2.0 * PI - 4.0 * 2.0_f64.sqrt() * 1e-3)).abs() < 1e-5, "{near}");
    assert!(r.solid_angle(Vec3::new(0.0, 0.0, -1000.0)).is_none());
    assert!(r.solid_angle(Vec3::new(0.0, 0.0, 1.0)).is_none());
    let far = f64::from(r.solid_angle(Vec3::new(0.0, 0.0, -99.0)).unwrap());
    assert!((far - 4e-4).abs() < 1e-7, "{far}");
}

#[test]
fn spheres_follow_their_density_outside_and_inside() {
    let full = QuadricKind::Sphere { radius: 1.0, z_min: -1.0, z_max: 1.0, phi_max: std::f32::consts::TAU };
    let s = quadric_surface(full, placement() * Affine3A::from_scale(Vec3::splat(1.5)));
    let center = Vec3::new(1.0, -2.0, 0.5);
    for d in [Vec3::new(2.0, 0.5, 1.0), Vec3::new(0.0, 0.0, 1.6), Vec3::new(0.7, 0.2, -0.3), Vec3::ZERO] {
        s.check("sphere", center + d);
    }
    s.check("ellipsoid", Vec3::ZERO);
    quadric_surface(full, squash()).check("ellipsoid", Vec3::new(4.0, 3.0, 2.0));
    let part = QuadricKind::Sphere { radius: 1.0, z_min: -0.5, z_max: 0.8, phi_max: 4.0 };
    quadric_surface(part, squash()).check("partial sphere", Vec3::new(4.0, 3.0, 2.0));
    quadric_surface(part, placement()).check("partial sphere", center + Vec3::new(0.1, 0.2, 0.3));
}

#[test]
fn disks_cylinders_and_patches_follow_their_density() {
    let tau = std::f32::consts::TAU;
    for p in [placement(), squash()] {
        for kind in [
            QuadricKind::Disk { height: 0.3, radius: 1.2, inner_radius: 0.0, phi_max: tau },
            QuadricKind::Disk { height: 0.3, radius: 1.2, inner_radius: 0.5, phi_max: 3.0 },
            QuadricKind::Cylinder { radius: 0.7, z_min: -1.0, z_max: 0.5, phi_max: tau },
            QuadricKind::Cylinder { radius: 0.7, z_min: -1.0, z_max: 0.5, phi_max: 2.0 },
        ] {
            let s = quadric_surface(kind, p);
            for local in [Vec3::new(0.2, 0.1, 1.5), Vec3::new(3.0, -2.0, 0.9), Vec3::new(40.0, 10.0, -20.0)] {
                s.check("quadric", p.transform_point3(local));
            }
        }
    }

    // A bent patch
    let v = Vec3::new;
    let patch = patch_surface([v(0.0, 0.0, 0.0), v(1.0, 0.1, 0.0), v(0.2, 2.0, 0.3), v(1.5, 1.2, -0.4)]);
    for from in [v(0.5, 0.5, 1.0), v(3.0, 3.0, 2.0), v(-10.0, 0.0, 5.0)] {
        patch.check("patch", from);
    }
}

/// Irradiance at `p` with normal `n` of a light of radiance 1, by its sampler.
fn estimated_irradiance(light: &AreaLight, p: Vec3, n: Vec3) -> Moments {
    let mut stream = pcg32([p.x.to_bits(), p.y.to_bits(), 77]);
    let mut moments = Moments::default();
    for _ in 0..200_000 {
        let value = light
            .sample_li(&LightCtx::on(p, n), stream.random::<[f32; 2]>())
            .map_or(0.0, |s| f64::from(s.li.r) * f64::from(s.wi.dot(n).max(0.0)) / f64::from(s.pdf));
        moments.add(value);
    }
    moments
}

/// Lambert's formula: E = ½|Σ Θᵢ·(n·Γᵢ)| over the edges of a polygon above the horizon.
fn polygon_irradiance(corners: &[Vec3], p: Vec3, n: Vec3) -> f64 {
    let r: Vec<glam::DVec3> = corners.iter().map(|c| (c.as_dvec3() - p.as_dvec3()).normalize()).collect();
    let sum: f64 = (0..r.len())
        .map(|i| {
            let (a, b) = (r[i], r[(i + 1) % r.len()]);
            let cross = a.cross(b);
            cross.length().atan2(a.dot(b)) * cross.normalize().dot(n.as_dvec3())
        })
        .sum();
    0.5 * sum.abs()
}

#[test]
fn irradiance_of_polygons_is_lamberts() {
    let (c, x, y) = (Vec3::new(-1.0, -0.5, 2.0), Vec3::new(2.0, 0.0, 0.0), Vec3::new(0.0, 1.0, 0.5));
    let rectangle = light_of(&rectangle_mesh(c, x, y));
    let triangle = light_of(&Shape::Mesh(TriangleMesh::new(vec![c, c + x, c + y], vec![[0, 1, 2]]).unwrap()));
    for (p, n) in [
        (Vec3::ZERO, Vec3::Z),
        (Vec3::new(0.0, 0.0, 1.5), Vec3::Z),
        (Vec3::new(0.3, 0.2, 1.9), Vec3::new(0.02, 0.03, 1.0).normalize()),
        (Vec3::new(5.0, 0.0, 0.0), Vec3::new(-1.0, 0.0, 0.3).normalize()),
        (Vec3::new(0.0, 0.0, -200.0), Vec3::Z),
    ] {
        let exact = polygon_irradiance(&[c, c + x, c + x + y, c + y], p, n);
        estimated_irradiance(&rectangle, p, n).assert_mean(exact, 1e-5, 1e-4);
        let exact = polygon_irradiance(&[c, c + x, c + y], p, n);
        estimated_irradiance(&triangle, p, n).assert_mean(exact, 1e-5, 1e-4);
    }
}

#[test]
fn irradiance_of_spheres_and_disks_is_that_of_form_factors() {
    let full = QuadricKind::Sphere { radius: 2.0, z_min: -2.0, z_max: 2.0, phi_max: std::f32::consts::TAU };
    let sphere = light_of(&Shape::Quadric(quadric(full, placement())));
    let center = Vec3::new(1.0, -2.0, 0.5);
    for distance in [2.001_f32, 2.5, 4.0, 50.0, 3000.0] {
        // A sphere fully above the horizon: E = π·(r/d)²·cos θ.
        let direction = Vec3::new(0.48, 0.6, 0.64);
        let sin2 = f64::from(2.0 / distance).powi(2);
        let cos = if distance < 2.2 { 1.0 } else { 0.95_f64 };
        let tangent = direction.any_orthonormal_vector();
        let n = -direction * cos as f32 + tangent * (1.0 - cos * cos).sqrt() as f32;
        let cos = if sin2.sqrt() > cos { continue } else { cos };
        estimated_irradiance(&sphere, center + direction * distance, n).assert_mean(PI * sin2 * cos, 1e-5, 2e-4);
    }
    // From inside, E = π in every direction.
    estimated_irradiance(&sphere, center + Vec3::new(0.5, 1.0, 0.2), Vec3::Y).assert_mean(PI, 1e-5, 1e-4);

    // A disk above a parallel surface on its axis: E = π·r²/(r² + h²).
    let kind = QuadricKind::Disk { height: 3.0, radius: 2.0, inner_radius: 0.0, phi_max: std::f32::consts::TAU };
    let disk = light_of(&Shape::Quadric(quadric(kind, Affine3A::IDENTITY)));
    estimated_irradiance(&disk, Vec3::ZERO, Vec3::Z).assert_mean(PI * 4.0 / 13.0, 1e-5, 1e-4);
}

#[test]
fn one_sided_lights_emit_on_the_side_of_their_normal() {
    let mirror = Affine3A::from_scale(Vec3::new(-1.0, 1.0, 1.0));
    let disk = QuadricKind::Disk { height: 0.0, radius: 1.0, inner_radius: 0.0, phi_max: std::f32::consts::TAU };
    let ball = QuadricKind::Sphere { radius: 1.0, z_min: -1.0, z_max: 1.0, phi_max: std::f32::consts::TAU };
    let tube = QuadricKind::Cylinder { radius: 1.0, z_min: -1.0, z_max: 1.0, phi_max: std::f32::consts::TAU };
    let far = Vec3::new(0.4, 0.3, 5.0);
    let lit = |kind, placement: Affine3A, flip_normal, p: Vec3| {
        let q = quadric(kind, placement).with_flip(flip_normal);
        let light = area_lights_of(&Shape::Quadric(q), &Emission::constant(Rgb::WHITE)).lights.remove(0);
        (0..64).any(|i| {
            let u = [(i % 8) as f32 / 8.0 + 0.03, (i / 8) as f32 / 8.0 + 0.03];
            light.sample_li(&LightCtx::at(p), u).is_some_and(|s| {
                assert_eq!(s.li.is_black(), s.n.dot(s.wi) >= 0.0);
                !s.li.is_black()
            })
        })
    };
    for placement in [Affine3A::IDENTITY, mirror] {
        // Mirroring alone does not turn a shape inside out: the importer then sets the flag.
        let out = placement == mirror;
        assert!(lit(disk, placement, out, far) && !lit(disk, placement, out, -far));
        assert!(!lit(disk, placement, !out, far) && lit(disk, placement, !out, -far));
        assert!(lit(ball, placement, out, far) && !lit(ball, placement, out, Vec3::ZERO));
        assert!(!lit(ball, placement, !out, far) && lit(ball, placement, !out, Vec3::ZERO));
        assert!(!lit(tube, placement, out, Vec3::X * 0.3) && lit(tube, placement, out, Vec3::X * 3.0));
        assert!(lit(tube, placement, !out, Vec3::X * 0.3));
    }
}

#[test]
fn powers_are_those_of_lambertian_emitters() {
    let full = QuadricKind::Sphere { radius: 2.0, z_min: -2.0, z_max: 2.0, phi_max: std::f32::consts::TAU };
    let sphere = Shape::Quadric(quadric(full, Affine3A::from_scale(Vec3::splat(0.5))));
    let constant = |two_sided| Emission { two_sided, ..Emission::constant(Rgb::splat(3.0)) };
    let power =
        |shape: &Shape, two_sided| f64::from(area_lights_of(shape, &constant(two_sided)).lights[0].power_luminance());
    assert!((power(&sphere, false) / (3.0 * PI * 4.0 * PI) - 1.0).abs() < 1e-5);
    let rectangle = rectangle_mesh(Vec3::ZERO, Vec3::X * 2.0, Vec3::Y * 3.0);
    assert!((power(&rectangle, true) / (3.0 * PI * 6.0 * 2.0) - 1.0).abs() < 1e-5);
    // The area of an ellipsoid of semi-axes 2, 1, 1 (prolate): 2π(1 + 2/e·asin e), e² = 3/4.
    let ellipsoid = Shape::Quadric(quadric(full, Affine3A::from_scale(Vec3::new(1.0, 0.5, 0.5))));
    let e = 0.75_f64.sqrt();
    assert!((power(&ellipsoid, false) / (3.0 * PI * 2.0 * PI * (1.0 + 2.0 / e * e.asin())) - 1.0).abs() < 1e-3);
    let env = Light::InfiniteConstant { l: Rgb::WHITE };
    assert!((f64::from(env.power_luminance(2.0)) / (4.0 * PI * 4.0 * PI) - 1.0).abs() < 1e-5);
}

#[test]
fn emission_images_are_looked_up_at_the_sampled_point() {
    let data: Vec<Rgb> = (0..64).map(|i| Rgb::new((i % 8) as f32, (i / 8) as f32, 1.0)).collect();
    let image = Some(std::sync::Arc::new(super::EmissionImage::new(8, 8, data).unwrap()));
    let emission = Emission { two_sided: true, image: image.clone(), ..Emission::constant(Rgb::splat(2.0)) };
    let positions = vec![Vec3::ZERO, Vec3::X * 2.0, Vec3::Y, Vec3::X * 2.0 + Vec3::Y];
    let flat = BilinearMesh { positions: positions.clone(), indices: vec![[0, 1, 2, 3]], ..BilinearMesh::default() };
    let mut bent = flat.clone();
    bent.positions[3].z = 0.5;
    let mut mesh = TriangleMesh::new(positions, vec![[0, 1, 3], [0, 3, 2]]).unwrap();
    mesh.uvs = vec![Vec2::ZERO, Vec2::X, Vec2::Y, Vec2::ONE];
    for shape in [Shape::Bilinear(flat), Shape::Bilinear(bent), Shape::Mesh(mesh)] {
        let lights = area_lights_of(&shape, &emission).lights;
        assert_eq!(lights.len(), 1, "two textured triangles with matching coordinates are one rectangle");
        let mut stream = pcg32([5, 6, 7]);
        for _ in 0..1000 {
            let s = lights[0].sample_li(&LightCtx::at(Vec3::new(0.3, 0.4, 2.0)), stream.random::<[f32; 2]>()).unwrap();
            let uv = Vec2::new(s.p.x / 2.0, s.p.y);
            let hit = LightHit { t: s.t, p: s.p, n: s.n, uv };
            let l = lights[0].l(&hit, -s.wi);
            assert!((l.r - s.li.r).abs() < 1e-3 && (l.g - s.li.g).abs() < 1e-3, "{l:?} {:?}", s.li);
        }
    }
    // Default coordinates of triangles do not continue over the diagonal: they stay two lights.
    let shape = rectangle_mesh(Vec3::ZERO, Vec3::X, Vec3::Y);
    assert_eq!(area_lights_of(&shape, &emission).lights.len(), 2);
}

#[test]
fn emission_images_may_have_texture_coordinates_of_their_own() {
    let data: Vec<Rgb> = (0..64).map(|i| Rgb::new((i % 8) as f32, (i / 8) as f32, 1.0)).collect();
    let image = super::EmissionImage::new(8, 8, data).unwrap();
    let wrap = [crate::imaging::AxisWrap::Repeat, crate::imaging::AxisWrap::Mirror];
    let image_from_uv = glam::Affine2::from_scale_angle_translation(Vec2::new(2.0, 3.0), 0.5, Vec2::new(-3.0, 0.25));
    let mapping = super::EmissionMapping { second: true, image_from_uv };
    let expected = image.clone().placed(wrap, None);
    let image = Some(std::sync::Arc::new(image.placed(wrap, Some(mapping))));
    let emission = Emission { two_sided: true, image, ..Emission::constant(Rgb::WHITE) };
    let mut mesh = TriangleMesh::new(vec![Vec3::ZERO, Vec3::X, Vec3::Y], vec![[0, 1, 2]]).unwrap();
    mesh.uvs = vec![Vec2::splat(0.1); 3];
    mesh.uvs1 = vec![Vec2::ZERO, Vec2::X, Vec2::Y];
    let light = &area_lights_of(&Shape::Mesh(mesh), &emission).lights[0];
    let mut stream = pcg32([5, 6, 8]);
    for _ in 0..1000 {
        let s = light.sample_li(&LightCtx::at(Vec3::new(0.3, 0.4, 2.0)), stream.random::<[f32; 2]>()).unwrap();
        // The light ignores the texture coordinates of the hit
        let hit = LightHit { t: s.t, p: s.p, n: s.n, uv: Vec2::splat(0.1) };
        assert_eq!(light.l(&hit, -s.wi), s.li);
        let at = expected.lookup(image_from_uv.transform_point2(s.p.truncate()));
        assert!((at - s.li).map(f32::abs).max_component() < 1e-2, "{at:?} {:?}", s.li);
    }
}

#[test]
fn vertex_colours_are_a_factor_of_radiance_power_and_importance() {
    let mut mesh = TriangleMesh::new(vec![Vec3::ZERO, Vec3::X, Vec3::Y], vec![[0, 1, 2]]).unwrap();
    mesh.colors = vec![[0.0, 0.0, 1.0, 1.0], [1.0, 0.0, 1.0, 1.0], [0.0, 1.0, 1.0, 1.0]];
    let of = |mesh: &TriangleMesh, emission: &Emission| area_lights_of(&Shape::Mesh(mesh.clone()), emission).lights;
    let plain = Emission { two_sided: true, ..Emission::constant(Rgb::splat(2.0)) };
    let emission = Emission { has_vertex_colors: true, ..plain.clone() };
    let light = of(&mesh, &emission).remove(0);
    let mut stream = pcg32([5, 6, 9]);
    let samples: Vec<_> = (0..1000).map(|_| stream.random::<[f32; 2]>()).collect();
    for u in samples {
        let s = light.sample_li(&LightCtx::at(Vec3::new(0.3, 0.4, 2.0)), u).unwrap();
        assert_eq!(light.l(&LightHit { t: s.t, p: s.p, n: s.n, uv: Vec2::ZERO }, -s.wi), s.li);
        let expected = Rgb::new(2.0 * s.p.x, 2.0 * s.p.y, 2.0);
        assert!((expected - s.li).map(f32::abs).max_component() < 1e-5, "{expected:?} {:?}", s.li);
        let point = light.sample_point_towards(u, Vec3::Z);
        let expected = Rgb::new(2.0 * point.p.x, 2.0 * point.p.y, 2.0);
        assert!((expected - point.radiance).map(f32::abs).max_component() < 1e-5, "{:?}", point.radiance);
    }
    let mean = Rgb::new(2.0 / 3.0, 2.0 / 3.0, 2.0);
    assert!(
        (light.power_luminance() - std::f32::consts::PI * mean.luminance()).abs() < 1e-5,
        "{}",
        light.power_luminance()
    );
    assert!((light.bounds().intensity - 0.5 * mean.luminance()).abs() < 1e-5);
    assert_eq!(of(&mesh, &plain)[0].mean_radiance(), Rgb::splat(2.0));

    // Triangles of one colour form a rectangle of that colour; others do not
    let Shape::Mesh(mut quad) = rectangle_mesh(Vec3::ZERO, Vec3::X, Vec3::Y) else { panic!("a mesh") };
    quad.colors = vec![[0.5, 0.25, 0.0, 1.0]; 4];
    let lights = of(&quad, &emission);
    assert!(matches!(lights[..], [AreaLight { shape: AreaShape::Rectangle(_), .. }]), "{lights:?}");
    assert_eq!(lights[0].mean_radiance(), Rgb::new(1.0, 0.5, 0.0));
    quad.colors[3][0] = 1.0;
    let lights = of(&quad, &emission);
    assert_eq!(lights.len(), 2);
    assert!((lights[1].mean_radiance().r - 4.0 / 3.0).abs() < 1e-6, "{lights:?}");
}

#[test]
fn delta_and_infinite_lights_are_consistent() {
    let distant = Light::Distant(DistantLight { wi: Vec3::Y, irradiance: Rgb::splat(2.0) });
    let s = distant.sample_li(&LightCtx::at(Vec3::ONE), [0.1, 0.2]).unwrap();
    assert!(s.is_delta && s.pdf == 1.0 && s.wi == Vec3::Y && s.t == f32::INFINITY && s.li == Rgb::splat(2.0));
    assert_eq!(distant.pdf_li(&LightCtx::at(Vec3::ONE), Vec3::Y, &LightHit::INFINITE), 0.0);

    // A reflected and rotated map: the lookup agrees with the sample.
    let texels = (0..16).map(|i| Rgb::splat(i as f32)).collect();
    let map = super::EnvironmentMap::new(
        texels,
        [4, 4],
        super::EnvironmentMapping::EqualArea,
        super::EnvironmentFilter::Bilinear,
    );
    let turn = Affine3A::from_mat3(Mat3::from_rotation_x(1.0) * Mat3::from_diagonal(Vec3::new(-3.0, 3.0, 3.0)));
    let light = Light::infinite_image(std::sync::Arc::new(map.unwrap()), &turn, 0.5);
    let mut stream = pcg32([3, 3, 3]);
    for _ in 0..1000 {
        let s = light.sample_li(&LightCtx::at(Vec3::ONE), stream.random::<[f32; 2]>()).unwrap();
        let le = light.le(Vec3::ZERO, s.wi);
        let pdf = light.pdf_li(&LightCtx::at(Vec3::ONE), s.wi, &LightHit::INFINITE);
        assert!((le.r - s.li.r).abs() < 1e-3 * (1.0 + le.r) && pdf > 0.0);
        let by_hand = turn.inverse().transform_vector3(s.wi).normalize();
        let Light::InfiniteImage { map, .. } = &light else { panic!() };
        assert!((map.le(by_hand).r * 0.5 - le.r).abs() < 1e-3);
    }
}
