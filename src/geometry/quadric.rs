//! Spheres, disks and cylinders, possibly partial.
//!
//! Parameters (u, v) of a point, φ its azimuth about z in 0..2π:
//! u = φ / φ_max, and v = (θ − θ(z_min)) / (θ(z_max) − θ(z_min)) on a sphere with cos θ = z / radius,
//! (radius − r) / (radius − inner_radius) on a disk, (z − z_min) / (z_max − z_min) on a cylinder.
//!
//! Roots are computed in f64 in local space. The hit point is chosen such that `local_from_group`, the transform
//! applied to rays, maps it onto the local surface. The two transforms are rounded separately, and their difference
//! would otherwise be an error of the point.

use super::hit::{LocalHit, SurfaceHit, VertexValues, round, spanning};
use glam::{DAffine3, DVec3};
use lumiris_numbers::math::transform::{swaps_handedness, transform_normal};
use lumiris_numbers::math::{Affine3A, Bounds3, Ray, Vec2, Vec3, gamma};
use std::f64::consts::{PI, TAU};

/// The kind of quadric, in its local space (pbrt's parameters; angles in radians).
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum QuadricKind {
    /// Sphere about the origin, cut to z_min..z_max and φ in 0..phi_max.
    Sphere {
        /// Radius.
        radius: f32,
        /// Lower cut, in −radius..radius.
        z_min: f32,
        /// Upper cut.
        z_max: f32,
        /// Sweep angle.
        phi_max: f32,
    },
    /// Disk z = height, inner_radius..radius.
    Disk {
        /// z of its plane.
        height: f32,
        /// Outer radius.
        radius: f32,
        /// Inner radius, 0 for a full disk.
        inner_radius: f32,
        /// Sweep angle.
        phi_max: f32,
    },
    /// Open cylinder about z, z_min..z_max.
    Cylinder {
        /// Radius.
        radius: f32,
        /// Lower end.
        z_min: f32,
        /// Upper end.
        z_max: f32,
        /// Sweep angle.
        phi_max: f32,
    },
}

/// A quadric with its transform to the space of its group.
#[derive(Clone, Copy, Debug)]
pub struct Quadric {
    /// Shape in local space.
    pub kind: QuadricKind,
    /// Transform.
    pub group_from_local: Affine3A,
    /// Inverse transform.
    pub local_from_group: Affine3A,
    /// True if the geometric normal is the reverse of ∂p/∂u × ∂p/∂v in the group's space: pbrt's `ReverseOrientation`
    /// xor reflection. Normals therefore point outward (+z for a disk), reflected or not, unless `ReverseOrientation`
    /// is set.
    pub flip_normal: bool,
    /// For spheres.
    ball: Option<Ball>,
}

/// A ball that contains a sphere, in the space of its group.
#[derive(Clone, Copy, Debug)]
struct Ball {
    center: DVec3,
    /// Square of its radius, with a margin for the rounding of the centre.
    radius_squared: f64,
}

impl Ball {
    /// Rounding of squared distances, relative to the squares of the numbers that they are differences of.
    const ROUNDING: f64 = 1e-14;

    /// The ball of a sphere that rays are transformed to by `local_from_group`; `None` for other quadrics.
    fn new(kind: &QuadricKind, local_from_group: &Affine3A) -> Option<Self> {
        let QuadricKind::Sphere { radius, .. } = *kind else { return None };
        let DAffine3 { matrix3: m, translation: center } = local_from_group.as_daffine3().inverse();

        // No eigenvalue of MᵀM is above its largest sum of magnitudes in a row [Gershgorin]
        let squares = (m.transpose() * m).abs();
        let rows = squares.x_axis + squares.y_axis + squares.z_axis;
        let radius_squared = rows.max_element() * f64::from(radius).powi(2) * OUTSIDE;
        Some(Ball { center, radius_squared: radius_squared + center.length_squared() * Self::ROUNDING })
    }

