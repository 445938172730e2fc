//! The watertight ray–triangle test, one triangle at a time.
//!
//! The triangle is translated to the ray's origin and sheared so that the ray runs along +z; then three 2D edge
//! functions decide [Woop et al. 2013]. The edge function of a shared edge is the same rounded expression for both
//! triangles, up to its sign. Rounding is monotonic, so a computed sign is correct or the value is 0; zeros are
//! evaluated again in f64, where the products are exact. Edges and vertices count as inside, so a closed mesh does not
//! leak.

use glam::DVec3;
use lumiris_numbers::math::{Ray, Vec3, gamma};

/// A ray with its shear. Axis `kz` is the largest of the direction; `kx`, `ky` follow cyclically.
#[derive(Clone, Copy, Debug)]
pub struct RayPrecomputed {
    /// The ray.
    pub ray: Ray,
    /// Axes in the order x, y, z of the sheared space.
    pub axes: [usize; 3],
    /// `d[kx]/d[kz]`, `d[ky]/d[kz]`, `1/d[kz]`.
    pub shear: [f32; 3],
}

impl RayPrecomputed {
    /// Prepares a ray; `None` if its direction is zero or it is not finite (`t_max` may be infinite).
    #[inline]
    pub fn new(ray: &Ray) -> Option<Self> {
        let d = ray.d.abs();
        let z = if d.x > d.y && d.x > d.z {
            0
        } else if d.y > d.z {
            1
        } else {
            2
        };
        let axes = [[1, 2, 0], [2, 0, 1], [0, 1, 2]][z];
        let dz = ray.d[axes[2]];
        let shear = [ray.d[axes[0]] / dz, ray.d[axes[1]] / dz, 1.0 / dz];
        let usable = ray.o.is_finite() && ray.d.is_finite() && shear[2].is_finite() && !ray.t_max.is_nan();
        usable.then_some(RayPrecomputed { ray: *ray, axes, shear })
    }
}

/// Hit of one triangle: t and the barycentric weights of vertices 1 and 2.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TriangleHit {
    /// Ray parameter.
    pub t: f32,
    /// Weight of vertex 1.
    pub b1: f32,
    /// Weight of vertex 2.
    pub b2: f32,
}

/// The hit with 0 < t ≤ `t_limit`, if any; both sides are hit.
///
/// The sign of t is decided in f64 if f32 is not accurate enough, so a ray from
/// [`lumiris_numbers::math::ray::offset_origin`] does not hit the triangle of its origin.
#[inline]
pub fn intersect_triangle(ray: &RayPrecomputed, triangle: [Vec3; 3], t_limit: f32) -> Option<TriangleHit> {
    let [kx, ky, kz] = ray.axes;
    let corners = triangle.map(|p| p - ray.ray.o);
    let [a, b, c] = corners.map(|p| Vec3::new(p[kx] - ray.shear[0] * p[kz], p[ky] - ray.shear[1] * p[kz], p[kz]));
    let (mut u, mut v, mut w) = (c.x * b.y - c.y * b.x, a.x * c.y - a.y * c.x, b.x * a.y - b.y * a.x);
    if u == 0.0 || v == 0.0 || w == 0.0 {
        // The exact signs; only zeros may be wrong.
        let edge = |p: Vec3, q: Vec3| f64::from(p.x) * f64::from(q.y) - f64::from(p.y) * f64::from(q.x);
        let (ue, ve, we) = (edge(c, b), edge(a, c), edge(b, a));
        let inside = (ue >= 0.0 && ve >= 0.0 && we >= 0.0) || (ue <= 0.0 && ve <= 0.0 && we <= 0.0);
        let det = ue + ve + we;
        if !inside || det == 0.0 {
            return None;
        }
        (u, v, w) = ((ue / det) as f32, (ve / det) as f32, (we / det) as f32);
    }
    let inside = (u >= 0.0 && v >= 0.0 && w >= 0.0) || (u <= 0.0 && v <= 0.0 && w <= 0.0);
    let det = u + v + w;
    if !inside || det == 0.0 {
        return None;
    }

    // The parameter of the plane, in f64 if the f32 sign is uncertain.
    let inv_det = 1.0 / det;
    let mut t = (u * a.z + v * b.z + w * c.z) * ray.shear[2] * inv_det;
    if t <= parameter_error([a, b, c], ray.shear[2], inv_det) {
        t = plane_parameter(&ray.ray, triangle)?;
    }
    (t > 0.0 && t <= t_limit).then_some(TriangleHit { t, b1: v * inv_det, b2: w * inv_det })
}

/// Bound of the rounding error of the f32 parameter [Pharr et al. 2023, §6.8.7].
#[inline]
fn parameter_error([a, b, c]: [Vec3; 3], inv_dz: f32, inv_det: f32) -> f32 {
    let max = a.abs().max(b.abs()).max(c.abs());
    let (x, y, z) = (max.x, max.y, max.z);
    let (delta_x, delta_y, delta_z) = (gamma(5) * (x + z), gamma(5) * (y + z), gamma(3) * z);
    let delta_e = 2.0 * (gamma(2) * x * y + delta_y * x + delta_x * y);
    let e = 2.0 * x * y;
    3.0 * (gamma(3) * e * z + delta_e * z + delta_z * e) * (inv_det * inv_dz).abs()
}

