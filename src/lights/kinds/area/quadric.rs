//! Spheres, disks and cylinders.
//!
//! A full sphere under a similarity transform is sampled uniformly in the cone that it subtends [Pharr et al. 2023,
//! §6.2.4], and uniformly in area from inside. All other shapes, including partial spheres, are sampled uniformly in
//! the area of their local shape. A transform M scales an area element by |cof(M)·n|, where n is the local normal.

use super::shape_sample::{ShapePoint, ShapeSample, pdf_by_area};
use crate::geometry::{Quadric, QuadricKind};
use crate::lights::Sphere;
use lumiris_numbers::math::subtended_cone::{ON_SURFACE, SpherePoint, SubtendedCone};
use lumiris_numbers::math::warp::{azimuth, direction, sample_uniform_disk_concentric};
use lumiris_numbers::math::{Bounds3, Mat3, Vec2, Vec3, gamma, safe_sqrt, sqr};
use std::f32::consts::TAU;

/// A quadric that emits.
#[derive(Clone, Debug)]
pub struct QuadricLight {
    quadric: Quadric,
    /// Cofactor matrix of the transform.
    cofactor: Mat3,
    local_area: f32,
    /// Area in world space.
    pub area: f32,
    /// The sphere in world space, if it is a full one.
    pub(in crate::lights) sphere: Option<Sphere>,
    /// True if the normal is the reverse of the outward one (of +z for a disk).
    pub(in crate::lights) reversed: bool,
}

/// A point of the local surface, and its normal before flipping.
struct LocalPoint {
    p: Vec3,
    n: Vec3,
}

/// The plane of a disk.
pub(super) struct DiskPlane {
    pub(super) center: Vec3,
    /// The largest coordinates of the terms that the points of the disk are sums of.
    pub(super) extent: Vec3,
    /// Unit normal.
    pub(super) n: Vec3,
}

/// Bounds of the normals and of the projected area of a quadric.
pub(super) struct DirectionBounds {
    /// Axis and cosine of a cone about all normals.
    pub(super) axis: Vec3,
    pub(super) cos: f32,
    /// Maximum intensity for a radiance of 1: a quarter of the area for full spheres, 1/π of it for full cylinders,
    /// half of it for parts of them.
    pub(super) max_projected_area: f32,
}

fn cofactor_matrix(m: &Mat3) -> Mat3 {
    Mat3::from_cols(m.y_axis.cross(m.z_axis), m.z_axis.cross(m.x_axis), m.x_axis.cross(m.y_axis))
}

fn local_area(kind: &QuadricKind) -> f32 {
    match *kind {
        QuadricKind::Sphere { radius, z_min, z_max, phi_max } => phi_max * radius * (z_max - z_min),
        QuadricKind::Disk { radius, inner_radius, phi_max, .. } => {
            0.5 * phi_max * (radius - inner_radius) * (radius + inner_radius)
        }
        QuadricKind::Cylinder { radius, z_min, z_max, phi_max } => phi_max * radius * (z_max - z_min),
    }
}

/// The world-space radius of a full sphere under a similarity transform; `None` for other shapes or transforms.
fn sphere_radius(kind: &QuadricKind, m: &Mat3) -> Option<f32> {
    let QuadricKind::Sphere { radius, z_min, z_max, phi_max } = *kind else { return None };
    let is_full = z_min <= -radius * (1.0 - 1e-6) && z_max >= radius * (1.0 - 1e-6) && phi_max >= TAU - 1e-5;
    let squares = [m.x_axis, m.y_axis, m.z_axis].map(|c| c.length_squared());
    let mean = (squares[0] + squares[1] + squares[2]) / 3.0;
    let dots = [m.x_axis.dot(m.y_axis), m.y_axis.dot(m.z_axis), m.z_axis.dot(m.x_axis)];
    let keeps_angles =
        squares.iter().all(|s| (s - mean).abs() <= 1e-5 * mean) && dots.iter().all(|d| d.abs() <= 1e-5 * mean);
    (is_full && keeps_angles && mean > 0.0).then(|| radius * mean.sqrt())
}

impl QuadricLight {
    /// A quadric in world space.
    pub fn new(quadric: &Quadric) -> Self {
        let m = Mat3::from(quadric.group_from_local.matrix3);
        let mut light = QuadricLight {
            quadric: *quadric,
            cofactor: cofactor_matrix(&m),
            local_area: local_area(&quadric.kind).max(0.0),
            area: 0.0,
            sphere: None,
            reversed: (m.determinant() < 0.0) != quadric.flip_normal,
        };
        if let Some(radius) = sphere_radius(&quadric.kind, &m) {
            light.sphere = Some(Sphere { center: quadric.group_from_local.translation.into(), radius });
        }
        light.area = light.world_area();
        light
    }

