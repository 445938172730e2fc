//! Time-dependent transforms, and the transformation of normals.

use glam::{Affine3A, DAffine3, Mat3A, Vec3};

/// Transforms a normal by the inverse transpose of `to_from`; the result is unit, or zero if the map is singular.
#[inline]
pub fn transform_normal(to_from: &Affine3A, n: Vec3) -> Vec3 {
    // The cofactor matrix is det·(inverse transpose): no division, and correct for singular maps of rank 2.
    let m = &to_from.matrix3;
    let cofactor = Mat3A::from_cols(m.y_axis.cross(m.z_axis), m.z_axis.cross(m.x_axis), m.x_axis.cross(m.y_axis));
    let sign = 1.0_f32.copysign(m.determinant());
    (Vec3::from(cofactor * glam::Vec3A::from(n)) * sign).normalize_or_zero()
}

/// True if the map reflects: it maps right-handed frames to left-handed ones.
#[inline]
pub fn swaps_handedness(to_from: &Affine3A) -> bool {
    to_from.matrix3.determinant() < 0.0
}

/// The componentwise linear blend of two maps at `t` in 0..1, which both ray tracers use between the time samples of a
/// moving instance.
#[inline]
pub fn lerp_affine(a: &Affine3A, b: &Affine3A, t: f32) -> Affine3A {
    let s = 1.0 - t;
    Affine3A { matrix3: a.matrix3 * s + b.matrix3 * t, translation: a.translation * s + b.translation * t }
}

/// The transform at `time` in 0..=1, linear between `samples` at equidistant times. There must be at least one sample.
#[inline]
pub fn transform_at(samples: &[Affine3A], time: f32) -> Affine3A {
    match segment_at(samples.len(), time) {
        Some(Segment { index: i, t }) => lerp_affine(&samples[i], &samples[i + 1], t),
        None => samples[0],
    }
}

/// A time between two samples.
struct Segment {
    /// Index of the first sample.
    index: usize,
    /// Relative position between both.
    t: f32,
}

/// The segment that contains `time` among `count` samples at equidistant times 0..=1; `None` for a single sample.
#[inline]
fn segment_at(count: usize, time: f32) -> Option<Segment> {
    let last = count - 1;
    let x = time.clamp(0.0, 1.0) * last as f32;
    let index = (x as usize).min(last.checked_sub(1)?);
    Some(Segment { index, t: x - index as f32 })
}

/// The transforms of a motion within a motion. Their product is not linear between samples; the result has the number
/// of samples of the finer motion.
pub fn compose_placements(outer: &[DAffine3], inner: &[DAffine3]) -> Vec<DAffine3> {
    let count = outer.len().max(inner.len());
    let time = |i: usize| if count == 1 { 0.0 } else { i as f32 / (count - 1) as f32 };
    let at = |samples: &[DAffine3], time: f32| match segment_at(samples.len(), time) {
        Some(Segment { index: i, t }) => {
            let (a, b, t) = (samples[i], samples[i + 1], f64::from(t));
            let (matrix3, translation) = (a.matrix3 * (1.0 - t) + b.matrix3 * t, a.translation.lerp(b.translation, t));
            DAffine3 { matrix3, translation }
        }
        None => samples[0],
    };
    (0..count).map(|i| at(outer, time(i)) * at(inner, time(i))).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DVec3;

    #[test]
    fn normals_stay_perpendicular_under_shear_and_mirror() {
        let m = Affine3A::from_mat3(glam::Mat3::from_cols_array(&[-2.0, 0.3, 0.0, 0.5, 1.0, 0.2, 0.1, 0.0, 3.0]));
        let (n, t) = (Vec3::Z, Vec3::new(0.4, -0.7, 0.0));
        let n2 = transform_normal(&m, n);
        assert!(n2.dot(m.transform_vector3(t)).abs() < 1e-6);
        assert!(n2.dot(m.transform_vector3(n)) > 0.0);
        assert!(swaps_handedness(&m));
    }

    #[test]
    fn motions_within_motions_are_products_at_the_times_of_the_finer() {
        let moves = |steps: usize| -> Vec<DAffine3> {
            (0..=steps).map(|i| DAffine3::from_translation(DVec3::X * (i as f64 / steps as f64))).collect()
        };
        let turned = DAffine3::from_rotation_z(std::f64::consts::FRAC_PI_2);
        let single = |made: &[DAffine3]| -> Vec<Affine3A> { made.iter().map(DAffine3::as_affine3a).collect() };
        let made = compose_placements(&moves(1), &moves(4));
        assert_eq!(made.len(), 5);
        assert_eq!(transform_at(&single(&made), 0.375).translation.x, 0.75);
        let made = compose_placements(&[turned], &moves(2));
        assert!((transform_at(&single(&made), 0.5).transform_point3(Vec3::ZERO) - Vec3::Y * 0.5).length() < 1e-6);
        assert_eq!(compose_placements(&[turned], &[turned]).len(), 1);
    }

    #[test]
    fn blends_are_linear_and_handedness_is_kept_without_a_mirror() {
        let a =
            Affine3A::from_scale_rotation_translation(Vec3::splat(2.0), glam::Quat::IDENTITY, Vec3::new(0.0, 4.0, 8.0));
        let blend = lerp_affine(&Affine3A::IDENTITY, &a, 0.25);
        assert_eq!(blend.transform_point3(Vec3::new(1.0, 2.0, 4.0)), Vec3::new(1.25, 3.5, 7.0));
        assert!(!swaps_handedness(&a));
        assert_eq!(transform_normal(&Affine3A::from_scale(Vec3::ZERO), Vec3::X), Vec3::ZERO);
    }
}
