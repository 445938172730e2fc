//! Rectangles, sampled uniformly in the solid angle that they subtend [Ureña, Fajardo and King 2013].
//!
//! In the frame of the rectangle's edges with the point at the origin, the rectangle is [x0, x1] × [y0, y1] × {z0},
//! z0 < 0. The planes through the origin and the edges have the inner angles g0 … g3; the solid angle is
//! S = g0 + g1 + g2 + g3 − 2π. For a first number u, the part of the spherical rectangle left of x(u) has the area
//! u·S; for a second number v, the height is uniform on that arc.
//!
//! Points farther than diagonal/[`MAX_EXTENT`] from the centre sample uniformly in area instead. The density per
//! steradian is then proportional to t³/|z0|, varies by less than a factor of two to either side, and costs a tenth of
//! the time. Points within [`MIN_HEIGHT`] diagonals of the plane do the same. `sample` and `pdf` decide by the same
//! function, so they always agree.

use super::shape_sample::{ShapePoint, ShapeSample, pdf_by_area};
use glam::DVec2;
use lumiris_lanes::area::many::MAX_EXTENT;
use lumiris_lanes::area::spherical::{MIN_HEIGHT, MIN_SOLID_ANGLE};
use lumiris_numbers::math::{Bounds3, Vec2, Vec3, gamma};
use std::f64::consts::TAU;

/// A rectangle that emits.
#[derive(Clone, Debug)]
pub struct RectangleLight {
    /// A corner.
    pub corner: Vec3,
    /// Unit vector along an edge from the corner.
    pub ex: Vec3,
    /// Unit vector along the other edge.
    pub ey: Vec3,
    /// Lengths of the two edges.
    pub size: Vec2,
    /// Unit normal of the emitting side.
    pub n: Vec3,
    /// Distance of the fourth corner from its position in an exact rectangle; at most 1e-4 of an edge.
    pub flatness_error: f32,
    /// Texture coordinates at the corner and at the far ends of the two edges.
    pub uvs: [Vec2; 3],
}

/// A rectangle relative to a point: [x0, x1] × [y0, y1] × {z0} in the frame of its edges, z0 < 0.
struct SphericalRectangle {
    /// Extent along the first edge.
    x: [f64; 2],
    /// Extent along the second edge.
    y: [f64; 2],
    /// Minus the distance of the plane.
    z0: f64,
    /// Solid angle.
    solid_angle: f64,
    /// e^{i(g2 + g3)} of the inner angles; x is the real part.
    g23: DVec2,
}

/// The argument of a product of complex numbers, in [0, 2π); a negative zero of rounding is 0.
#[inline]
fn angle(z: DVec2) -> f64 {
    let a = z.y.atan2(z.x);
    if a < -1e-6 { a + TAU } else { a.max(0.0) }
}

#[inline]
fn complex_product(a: DVec2, b: DVec2) -> DVec2 {
    DVec2::new(a.x * b.x - a.y * b.y, a.x * b.y + a.y * b.x)
}

/// e^{i·g} up to a positive factor, as two pairwise products: for the inner angles at (x1, y0) and (x1, y1), and for
/// the inner angles at (x0, y1) and (x0, y0).
#[inline]
fn inner_angles(x: [f64; 2], y: [f64; 2], z0: f64) -> [DVec2; 2] {
    let (xx, yy, zz) = ([x[0] * x[0], x[1] * x[1]], [y[0] * y[0], y[1] * y[1]], z0 * z0);
    let corner = |i: usize, j: usize, sign: f64| DVec2::new(sign * x[i] * y[j], -z0 * (xx[i] + yy[j] + zz).sqrt());
    [complex_product(corner(1, 0, 1.0), corner(1, 1, -1.0)), complex_product(corner(0, 1, 1.0), corner(0, 0, -1.0))]
}

/// The spherical rectangle subtended at `from`; `None` if points are sampled uniformly in area instead.
fn spherical_rectangle(rectangle: &RectangleLight, from: Vec3) -> Option<SphericalRectangle> {
    let center = rectangle.corner + rectangle.ex * (0.5 * rectangle.size.x) + rectangle.ey * (0.5 * rectangle.size.y);
    let is_far = rectangle.size.length_squared() < MAX_EXTENT * MAX_EXTENT * (center - from).length_squared();
    if is_far { None } else { accurate_rectangle(rectangle, from) }
}

/// The spherical rectangle; `None` if its angles are inaccurate.
fn accurate_rectangle(rectangle: &RectangleLight, from: Vec3) -> Option<SphericalRectangle> {
    let d = rectangle.corner.as_dvec3() - from.as_dvec3();
    let (ex, ey) = (rectangle.ex.as_dvec3(), rectangle.ey.as_dvec3());
    let (width, height) = (f64::from(rectangle.size.x), f64::from(rectangle.size.y));
    let (x0, y0, z0) = (d.dot(ex), d.dot(ey), -d.dot(ex.cross(ey)).abs());
    let (x, y) = ([x0, x0 + width], [y0, y0 + height]);
    if z0 * z0 <= MIN_HEIGHT * MIN_HEIGHT * (width * width + height * height) {
        return None;
    }
    let [g01, g23] = inner_angles(x, y, z0);
    let solid_angle = angle(complex_product(g01, g23));
    (solid_angle >= MIN_SOLID_ANGLE).then_some(SphericalRectangle { x, y, z0, solid_angle, g23 })
}

