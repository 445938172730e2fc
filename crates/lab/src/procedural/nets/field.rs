//! Functions of space.

use lumiris_numbers::math::Vec3;

/// A sphere in which a field is queried.
#[derive(Clone, Copy, Debug)]
pub struct Ball {
    /// Centre.
    pub center: Vec3,
    /// Radius.
    pub radius: f32,
}

/// A function of space that is negative inside a solid.
pub trait Field: Sync {
    /// The part of the field that affects a ball.
    type Near;
    /// Restricts the field to a ball within the ball of `wider`.
    fn near(&self, wider: Option<&Self::Near>, ball: Ball) -> Self::Near;
    /// True or false if all of the ball is certainly inside or outside.
    fn is_inside(&self, near: &Self::Near) -> Option<bool>;
    /// The value at a point of the ball of `near`; a function of the point alone.
    fn value(&self, near: &Self::Near, p: Vec3) -> f32;
}
