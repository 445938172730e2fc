//! The current transformation matrix, at the start and at the end of the motion. It is in f64, from the text to
//! rendered space, so that transforms may cancel large translations.

use lumiris_formats::pbrt::directive::{ActiveTimes, DirectiveKind};
use lumiris_numbers::math::{DAffine3, DMat3, DMat4, DQuat, DVec3};

/// Largest angle (radians) between samples of a rotating motion, which is linear between them: paths deviate by at most
/// 0.12 % of their radius.
const MAX_ANGLE: f64 = std::f64::consts::PI / 32.0;

/// The current transformation matrix at both ends of the motion.
#[derive(Clone, Debug, PartialEq)]
pub struct Ctm {
    /// At the start time.
    pub start: DMat4,
    /// At the end time, if it differs: a scene may have millions of transforms, most of which do not move.
    end: Option<Box<DMat4>>,
}

impl Ctm {
    /// No transformation.
    pub const IDENTITY: Ctm = Ctm { start: DMat4::IDENTITY, end: None };

    /// The transformation from its values at both ends.
    pub fn new(start: DMat4, end: DMat4) -> Ctm {
        Ctm { start, end: (start != end).then(|| Box::new(end)) }
    }

    /// At the end time.
    fn end(&self) -> &DMat4 {
        self.end.as_deref().unwrap_or(&self.start)
    }

    /// True if it moves.
    pub fn is_moving(&self) -> bool {
        self.end.is_some()
    }

    /// True if it only shifts while it moves, or does not move.
    pub fn only_shifts(&self) -> bool {
        DMat3::from_mat4(self.start) == DMat3::from_mat4(*self.end())
    }

    /// The motion of a shape that is placed at the start if this only shifts, and in the space of the shape otherwise.
    pub fn motion(&self) -> Ctm {
        if !self.only_shifts() {
            return self.clone();
        }
        // Rounded to f32, so that shapes in different places that shift alike do so in all bits
        let shift = (self.end().w_axis - self.start.w_axis).truncate().as_vec3().as_dvec3();
        Ctm::new(DMat4::IDENTITY, DMat4::from_translation(shift))
    }

    /// This transformation with `change` applied to the active times.
    #[must_use]
    pub fn changed(&self, active: ActiveTimes, change: impl Fn(&DMat4) -> DMat4) -> Ctm {
        match active {
            ActiveTimes::Start => Ctm::new(change(&self.start), *self.end()),
            ActiveTimes::End => Ctm::new(self.start, change(self.end())),
            ActiveTimes::All if self.is_moving() => Ctm::new(change(&self.start), change(self.end())),
            ActiveTimes::All => Ctm { start: change(&self.start), end: None },
        }
    }

    /// This transformation in the space that `outer`, which does not move, places.
    #[must_use]
    pub fn within(&self, outer: &DMat4) -> Ctm {
        self.changed(ActiveTimes::All, |m| *outer * *m)
    }

    /// The inverse at both ends.
    pub fn inverse(&self) -> Ctm {
        self.changed(ActiveTimes::All, DMat4::inverse)
    }

    /// True if all its elements are in the range of f32.
    pub fn is_finite(&self) -> bool {
        [&self.start, self.end()].iter().all(|m| m.as_mat4().is_finite())
    }

    /// True if it is invertible and finite. Singular transforms flatten; meshes are rendered flat.
    pub fn is_invertible(&self) -> bool {
        [&self.start, self.end()].iter().all(|m| {
            let scale = m.x_axis.length() * m.y_axis.length() * m.z_axis.length();
            self.is_finite()
                && m.determinant().abs() > f64::from(f32::MIN_POSITIVE)
                && m.determinant().abs() > 1e-12 * scale
        })
    }

    /// True if it is invertible and does not move.
    pub fn is_fixed(&self) -> bool {
        !self.is_moving() && self.is_invertible()
    }

    /// The transforms at equidistant times 0..=1 of the shutter, which opens and closes at the given fractions of the
    /// motion: one without motion, two without rotation, otherwise enough for the rotation.
    pub fn samples(&self, shutter: [f32; 2]) -> Vec<DAffine3> {
        if !self.is_moving() {
            return vec![affine(&self.start)];
        }
        let (a, b) = (Parts::new(&self.start), Parts::new(self.end()));
        // The shorter way round; a power of two, so that the samples of motions within motions coincide
        let angle = 2.0 * a.rotation.dot(b.rotation).abs().min(1.0).acos() * f64::from(shutter[1] - shutter[0]).abs();
        let segments = ((angle / MAX_ANGLE - 1e-6).ceil() as usize).next_power_of_two();
        let at = |i: usize| {
            let t = shutter[0] + (shutter[1] - shutter[0]) * i as f32 / segments as f32;
            a.interpolate(&b, f64::from(t.clamp(0.0, 1.0)))
        };
        (0..=segments).map(at).collect()
    }
}

/// A matrix as translation · rotation · rest, which is how pbrt interpolates motion [Shoemake and Duff 1992].
struct Parts {
    translation: DVec3,
    rotation: DQuat,
    stretch: DMat3,
}

impl Parts {
    fn new(m: &DMat4) -> Self {
        let linear = DMat3::from_mat4(*m);
        // Polar decomposition by averaging with the inverse transpose.
        let mut r = linear;
        for _ in 0..100 {
            let next = (r + r.inverse().transpose()) * 0.5;
            let change = (next - r).to_cols_array().iter().fold(0.0_f64, |m, x| m.max(x.abs()));
            r = next;
            if change < 1e-14 {
                break;
            }
        }
        // A reflection goes into the stretch, as quaternions only rotate.
        if r.determinant() < 0.0 {
            r *= -1.0;
        }
        Parts { translation: m.w_axis.truncate(), rotation: DQuat::from_mat3(&r), stretch: r.inverse() * linear }
    }