/// The parameter of the triangle's plane from the original vertices in f64; `None` unless positive.
#[cold]
fn plane_parameter(ray: &Ray, [p0, p1, p2]: [Vec3; 3]) -> Option<f32> {
    let [p0, p1, p2]: [DVec3; 3] = [p0, p1, p2].map(Vec3::as_dvec3);
    let n = (p1 - p0).cross(p2 - p0);
    let t = n.dot(p0 - ray.o.as_dvec3()) / n.dot(ray.d.as_dvec3());
    (t > 0.0).then_some(t as f32)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::reference_for_tests::{random_point, triangle_hit};
    use lumiris_test_support::random::{RngExt, pcg32};

    #[test]
    fn hits_agree_with_f64() {
        let mut s = pcg32([5, 0, 0]);
        let mut found = 0;
        for _ in 0..100_000 {
            let triangle = [random_point(&mut s), random_point(&mut s), random_point(&mut s)];
            let o = random_point(&mut s) * 2.0;
            let d = (random_point(&mut s) * 0.5 - o) * (0.1 + s.random::<f32>());
            let ray = Ray { o, d, t_max: f32::INFINITY, time: 0.0 };
            let hit = RayPrecomputed::new(&ray).and_then(|r| intersect_triangle(&r, triangle, ray.t_max));
            match (hit, triangle_hit(&ray, triangle)) {
                (Some(hit), Some([t, b1, b2])) => {
                    found += 1;
                    // Compare points, not parameters: grazing rays have ill-conditioned weights.
                    let p = triangle[0] * (1.0 - hit.b1 - hit.b2) + triangle[1] * hit.b1 + triangle[2] * hit.b2;
                    let q = ray.o.as_dvec3() + t * ray.d.as_dvec3();
                    let n = (triangle[1] - triangle[0]).cross(triangle[2] - triangle[0]).normalize();
                    let cos = n.dot(ray.d.normalize()).abs();
                    assert!((p.as_dvec3() - q).length() * f64::from(cos) < 1e-5, "{hit:?} {t} {b1} {b2}");
                    assert!((f64::from(hit.t) - t).abs() * f64::from(cos) < 1e-5 * (1.0 + t), "{hit:?} {t}");
                }
                (None, None) => {}
                (hit, Some([_, b1, b2])) => assert!(b1.min(b2).min(1.0 - b1 - b2) < 1e-4, "{hit:?}"),
                (Some(hit), None) => {
                    assert!(hit.b1.min(hit.b2).min(1.0 - hit.b1 - hit.b2) < 1e-4 || hit.t < 1e-5, "{hit:?}");
                }
            }
        }
        assert!(found > 3000, "{found}");
    }

    #[test]
    fn rays_through_shared_edges_and_vertices_hit_a_neighbour() {
        let mut s = pcg32([6, 0, 0]);
        for i in 0..100_000 {
            // A fan of triangles about a vertex; the ray aims at a point of an inner edge with f32 accuracy.
            let hub = random_point(&mut s);
            let rim: Vec<Vec3> = (0..6)
                .map(|k| {
                    let (sin, cos) = (k as f32 * std::f32::consts::TAU / 6.0).sin_cos();
                    hub + Vec3::new(cos, sin, 0.3 * s.random::<f32>())
                })
                .collect();
            let along = if i % 4 == 0 { 0.0 } else { s.random::<f32>() * 0.9 };
            let target = hub + (rim[i % 6] - hub) * along;
            let o = hub + Vec3::new(s.random::<f32>() - 0.5, s.random::<f32>() - 0.5, 3.0);
            let ray = Ray { o, d: target - o, t_max: f32::INFINITY, time: 0.0 };
            let pre = RayPrecomputed::new(&ray).unwrap();
            let hit =
                (0..6).any(|k| intersect_triangle(&pre, [hub, rim[k], rim[(k + 1) % 6]], f32::INFINITY).is_some());
            assert!(hit, "ray {i} leaks");
        }
    }

    #[test]
    fn degenerate_triangles_and_rays_give_no_hit() {
        let ray = Ray { o: Vec3::ZERO, d: Vec3::Z, t_max: f32::INFINITY, time: 0.0 };
        let pre = RayPrecomputed::new(&ray).unwrap();
        let p = Vec3::Z;
        assert_eq!(intersect_triangle(&pre, [p, p, p], f32::INFINITY), None);
        assert_eq!(intersect_triangle(&pre, [p - Vec3::X, p, p + Vec3::X], f32::INFINITY), None);
        assert_eq!(intersect_triangle(&pre, [Vec3::NAN, p, p + Vec3::X], f32::INFINITY), None);
        for d in [Vec3::ZERO, Vec3::NAN, Vec3::INFINITY] {
            assert!(RayPrecomputed::new(&Ray { d, ..ray }).is_none());
        }
    }
}
