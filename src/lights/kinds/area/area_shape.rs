//! The surface of an area light, of any shape.

use super::patch::PatchLight;
use super::quadric::QuadricLight;
use super::rectangle::RectangleLight;
use super::triangle::TriangleLight;

/// The surface of an area light.
#[derive(Clone, Debug)]
pub enum AreaShape {
    /// One triangle.
    Triangle(TriangleLight),
    /// A rectangle: two triangles, or a bilinear patch.
    Rectangle(RectangleLight),
    /// Sphere, disk or cylinder.
    Quadric(Box<QuadricLight>),
    /// A bilinear patch.
    Patch(Box<PatchLight>),
}
