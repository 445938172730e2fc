//! Shared helpers of the tests of shapes and ray tracers.

use lumiris_numbers::math::{Ray, Vec3};
use lumiris_test_support::random::{Pcg32, RngExt};

/// A point in [−1, 1]³.
pub(crate) fn random_point(s: &mut Pcg32) -> Vec3 {
    Vec3::new(s.random::<f32>(), s.random::<f32>(), s.random::<f32>()) * 2.0 - 1.0
}

/// Möller–Trumbore in f64: t and the weights of vertices 1 and 2.
pub(crate) fn triangle_hit(ray: &Ray, [p0, p1, p2]: [Vec3; 3]) -> Option<[f64; 3]> {
    let [p0, p1, p2] = [p0, p1, p2].map(Vec3::as_dvec3);
    let (o, d) = (ray.o.as_dvec3(), ray.d.as_dvec3());
    let (e1, e2) = (p1 - p0, p2 - p0);
    let q = d.cross(e2);
    let det = e1.dot(q);
    let s = o - p0;
    let (b1, b2, t) = (s.dot(q) / det, d.dot(s.cross(e1)) / det, e2.dot(s.cross(e1)) / det);
    (b1 >= 0.0 && b2 >= 0.0 && b1 + b2 <= 1.0 && t > 0.0 && t < f64::from(ray.t_max)).then_some([t, b1, b2])
}