    /// The sphere, if it is a full one whose normal points outwards.
    pub(in crate::lights) fn outward_sphere(&self) -> Option<Sphere> {
        self.sphere.filter(|_| !self.reversed)
    }

    /// ∫|cof(M)·n| dA by the midpoint rule, which is exact where the integrand is constant.
    fn world_area(&self) -> f32 {
        const CELLS: u32 = 32;
        let sum: f64 = (0..CELLS * CELLS)
            .map(|i| [(i % CELLS) as f32 + 0.5, (i / CELLS) as f32 + 0.5].map(|x| x / CELLS as f32))
            .map(|u| f64::from((self.cofactor * self.sample_local(u).n).length()))
            .sum();
        let area = (sum / f64::from(CELLS * CELLS)) as f32 * self.local_area;
        if area.is_finite() { area } else { 0.0 }
    }

    /// A point uniform in local area.
    fn sample_local(&self, u: [f32; 2]) -> LocalPoint {
        match self.quadric.kind {
            QuadricKind::Sphere { radius, z_min, z_max, phi_max } => {
                // Uniform in z (Archimedes)
                let n = direction((z_max + (z_min - z_max) * u[0]) / radius, phi_max * u[1]);
                LocalPoint { p: n * radius, n }
            }
            QuadricKind::Disk { height, radius, inner_radius, phi_max } => {
                let xy = if inner_radius <= 0.0 && phi_max >= TAU {
                    sample_uniform_disk_concentric(u) * radius
                } else {
                    let r = safe_sqrt(sqr(inner_radius) + u[0] * (sqr(radius) - sqr(inner_radius)));
                    Vec2::from_angle(phi_max * u[1]) * r
                };
                LocalPoint { p: xy.extend(height), n: Vec3::Z }
            }
            QuadricKind::Cylinder { radius, z_min, z_max, phi_max } => {
                let xy = Vec2::from_angle(phi_max * u[1]);
                LocalPoint { p: (xy * radius).extend(z_min + (z_max - z_min) * u[0]), n: xy.extend(0.0) }
            }
        }
    }

    /// The normal, before flipping, at a local point of the surface.
    #[inline]
    fn local_normal(&self, p: Vec3) -> Vec3 {
        match self.quadric.kind {
            QuadricKind::Sphere { .. } => p.normalize_or_zero(),
            QuadricKind::Disk { .. } => Vec3::Z,
            QuadricKind::Cylinder { .. } => Vec3::new(p.x, p.y, 0.0).normalize_or_zero(),
        }
    }

    /// The cone that the sphere subtends at `from`. `None` if the shape is not a full sphere or `from` is inside.
    #[inline]
    fn cone(&self, from: Vec3) -> Option<SubtendedCone<f32>> {
        Some(SubtendedCone::new(&self.sphere?, from.into())).filter(|cone| cone.is_outside)
    }

    pub(super) fn sample(&self, from: Vec3, u: [f32; 2]) -> Option<ShapeSample> {
        let (Some(cone), Some(sphere)) = (self.cone(from), self.sphere) else {
            return ShapeSample::by_area(from, self.sample_point(u));
        };
        let SpherePoint { p, p_error, outward, wi, t, pdf } = cone.sample(&sphere, from.into(), u);
        let outward = Vec3::from(outward);
        let n = if self.reversed { -outward } else { outward };
        (pdf > 0.0).then_some(ShapeSample { p: p.into(), n, p_error: p_error.into(), wi: wi.into(), t, pdf })
    }

    /// A point uniform in the area of the local quadric.
    pub(super) fn sample_point(&self, u: [f32; 2]) -> ShapePoint {
        let LocalPoint { p: local, n: local_n } = self.sample_local(u);
        let to_world = &self.quadric.group_from_local;
        let scaled_n = self.cofactor * local_n;
        let jacobian = scaled_n.length();
        let n = scaled_n / jacobian;
        let n = if self.quadric.flip_normal { -n } else { n };
        let (local, p) = (local.abs(), to_world.transform_point3(local));
        let m = Mat3::from(to_world.matrix3);
        let magnitude = m.x_axis.abs() * local.x + m.y_axis.abs() * local.y + m.z_axis.abs() * local.z;
        let p_error = (magnitude + Vec3::from(to_world.translation).abs()) * gamma(10);
        ShapePoint { p, n, p_error, pdf_area: 1.0 / (self.local_area * jacobian) }
    }