    fn interpolate(&self, other: &Parts, t: f64) -> DAffine3 {
        let rotation = DMat3::from_quat(self.rotation.slerp(other.rotation, t));
        let stretch = self.stretch * (1.0 - t) + other.stretch * t;
        DAffine3::from_mat3_translation(rotation * stretch, self.translation.lerp(other.translation, t))
    }
}

/// The affine part of a matrix.
pub fn affine(m: &DMat4) -> DAffine3 {
    DAffine3::from_mat4(*m)
}

/// The matrix that a transform directive multiplies or sets; `None` for other directives.
///
/// Returns `Err` with a reason if its numbers are not a transform.
pub fn matrix_of(kind: &DirectiveKind) -> Option<Result<DMat4, &'static str>> {
    Some(match kind {
        DirectiveKind::Identity => Ok(DMat4::IDENTITY),
        DirectiveKind::Translate(v) => Ok(DMat4::from_translation(DVec3::from_array(*v))),
        DirectiveKind::Scale(v) => Ok(DMat4::from_scale(DVec3::from_array(*v))),
        DirectiveKind::Rotate([degrees, x, y, z]) => match DVec3::new(*x, *y, *z).try_normalize() {
            Some(axis) => Ok(DMat4::from_axis_angle(axis, degrees.to_radians())),
            None => Err("the axis of a rotation must not be zero"),
        },
        DirectiveKind::LookAt(v) => look_at(v),
        DirectiveKind::Transform(m) | DirectiveKind::ConcatTransform(m) => Ok(DMat4::from_cols_array(m)),
        _ => return None,
    })
}

/// pbrt's `LookAt`: camera space is left-handed, x right, y up, z forward.
fn look_at(v: &[f64; 9]) -> Result<DMat4, &'static str> {
    let (eye, target, up) = (DVec3::new(v[0], v[1], v[2]), DVec3::new(v[3], v[4], v[5]), DVec3::new(v[6], v[7], v[8]));
    let forward = (target - eye).try_normalize().ok_or("the eye and the target are the same point")?;
    let up = up.try_normalize().ok_or("the up vector is zero")?;
    let right = up.cross(forward).try_normalize().ok_or("the up vector points along the view")?;
    let world_from_camera =
        DMat4::from_cols(right.extend(0.0), forward.cross(right).extend(0.0), forward.extend(0.0), eye.extend(1.0));
    Ok(world_from_camera.inverse())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn look_at_puts_the_target_on_the_positive_z_axis() {
        let m = look_at(&[1.0, 2.0, 3.0, 4.0, 2.0, 3.0, 0.0, 0.0, 1.0]).unwrap();
        assert!((m.transform_point3(DVec3::new(4.0, 2.0, 3.0)) - DVec3::new(0.0, 0.0, 3.0)).length() < 1e-5);
        assert!((m.transform_vector3(DVec3::Z) - DVec3::Y).length() < 1e-6);
        // Left-handed: facing +x with z up, the image's right is +y.
        assert!((m.transform_vector3(DVec3::Y) - DVec3::X).length() < 1e-6);
        assert!(look_at(&[0.0; 9]).is_err());
    }

    #[test]
    fn a_camera_far_away_is_where_it_was_put() {
        let eye = DVec3::new(1e7 + 0.3, -4e6, 5e5 + 0.1);
        let at = |p: DVec3| p.to_array();
        let [[a, b, c], [d, e, f]] = [at(eye), at(eye + DVec3::new(0.5, 2.0, -1.0))];
        let world_from_camera = affine(&look_at(&[a, b, c, d, e, f, 0.0, 0.0, 1.0]).unwrap().inverse());
        assert!((world_from_camera.translation - eye).length() < 1e-7, "{}", world_from_camera.translation);
    }

    #[test]
    fn motion_is_sampled_as_rotation_and_translation() {
        let turn = |degrees: f64| DMat4::from_rotation_z(degrees.to_radians()) * DMat4::from_scale(DVec3::splat(2.0));
        let ctm = Ctm::new(turn(0.0), turn(90.0));
        let samples = ctm.samples([0.0, 1.0]);
        assert_eq!(samples.len(), 17);
        let middle = samples[8].transform_point3(DVec3::X);
        assert!((middle - DVec3::new(2.0_f64.sqrt(), 2.0_f64.sqrt(), 0.0)).length() < 1e-4, "{middle}");
        let slide = Ctm::new(DMat4::IDENTITY, DMat4::from_translation(DVec3::X));
        assert_eq!(slide.samples([0.0, 0.5])[1].translation.x, 0.5);
        assert_eq!(Ctm::IDENTITY.samples([0.0, 1.0]).len(), 1);
    }

    #[test]
    fn mirrored_motion_stays_mirrored() {
        let m = DMat4::from_scale(DVec3::new(-1.0, 1.0, 1.0));
        let ctm = Ctm::new(m, DMat4::from_rotation_y(1.0) * m);
        assert!(ctm.samples([0.0, 1.0]).iter().all(|s| s.matrix3.determinant() < -0.9));
    }

    #[test]
    fn degenerate_matrices_are_found() {
        assert!(!Ctm::new(DMat4::from_scale(DVec3::new(1.0, 0.0, 1.0)), DMat4::IDENTITY).is_invertible());
        assert!(!Ctm::new(DMat4::from_cols_array(&[f64::NAN; 16]), DMat4::IDENTITY).is_invertible());
        assert!(Ctm::new(DMat4::from_scale(DVec3::splat(1e-5)), DMat4::IDENTITY).is_invertible());
    }
}
