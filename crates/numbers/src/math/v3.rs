//! Directions of single samples and of vectors.

use super::number::Number;
use glam::Vec3;

/// A direction, or many by component.
#[derive(Clone, Copy, Debug)]
pub struct V3<N> {
    /// x.
    pub x: N,
    /// y.
    pub y: N,
    /// z.
    pub z: N,
}

impl From<Vec3> for V3<f32> {
    #[inline(always)]
    fn from(v: Vec3) -> Self {
        V3 { x: v.x, y: v.y, z: v.z }
    }
}

impl From<V3<f32>> for Vec3 {
    #[inline(always)]
    fn from(v: V3<f32>) -> Self {
        Vec3::new(v.x, v.y, v.z)
    }
}

impl<N: Number> V3<N> {
    /// Dot product.
    #[inline(always)]
    pub fn dot(self, o: Self) -> N {
        self.x * o.x + self.y * o.y + self.z * o.z
    }

    /// Cross product.
    #[inline(always)]
    pub fn cross(self, o: Self) -> Self {
        V3 { x: self.y * o.z - o.y * self.z, y: self.z * o.x - o.z * self.x, z: self.x * o.y - o.x * self.y }
    }

    /// Vector sum.
    #[inline(always)]
    pub fn plus(self, o: Self) -> Self {
        V3 { x: self.x + o.x, y: self.y + o.y, z: self.z + o.z }
    }

    /// Vector difference.
    #[inline(always)]
    pub fn minus(self, o: Self) -> Self {
        V3 { x: self.x - o.x, y: self.y - o.y, z: self.z - o.z }
    }

    /// Scalar multiple.
    #[inline(always)]
    pub fn times(self, s: N) -> Self {
        V3 { x: self.x * s, y: self.y * s, z: self.z * s }
    }

    /// Absolute values of the components.
    #[inline(always)]
    pub fn magnitude(self) -> Self {
        V3 { x: self.x.magnitude(), y: self.y.magnitude(), z: self.z.magnitude() }
    }

    /// Replaces z.
    #[inline(always)]
    pub fn with_z(self, z: N) -> Self {
        V3 { z, ..self }
    }

    /// `yes` where the mask is true, else `no`.
    #[inline(always)]
    pub fn choose(mask: N::Mask, yes: Self, no: Self) -> Self {
        V3 { x: N::choose(mask, yes.x, no.x), y: N::choose(mask, yes.y, no.y), z: N::choose(mask, yes.z, no.z) }
    }

    /// Normalised to unit length.
    #[inline(always)]
    pub fn unit(self) -> Self {
        self.times(self.x.constant(1.0) / self.dot(self).root())
    }

    /// x and y of [`super::Frame::from_z`] about the unit vector [Duff et al. 2017].
    #[inline(always)]
    pub fn tangents(self) -> [Self; 2] {
        let one = self.x.constant(1.0);
        let sign = one.signed_as(self.z);
        let a = -(one / (sign + self.z));
        let b = self.x * self.y * a;
        let x = V3 { x: one + sign * self.x * self.x * a, y: sign * b, z: -(sign * self.x) };
        [x, V3 { x: b, y: sign + self.y * self.y * a, z: -self.y }]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::{Frame, warp};

    #[test]
    fn tangents_are_those_of_the_frame_in_all_bits() {
        for i in 0..1000 {
            let z = warp::sample_uniform_sphere([i as f32 / 1000.0, (i * 7 % 13) as f32 / 13.0]);
            let (frame, [x, y]) = (Frame::from_z(z), V3::from(z).tangents());
            assert_eq!((frame.x, frame.y), (x.into(), y.into()), "{z}");
            let w = Vec3::new(0.2, -0.7, z.x);
            assert_eq!(V3::from(w).dot(x), frame.to_local(w).x);
            assert_eq!(Vec3::from(V3::from(z).cross(V3::from(w))), z.cross(w));
        }
    }
}