    /// True if the part of a ray from `o` to o + t_max d is outside. Shadow segments to a spherical light are: they end
    /// just before the sphere.
    #[inline]
    fn is_missed(&self, o: DVec3, d: DVec3, t_max: f64) -> bool {
        let from = o - self.center;
        let (a, b) = (d.length_squared(), from.dot(d));
        let nearest = if -b >= a * t_max { from + d * t_max } else { from - d * (b.min(0.0) / a) };
        nearest.length_squared() > self.radius_squared + from.length_squared() * Self::ROUNDING
    }
}

impl Quadric {
    /// A quadric with its transform. See [`Self::flip_normal`].
    pub fn new(kind: QuadricKind, group_from_local: Affine3A, flip_normal: bool) -> Self {
        let local_from_group = group_from_local.inverse();
        Quadric { kind, group_from_local, local_from_group, flip_normal, ball: Ball::new(&kind, &local_from_group) }
    }

    /// The same quadric with another [`Self::flip_normal`].
    #[must_use]
    pub fn with_flip(self, flip_normal: bool) -> Self {
        Quadric { flip_normal, ..self }
    }

    /// Bounds of the full quadric (the sweep angle is not used to tighten them).
    pub fn bounds(&self) -> Bounds3 {
        let local = match self.kind {
            QuadricKind::Sphere { radius, z_min, z_max, .. } | QuadricKind::Cylinder { radius, z_min, z_max, .. } => {
                Bounds3 { min: Vec3::new(-radius, -radius, z_min), max: Vec3::new(radius, radius, z_max) }
            }
            QuadricKind::Disk { height, radius, .. } => {
                Bounds3 { min: Vec3::new(-radius, -radius, height), max: Vec3::new(radius, radius, height) }
            }
        };
        local.transformed(&self.group_from_local)
    }

    /// The first hit in (0, t_max); uv are the parameters (u, v).
    ///
    /// A ray from [`lumiris_numbers::math::ray::offset_origin`] does not hit its origin again.
    pub fn intersect(&self, ray: &Ray) -> Option<LocalHit> {
        self.intersect_where(ray, |_, _| true)
    }

    /// The first hit in (0, t_max) for which `accepts` is true. Its arguments are the hit and its index: 0 for the
    /// first intersection of the ray's line with the full quadric, 1 for the second.
    #[inline]
    pub fn intersect_where(&self, ray: &Ray, accepts: impl Fn(&LocalHit, usize) -> bool) -> Option<LocalHit> {
        self.first(ray, |p, t, crossing| {
            let hit = LocalHit { t, uv: self.kind.parameters(p)? };
            accepts(&hit, crossing).then_some(hit)
        })
    }

    /// t of [`Self::intersect`], without its parameters.
    pub fn distance(&self, ray: &Ray) -> Option<f32> {
        self.first(ray, |p, t, _| self.kind.azimuth(p).map(|_| t))
    }

    /// Calls `take` with the intersections of the full quadric in (0, t_max), in order, and returns its first result.
    /// The arguments are the point, its t and its index.
    #[inline]
    fn first<T>(&self, ray: &Ray, take: impl Fn(DVec3, f32, usize) -> Option<T>) -> Option<T> {
        let (o, d) = (ray.o.as_dvec3(), ray.d.as_dvec3());
        if self.ball.is_some_and(|ball| ball.is_missed(o, d, f64::from(ray.t_max))) {
            return None;
        }
        let local_from_group = self.local_from_group.as_daffine3();
        let (o, d) = (local_from_group.transform_point3(o), local_from_group.transform_vector3(d));
        let roots = self.kind.roots(o, d)?;

        // Below this parameter a hit is rounding noise: o is the sum of terms of this size.
        let scale = o.abs().max_element() + local_from_group.translation.abs().max_element() + self.kind.radius();
        let t_min = scale * 2.0_f64.powi(-44) / d.length();
        roots.into_iter().enumerate().find_map(|(crossing, t)| {
            let rounded = t as f32;
            let is_met = t > t_min && rounded > 0.0 && rounded < ray.t_max;
            if is_met { take(o + d * t, rounded, crossing) } else { None }
        })
    }