    pub(super) fn pdf(&self, from: Vec3, p: Vec3) -> f32 {
        if let Some(cone) = self.cone(from) {
            return cone.pdf();
        }
        let scaled_n = self.cofactor * self.local_normal(self.quadric.local_from_group.transform_point3(p));
        let jacobian = scaled_n.length();
        pdf_by_area(from, p, scaled_n / jacobian, 1.0 / (self.local_area * jacobian))
    }

    /// The plane of a disk; `None` for other quadrics.
    pub(super) fn disk_plane(&self) -> Option<DiskPlane> {
        let QuadricKind::Disk { height, radius, .. } = self.quadric.kind else { return None };
        let m = self.quadric.group_from_local.as_daffine3();
        let n = m.matrix3.x_axis.cross(m.matrix3.y_axis).normalize_or_zero().as_vec3();
        let center = m.transform_point3(Vec3::new(0.0, 0.0, height).as_dvec3());
        let local = Vec3::new(radius, radius, height.abs()).as_dvec3();
        let extent = m.matrix3.abs() * local + m.translation.abs();
        let n = if self.quadric.flip_normal { -n } else { n };
        Some(DiskPlane { center: center.as_vec3(), extent: extent.as_vec3(), n })
    }

    /// True if the side of the normal is not visible from `p`: `p` is outside a sphere whose normal points inwards, or
    /// inside a sphere whose normal points outwards.
    #[inline]
    pub(super) fn is_behind(&self, p: Vec3) -> bool {
        match (self.quadric.kind, self.sphere) {
            (QuadricKind::Sphere { .. }, Some(Sphere { center, radius })) => {
                // A point on the sphere, which rounding may put on either side, counts as inside.
                let distance = p.distance(center);
                let is_inside = distance < radius * (1.0 - ON_SURFACE);
                let is_outside = distance > radius * (1.0 + ON_SURFACE);
                if self.reversed { is_outside } else { is_inside }
            }
            (QuadricKind::Sphere { .. } | QuadricKind::Cylinder { .. } | QuadricKind::Disk { .. }, _) => false,
        }
    }

    pub(super) fn bounds(&self) -> Bounds3 {
        self.quadric.bounds()
    }

    /// Bounds of the normals and of the projected area.
    pub(super) fn direction_bounds(&self) -> DirectionBounds {
        let all = DirectionBounds { axis: Vec3::Z, cos: -1.0, max_projected_area: 0.0 };
        match self.quadric.kind {
            QuadricKind::Disk { .. } => {
                let n = (self.cofactor * Vec3::Z).normalize_or_zero();
                let axis = if self.quadric.flip_normal { -n } else { n };
                DirectionBounds { axis, cos: 1.0, max_projected_area: self.area }
            }
            QuadricKind::Sphere { .. } => {
                let factor = if self.sphere.is_some() { 0.25 } else { 0.5 };
                DirectionBounds { max_projected_area: self.area * factor, ..all }
            }
            QuadricKind::Cylinder { .. } => {
                DirectionBounds { max_projected_area: self.area * std::f32::consts::FRAC_1_PI, ..all }
            }
        }
    }

    /// Texture coordinates as pbrt-v4 assigns them.
    pub(super) fn uv(&self, p: Vec3) -> Vec2 {
        let p = self.quadric.local_from_group.transform_point3(p);
        let phi = azimuth(p);
        match self.quadric.kind {
            QuadricKind::Sphere { radius, z_min, z_max, phi_max } => {
                let theta = |z: f32| (z / radius).clamp(-1.0, 1.0).acos();
                let v = (theta(p.z) - theta(z_min)) / (theta(z_max) - theta(z_min));
                Vec2::new(phi / phi_max, v)
            }
            QuadricKind::Disk { radius, inner_radius, phi_max, .. } => {
                Vec2::new(phi / phi_max, (radius - p.truncate().length()) / (radius - inner_radius))
            }
            QuadricKind::Cylinder { z_min, z_max, phi_max, .. } => {
                Vec2::new(phi / phi_max, (p.z - z_min) / (z_max - z_min))
            }
        }
    }
}

#[cfg(test)]
impl QuadricLight {
    /// True if `sample` can return the point `p`. False only for points of a full sphere, sampled from outside, that
    /// face away from `from`.
    pub(crate) fn pdf_is_visible(&self, from: Vec3, p: Vec3) -> bool {
        match (self.cone(from), self.sphere) {
            (Some(_), Some(Sphere { center, .. })) => (p - center).dot(from - p) > 0.0,
            _ => true,
        }
    }
}
