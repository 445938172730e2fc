//! Camera matrices for compositing programs: the standard attributes of OpenEXR.

use super::camera::Camera;
use lumiris_numbers::math::{Mat4, Vec4};

impl Camera {
    /// From world space to camera space at the start of the motion: x right, y up, z forward.
    pub fn camera_from_world(&self) -> Mat4 {
        Mat4::from(self.base().world_from_camera[0].inverse())
    }

    /// From world space to the image, after division by w: (0, 0) is its upper left corner, (1, 1) the lower right one.
    /// `None` for spherical cameras, which have no such matrix, and for lens systems, for which no matrix is exact.
    pub fn ndc_from_world(&self) -> Option<Mat4> {
        let (window, scale, is_perspective) = match self {
            Camera::Perspective { screen_window, tan_half_fov, .. } => (screen_window, *tan_half_fov, true),
            Camera::Orthographic { screen_window, .. } => (screen_window, 1.0, false),
            Camera::Spherical { .. } | Camera::Realistic { .. } => return None,
        };
        let [x0, x1, y0, y1] = *window;
        // x = (screen x − x0) / (x1 − x0), where screen x = camera x / (scale · w), and w is camera z or 1
        let (to_x, to_y) = (1.0 / (scale * (x1 - x0)), -1.0 / (scale * (y1 - y0)));
        let shift = Vec4::new(-x0 / (x1 - x0), y1 / (y1 - y0), 0.0, 1.0);
        let (x, y) = (Vec4::new(to_x, 0.0, 0.0, 0.0), Vec4::new(0.0, to_y, 0.0, 0.0));
        let ndc_from_camera =
            if is_perspective { Mat4::from_cols(x, y, shift, Vec4::Z) } else { Mat4::from_cols(x, y, Vec4::Z, shift) };
        Some(ndc_from_camera * self.camera_from_world())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cameras::SphericalMapping;
    use lumiris_numbers::math::{Affine3A, Quat, Vec2, Vec3};

    #[test]
    fn points_of_a_ray_fall_on_its_place_in_the_image() {
        let placement = Affine3A::from_rotation_translation(Quat::from_rotation_y(0.7), Vec3::new(1.0, 2.0, -3.0));
        let window = [-1.5, 2.0, -1.0, 0.9];
        for camera in [
            Camera::perspective(placement, 50.0, window, [200, 100], 0.0, 1e6),
            Camera::orthographic(placement, window, [200, 100], 0.0, 1e6),
        ] {
            let (ndc, space) = (camera.ndc_from_world().unwrap(), camera.camera_from_world());
            for place in [Vec2::new(0.0, 0.0), Vec2::new(200.0, 100.0), Vec2::new(31.0, 77.0)] {
                let ray = camera.ray(place, [0.5; 2], 0.0).ray;
                for t in [0.5, 40.0] {
                    let p = ray.o + ray.d * t;
                    let found = ndc.project_point3(p).truncate();
                    assert!((found - place / Vec2::new(200.0, 100.0)).length() < 1e-4, "{place} {t}: {found}");
                    assert!(space.transform_point3(p).z > 0.0);
                }
            }
            assert!(ndc.inverse().is_finite());
        }
        let sphere = Camera::spherical(placement, [20, 10], SphericalMapping::EquiRectangular);
        assert!(sphere.ndc_from_world().is_none());
        assert!(sphere.camera_from_world().transform_point3(Vec3::new(1.0, 2.0, -3.0)).length() < 1e-6);
    }
}