    /// The surface at the parameters `uv`, in the space of the group.
    pub fn surface_hit(&self, uv: [f32; 2]) -> SurfaceHit {
        let local = self.kind.surface(uv.map(f64::from));
        let group_from_local = self.group_from_local.as_daffine3();
        let p = refined_point(&group_from_local, &self.local_from_group.as_daffine3(), local.p);
        let extent = group_from_local.matrix3.abs() * self.kind.extent() + group_from_local.translation.abs();
        let p_error = (p.abs() + extent.as_vec3()) * gamma(3);

        let outward = transform_normal(&self.group_from_local, round(local.n));
        let reversed = self.flip_normal != swaps_handedness(&self.group_from_local);
        let n = if reversed { -outward } else { outward };
        let [dpdu, dpdv] = local.derivatives.map(|v| round(group_from_local.transform_vector3(v)));
        let [dpdu, dpdv] = spanning(dpdu, dpdv, n);
        let vertex = VertexValues::default();
        SurfaceHit { p, p_error, n, ns: n, dpdu, dpdv, dpdus: dpdu, dpdvs: dpdv, uv: Vec2::from(uv), vertex }
    }
}

/// The group-space point that `local_from_group` maps to `p`, by one step of iterative refinement.
fn refined_point(group_from_local: &DAffine3, local_from_group: &DAffine3, p: DVec3) -> Vec3 {
    let first = group_from_local.transform_point3(p);
    let residual = local_from_group.transform_point3(first) - p;
    let refined = first - group_from_local.transform_vector3(residual);
    round(if refined.is_finite() { refined } else { first })
}

/// A point of a quadric in local space.
struct LocalSurface {
    p: DVec3,
    /// Unit; outward, +z for a disk.
    n: DVec3,
    /// ∂p/∂u, ∂p/∂v.
    derivatives: [DVec3; 2],
}

impl QuadricKind {
    fn radius(&self) -> f64 {
        let (QuadricKind::Sphere { radius, .. }
        | QuadricKind::Disk { radius, .. }
        | QuadricKind::Cylinder { radius, .. }) = *self;
        f64::from(radius)
    }

    /// The maximum coordinates of its points.
    fn extent(&self) -> DVec3 {
        let z = match *self {
            QuadricKind::Sphere { z_min, z_max, .. } | QuadricKind::Cylinder { z_min, z_max, .. } => {
                z_min.abs().max(z_max.abs())
            }
            QuadricKind::Disk { height, .. } => height.abs(),
        };
        DVec3::new(self.radius(), self.radius(), f64::from(z))
    }

    /// Parameters of the intersections of the line o + t d with the full quadric, in ascending order.
    fn roots(&self, o: DVec3, d: DVec3) -> Option<[f64; 2]> {
        match *self {
            QuadricKind::Sphere { radius, .. } => sphere_roots(o, d, f64::from(radius)),
            QuadricKind::Cylinder { radius, .. } => sphere_roots(o.with_z(0.0), d.with_z(0.0), f64::from(radius)),
            QuadricKind::Disk { height, .. } => {
                let t = (f64::from(height) - o.z) / d.z;
                t.is_finite().then_some([t, f64::NAN])
            }
        }
    }

    /// Parameters of a point of the full quadric; `None` if it is cut off.
    fn parameters(&self, p: DVec3) -> Option<[f32; 2]> {
        let Azimuth { phi, phi_max } = self.azimuth(p)?;
        let v = match *self {
            QuadricKind::Sphere { radius, z_min, z_max, .. } => {
                let [from, to] = polar_range(radius, z_min, z_max);
                // Accurate near the poles, where arc cosines are not.
                ratio(p.x.hypot(p.y).atan2(p.z) - from, to - from)
            }
            QuadricKind::Cylinder { z_min, z_max, .. } => {
                let (z_min, z_max) = (f64::from(z_min), f64::from(z_max));
                ratio(p.z - z_min, z_max - z_min)
            }
            QuadricKind::Disk { radius, inner_radius, .. } => {
                let (radius, inner_radius) = (f64::from(radius), f64::from(inner_radius));
                ratio(radius - p.x.hypot(p.y), radius - inner_radius)
            }
        };
        let phi = phi.unwrap_or_else(|| azimuth(p));
        Some([ratio(phi, phi_max) as f32, v as f32])
    }

