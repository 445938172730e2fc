//! Bounds of emission: position, orientation and intensity of sets of lights [Conty Estévez and Kulla 2018].
//!
//! A cone of half-angle θo about the axis contains all normals; light is emitted within θe of a normal.

use lumiris_numbers::math::{Bounds3, Vec3, safe_sqrt};
use std::f32::consts::{FRAC_PI_2, PI};

/// Bounds of the emission of a set of lights.
#[derive(Clone, Copy, Debug)]
pub struct LightBounds {
    /// Bounding box.
    pub bounds: Bounds3,
    /// Unit axis of the cone of normals.
    pub axis: Vec3,
    /// Cosine of its half-angle θo.
    pub cos_theta_o: f32,
    /// Cosine of the angle θe from a normal up to which light is emitted.
    pub cos_theta_e: f32,
    /// True if they emit along the reversed normals too.
    pub two_sided: bool,
    /// Sum of the luminances of the maximum radiant intensities; of the mean intensities for lights with an image.
    pub intensity: f32,
}

impl LightBounds {
    /// The bounds of no light.
    pub const EMPTY: LightBounds = LightBounds {
        bounds: Bounds3::EMPTY,
        axis: Vec3::Z,
        cos_theta_o: 1.0,
        cos_theta_e: 1.0,
        two_sided: false,
        intensity: 0.0,
    };

    /// Bounds of both sets.
    #[must_use]
    pub fn union(mut self, other: &LightBounds) -> LightBounds {
        self.add(other);
        self
    }

    /// Extends the bounds by another set.
    pub fn add(&mut self, other: &LightBounds) {
        if other.intensity > 0.0 {
            let bounds = if self.intensity > 0.0 { self.bounds.union(other.bounds) } else { other.bounds };
            self.add_emission(other);
            self.bounds = bounds;
        }
    }

    /// [`Self::add`] of a set with intensity, without its bounding box.
    #[inline(always)]
    pub(super) fn add_emission(&mut self, other: &LightBounds) {
        if self.intensity <= 0.0 {
            *self = *other;
            return;
        }
        // The axis of a two-sided light has no sign.
        let flips = self.two_sided && other.two_sided && self.axis.dot(other.axis) < 0.0;
        let cone = Cone { axis: self.axis, cos: self.cos_theta_o };
        let other_cone = Cone { axis: if flips { -other.axis } else { other.axis }, cos: other.cos_theta_o };
        if !cone.clearly_holds(other_cone) {
            let cone = cone.union(other_cone);
            (self.axis, self.cos_theta_o) = (cone.axis, cone.cos);
        }
        self.cos_theta_e = self.cos_theta_e.min(other.cos_theta_e);
        self.two_sided |= other.two_sided;
        self.intensity += other.intensity;
    }

    /// M_Ω of the surface-area orientation heuristic: ∫ over directions of the cosine, outside the cone of normals,
    /// up to θo + θe.
    pub fn orientation_measure(&self) -> f32 {
        let theta_o = angle(self.cos_theta_o);
        let theta_w = (theta_o + angle(self.cos_theta_e)).min(PI);
        let sin_o = safe_sqrt(1.0 - self.cos_theta_o * self.cos_theta_o);
        let edge = 2.0 * theta_w * sin_o - (theta_o - 2.0 * theta_w).cos() - 2.0 * theta_o * sin_o + self.cos_theta_o;
        2.0 * PI * (1.0 - self.cos_theta_o) + FRAC_PI_2 * edge
    }

    /// The cost of a cluster in the heuristic. A small fraction of the squared diagonal is added to the area, so that
    /// lights on a line have different costs as well.
    pub fn cost(&self) -> f32 {
        if self.intensity <= 0.0 {
            return 0.0;
        }
        let extent = self.bounds.half_area() + 0.01 * self.bounds.diagonal().length_squared();
        self.intensity * self.orientation_measure() * extent
    }
}

/// Difference of cosines above all rounding errors.
const CLEAR: f32 = 1e-5;

/// The angle of a cosine. The angles of flat lights take no time.
#[inline]
fn angle(cos: f32) -> f32 {
    if cos >= 1.0 {
        0.0
    } else if cos == 0.0 {
        FRAC_PI_2
    } else {
        cos.max(-1.0).acos()
    }
}

/// The angle between unit vectors, accurate for all angles.
fn angle_between(a: Vec3, b: Vec3) -> f32 {
    2.0 * (a - b).length().atan2((a + b).length())
}

/// A cone of directions.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Cone {
    /// Unit axis.
    axis: Vec3,
    /// Cosine of the half-angle.
    cos: f32,
}

impl Cone {
    const SPHERE: Cone = Cone { axis: Vec3::Z, cos: -1.0 };

    /// True if the union with `other` is this cone, by a margin above the rounding errors of angles: cos θd > cos(θ −
    /// θ_other). Found without angles, which take longer.
    #[inline]
    fn clearly_holds(self, other: Cone) -> bool {
        // A single normal, as of flat lights, needs no sines
        let sin = |c: Cone| ((1.0 - c.cos) * (1.0 + c.cos)).sqrt();
        let sines = if other.cos >= 1.0 { 0.0 } else { sin(self) * sin(other) };
        self == Self::SPHERE
            || -1.0 < self.cos
                && self.cos < other.cos
                && self.axis.dot(other.axis) > self.cos * other.cos + sines + CLEAR
    }

