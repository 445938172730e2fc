//! Bilinear patches, sampled uniformly in (u, v).
//!
//! p(u, v) = a + u·b + v·c + uv·d. The density per area is 1/|∂p/∂u × ∂p/∂v|. The normal before normalisation is
//! bilinear in (u, v) too, so every cone narrower than a half-space that contains the four corner normals contains all
//! normals.

use super::shape_sample::{ShapePoint, ShapeSample, pdf_by_area};
use glam::DVec3;
use lumiris_numbers::math::{Bounds3, Vec2, Vec3, gamma};

/// A bilinear patch that emits.
#[derive(Clone, Debug)]
pub struct PatchLight {
    /// Corners p00, p10, p01, p11.
    pub corners: [Vec3; 4],
    /// True if the emitting side is the reverse of ∂p/∂u × ∂p/∂v.
    pub flip_normal: bool,
    /// Texture coordinates of the corners.
    pub uvs: [Vec2; 4],
    /// Area.
    pub area: f32,
    /// Axis of a cone about all normals.
    pub cone_axis: Vec3,
    /// Cosine of its half-angle.
    pub cos_cone: f32,
}

fn bilinear_vec2(c: &[Vec2; 4], u: f32, v: f32) -> Vec2 {
    c[0].lerp(c[1], u).lerp(c[2].lerp(c[3], u), v)
}

impl PatchLight {
    /// A patch in world space.
    pub fn new(corners: [Vec3; 4], flip_normal: bool, uvs: [Vec2; 4]) -> Self {
        let mut patch = PatchLight { corners, flip_normal, uvs, area: 0.0, cone_axis: Vec3::Z, cos_cone: -1.0 };
        const CELLS: u32 = 32;
        let sum: f64 = (0..CELLS * CELLS)
            .map(|i| [(i % CELLS) as f32 + 0.5, (i / CELLS) as f32 + 0.5].map(|x| x / CELLS as f32))
            .map(|[u, v]| f64::from(patch.scaled_normal(u, v).length()))
            .sum();
        patch.area = (sum / f64::from(CELLS * CELLS)) as f32;

        let normals = [(0.0, 0.0), (1.0, 0.0), (0.0, 1.0), (1.0, 1.0)]
            .map(|(u, v)| patch.scaled_normal(u, v).normalize_or_zero());
        let axis = normals.iter().copied().sum::<Vec3>().normalize_or_zero();
        let cos = normals.iter().map(|n| n.dot(axis)).fold(1.0, f32::min) - 1e-5;
        if axis != Vec3::ZERO && cos > 1e-3 {
            (patch.cone_axis, patch.cos_cone) = (axis, cos);
        }
        patch
    }

    #[inline]
    fn point(&self, u: f32, v: f32) -> Vec3 {
        let c = &self.corners;
        c[0].lerp(c[1], u).lerp(c[2].lerp(c[3], u), v)
    }

    /// ±∂p/∂u × ∂p/∂v, on the emitting side.
    #[inline]
    fn scaled_normal(&self, u: f32, v: f32) -> Vec3 {
        let c = &self.corners;
        let dpdu = (c[1] - c[0]).lerp(c[3] - c[2], v);
        let dpdv = (c[2] - c[0]).lerp(c[3] - c[1], u);
        let n = dpdu.cross(dpdv);
        if self.flip_normal { -n } else { n }
    }

    /// The unit normal of the plane that is parallel to both diagonals, on the emitting side; zero if there is none.
    pub(super) fn mean_normal(&self) -> Vec3 {
        let [p00, p10, p01, p11] = self.corners.map(|p| p.as_dvec3());
        let n = (p11 - p00).cross(p01 - p10).normalize_or_zero().as_vec3();
        if self.flip_normal { -n } else { n }
    }

    pub(super) fn sample(&self, from: Vec3, u: [f32; 2]) -> Option<ShapeSample> {
        ShapeSample::by_area(from, self.sample_point(u))
    }