    /// Azimuth of a point of the full quadric; `None` if the point is cut off.
    #[inline]
    fn azimuth(&self, p: DVec3) -> Option<Azimuth> {
        let phi_max = match *self {
            QuadricKind::Sphere { radius, z_min, z_max, phi_max } => {
                if (z_min > -radius && p.z < f64::from(z_min)) || (z_max < radius && p.z > f64::from(z_max)) {
                    return None;
                }
                phi_max
            }
            QuadricKind::Cylinder { z_min, z_max, phi_max, .. } => {
                if p.z < f64::from(z_min) || p.z > f64::from(z_max) {
                    return None;
                }
                phi_max
            }
            QuadricKind::Disk { radius, inner_radius, phi_max, .. } => {
                let r = p.x.hypot(p.y);
                if r > f64::from(radius) || r < f64::from(inner_radius) {
                    return None;
                }
                phi_max
            }
        };
        let phi_max = f64::from(phi_max);
        // Azimuths are at most 2π
        if phi_max >= TAU && p.is_finite() {
            return Some(Azimuth { phi: None, phi_max });
        }
        let phi = azimuth(p);
        (phi <= phi_max).then_some(Azimuth { phi: Some(phi), phi_max })
    }

    /// The surface at parameters (u, v).
    fn surface(&self, [u, v]: [f64; 2]) -> LocalSurface {
        let phi_max = f64::from(match *self {
            QuadricKind::Sphere { phi_max, .. }
            | QuadricKind::Disk { phi_max, .. }
            | QuadricKind::Cylinder { phi_max, .. } => phi_max,
        });
        let (sin, cos) = (u * phi_max).sin_cos();
        let (radial, around) = (DVec3::new(cos, sin, 0.0), DVec3::new(-sin, cos, 0.0));
        match *self {
            QuadricKind::Sphere { radius, z_min, z_max, .. } => {
                let [from, to] = polar_range(radius, z_min, z_max);
                let radius = f64::from(radius);
                let (sin_theta, cos_theta) = (from + v * (to - from)).sin_cos();
                let n = radial * sin_theta + DVec3::Z * cos_theta;
                // ∂p/∂u vanishes at a pole; a small length keeps its direction.
                let du = around * (phi_max * radius * sin_theta.max(1e-5));
                let dv = (radial * cos_theta - DVec3::Z * sin_theta) * (radius * (to - from));
                LocalSurface { p: n * radius, n, derivatives: [du, dv] }
            }
            QuadricKind::Cylinder { radius, z_min, z_max, .. } => {
                let (radius, z_min, z_max) = (f64::from(radius), f64::from(z_min), f64::from(z_max));
                let p = radial * radius + DVec3::Z * (z_min + v * (z_max - z_min));
                let derivatives = [around * (phi_max * radius), DVec3::Z * (z_max - z_min)];
                LocalSurface { p, n: radial, derivatives }
            }
            QuadricKind::Disk { height, radius, inner_radius, .. } => {
                let (radius, inner_radius) = (f64::from(radius), f64::from(inner_radius));
                let r = radius + v * (inner_radius - radius);
                let p = radial * r + DVec3::Z * f64::from(height);
                let derivatives = [around * (phi_max * r.max(1e-5 * radius)), radial * (inner_radius - radius)];
                LocalSurface { p, n: DVec3::Z, derivatives }
            }
        }
    }
}

/// Squared distance from the centre of a sphere, relative to its squared radius, from which on a point is outside
/// despite rounding, if no coordinates are much larger.
const OUTSIDE: f64 = 1.0 + 1e-9;

/// The azimuth of a point of a quadric.
struct Azimuth {
    /// `None` if it was not needed to decide whether the point is cut off.
    phi: Option<f64>,
    phi_max: f64,
}

/// x / y, and 0 if y is.
#[inline]
fn ratio(x: f64, y: f64) -> f64 {
    if y == 0.0 { 0.0 } else { x / y }
}

/// Azimuth about z, in 0..2π.
#[inline]
fn azimuth(p: DVec3) -> f64 {
    let phi = p.y.atan2(p.x);
    if phi < 0.0 { phi + TAU } else { phi }
}

