//! Compact unit vectors: the sphere is projected onto the octahedron |x| + |y| + |z| = 1, whose lower half is folded
//! over the upper one to fill the square [−1, 1]², quantised to 2^b − 1 points per side [Meyer et al. 2010; Cigolle et
//! al. 2014].
//!
//! It needs no trigonometry, unlike the equal-area map of [`super::sphere_map`]. The number of grid points is odd, so
//! that the axes, which are the normals of most walls, are exact.

use super::Vec3;

/// Bits of each coordinate.
const BITS: u32 = 14;
/// Grid points on each side of 0.
const HALF: f32 = ((1 << (BITS - 1)) - 1) as f32;

/// Bits of a packed vector; the other bits of the word are 0.
pub const PACKED_BITS: u32 = 2 * BITS;

/// Maximum angle between a vector and its unpacked value (radians).
pub const MAX_ERROR: f32 = 2.7e-4;

/// Packs the unit vector `v`.
#[inline]
pub fn pack_unit(v: Vec3) -> u32 {
    let v = v / (v.x.abs() + v.y.abs() + v.z.abs()).max(f32::MIN_POSITIVE);
    let (x, y) =
        if v.z < 0.0 { ((1.0 - v.y.abs()).copysign(v.x), (1.0 - v.x.abs()).copysign(v.y)) } else { (v.x, v.y) };
    let quantise = |c: f32| (c * HALF).round() + HALF;
    quantise(x) as u32 | (quantise(y) as u32) << BITS
}

/// Inverse of [`pack_unit`]; bits above [`PACKED_BITS`] are ignored.
#[inline]
pub fn unpack_unit(bits: u32) -> Vec3 {
    let mask = (1 << BITS) - 1;
    let coordinate = |q: u32| (q & mask) as f32 * (1.0 / HALF) - 1.0;
    let (x, y) = (coordinate(bits), coordinate(bits >> BITS));
    // 1/HALF is rounded, but the centre must be exact
    let exact = |c: f32| if c.abs() < 0.5 / HALF { 0.0 } else { c };
    let (x, y) = (exact(x), exact(y));
    let z = 1.0 - x.abs() - y.abs();
    // Unfold the lower half
    let fold = (-z).max(0.0);
    Vec3::new(x - fold.copysign(x), y - fold.copysign(y), z).normalize()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::warp::sample_uniform_sphere;
    use lumiris_test_support::random::{RngExt, pcg32};

    #[test]
    fn axes_come_back_as_they_were() {
        for v in [Vec3::X, -Vec3::X, Vec3::Y, -Vec3::Y, Vec3::Z, -Vec3::Z] {
            assert!((unpack_unit(pack_unit(v)) - v).length() < 1e-7, "{v} {}", unpack_unit(pack_unit(v)));
        }
    }

    #[test]
    fn the_error_is_bounded_and_without_drift() {
        let mut stream = pcg32([2, 8, 0]);
        let (mut worst, mut drift) = (0.0_f32, glam::DVec3::ZERO);
        let count = 200_000;
        for i in 0..count {
            let mut v = sample_uniform_sphere(stream.random::<[f32; 2]>());
            if i % 4 == 0 {
                v.z *= 1e-4;
                v = v.normalize();
            }
            let packed = pack_unit(v);
            assert_eq!(packed >> PACKED_BITS, 0);
            let back = unpack_unit(packed);
            assert!((back.length() - 1.0).abs() < 1e-6);
            worst = worst.max((back - v).length());
            drift += (back - v).as_dvec3();
        }
        assert!(worst < MAX_ERROR && worst > 0.25 * MAX_ERROR, "{worst}");
        // Each component of the error is at most MAX_ERROR, so the mean's standard error is below MAX_ERROR/√count
        assert!(drift.length() / f64::from(count) < 6.0 * f64::from(MAX_ERROR) / f64::from(count).sqrt(), "{drift}");
    }
}