    pub(super) fn sample_point(&self, [u, v]: [f32; 2]) -> ShapePoint {
        let n = self.scaled_normal(u, v);
        let jacobian = n.length();
        let magnitude = self.corners.iter().fold(Vec3::ZERO, |m, c| m.max(c.abs()));
        ShapePoint { p: self.point(u, v), n: n / jacobian, p_error: magnitude * gamma(8), pdf_area: 1.0 / jacobian }
    }

    pub(super) fn pdf(&self, from: Vec3, p: Vec3) -> f32 {
        let uv = self.invert(p);
        let n = self.scaled_normal(uv.x, uv.y);
        let jacobian = n.length();
        pdf_by_area(from, p, n / jacobian, 1.0 / jacobian)
    }

    pub(super) fn bounds(&self) -> Bounds3 {
        Bounds3::from_points(self.corners)
    }

    pub(super) fn uv(&self, p: Vec3) -> Vec2 {
        let uv = self.invert(p);
        bilinear_vec2(&self.uvs, uv.x, uv.y)
    }

    /// The (u, v) of a point of the patch. With h = p − a, the component of (h − v·c) × (b + v·d) = 0 along the mean
    /// normal is a quadratic equation in v. The root whose point is nearest to p is taken.
    pub fn invert(&self, p: Vec3) -> Vec2 {
        let [p00, p10, p01, p11] = self.corners.map(|c| c.as_dvec3());
        let (b, c, d) = (p10 - p00, p01 - p00, p11 - p10 - p01 + p00);
        let h = p.as_dvec3() - p00;
        let axis = (p11 - p00).cross(p01 - p10);
        let along = |x: DVec3, y: DVec3| x.cross(y).dot(axis);
        // Coefficients of v², v and 1.
        let (k2, k1, k0) = (-along(c, d), along(h, d) - along(c, b), along(h, b));

        let u_of = |v: f64| {
            let e = b + d * v;
            ((h - c * v).dot(e) / e.length_squared()).clamp(0.0, 1.0)
        };
        let mut best = (f64::INFINITY, Vec2::splat(0.5));
        for v in quadratic_roots(k2, k1, k0) {
            let v = if v.is_finite() { v.clamp(0.0, 1.0) } else { continue };
            let u = u_of(v);
            if !u.is_finite() {
                continue;
            }
            let residual = (b * u + c * v + d * (u * v) - h).length_squared();
            if residual < best.0 {
                best = (residual, Vec2::new(u as f32, v as f32));
            }
        }
        best.1
    }
}

/// Both real roots of a·x² + b·x + c; the real part if they are complex. NaN or infinite if there are fewer roots.
fn quadratic_roots(a: f64, b: f64, c: f64) -> [f64; 2] {
    let root = (b * b - 4.0 * a * c).max(0.0).sqrt();
    let q = -0.5 * (b + root.copysign(b));
    [q / a, c / q]
}

#[cfg(test)]
mod tests {
    use super::*;
    use lumiris_test_support::random::{RngExt, pcg32};

    #[test]
    fn points_invert_to_their_parameters() {
        let v = Vec3::new;
        let patches = [
            [v(0.0, 0.0, 0.0), v(1.0, 0.1, 0.0), v(0.2, 2.0, 0.3), v(1.5, 1.2, -0.4)],
            [v(0.0, 0.0, 0.0), v(1.0, 0.0, 0.0), v(0.0, 1.0, 0.0), v(1.0, 1.0, 1.0)],
            [v(5.0, 0.0, 0.0), v(6.0, 0.0, 0.0), v(5.3, 1.0, 0.0), v(6.3, 1.0, 0.0)],
            [v(0.0, 0.0, 0.0), v(1.0, 0.0, 0.0), v(0.3, 1.0, 0.0), v(0.6, 1.0, 0.0)],
        ];
        let mut stream = pcg32([8, 8, 8]);
        for corners in patches {
            let patch = PatchLight::new(corners, false, [Vec2::ZERO; 4]);
            for _ in 0..1000 {
                let [a, b] = stream.random::<[f32; 2]>();
                let uv = patch.invert(patch.point(a, b));
                assert!((uv - Vec2::new(a, b)).length() < 1e-4, "{corners:?} {a} {b} {uv}");
            }
        }
    }
}
