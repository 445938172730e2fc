//! Planes of flat lights.
//!
//! A flat light is not visible from its own plane. Points of the plane are inexact by rounding. At a nearby point even
//! a tiny offset from the plane gives a large angle, so points within the rounding error count as on the plane.

use super::area_shape::AreaShape;
use super::quadric::DiskPlane;
use lumiris_numbers::math::{Vec3, gamma};

/// Bound of the rounding errors of a point of the plane, of the plane itself, and of the distance between them,
/// relative to their coordinates.
const ROUNDING: f32 = gamma(9);
/// Maximum distance of the corners of a flat patch from one plane, relative to their coordinates: the rounding error of
/// the transform to world space.
const FLATNESS: f32 = gamma(16);

/// The plane of a flat light.
#[derive(Clone, Copy, Debug)]
pub struct Plane {
    /// A point of it.
    p: Vec3,
    /// Unit normal on the emitting side; zero if the light has no area.
    n: Vec3,
    /// Distance up to which the origin counts as on it.
    error: f32,
}

impl Plane {
    /// The plane of a shape; `None` if the shape is curved.
    pub(super) fn of(shape: &AreaShape) -> Option<Plane> {
        match shape {
            AreaShape::Triangle(t) => Some(Plane::new(&t.p, t.n)),
            AreaShape::Rectangle(r) => {
                let plane = Plane::new(&r.corners(), r.n);
                Some(Plane { error: plane.error + r.flatness_error, ..plane })
            }
            AreaShape::Quadric(quadric) => quadric.disk_plane().map(|DiskPlane { center, extent, n }| Plane {
                error: n.abs().dot(extent) * ROUNDING,
                ..Plane::new(&[center], n)
            }),
            AreaShape::Patch(patch) => {
                let plane = Plane::new(&patch.corners, patch.mean_normal());
                let extent = patch.corners.iter().fold(Vec3::ZERO, |m, p| m.max(p.abs()));
                (plane.error <= plane.n.abs().dot(extent) * (FLATNESS + ROUNDING)).then_some(plane)
            }
        }
    }

    /// The plane through the first of `corners`. Distances of the other corners increase the error bound.
    fn new(corners: &[Vec3], n: Vec3) -> Plane {
        let (first, normal) = (corners[0].as_dvec3(), n.as_dvec3());
        let off = |p: &Vec3| normal.dot(p.as_dvec3() - first).abs();
        let bend = corners.iter().map(off).fold(0.0, f64::max) as f32;
        let extent = corners.iter().fold(Vec3::ZERO, |m, p| m.max(p.abs()));
        Plane { p: corners[0], n, error: bend + n.abs().dot(extent) * ROUNDING }
    }

    /// Distance of `p` on the emitting side, negative behind; 0 if `p` is on the plane within the rounding error.
    #[inline]
    pub(super) fn height(&self, p: Vec3) -> f32 {
        let height = self.n.dot(p - self.p);
        if height.abs() <= self.error + self.n.abs().dot(p.abs()) * ROUNDING { 0.0 } else { height }
    }
}

#[cfg(test)]
mod tests {
    use crate::geometry::reference_for_tests::random_point;
    use crate::geometry::{BilinearMesh, Quadric, QuadricKind, Shape, TriangleMesh};
    use crate::lights::{AreaLight, Emission, area_lights_of};
    use lumiris_numbers::math::{Affine3A, Quat, Rgb, Vec3};
    use lumiris_test_support::random::{Pcg32, RngExt, pcg32};

    fn placement(s: &mut Pcg32, k: usize) -> Affine3A {
        let axis = [random_point(s).normalize_or(Vec3::X), Vec3::Y, Vec3::Z][k % 3];
        let scale = [1e-3, 1.0, 30.0, 1e4][k / 3 % 4];
        let rotation = Quat::from_axis_angle(axis, s.random::<f32>() * 6.0);
        let p = random_point(s) * [0.0, 1.0, 100.0][k / 12 % 3] * scale;
        Affine3A::from_scale_rotation_translation(Vec3::splat(scale), rotation, p)
    }

    /// A triangle, a quadrilateral of two triangles, the same quadrilateral as a patch, and a disk.
    fn flat_shapes(m: &Affine3A, s: &mut Pcg32) -> [Shape; 4] {
        let far = 1.0 + s.random::<f32>();
        let corners = [(0.0, 0.0), (1.0, 0.1), (0.0, 1.0), (far, far)];
        let [a, b, c, d] = corners.map(|(x, y)| m.transform_point3(Vec3::new(x, y, 0.0)));
        let mesh = |p: Vec<Vec3>, indices| Shape::Mesh(TriangleMesh::new(p, indices).unwrap());
        let patch = BilinearMesh { positions: vec![a, b, c, d], indices: vec![[0, 1, 2, 3]], ..Default::default() };
        let kind = QuadricKind::Disk { height: 0.0, radius: 1.5, inner_radius: 0.0, phi_max: std::f32::consts::TAU };
        let disk = Quadric::new(kind, *m, false);
        [
            mesh(vec![a, b, c], vec![[0, 1, 2]]),
            mesh(vec![a, b, d, c], vec![[0, 1, 2], [0, 2, 3]]),
            Shape::Bilinear(patch),
            Shape::Quadric(disk),
        ]
    }

    fn lights_of(shape: &Shape, two_sided: bool) -> Vec<AreaLight> {
        area_lights_of(shape, &Emission { two_sided, ..Emission::constant(Rgb::WHITE) }).lights
    }

    #[test]
    fn a_flat_light_is_dark_from_its_own_points_and_not_from_near_by() {
        let s = &mut pcg32([4, 8, 2]);
        for k in 0..1200 {
            let m = placement(s, k);
            for shape in flat_shapes(&m, s) {
                let lights = [true, false].map(|two_sided| lights_of(&shape, two_sided));
                let count = if let Shape::Mesh(mesh) = &shape { mesh.triangle_count() } else { 1 };
                for primitive in (0..count as u32).cycle().take(8) {
                    let uv = s.random::<[f32; 2]>().map(|u| 0.5 * u);
                    let hit = shape.surface_hit(primitive, uv, -Vec3::Z);
                    for light in lights.iter().flatten() {
                        assert!(light.is_dark_from(hit.p), "{shape:?} {uv:?}");
                        // Larger than the rounding errors of p and of the extent of the light
                        let height = 1e-5 * (hit.p.abs().max_element() + light.area().sqrt());
                        let above = [hit.p + hit.n * height, hit.p - hit.n * height].map(|p| light.is_dark_from(p));
                        assert_eq!(above, [false, !light.emission.two_sided], "{shape:?} {uv:?}");
                    }
                }
            }
        }
    }

    #[test]
    fn a_curved_light_has_no_plane() {
        let corners = [Vec3::ZERO, Vec3::X, Vec3::Y, Vec3::new(1.0, 1.0, 1e-3)];
        let patch = BilinearMesh { positions: corners.to_vec(), indices: vec![[0, 1, 2, 3]], ..Default::default() };
        assert!(lights_of(&Shape::Bilinear(patch), true)[0].plane.is_none());
    }
}
