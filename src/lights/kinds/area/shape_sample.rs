//! Sampled points of shapes.

use lumiris_numbers::math::Vec3;

/// A point sampled on a shape.
#[derive(Clone, Copy, Debug)]
pub(in crate::lights) struct ShapePoint {
    pub(in crate::lights) p: Vec3,
    pub(in crate::lights) n: Vec3,
    pub(in crate::lights) p_error: Vec3,
    /// Density (1/m²).
    pub(in crate::lights) pdf_area: f32,
}

/// A point sampled on a shape, and the direction to it.
#[derive(Clone, Copy, Debug)]
pub(super) struct ShapeSample {
    pub(super) p: Vec3,
    pub(super) n: Vec3,
    pub(super) p_error: Vec3,
    pub(super) wi: Vec3,
    pub(super) t: f32,
    pub(super) pdf: f32,
}

impl ShapeSample {
    /// From a density per area at the point: pdf = pdf_area·t²/|cos θ|.
    #[inline]
    pub(super) fn by_area(from: Vec3, point: ShapePoint) -> Option<Self> {
        let ShapePoint { p, n, p_error, pdf_area } = point;
        let d = p - from;
        let t2 = d.length_squared();
        let t = t2.sqrt();
        let wi = d / t;
        let pdf = pdf_area * t2 / n.dot(wi).abs();
        (pdf > 0.0 && pdf.is_finite()).then_some(ShapeSample { p, n, p_error, wi, t, pdf })
    }
}

/// Converts a density per area at `p` to a density per steradian at `from`; 0 if it is not defined.
#[inline]
pub(super) fn pdf_by_area(from: Vec3, p: Vec3, n: Vec3, pdf_area: f32) -> f32 {
    let d = p - from;
    let t2 = d.length_squared();
    let pdf = pdf_area * t2 * t2.sqrt() / n.dot(d).abs();
    if pdf.is_finite() { pdf } else { 0.0 }
}
