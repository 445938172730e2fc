//! Axis-aligned boxes.

use glam::{Affine3A, Vec3};

/// Axis-aligned box; empty when `min > max` in any axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bounds3 {
    /// Lower corner.
    pub min: Vec3,
    /// Upper corner.
    pub max: Vec3,
}

impl Default for Bounds3 {
    fn default() -> Self {
        Bounds3::EMPTY
    }
}

impl Bounds3 {
    /// The box that contains nothing.
    pub const EMPTY: Bounds3 = Bounds3 { min: Vec3::splat(f32::INFINITY), max: Vec3::splat(f32::NEG_INFINITY) };

    /// The smallest box of the points.
    pub fn from_points(points: impl IntoIterator<Item = Vec3>) -> Self {
        points.into_iter().fold(Bounds3::EMPTY, |b, p| b.union_point(p))
    }

    /// The smallest box that holds `self` and `p`.
    #[inline]
    #[must_use]
    pub fn union_point(self, p: Vec3) -> Self {
        Bounds3 { min: self.min.min(p), max: self.max.max(p) }
    }

    /// The smallest box that holds both.
    #[inline]
    #[must_use]
    pub fn union(self, other: Bounds3) -> Self {
        Bounds3 { min: self.min.min(other.min), max: self.max.max(other.max) }
    }

    /// True if it holds no point.
    #[inline]
    pub fn is_empty(&self) -> bool {
        self.min.cmpgt(self.max).any()
    }

    /// The centre.
    #[inline]
    pub fn center(&self) -> Vec3 {
        (self.min + self.max) * 0.5
    }

    /// Edge lengths.
    #[inline]
    pub fn diagonal(&self) -> Vec3 {
        self.max - self.min
    }

    /// Half the surface area, the quantity that the surface-area heuristic compares.
    #[inline]
    pub fn half_area(&self) -> f32 {
        if self.is_empty() {
            return 0.0;
        }
        let d = self.diagonal();
        d.x * d.y + d.y * d.z + d.z * d.x
    }

    /// True if `p` is inside or on the boundary.
    #[inline]
    pub fn contains(&self, p: Vec3) -> bool {
        p.cmpge(self.min).all() && p.cmple(self.max).all()
    }

    /// Centre and radius of a sphere about the box; radius 0 if empty.
    pub fn bounding_sphere(&self) -> (Vec3, f32) {
        if self.is_empty() {
            return (Vec3::ZERO, 0.0);
        }
        let center = self.center();
        (center, (self.max - center).length())
    }

    /// The box of the eight transformed corners.
    #[must_use]
    pub fn transformed(&self, to_from: &Affine3A) -> Self {
        if self.is_empty() {
            return *self;
        }
        Bounds3::from_points((0..8).map(|i| to_from.transform_point3(self.corner(i))))
    }

    /// Corner `i` of 0..8; bit k chooses the upper end of axis k.
    #[inline]
    pub fn corner(&self, i: u32) -> Vec3 {
        let pick = |bit: u32, lo: f32, hi: f32| if i >> bit & 1 == 0 { lo } else { hi };
        Vec3::new(pick(0, self.min.x, self.max.x), pick(1, self.min.y, self.max.y), pick(2, self.min.z, self.max.z))
    }
}
