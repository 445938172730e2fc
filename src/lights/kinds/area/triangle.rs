//! Triangles, sampled uniformly in area.

use super::shape_sample::{ShapePoint, ShapeSample, pdf_by_area};
use lumiris_numbers::math::warp::sample_uniform_triangle;
use lumiris_numbers::math::{Bounds3, Rgb, Vec2, Vec3, gamma};

/// A triangle that emits.
#[derive(Clone, Debug)]
pub struct TriangleLight {
    /// Corners.
    pub p: [Vec3; 3],
    /// Unit normal of the emitting side; zero if the triangle has no area.
    pub n: Vec3,
    /// Area.
    pub area: f32,
    /// Texture coordinates of the corners.
    pub uvs: [Vec2; 3],
    /// Factors of the radiance at the corners; `None` for 1.
    pub colors: Option<Box<[Rgb; 3]>>,
}

impl TriangleLight {
    /// A triangle whose corners are counter-clockwise as seen from its emitting side, or clockwise if `flip_normal`.
    pub fn new(p: [Vec3; 3], flip_normal: bool, uvs: [Vec2; 3]) -> Self {
        let [a, b, c] = p.map(|p| p.as_dvec3());
        let cross = (b - a).cross(c - a);
        let n = cross.normalize_or_zero().as_vec3();
        let area = (0.5 * cross.length()) as f32;
        TriangleLight { p, n: if flip_normal { -n } else { n }, area, uvs, colors: None }
    }

    #[inline]
    pub(super) fn sample(&self, from: Vec3, u: [f32; 2]) -> Option<ShapeSample> {
        ShapeSample::by_area(from, self.sample_point(u))
    }

    #[inline]
    pub(super) fn sample_point(&self, u: [f32; 2]) -> ShapePoint {
        let [b0, b1] = sample_uniform_triangle(u);
        let parts = [self.p[0] * b0, self.p[1] * b1, self.p[2] * (1.0 - b0 - b1)];
        let p_error = (parts[0].abs() + parts[1].abs() + parts[2].abs()) * gamma(6);
        ShapePoint { p: parts[0] + parts[1] + parts[2], n: self.n, p_error, pdf_area: 1.0 / self.area }
    }

    #[inline]
    pub(super) fn pdf(&self, from: Vec3, p: Vec3) -> f32 {
        pdf_by_area(from, p, self.n, 1.0 / self.area)
    }

    pub(super) fn bounds(&self) -> Bounds3 {
        Bounds3::from_points(self.p)
    }

    pub(super) fn uv(&self, p: Vec3) -> Vec2 {
        let [b0, b1, b2] = self.barycentric(p);
        self.uvs[0] * b0 + self.uvs[1] * b1 + self.uvs[2] * b2
    }

    /// The factor of the radiance at the point `p`.
    #[inline]
    pub(super) fn color(&self, p: Vec3) -> Rgb {
        let Some(colors) = &self.colors else { return Rgb::WHITE };
        // Rounding may give weights outside [0, 1]
        let [b0, b1, b2] = self.barycentric(p).map(|b| b.clamp(0.0, 1.0));
        colors[0] * b0 + colors[1] * b1 + colors[2] * b2
    }

    /// The mean of the factor of the radiance.
    pub(super) fn mean_color(&self) -> Rgb {
        self.colors.as_ref().map_or(Rgb::WHITE, |colors| colors.iter().copied().sum::<Rgb>() / 3.0)
    }

    /// Weights of the corners at the point `p`.
    fn barycentric(&self, p: Vec3) -> [f32; 3] {
        // Least squares for p − p0 = b1·e1 + b2·e2.
        let (e1, e2, d) = (self.p[1] - self.p[0], self.p[2] - self.p[0], p - self.p[0]);
        let (a, b, c) = (e1.dot(e1), e1.dot(e2), e2.dot(e2));
        let determinant = a * c - b * b;
        let (x, y) = (d.dot(e1), d.dot(e2));
        let (b1, b2) = ((c * x - b * y) / determinant, (a * y - b * x) / determinant);
        [1.0 - b1 - b2, b1, b2]
    }
}
