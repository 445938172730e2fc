//! Orthonormal frames; local +z is the normal.

use glam::Vec3;

/// Right-handed orthonormal frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Frame {
    /// Tangent, local +x.
    pub x: Vec3,
    /// Bitangent, local +y.
    pub y: Vec3,
    /// Normal, local +z.
    pub z: Vec3,
}

impl Frame {
    /// Any frame about the unit vector `z` [Duff et al. 2017].
    #[inline]
    pub fn from_z(z: Vec3) -> Self {
        let sign = 1.0_f32.copysign(z.z);
        let a = -1.0 / (sign + z.z);
        let b = z.x * z.y * a;
        let x = Vec3::new(1.0 + sign * z.x * z.x * a, sign * b, -sign * z.x);
        let y = Vec3::new(b, sign + z.y * z.y * a, -z.y);
        Frame { x, y, z }
    }

    /// The frame about the unit vector `z` whose x axis is nearest to `x`; some frame if `x` is zero or parallel to
    /// `z`.
    #[inline]
    pub fn from_xz(x: Vec3, z: Vec3) -> Self {
        let tangent = x - z * z.dot(x);
        let length_squared = tangent.length_squared();
        if length_squared.is_nan() || length_squared <= 1e-12 * x.length_squared() {
            return Frame::from_z(z);
        }
        let x = tangent / length_squared.sqrt();
        Frame { x, y: z.cross(x), z }
    }

    /// World to local.
    #[inline]
    pub fn to_local(&self, v: Vec3) -> Vec3 {
        Vec3::new(v.dot(self.x), v.dot(self.y), v.dot(self.z))
    }

    /// Local to world.
    #[inline]
    pub fn to_world(&self, v: Vec3) -> Vec3 {
        self.x * v.x + self.y * v.y + self.z * v.z
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_are_orthonormal_and_right_handed() {
        for v in [Vec3::Z, -Vec3::Z, Vec3::X, Vec3::new(0.3, -0.8, 0.2), Vec3::new(-1.0, 1.0, -1e-4)] {
            let z = v.normalize();
            for f in [Frame::from_z(z), Frame::from_xz(Vec3::new(0.1, 2.0, 0.7), z), Frame::from_xz(z, z)] {
                assert!((f.x.length() - 1.0).abs() < 1e-5 && (f.y.length() - 1.0).abs() < 1e-5);
                assert!(f.x.dot(f.y).abs() < 1e-5 && f.x.dot(f.z).abs() < 1e-5);
                assert!((f.x.cross(f.y) - f.z).length() < 1e-5);
            }
        }
    }

    #[test]
    fn directions_go_to_the_frame_and_back() {
        let z = Vec3::new(0.3, -0.8, 0.2).normalize();
        for f in [Frame::from_z(z), Frame::from_z(-z), Frame::from_xz(Vec3::new(0.1, 2.0, 0.7), z)] {
            let v = Vec3::new(0.7, -0.2, 1.9);
            assert!((f.to_world(f.to_local(v)) - v).length() < 1e-6);
            assert!((f.to_world(v) - (f.x * 0.7 - f.y * 0.2 + f.z * 1.9)).length() < 1e-6);
            assert!((f.to_local(f.x) - Vec3::X).length() < 1e-6 && (f.to_local(f.y) - Vec3::Y).length() < 1e-6);
        }
    }

    #[test]
    fn the_tangent_is_as_near_as_can_be() {
        let f = Frame::from_xz(Vec3::new(3.0, 0.0, 4.0), Vec3::Z);
        assert_eq!((f.x, f.y, f.z), (Vec3::X, Vec3::Y, Vec3::Z));
        for bad in [Vec3::ZERO, Vec3::Z * 5.0, Vec3::splat(f32::NAN)] {
            assert_eq!(Frame::from_xz(bad, Vec3::Z), Frame::from_z(Vec3::Z));
        }
    }
}