/// The point (x, y) of the rectangle for two uniform random numbers.
fn sample_spherical(spherical: &SphericalRectangle, u: [f32; 2]) -> [f64; 2] {
    let SphericalRectangle { x, y, z0, solid_angle, g23 } = *spherical;
    // Ureña's b0 and b1: z of the normals of the planes through the edges y0 and y1.
    let b0 = -y[0] / (y[0] * y[0] + z0 * z0).sqrt();
    let b1 = y[1] / (y[1] * y[1] + z0 * z0).sqrt();
    // cos and sin of u·S − (g2 + g3).
    let (sin_us, cos_us) = (f64::from(u[0]) * solid_angle).sin_cos();
    let scale = 1.0 / (g23.x * g23.x + g23.y * g23.y).sqrt();
    let DVec2 { x: cos, y: sin } =
        complex_product(DVec2::new(cos_us, sin_us), DVec2::new(g23.x * scale, -g23.y * scale));
    let fu = (cos * b0 - b1) / sin;
    let cu = (1.0 / (fu * fu + b0 * b0).sqrt()).copysign(fu).clamp(-1.0, 1.0);
    let xu = (-(cu * z0) / (1.0 - cu * cu).max(1e-300).sqrt()).clamp(x[0], x[1]);

    let d2 = xu * xu + z0 * z0;
    let h = y.map(|y| y / (d2 + y * y).sqrt());
    let hv = h[0] + f64::from(u[1]) * (h[1] - h[0]);
    let yv = (hv * (d2 / (1.0 - hv * hv).max(1e-300)).sqrt()).clamp(y[0], y[1]);
    [xu, yv]
}

/// A point, and the bound of its rounding error per axis.
struct PointWithError {
    p: Vec3,
    p_error: Vec3,
}

impl RectangleLight {
    /// Area.
    #[inline]
    pub fn area(&self) -> f32 {
        self.size.x * self.size.y
    }

    /// The solid angle subtended at `from`; `None` if it is too small to be accurate.
    pub fn solid_angle(&self, from: Vec3) -> Option<f32> {
        accurate_rectangle(self, from).map(|s| s.solid_angle as f32)
    }

    #[inline]
    pub(super) fn sample(&self, from: Vec3, u: [f32; 2]) -> Option<ShapeSample> {
        let Some(spherical) = spherical_rectangle(self, from) else {
            return ShapeSample::by_area(from, self.sample_point(u));
        };
        let [x, y] = sample_spherical(&spherical, u);
        let PointWithError { p, p_error } = self.point((x - spherical.x[0]) as f32, (y - spherical.y[0]) as f32);
        let d = p - from;
        let t = d.length();
        (t > 0.0).then(|| {
            let pdf = (1.0 / spherical.solid_angle) as f32;
            ShapeSample { p, n: self.n, p_error, wi: d / t, t, pdf }
        })
    }

    #[inline]
    pub(super) fn sample_point(&self, u: [f32; 2]) -> ShapePoint {
        let PointWithError { p, p_error } = self.point(u[0] * self.size.x, u[1] * self.size.y);
        ShapePoint { p, n: self.n, p_error, pdf_area: 1.0 / self.area() }
    }

    #[inline]
    pub(super) fn pdf(&self, from: Vec3, p: Vec3) -> f32 {
        match spherical_rectangle(self, from) {
            Some(spherical) => (1.0 / spherical.solid_angle) as f32,
            None => pdf_by_area(from, p, self.n, 1.0 / self.area()),
        }
    }

    /// The point at `s` along one edge and `t` along the other.
    #[inline]
    fn point(&self, s: f32, t: f32) -> PointWithError {
        let (x, y) = (self.ex * s, self.ey * t);
        let p_error = (self.corner.abs() + x.abs() + y.abs()) * gamma(6) + Vec3::splat(self.flatness_error);
        PointWithError { p: self.corner + x + y, p_error }
    }

    pub(super) fn corners(&self) -> [Vec3; 4] {
        let (w, h) = (self.size.x, self.size.y);
        [(0.0, 0.0), (w, 0.0), (0.0, h), (w, h)].map(|(s, t)| self.point(s, t).p)
    }

    pub(super) fn bounds(&self) -> Bounds3 {
        Bounds3::from_points(self.corners())
    }

    pub(super) fn uv(&self, p: Vec3) -> Vec2 {
        let d = p - self.corner;
        let (s, t) = (d.dot(self.ex) / self.size.x, d.dot(self.ey) / self.size.y);
        self.uvs[0] + (self.uvs[1] - self.uvs[0]) * s + (self.uvs[2] - self.uvs[0]) * t
    }
}
