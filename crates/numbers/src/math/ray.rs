//! Rays and robust ray origins.

use super::gamma;
use glam::Vec3;

/// A ray `o + t·d`, `0 < t < t_max`.
#[derive(Clone, Copy, Debug)]
pub struct Ray {
    /// Origin.
    pub o: Vec3,
    /// Direction; need not be unit.
    pub d: Vec3,
    /// End of the open interval, in units of |d|.
    pub t_max: f32,
    /// Time in the shutter interval, 0..1.
    pub time: f32,
}

impl Ray {
    /// The point at parameter `t`.
    #[inline]
    pub fn at(&self, t: f32) -> Vec3 {
        self.o + self.d * t
    }
}

/// The part of a segment `o + t·(end − o)` that is tested for occlusion. Its end is already offset from its surface;
/// the margin covers the rounding of `o + t·d` at t = 1.
pub const SEGMENT_END: f32 = 1.0 - 8.0 * f32::EPSILON;

/// Bound of the distance between surfaces meant to coincide, relative to the maximum coordinate of a point there: each
/// is rounded separately by its transform, and rotations mix the axes.
pub const COINCIDENCE: f32 = gamma(8);

/// Offsets `p` from its surface along the geometric normal `n`, to the side of `w`. The offset is at least the bound
/// `p_error` of its rounding error, so that a ray from there cannot hit its own surface [Pharr et al. 2023, §6.8.6]. It
/// is also at least [`COINCIDENCE`], so that the ray cannot hit a coincident surface. `n` is unit, or zero without a
/// surface; `p_error` is per axis and non-negative.
#[inline]
pub fn offset_origin(p: Vec3, p_error: Vec3, n: Vec3, w: Vec3) -> Vec3 {
    let distance = n.abs().dot(p_error).max(p.abs().max_element() * COINCIDENCE);
    let offset = if w.dot(n) < 0.0 { -n * distance } else { n * distance };
    let moved = p + offset;
    // Round away from the surface, so that the addition cannot return to it.
    let round = |moved: f32, offset: f32| {
        if offset > 0.0 {
            moved.next_up()
        } else if offset < 0.0 {
            moved.next_down()
        } else {
            moved
        }
    };
    Vec3::new(round(moved.x, offset.x), round(moved.y, offset.y), round(moved.z, offset.z))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn offset_origin_leaves_the_plane_on_the_side_of_w() {
        let p = Vec3::new(1e4, 2.0, -3.0);
        let e = p.abs() * crate::math::gamma(7);
        let n = Vec3::new(1.0, 1.0, 0.5).normalize();
        assert!((offset_origin(p, e, n, n) - p).dot(n) > 0.0);
        assert!((offset_origin(p, e, n, -n) - p).dot(n) < 0.0);
    }

    #[test]
    fn a_point_of_a_ray_is_its_origin_and_so_many_directions() {
        let ray = Ray { o: Vec3::new(1.0, 2.0, 3.0), d: Vec3::new(0.0, 2.0, -1.0), t_max: 9.0, time: 0.0 };
        assert_eq!(ray.at(3.0), Vec3::new(1.0, 8.0, 0.0));
    }

    #[test]
    fn an_offset_is_the_projected_error_rounded_outward() {
        let (p, e) = (Vec3::new(1.0, -2.0, 4.0), Vec3::new(1e-3, 2e-3, 4e-3));
        for axis in [Vec3::X, Vec3::Y, Vec3::Z, -Vec3::X, -Vec3::Y, -Vec3::Z] {
            for (w, side) in [(axis, 1.0), (-axis, -1.0)] {
                let moved = offset_origin(p, e, axis, w) - p;
                let exact = e * axis * side * axis.abs();
                assert!((moved - exact).abs().max_element() < 1e-6, "{axis} {w}: {moved} {exact}");
                // Other axes are unchanged, bit for bit
                assert_eq!(moved * (Vec3::ONE - axis.abs()), Vec3::ZERO);
            }
        }
        // An error far below the spacing of floats still moves to the next one
        assert_eq!(offset_origin(Vec3::X, Vec3::splat(1e-20), Vec3::X, Vec3::X).x, (1.0 + COINCIDENCE).next_up());
        // A coincident surface, even in a plane through the origin
        assert!(offset_origin(p.with_x(0.0), Vec3::ZERO, Vec3::X, Vec3::X).x >= 4.0 * COINCIDENCE);
        // Without a surface, the point is unchanged
        assert_eq!(offset_origin(p, e, Vec3::ZERO, Vec3::X), p);
        // For directions in the plane, the side of the normal
        assert!(offset_origin(p, e, Vec3::X, Vec3::Y).x > p.x);
    }
}