    /// A cone about two cones, a little wider than necessary against rounding.
    #[inline(never)]
    fn union(self, other: Cone) -> Cone {
        let (a, b) = (self, other);
        if a.cos <= -1.0 || b.cos <= -1.0 {
            return Self::SPHERE;
        }
        // One cone may contain the other.
        if b.clearly_holds(a) {
            return b;
        }
        let (theta_a, theta_b) = (angle(a.cos), angle(b.cos));
        let theta_d = angle_between(a.axis, b.axis);
        if theta_d + theta_b <= theta_a {
            return a;
        }
        if theta_d + theta_a <= theta_b {
            return b;
        }

        // Rotate the axis of `a` towards the axis of `b` until the cone touches the far side of both.
        let theta_o = 0.5 * (theta_a + theta_d + theta_b) + 1e-5;
        if theta_o >= PI {
            return Self::SPHERE;
        }
        let difference = b.axis - a.axis * a.axis.dot(b.axis);
        if difference.length_squared() <= 1e-8 {
            // Parallel axes: widen one cone. Opposite axes have no preferred direction of rotation.
            let widened = theta_d + theta_a.max(theta_b) + 1e-5;
            let is_cone = a.axis.dot(b.axis) > 0.0 && widened < PI;
            return if is_cone { Cone { cos: widened.cos(), ..a } } else { Self::SPHERE };
        }
        // Orthogonalise twice: rounding tilts the first difference of nearly parallel axes.
        let towards_b = difference.normalize();
        let towards_b = (towards_b - a.axis * a.axis.dot(towards_b)).normalize();
        let (sin, cos) = (theta_o - theta_a).sin_cos();
        let axis = (a.axis * cos + towards_b * sin).normalize_or_zero();
        if axis == Vec3::ZERO || !axis.is_finite() { Self::SPHERE } else { Cone { axis, cos: theta_o.cos() } }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use lumiris_numbers::math::Frame;
    use lumiris_numbers::math::warp::{direction, sample_uniform_sphere};
    use lumiris_test_support::random::{RngExt, pcg32};

    #[test]
    fn the_union_of_cones_holds_both() {
        let mut stream = pcg32([1, 1, 2]);
        for i in 0..20_000 {
            let mut cone = || Cone {
                axis: sample_uniform_sphere(stream.random::<[f32; 2]>()),
                cos: 1.0 - 2.0 * stream.random::<f32>().powi(3),
            };

            // Same axes, opposite axes, nearly equal and nearly opposite axes, and random axes
            let a = cone();
            let b = match i % 6 {
                0 => Cone { axis: a.axis, ..cone() },
                1 => Cone { axis: -a.axis, ..cone() },
                2 => Cone { axis: (a.axis + cone().axis * 1e-4).normalize(), cos: 1.0 },
                3 => Cone { axis: (cone().axis * 1e-4 - a.axis).normalize(), cos: a.cos },
                _ => cone(),
            };

            // The edges of both cones are inside of the union
            let Cone { axis, cos } = a.union(b);
            assert!(axis.is_finite() && (axis.length() - 1.0).abs() < 1e-5 && cos.is_finite());
            for c in [a, b] {
                let edge = direction(c.cos, std::f32::consts::TAU * stream.random::<f32>());
                let w = Frame::from_z(c.axis).to_world(edge);
                assert!(w.dot(axis) >= cos - 2e-6, "{a:?} {b:?} -> {axis} {cos}");
            }
        }
    }

    #[test]
    fn a_cone_that_clearly_holds_another_is_their_union() {
        let mut stream = pcg32([1, 1, 3]);
        let mut held = 0;
        for i in 0..100_000 {
            let mut cos = |power| 1.0 - 2.0 * stream.random::<f32>().powi(power);
            let (a, b) = (cos(2), if i % 2 == 0 { 1.0 } else { cos(6) });
            let a = Cone { axis: sample_uniform_sphere(stream.random::<[f32; 2]>()), cos: a };
            let near = a.axis + sample_uniform_sphere(stream.random::<[f32; 2]>()) * stream.random::<f32>();
            let b = Cone { axis: near.normalize(), cos: b };
            if a.clearly_holds(b) {
                held += 1;
                assert_eq!(a.union(b), a, "{b:?}");
            }
        }
        assert!(held > 20_000, "{held}");
    }

    #[test]
    fn orientation_measure_of_known_cones() {
        let measure =
            |o: f32, e: f32| LightBounds { cos_theta_o: o, cos_theta_e: e, ..LightBounds::EMPTY }.orientation_measure();
        assert!((measure(-1.0, 0.0) - 4.0 * PI).abs() < 1e-4);
        assert!((measure(1.0, 0.0) - PI).abs() < 1e-5);
        assert!(measure(1.0, 1.0).abs() < 1e-5);
    }
}