/// Polar angles of z_min and z_max.
fn polar_range(radius: f32, z_min: f32, z_max: f32) -> [f64; 2] {
    if z_min == -radius && z_max == radius {
        return [PI, 0.0];
    }
    [z_min, z_max].map(|z| (f64::from(z) / f64::from(radius)).clamp(-1.0, 1.0).acos())
}

/// The roots of |o + t d| = radius in ascending order. The discriminant is computed from the point nearest to the
/// centre, and the constant term from a product, so that neither cancels [Haines et al. 2019].
fn sphere_roots(o: DVec3, d: DVec3, radius: f64) -> Option<[f64; 2]> {
    let a = d.length_squared();
    let b = o.dot(d);
    let nearest = o - d * (b / a);
    if nearest.length_squared() > radius * radius * OUTSIDE {
        return None;
    }
    let nearest = nearest.length();
    let discriminant = a * (radius + nearest) * (radius - nearest);
    if discriminant.is_nan() || discriminant < 0.0 {
        return None;
    }
    let distance = o.length();
    let c = (distance + radius) * (distance - radius);
    let q = -(b + discriminant.sqrt().copysign(b));
    if q == 0.0 {
        return Some([0.0, 0.0]);
    }
    let (t0, t1) = (q / a, c / q);
    Some(if t0 <= t1 { [t0, t1] } else { [t1, t0] })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::reference_for_tests::random_point;
    use lumiris_numbers::math::ray::offset_origin;
    use lumiris_test_support::random::{Pcg32, RngExt, pcg32};
    use std::f32::consts::TAU as TAU32;

    fn kinds() -> [QuadricKind; 6] {
        [
            QuadricKind::Sphere { radius: 1.3, z_min: -1.3, z_max: 1.3, phi_max: TAU32 },
            QuadricKind::Sphere { radius: 1.3, z_min: -0.4, z_max: 1.0, phi_max: 4.0 },
            QuadricKind::Disk { height: 0.3, radius: 1.5, inner_radius: 0.0, phi_max: TAU32 },
            QuadricKind::Disk { height: -0.3, radius: 1.5, inner_radius: 0.5, phi_max: 5.0 },
            QuadricKind::Cylinder { radius: 0.8, z_min: -1.0, z_max: 2.0, phi_max: TAU32 },
            QuadricKind::Cylinder { radius: 0.8, z_min: -1.0, z_max: 2.0, phi_max: 2.0 },
        ]
    }

    fn placed(kind: QuadricKind, group_from_local: Affine3A) -> Quadric {
        Quadric::new(kind, group_from_local, swaps_handedness(&group_from_local))
    }

    fn random_placement(s: &mut Pcg32) -> Affine3A {
        let axis = random_point(s).normalize_or(Vec3::X);
        let rotation = glam::Quat::from_axis_angle(axis, s.random::<f32>() * 6.0);
        let mirror = if s.random::<f32>() < 0.5 { -1.0 } else { 1.0 };
        let scale = Vec3::new(mirror, 0.5 + s.random::<f32>(), 1.0) * (0.1 + 3.0 * s.random::<f32>());
        Affine3A::from_scale_rotation_translation(scale, rotation, random_point(s) * 50.0)
    }

    /// The first intersection by marching along the ray in f64 and bisecting.
    fn reference(quadric: &Quadric, ray: &Ray) -> Option<f64> {
        let m = quadric.local_from_group.as_daffine3();
        let o = m.transform_point3(ray.o.as_dvec3());
        let d = m.transform_vector3(ray.d.as_dvec3());
        let implicit = |p: DVec3| match quadric.kind {
            QuadricKind::Sphere { radius, .. } => p.length_squared() - f64::from(radius).powi(2),
            QuadricKind::Cylinder { radius, .. } => p.truncate().length_squared() - f64::from(radius).powi(2),
            QuadricKind::Disk { height, .. } => p.z - f64::from(height),
        };

        // Clipping by z, radius and azimuth
        let inside = |p: DVec3| {
            let phi = p.y.atan2(p.x).rem_euclid(TAU);
            match quadric.kind {
                QuadricKind::Sphere { z_min, z_max, phi_max, .. }
                | QuadricKind::Cylinder { z_min, z_max, phi_max, .. } => {
                    p.z >= f64::from(z_min) && p.z <= f64::from(z_max) && phi <= f64::from(phi_max)
                }
                QuadricKind::Disk { radius, inner_radius, phi_max, .. } => {
                    let r = p.truncate().length();
                    r <= f64::from(radius) && r >= f64::from(inner_radius) && phi <= f64::from(phi_max)
                }
            }
        };

        // March to a change of sign, and bisect
        let step = 2e-3 / d.length();
        for k in 0..6000 {
            let (mut lo, mut hi) = (k as f64 * step, (k + 1) as f64 * step);
            if (implicit(o + d * lo) < 0.0) == (implicit(o + d * hi) < 0.0) {
                continue;
            }
            for _ in 0..60 {
                let mid = 0.5 * (lo + hi);
                if (implicit(o + d * mid) < 0.0) == (implicit(o + d * lo) < 0.0) { lo = mid } else { hi = mid }
            }
            if inside(o + d * lo) {
                return Some(lo);
            }
        }
        None
    }

    #[test]
    fn rays_outside_of_the_ball_hit_nothing() {
        let mut s = pcg32([3, 0, 4]);
        let (mut missed, mut met) = (0, 0);
        for k in 0..20_000 {
            // The ball of a sphere that is scaled evenly is the sphere
            let rotation = glam::Quat::from_axis_angle(random_point(&mut s).normalize_or(Vec3::X), 2.0);
            let even = Affine3A::from_rotation_translation(rotation, random_point(&mut s) * 5.0);
            let placement = if k % 5 == 0 { random_placement(&mut s) } else { even };
            let quadric = placed(kinds()[k / 4 % 2], placement);
            // Segments of any length to a point near the surface, from inside or outside
            let to_group = |p: Vec3| quadric.group_from_local.transform_point3(p);
            let target = to_group(random_point(&mut s).normalize_or(Vec3::X) * 1.3 * (1.0 + 1e-6 * s.random::<f32>()));
            let distance = if k % 7 == 0 { 1e6 } else { 3.0 };
            let o = to_group(random_point(&mut s) * distance);
            let t_max = [0.9999, 1.0, 1.5, f32::INFINITY][k % 4];
            let ray = Ray { o, d: target - o, t_max, time: 0.0 };
            let unbounded = Quadric { ball: None, ..quadric };
            let is_missed = quadric.ball.unwrap().is_missed(o.as_dvec3(), ray.d.as_dvec3(), f64::from(t_max));
            assert!(!is_missed || unbounded.distance(&ray).is_none(), "{quadric:?} {ray:?}");
            missed += usize::from(is_missed);
            met += usize::from(unbounded.distance(&ray).is_some());
        }
        assert!(missed > 1000 && met > 1000, "{missed} {met}");
    }

    #[test]
    fn hits_agree_with_a_march_along_the_ray() {
        let mut s = pcg32([3, 0, 0]);
        let (mut both, mut differ) = (0, 0);
        for k in 0..600 {
            let quadric = placed(kinds()[k % 6], random_placement(&mut s));
            let to_group = |p: Vec3| quadric.group_from_local.transform_point3(p);
            let o = to_group(random_point(&mut s) * 3.0);
            let target = to_group(random_point(&mut s) * 1.5);
            let ray = Ray { o, d: target - o, t_max: f32::INFINITY, time: 0.0 };
            assert_eq!(quadric.distance(&ray), quadric.intersect(&ray).map(|hit| hit.t));
            match (quadric.intersect(&ray), reference(&quadric, &ray)) {
                (Some(hit), Some(t)) => {
                    both += 1;
                    differ += usize::from((f64::from(hit.t) - t).abs() > 1e-5 * (1.0 + t));
                    let p = quadric.surface_hit(hit.uv).p;
                    assert!((p - ray.at(hit.t)).length() < 2e-4, "{quadric:?} {hit:?}");
                }
                (None, None) => {}
                _ => differ += 1,
            }
        }
        // Marching misses grazing pairs of roots.
        assert!(both > 200 && differ <= 3, "{both} {differ}");
    }

    #[test]
    fn normals_are_outward_and_perpendicular_to_the_derivatives() {
        let mut s = pcg32([4, 0, 0]);
        for k in 0..600 {
            let mut quadric = placed(kinds()[k % 6], random_placement(&mut s));
            let uv = s.random::<[f32; 2]>();
            let hit = quadric.surface_hit(uv);
            let outside = quadric.local_from_group.transform_vector3(hit.n);
            let local = quadric.local_from_group.transform_point3(hit.p);
            let along = match quadric.kind {
                QuadricKind::Sphere { .. } => local.dot(outside),
                QuadricKind::Cylinder { .. } => local.truncate().dot(outside.truncate()),
                QuadricKind::Disk { .. } => outside.z,
            };
            assert!(along > 0.0, "{quadric:?} {hit:?}");
            let tolerance = 1e-4 * (hit.dpdu.length() + hit.dpdv.length());
            assert!(hit.n.dot(hit.dpdu).abs() < tolerance && hit.n.dot(hit.dpdv).abs() < tolerance);
            quadric.flip_normal = !quadric.flip_normal;
            assert_eq!(quadric.surface_hit(uv).n, -hit.n);

            // Finite differences, away from the poles and edges.
            let h = 1e-2;
            let at = |u: f32, v: f32| quadric.surface_hit([u, v]).p;
            let uv = uv.map(|x| 0.1 + 0.8 * x);
            let du = (at(uv[0] + h, uv[1]) - at(uv[0] - h, uv[1])) / (2.0 * h);
            let dv = (at(uv[0], uv[1] + h) - at(uv[0], uv[1] - h)) / (2.0 * h);
            let exact = quadric.surface_hit(uv);
            let tolerance = 1e-2 * (exact.dpdu.length() + exact.dpdv.length());
            assert!((du - exact.dpdu).length() < tolerance, "{du} {exact:?}");
            assert!((dv - exact.dpdv).length() < tolerance, "{dv} {exact:?}");
        }
    }

    #[test]
    fn rays_that_leave_do_not_meet_their_origin_again() {
        let mut s = pcg32([7, 0, 0]);
        for k in 0..120_000 {
            let quadric = placed(kinds()[k % 6], random_placement(&mut s));
            let hit = quadric.surface_hit(s.random::<[f32; 2]>());
            let mut w = random_point(&mut s).normalize_or(Vec3::Y);
            if k % 3 == 0 {
                // Grazing rays are the critical case.
                w = (w - hit.n * (w.dot(hit.n) * (1.0 - 1e-4))).normalize_or(w);
            }
            let ray = Ray { o: offset_origin(hit.p, hit.p_error, hit.n, w), d: w, t_max: f32::INFINITY, time: 0.0 };
            let again = quadric.intersect(&ray);
            // For an inward ray, the far side is a valid hit: its chord is 2 r cos θ or longer.
            let inward = w.dot(hit.n) < 0.0 && !matches!(quadric.kind, QuadricKind::Disk { .. });
            match again {
                None => {}
                Some(far) => {
                    let cos = w.dot(hit.n).abs();
                    assert!(inward && far.t > 0.01 * cos, "{quadric:?} {hit:?} {ray:?} {far:?}");
                }
            }
        }
    }

    #[test]
    fn odd_rays_and_shapes_do_not_panic() {
        let nan = Ray { o: Vec3::NAN, d: Vec3::NAN, t_max: f32::INFINITY, time: 0.0 };
        let still = Ray { o: Vec3::ZERO, d: Vec3::ZERO, t_max: f32::INFINITY, time: 0.0 };
        for kind in kinds() {
            let quadric = placed(kind, Affine3A::IDENTITY);
            assert_eq!(quadric.intersect(&nan), None);
            assert_eq!(quadric.intersect(&still), None);
            let flat = placed(kind, Affine3A::from_scale(Vec3::new(1.0, 0.0, 1.0)));
            let _ = flat.intersect(&Ray { d: Vec3::X, ..still });
            let _ = flat.surface_hit([0.5, 0.5]);
            for uv in [[0.0, 0.0], [1.0, 1.0]] {
                let hit = quadric.surface_hit(uv);
                assert!(hit.dpdu.cross(hit.dpdv).length_squared() > 0.0);
            }
        }
    }
}
