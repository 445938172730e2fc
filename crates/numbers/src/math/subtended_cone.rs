//! The cone that a sphere subtends at a point, and points of the sphere that are seen from there; for single points and
//! for vectors of them.

use super::bounds::Sphere;
use super::elementary::{SinCos, sin_cos_turn};
use super::number::Number;
use super::scalar::gamma;
use super::v3::V3;
use std::f32::consts::TAU;

/// Relative distance from a sphere within which a point counts as on it.
pub const ON_SURFACE: f32 = 1e-5;

/// The cone that a sphere subtends at a point.
#[derive(Clone, Copy, Debug)]
pub struct SubtendedCone<N: Number> {
    /// 1 − cos θmax, which is accurate for small cones.
    one_minus_cos: N,
    /// sin² θmax.
    sin2: N,
    /// Unit direction to the centre.
    axis: V3<N>,
    /// True if the point is outside of the sphere. Otherwise there is no cone, and other members are undefined.
    pub is_outside: N::Mask,
}

/// A point of a sphere that is seen from another point.
#[derive(Clone, Copy, Debug)]
pub struct SpherePoint<N> {
    /// The point.
    pub p: V3<N>,
    /// Bound of its rounding error.
    pub p_error: V3<N>,
    /// Outward unit normal.
    pub outward: V3<N>,
    /// Unit direction to the point.
    pub wi: V3<N>,
    /// Its distance.
    pub t: N,
    /// Density per steradian; 0 if there is no sample.
    pub pdf: N,
}

impl<N: Number> SubtendedCone<N> {
    /// The cone of `sphere` at the point `from`.
    #[inline(always)]
    pub fn new(sphere: &Sphere, from: V3<N>) -> Self {
        let radius = from.x.constant(sphere.radius);
        let d = splat(sphere.center, radius).minus(from);
        let distance = d.dot(d).root();
        let inverse = distance.constant(1.0) / distance;
        let sin2 = (radius * inverse).squared();
        let cos = ((distance - radius) * (distance + radius)).safe_root() * inverse;
        SubtendedCone {
            one_minus_cos: sin2 / (cos + 1.0),
            sin2,
            axis: d.times(inverse),
            is_outside: distance.above(radius * (1.0 + ON_SURFACE)),
        }
    }

    /// Density of [`Self::sample`] per steradian.
    #[inline(always)]
    pub fn pdf(&self) -> N {
        self.sin2.constant(1.0) / (self.one_minus_cos * TAU)
    }

    /// Samples a direction uniform in the cone, and the point that it meets first [Pharr et al. 2023, §6.2.4]. `sphere`
    /// and `from` are as for [`Self::new`].
    #[inline(always)]
    pub fn sample(&self, sphere: &Sphere, from: V3<N>, u: [N; 2]) -> SpherePoint<N> {
        let (zero, one) = (from.x.constant(0.0), from.x.constant(1.0));
        let below_one = u[0] * self.one_minus_cos;
        let (sin2, cos) = (below_one * (-below_one + 2.0), one - below_one);
        let SinCos { sin: sin_phi, cos: cos_phi } = sin_cos_turn(u[1]);

        // The point is computed from the angle α at the centre, which stays accurate for small and distant spheres: cos
        // α = sin²θ/sin θmax + cos θ·sqrt(1 − sin²θ/sin²θmax).
        let cos_alpha = sin2 / self.sin2.root() + cos * (one - sin2 / self.sin2).safe_root();
        let sin_alpha = (one - cos_alpha.squared()).safe_root();
        let [x, y] = self.axis.tangents();
        let around = x.times(cos_phi * sin_alpha).plus(y.times(sin_phi * sin_alpha));
        let outward = around.minus(self.axis.times(cos_alpha)).unit();

        let (center, offset) = (splat(sphere.center, zero), outward.times(zero.constant(sphere.radius)));
        let p = center.plus(offset);
        let p_error = center.magnitude().plus(offset.magnitude()).times(zero.constant(gamma(8)));
        let d = p.minus(from);
        let t = d.dot(d).root();
        let pdf = self.pdf();
        let pdf = pdf.or_zero(pdf.finite() & t.above(zero));
        SpherePoint { p, p_error, outward, wi: d.times(one / t), t, pdf }
    }
}

#[inline(always)]
fn splat<N: Number>(v: glam::Vec3, like: N) -> V3<N> {
    V3 { x: like.constant(v.x), y: like.constant(v.y), z: like.constant(v.z) }
}
