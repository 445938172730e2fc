//! Blocks of spans of curves. The capsules of eight spans are tested at once in f32, which leaves few for the exact
//! intersection.
//!
//! In a frame with the ray as its third axis, a capsule of radius r is met if its segment is within r of the origin of
//! the first two axes. The radius is increased by a bound of the rounding errors, so no hit is lost.

use super::build::{LEAF_SPANS, PrimRef};
use crate::geometry::{GeometrySet, Shape};
use lumiris_numbers::math::{Bounds3, Ray, Vec4, gamma};

/// The rounding error of a distance, relative to the coordinates: twice the sum over the operations of the test.
const ERROR: f32 = 1.0 / (1 << 18) as f32;

/// Eight spans of curves.
#[derive(Clone, Debug)]
#[repr(C, align(32))]
pub(super) struct CurveBlock {
    /// Starts of the segments, by axis.
    from: [[Vec4; 2]; 3],
    /// Ends relative to the starts.
    along: [[Vec4; 2]; 3],
    /// Radii; negative in unused lanes.
    radius: [Vec4; 2],
    pub(super) geometry: [u32; LEAF_SPANS],
    /// First primitives of the spans.
    pub(super) first: [u32; LEAF_SPANS],
}

/// A ray prepared for the test.
pub(super) struct CurveRay {
    o: [Vec4; 3],
    /// Unit vectors across the ray and along it.
    axes: [[Vec4; 3]; 3],
    /// Length of the direction.
    length: f32,
    /// Bound of the rounding error of a distance.
    error: Vec4,
}

impl CurveBlock {
    pub(super) fn new(geometry: &GeometrySet, prims: &[PrimRef]) -> Self {
        // Rows of coordinates
        let mut rows = [[0.0_f32; LEAF_SPANS]; 7];
        rows[6] = [f32::NEG_INFINITY; LEAF_SPANS];
        let (mut geometries, mut first) = ([0; LEAF_SPANS], [0; LEAF_SPANS]);
        for (lane, prim) in prims.iter().enumerate() {
            let Shape::Curves(curves) = &geometry.geometries[prim.geometry as usize].shape else { continue };
            let capsule = curves.capsule(prim.primitive);
            let [from, to] = capsule.ends;
            for axis in 0..3 {
                (rows[axis][lane], rows[3 + axis][lane]) = (from[axis], to[axis] - from[axis]);
            }
            rows[6][lane] = capsule.radius;
            (geometries[lane], first[lane]) = (prim.geometry, prim.primitive);
        }

        // Two vectors for each row
        let [fx, fy, fz, ax, ay, az, radius] =
            rows.map(|row| [Vec4::from_slice(&row[..4]), Vec4::from_slice(&row[4..])]);
        CurveBlock { from: [fx, fy, fz], along: [ax, ay, az], radius, geometry: geometries, first }
    }

    /// Bit mask of the spans that the ray may hit at a parameter of at most `limit`.
    #[inline]
    pub(super) fn candidates(&self, ray: &CurveRay, limit: f32) -> u32 {
        let far = Vec4::splat(limit * ray.length * (1.0 + gamma(8)));
        let half = |h: usize| {
            // Start and direction of the segments in the frame of the ray
            let from: [Vec4; 3] = std::array::from_fn(|axis| self.from[axis][h] - ray.o[axis]);
            let along: [Vec4; 3] = std::array::from_fn(|axis| self.along[axis][h]);
            let [from, along] =
                [from, along].map(|v| ray.axes.map(|axis| v[0] * axis[0] + v[1] * axis[1] + v[2] * axis[2]));

            // Nearest point of the segment. 0/0 becomes 0
            let nearest = -(from[0] * along[0] + from[1] * along[1]) / (along[0] * along[0] + along[1] * along[1]);
            let nearest = nearest.max(Vec4::ZERO).min(Vec4::ONE);
            let (x, y) = (from[0] + nearest * along[0], from[1] + nearest * along[1]);
            let radius = self.radius[h] + ray.error;

            // Exclude what is too far from the ray, behind its end or before its start. NaN excludes nothing
            let end = from[2] + along[2];
            let is_beside = (x * x + y * y).cmpgt(radius * radius) | self.radius[h].cmplt(Vec4::ZERO);
            let is_beyond = (from[2].min(end) - radius).cmpgt(far) | (from[2].max(end) + radius).cmplt(Vec4::ZERO);
            !(is_beside | is_beyond).bitmask() & 15
        };
        half(0) | half(1) << 4
    }
}

impl CurveRay {
    /// `bounds` contain all capsules.
    pub(super) fn new(ray: &Ray, bounds: Bounds3) -> Self {
        let d = ray.d.as_dvec3();
        let length = d.length();
        let z = d / length;
        let (x, y) = z.any_orthonormal_pair();
        let axes = [x, y, z].map(|axis| axis.as_vec3().to_array().map(Vec4::splat));
        let scale = ray.o.length() + bounds.min.abs().max(bounds.max.abs()).length();
        let o = ray.o.to_array().map(Vec4::splat);
        CurveRay { o, axes, length: length as f32, error: Vec4::splat(scale * ERROR) }
    }
}
