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
    /// The empty box.
    pub const EMPTY: Bounds3 = Bounds3 { min: Vec3::splat(f32::INFINITY), max: Vec3::splat(f32::NEG_INFINITY) };

    /// The smallest box of the points.
    pub fn from_points(points: impl IntoIterator<Item = Vec3>) -> Self {
        points.into_iter().fold(Bounds3::EMPTY, |b, p| b.union_point(p))
    }

    /// The smallest box that contains `self` and `p`.
    #[inline]
    #[must_use]
    pub fn union_point(self, p: Vec3) -> Self {
        Bounds3 { min: self.min.min(p), max: self.max.max(p) }
    }

    /// The smallest box that contains both.
    #[inline]
    #[must_use]
    pub fn union(self, other: Bounds3) -> Self {
        Bounds3 { min: self.min.min(other.min), max: self.max.max(other.max) }
    }

    /// True if it contains no point.
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

    /// Half the surface area, as used by the surface-area heuristic.
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

    /// A sphere about the box; its radius is 0 if the box is empty.
    pub fn bounding_sphere(&self) -> Sphere {
        if self.is_empty() {
            return Sphere { center: Vec3::ZERO, radius: 0.0 };
        }
        let center = self.center();
        Sphere { center, radius: (self.max - center).length() }
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

/// A sphere.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sphere {
    /// Centre.
    pub center: Vec3,
    /// Radius (m).
    pub radius: f32,
}

#[cfg(test)]
mod tests {
    use super::*;

    const BOX: Bounds3 = Bounds3 { min: Vec3::new(-1.0, 2.0, 3.0), max: Vec3::new(1.0, 5.0, 10.0) };

    #[test]
    fn a_box_has_its_centre_edges_area_and_sphere() {
        assert_eq!(Bounds3::from_points([BOX.max, BOX.min, Vec3::new(0.0, 3.0, 4.0)]), BOX);
        assert_eq!((BOX.center(), BOX.diagonal()), (Vec3::new(0.0, 3.5, 6.5), Vec3::new(2.0, 3.0, 7.0)));
        assert_eq!(BOX.half_area(), 2.0 * 3.0 + 3.0 * 7.0 + 7.0 * 2.0);
        assert_eq!(BOX.bounding_sphere(), Sphere { center: BOX.center(), radius: 0.5 * 62.0_f32.sqrt() });
        assert_eq!(Bounds3::default(), Bounds3::EMPTY);
        assert!(Bounds3::EMPTY.is_empty() && !BOX.is_empty());
        assert_eq!((Bounds3::EMPTY.half_area(), Bounds3::EMPTY.bounding_sphere().radius), (0.0, 0.0));
        let point = Bounds3::from_points([Vec3::X]);
        assert!(!point.is_empty() && point.half_area() == 0.0);
    }

    #[test]
    fn a_box_contains_its_boundary_and_nothing_outside() {
        assert!(BOX.contains(BOX.min) && BOX.contains(BOX.max) && BOX.contains(BOX.center()));
        for axis in [Vec3::X, Vec3::Y, Vec3::Z] {
            assert!(!BOX.contains(BOX.max + axis) && !BOX.contains(BOX.min - axis));
            let wider = BOX.union_point(BOX.max + axis);
            assert_eq!((wider.min, wider.max), (BOX.min, BOX.max + axis));
            assert_eq!(BOX.union(Bounds3::from_points([BOX.min - axis])).min, BOX.min - axis);
        }
        assert_eq!(BOX.union(Bounds3::EMPTY), BOX);
    }

    #[test]
    fn corners_are_numbered_by_bits_and_transformed_together() {
        let corners: Vec<Vec3> = (0..8).map(|i| BOX.corner(i)).collect();
        assert_eq!((corners[0], corners[7]), (BOX.min, BOX.max));
        assert_eq!(corners[1], Vec3::new(1.0, 2.0, 3.0));
        assert_eq!(corners[2], Vec3::new(-1.0, 5.0, 3.0));
        assert_eq!(corners[4], Vec3::new(-1.0, 2.0, 10.0));
        let turned = BOX.transformed(&Affine3A::from_mat3(glam::Mat3::from_cols(Vec3::Y, -Vec3::X, Vec3::Z)));
        assert_eq!((turned.min, turned.max), (Vec3::new(-5.0, -1.0, 3.0), Vec3::new(-2.0, 1.0, 10.0)));
        assert!(Bounds3::EMPTY.transformed(&Affine3A::IDENTITY).is_empty());
    }
}
