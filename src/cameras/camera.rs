//! A camera of any kind: rays, widths of pixels, and projections of points.

use super::lens_system::LensSystem;
use lumiris_lanes::camera::Pinhole;
use lumiris_numbers::math::sphere_map::{equal_area_square_to_sphere, lat_long_to_sphere, wrap_equal_area_square};
use lumiris_numbers::math::transform::transform_at;
use lumiris_numbers::math::warp::sample_uniform_disk_concentric;
use lumiris_numbers::math::{Affine3A, Ray, Vec2, Vec3};
use std::f32::consts::PI;
use std::sync::Arc;

/// A ray from the camera.
#[derive(Clone, Copy, Debug)]
pub struct CameraRay {
    /// The ray, in world space, with unit direction.
    pub ray: Ray,
    /// Angle between the rays of neighbouring pixels (radians): the square root of a pixel's solid angle.
    pub spread: f32,
    /// Distance between the origins of the rays of neighbouring pixels, in world units.
    pub width0: f32,
    /// Factor of the radiance.
    pub weight: f32,
}

/// The projection of a point onto the film.
#[derive(Clone, Copy, Debug)]
pub struct Projection {
    /// The raster point.
    pub film_xy: Vec2,
    /// The point of the lens, in world space.
    pub o: Vec3,
    /// Area of the film (pixels) per solid angle at `o` (1/sr).
    pub density: f32,
}

/// Mapping from the film of a spherical camera to directions.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SphericalMapping {
    /// Longitude and colatitude.
    EquiRectangular,
    /// Equal-area octahedral map [Clarberg 2008].
    EqualArea,
}

/// The common part of all cameras.
#[derive(Clone, Debug)]
pub struct CameraBase {
    /// Transforms at equidistant times 0..=1, interpolated linearly; a single one if the camera does not move.
    pub(super) world_from_camera: Arc<[Affine3A]>,
    /// The placement by the first transform.
    first: Placement,
    resolution: Vec2,
}

/// A camera in world space.
#[derive(Clone, Copy, Debug)]
struct Placement {
    origin: Vec3,
    /// Unit axis upwards.
    up: Vec3,
    /// Unit axis of view.
    forward: Vec3,
}

impl Placement {
    fn new(world_from_camera: &Affine3A) -> Self {
        let axis = |axis: Vec3| world_from_camera.transform_vector3(axis).normalize();
        let origin = world_from_camera.transform_point3(Vec3::ZERO);
        Placement { origin, up: axis(Vec3::Y), forward: axis(Vec3::Z) }
    }
}

/// A thin lens of a perspective or orthographic camera.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Lens {
    /// Radius of the aperture; 0 for a pinhole.
    pub radius: f32,
    /// Distance of the focus plane, along z.
    pub focal_distance: f32,
}

/// A camera.
#[derive(Clone, Debug)]
pub enum Camera {
    /// Thin lens.
    Perspective {
        /// Common part.
        base: CameraBase,
        /// Screen window.
        screen_window: [f32; 4],
        /// Length of one screen unit on the plane z = 1.
        tan_half_fov: f32,
        /// Lens.
        lens: Lens,
    },
    /// Parallel rays.
    Orthographic {
        /// Common part.
        base: CameraBase,
        /// Screen window, in units of camera space.
        screen_window: [f32; 4],
        /// Lens.
        lens: Lens,
    },
    /// All directions from a point; y is up, the middle of an equirectangular film faces −x.
    Spherical {
        /// Common part.
        base: CameraBase,
        /// Mapping of the film.
        mapping: SphericalMapping,
    },
    /// A film behind lenses.
    Realistic {
        /// Common part.
        base: CameraBase,
        /// Width and height of the film (m).
        film_size: Vec2,
        /// Lenses.
        lens: Arc<LensSystem>,
    },
}

/// The screen window for a frame of the given aspect ratio (width over height): −1..1 on the shorter axis.
pub fn default_screen_window(frame_aspect: f32) -> [f32; 4] {
    if frame_aspect > 1.0 {
        [-frame_aspect, frame_aspect, -1.0, 1.0]
    } else {
        [-1.0, 1.0, -1.0 / frame_aspect, 1.0 / frame_aspect]
    }
}

impl CameraBase {
    fn new(world_from_camera: Affine3A, resolution: [u32; 2]) -> Self {
        let resolution = Vec2::new(resolution[0].max(1) as f32, resolution[1].max(1) as f32);
        let first = Placement::new(&world_from_camera);
        CameraBase { world_from_camera: Arc::new([world_from_camera]), first, resolution }
    }

    /// The placement at a time (0 to 1).
    #[inline]
    fn placement(&self, time: f32) -> Placement {
        match &*self.world_from_camera {
            [_] => self.first,
            moving => Placement::new(&transform_at(moving, time)),
        }
    }

    /// The ray of a point and a direction given in camera space.
    #[inline]
    fn ray(&self, o: Vec3, d: Vec3, time: f32) -> Ray {
        let world_from_camera = transform_at(&self.world_from_camera, time);
        let d = world_from_camera.transform_vector3(d).normalize();
        Ray { o: world_from_camera.transform_point3(o), d, t_max: f32::INFINITY, time }
    }

    /// Film coordinates to screen coordinates.
    #[inline]
    fn screen_point(&self, window: &[f32; 4], film_xy: Vec2) -> Vec2 {
        let p = film_xy / self.resolution;
        Vec2::new(window[0] + p.x * (window[1] - window[0]), window[3] - p.y * (window[3] - window[2]))
    }

    /// Area of a pixel on the screen.
    #[inline]
    fn pixel_area(&self, window: &[f32; 4]) -> f32 {
        ((window[1] - window[0]) * (window[3] - window[2]) / (self.resolution.x * self.resolution.y)).abs()
    }

    /// Angle between the rays of neighbouring pixels of a perspective camera (radians), at the cosine `cos` to its
    /// axis: a pixel of area a on the plane z = 1 subtends a·cos³θ.
    #[inline]
    fn perspective_spread(&self, window: &[f32; 4], tan_half_fov: f32, cos: f32) -> f32 {
        (self.pixel_area(window) * cos).sqrt() * cos * tan_half_fov
    }

    /// The same for a spherical camera, at the sine `sin` to its upward axis.
    #[inline]
    fn spherical_spread(&self, mapping: SphericalMapping, sin: f32) -> f32 {
        let pixels = self.resolution.x * self.resolution.y;
        let solid_angle = match mapping {
            SphericalMapping::EquiRectangular => 2.0 * PI * PI * sin / pixels,
            SphericalMapping::EqualArea => 4.0 * PI / pixels,
        };
        solid_angle.sqrt()
    }

    /// Distance between the parallel rays of neighbouring pixels, in world units.
    #[inline]
    fn parallel_width(&self, window: &[f32; 4], time: f32) -> f32 {
        let m = transform_at(&self.world_from_camera, time).matrix3;
        let scale = m.x_axis.cross(m.y_axis).length();
        (self.pixel_area(window) * scale).sqrt()
    }
}

impl Lens {
    /// The ray through a point of the lens: all rays of one film point meet in the plane z = focal distance. `d.z` must
    /// be positive.
    #[inline]
    fn through(&self, o: Vec3, d: Vec3, u: [f32; 2]) -> (Vec3, Vec3) {
        if self.radius <= 0.0 {
            return (o, d);
        }
        let focus = o + d * (self.focal_distance / d.z);
        let on_lens = o + (sample_uniform_disk_concentric(u) * self.radius).extend(0.0);
        (on_lens, focus - on_lens)
    }
}

impl Camera {
    /// A perspective camera. `fov_degrees` is the angle of −1..1 on the screen; with the default screen window this is
    /// the field of view of the shorter axis.
    pub fn perspective(
        world_from_camera: Affine3A,
        fov_degrees: f32,
        screen_window: [f32; 4],
        resolution: [u32; 2],
        lens_radius: f32,
        focal_distance: f32,
    ) -> Self {
        let base = CameraBase::new(world_from_camera, resolution);
        let lens = Lens { radius: lens_radius, focal_distance };
        Camera::Perspective { base, screen_window, tan_half_fov: (fov_degrees.to_radians() * 0.5).tan(), lens }
    }

    /// An orthographic camera.
    pub fn orthographic(
        world_from_camera: Affine3A,
        screen_window: [f32; 4],
        resolution: [u32; 2],
        lens_radius: f32,
        focal_distance: f32,
    ) -> Self {
        let lens = Lens { radius: lens_radius, focal_distance };
        Camera::Orthographic { base: CameraBase::new(world_from_camera, resolution), screen_window, lens }
    }

    /// A camera with all directions.
    pub fn spherical(world_from_camera: Affine3A, resolution: [u32; 2], mapping: SphericalMapping) -> Self {
        Camera::Spherical { base: CameraBase::new(world_from_camera, resolution), mapping }
    }

    /// A camera with a film of the given diagonal (m) behind lenses.
    pub fn realistic(world_from_camera: Affine3A, resolution: [u32; 2], diagonal: f32, lens: LensSystem) -> Self {
        let base = CameraBase::new(world_from_camera, resolution);
        let film_size = base.resolution * (diagonal / base.resolution.length());
        Camera::Realistic { base, film_size, lens: Arc::new(lens) }
    }

    /// Sets the transforms at equidistant times 0..=1, in the time unit in which instances move from 0 to 1. The camera
    /// moves linearly between them. There must be at least one.
    #[must_use]
    pub fn moving(mut self, world_from_camera: &[Affine3A]) -> Self {
        let base = self.base_mut();
        base.world_from_camera = world_from_camera.into();
        base.first = Placement::new(&world_from_camera[0]);
        self
    }

    /// True if the camera moves, so that time matters.
    pub fn is_moving(&self) -> bool {
        self.base().world_from_camera.len() > 1
    }

    pub(super) fn base(&self) -> &CameraBase {
        match self {
            Camera::Perspective { base, .. }
            | Camera::Orthographic { base, .. }
            | Camera::Spherical { base, .. }
            | Camera::Realistic { base, .. } => base,
        }
    }

    fn base_mut(&mut self) -> &mut CameraBase {
        match self {
            Camera::Perspective { base, .. }
            | Camera::Orthographic { base, .. }
            | Camera::Spherical { base, .. }
            | Camera::Realistic { base, .. } => base,
        }
    }

    /// A batch generator of rays; `None` if the camera has a lens or moves.
    pub fn pinhole(&self) -> Option<Pinhole> {
        let Camera::Perspective { base, screen_window, tan_half_fov, lens } = self else { return None };
        let [world_from_camera] = &*base.world_from_camera else { return None };
        let pinhole = Pinhole {
            world_from_camera: world_from_camera.matrix3.into(),
            resolution: base.resolution,
            screen_window: *screen_window,
            tan_half_fov: *tan_half_fov,
            pixel_area: base.pixel_area(screen_window),
            origin: world_from_camera.transform_point3(Vec3::ZERO),
        };
        (lens.radius <= 0.0).then_some(pinhole)
    }

    /// The ray of the raster point `film_xy`, through the point `u_lens` of the lens, at `time` (0 to 1).
    #[inline]
    pub fn ray(&self, film_xy: Vec2, u_lens: [f32; 2], time: f32) -> CameraRay {
        match self {
            Camera::Perspective { base, screen_window, tan_half_fov, lens } => {
                let d = (base.screen_point(screen_window, film_xy) * *tan_half_fov).extend(1.0);
                let (o, through) = lens.through(Vec3::ZERO, d, u_lens);
                let spread = base.perspective_spread(screen_window, *tan_half_fov, 1.0 / d.length());
                CameraRay { ray: base.ray(o, through, time), spread, width0: 0.0, weight: 1.0 }
            }
            Camera::Orthographic { base, screen_window, lens } => {
                let o = base.screen_point(screen_window, film_xy).extend(0.0);
                let (o, d) = lens.through(o, Vec3::Z, u_lens);
                let width0 = base.parallel_width(screen_window, time);
                CameraRay { ray: base.ray(o, d, time), spread: 0.0, width0, weight: 1.0 }
            }
            Camera::Spherical { base, mapping } => {
                let p = film_xy / base.resolution;
                let d = match mapping {
                    SphericalMapping::EquiRectangular => lat_long_to_sphere(p),
                    SphericalMapping::EqualArea => equal_area_square_to_sphere(wrap_equal_area_square(p)),
                };
                let spread = base.spherical_spread(*mapping, d.truncate().length());
                let d = Vec3::new(d.x, d.z, d.y);
                CameraRay { ray: base.ray(Vec3::ZERO, d, time), spread, width0: 0.0, weight: 1.0 }
            }
            Camera::Realistic { base, film_size, lens } => {
                // The image on the film is upside down and mirrored: its upper left corner is at the lower right
                let p = (film_xy / base.resolution - 0.5) * *film_size * Vec2::new(-1.0, 1.0);
                let s = lens.sample(p, u_lens);
                let spread = lens.spread(p) * film_size.x / base.resolution.x;
                CameraRay { ray: base.ray(s.o, s.d, time), spread, width0: 0.0, weight: s.weight }
            }
        }
    }
}

impl Camera {
    /// Width of a pixel (scene units) at the point `p` of world space, as seen directly by the camera at the time
    /// `time`. Points outside of the image or behind the camera use the same formula. Unlike the width along a path, it
    /// depends only on the point, so all techniques that sample a path agree on it [Pharr et al. 2023, §10.1.3].
    #[inline]
    pub fn pixel_width(&self, p: Vec3, time: f32) -> f32 {
        // Distance and direction from the camera
        let base = self.base();
        let placement = base.placement(time);
        let d = p - placement.origin;
        let distance = d.length();
        if !(distance > 0.0) {
            return 0.0;
        }

        // Width = distance × spread of the camera in this direction
        let cos_to = |axis: Vec3| (d.dot(axis) / distance).abs();
        match self {
            Camera::Perspective { base, screen_window, tan_half_fov, .. } => {
                base.perspective_spread(screen_window, *tan_half_fov, cos_to(placement.forward)) * distance
            }
            Camera::Orthographic { base, screen_window, .. } => base.parallel_width(screen_window, time),
            Camera::Spherical { base, mapping } => {
                let sin = (1.0 - cos_to(placement.up).powi(2)).max(0.0).sqrt();
                base.spherical_spread(*mapping, sin) * distance
            }
            Camera::Realistic { base, film_size, lens } => {
                lens.spread_towards(cos_to(placement.forward)) * film_size.x / base.resolution.x * distance
            }
        }
    }

    /// True if the camera supports [`Self::project`].
    pub fn projects(&self) -> bool {
        matches!(self, Camera::Perspective { .. })
    }

    /// Projects the point `p` of world space through the point `u_lens` of the lens at `time` (0 to 1), onto the film
    /// or beyond its edges. `None` for points behind the camera, and for cameras that are not perspective.
    pub fn project(&self, p: Vec3, u_lens: [f32; 2], time: f32) -> Option<Projection> {
        let Camera::Perspective { base, screen_window, tan_half_fov, lens } = self else { return None };
        let world_from_camera = transform_at(&base.world_from_camera, time);
        let on_lens = if lens.radius > 0.0 { sample_uniform_disk_concentric(u_lens) * lens.radius } else { Vec2::ZERO };
        let on_lens = on_lens.extend(0.0);
        let d = world_from_camera.inverse().transform_point3(p) - on_lens;
        if !(d.z > 0.0) {
            return None;
        }

        // All rays of a film point meet in the focus plane
        let distance = if lens.radius > 0.0 { lens.focal_distance } else { 1.0 };
        let focus = on_lens + d * (distance / d.z);
        let screen = focus.truncate() / (distance * *tan_half_fov);
        let [x0, x1, y0, y1] = *screen_window;
        let film_xy = Vec2::new((screen.x - x0) / (x1 - x0), (y1 - screen.y) / (y1 - y0)) * base.resolution;

        // Chain of area ratios: solid angle in world space, in camera space, focus plane, film
        let direction = d.normalize();
        let stretched = world_from_camera.transform_vector3(direction).length();
        let solid_angle = stretched.powi(3) / world_from_camera.matrix3.determinant().abs();
        let area = (focus - on_lens).length_squared() / direction.z;
        let pixel = base.pixel_area(screen_window) * (distance * *tan_half_fov).powi(2);
        let density = solid_angle * area / pixel;
        density.is_finite().then(|| Projection { film_xy, o: world_from_camera.transform_point3(on_lens), density })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use lumiris_lanes::camera::PinholeRays;
    use lumiris_numbers::math::warp::invert_uniform_disk_concentric;
    use lumiris_test_support::assert_chi_squared;
    use lumiris_test_support::random::{RngExt, pcg32};

    const PINHOLE: Lens = Lens { radius: 0.0, focal_distance: 1e6 };

    fn orthographic(placement: Affine3A, window: [f32; 4], lens: Lens) -> Camera {
        Camera::orthographic(placement, window, [200, 100], lens.radius, lens.focal_distance)
    }

    fn near(a: Vec3, b: Vec3) {
        assert!((a - b).length() < 1e-5, "{a} {b}");
    }

    fn perspective(placement: Affine3A, fov: f32, lens: Lens) -> Camera {
        Camera::perspective(placement, fov, default_screen_window(2.0), [200, 100], lens.radius, lens.focal_distance)
    }

    #[test]
    fn perspective_rays_are_those_of_trigonometry() {
        let camera = perspective(Affine3A::IDENTITY, 60.0, PINHOLE);
        let d = |x, y| camera.ray(Vec2::new(x, y), [0.5; 2], 0.5).ray.d;
        near(d(100.0, 50.0), Vec3::Z);
        let t = 30.0_f32.to_radians().tan();
        near(d(100.0, 0.0), Vec3::new(0.0, t, 1.0).normalize());
        near(d(0.0, 0.0), Vec3::new(-2.0 * t, t, 1.0).normalize());
        near(d(200.0, 100.0), Vec3::new(2.0 * t, -t, 1.0).normalize());
        // The field of view is measured along the shorter axis.
        let angle = d(100.0, 0.0).angle_between(d(100.0, 100.0)).to_degrees();
        assert!((angle - 60.0).abs() < 1e-3, "{angle}");
        let tall = Camera::perspective(Affine3A::IDENTITY, 60.0, default_screen_window(0.5), [50, 100], 0.0, 1e6);
        let d = |x, y| tall.ray(Vec2::new(x, y), [0.5; 2], 0.5).ray.d;
        assert!((d(0.0, 50.0).angle_between(d(50.0, 50.0)).to_degrees() - 60.0).abs() < 1e-3);
        // An off-centre window.
        let shifted = Camera::perspective(Affine3A::IDENTITY, 90.0, [0.0, 1.0, 0.0, 1.0], [10, 10], 0.0, 1e6);
        near(shifted.ray(Vec2::new(0.0, 10.0), [0.5; 2], 0.0).ray.d, Vec3::Z);
    }

    #[test]
    fn points_of_rays_are_seen_where_the_rays_come_from() {
        use lumiris_numbers::math::Quat;
        let rotated = Affine3A::from_rotation_translation(Quat::from_rotation_y(0.7), Vec3::ONE);
        let stretched = rotated * Affine3A::from_scale(Vec3::new(-2.0, 1.0, 0.7));
        for (placement, radius) in [(rotated, 0.0), (rotated, 0.2), (stretched, 0.0), (stretched, 0.1)] {
            let camera = Camera::perspective(placement, 50.0, [-1.5, 2.0, -1.0, 0.9], [200, 100], radius, 3.0);
            for (film, u) in [([3.0, 5.0], [0.1, 0.9]), ([150.0, 70.0], [0.6, 0.3]), ([-7.0, 104.0], [0.5, 0.5])] {
                let film = Vec2::from(film);
                let at = |film| camera.ray(film, u, 0.5).ray;
                let (ray, t) = (at(film), 4.5);
                let seen = camera.project(ray.at(t), u, 0.5).unwrap();
                assert!((seen.film_xy - film).length() < 1e-2, "{} {film}", seen.film_xy);
                near(seen.o, ray.o);
                // The solid angle of a square of the film, by its edges
                let h = 0.25;
                let side = |d: Vec2| at(film + d * h).d - at(film - d * h).d;
                let solid_angle = side(Vec2::X).cross(side(Vec2::Y)).length();
                let expected = 4.0 * h * h / solid_angle;
                assert!((seen.density / expected - 1.0).abs() < 2e-3, "{} {expected}", seen.density);
                assert!(camera.project(ray.at(-t), u, 0.5).is_none());
            }
        }
    }

    #[test]
    fn pixels_are_as_wide_at_a_point_as_along_the_ray_that_sees_it() {
        use lumiris_numbers::math::Quat;
        let placement = Affine3A::from_rotation_translation(Quat::from_rotation_y(0.7), Vec3::ONE);
        let spherical = |mapping| Camera::spherical(placement, [200, 100], mapping);
        for camera in [
            perspective(placement, 100.0, PINHOLE),
            orthographic(placement * Affine3A::from_scale(Vec3::new(-2.0, 1.0, 1.0)), [-2.0, 2.0, -1.0, 1.0], PINHOLE),
            spherical(SphericalMapping::EquiRectangular),
            spherical(SphericalMapping::EqualArea),
        ] {
            for (film, t) in [([3.0, 5.0], 0.5), ([150.0, 70.0], 4.0), ([100.0, 50.0], 1e4)] {
                let CameraRay { ray, spread, width0, .. } = camera.ray(Vec2::from(film), [0.5; 2], 0.5);
                let width = camera.pixel_width(ray.at(t), ray.time);
                let along = width0 + spread * t;
                assert!((width / along - 1.0).abs() < 2e-3, "{camera:?} {film:?} {t}: {width} {along}");
            }
            let behind = camera.pixel_width(Vec3::ONE - placement.transform_vector3(Vec3::Z), 0.5);
            assert!(behind > 0.0 && behind < 1.0 && camera.pixel_width(Vec3::ONE, 0.5).is_finite());
        }
    }

    #[test]
    fn many_rays_of_a_pinhole_are_single_rays() {
        let placement =
            Affine3A::from_rotation_translation(lumiris_numbers::math::Quat::from_rotation_y(0.7), Vec3::ONE);
        let camera = Camera::perspective(placement, 50.0, [-1.5, 2.0, -1.0, 0.9], [200, 100], 0.0, 1e6);
        let pinhole = camera.pinhole().unwrap();
        let (x, y): (Vec<f32>, Vec<f32>) = (0..64).map(|i| (i as f32 * 3.3 - 1.0, i as f32 * 1.7)).unzip();
        let (mut d, mut spread) = ([0, 1, 2].map(|_| vec![0.0; 64]), vec![0.0; 64]);
        let mut rays = PinholeRays { d: d.each_mut().map(|d| &mut d[..]), spread: &mut spread };
        pinhole.rays(lumiris_lanes::level(), [&x, &y], &mut rays);
        for i in 0..64 {
            let single = camera.ray(Vec2::new(x[i], y[i]), [0.5; 2], 0.0);
            near(Vec3::new(d[0][i], d[1][i], d[2][i]), single.ray.d);
            assert!(pinhole.origin == single.ray.o && (spread[i] - single.spread).abs() < 1e-6 * single.spread);
        }
        let lens = Lens { radius: 0.3, focal_distance: 4.0 };
        assert!(perspective(placement, 50.0, lens).pinhole().is_none());
        assert!(orthographic(placement, [-2.0, 2.0, -1.0, 1.0], PINHOLE).pinhole().is_none());
    }

    #[test]
    fn placements_move_and_mirror() {
        let mirror =
            Affine3A::from_translation(Vec3::new(1.0, 2.0, 3.0)) * Affine3A::from_scale(Vec3::new(-1.0, 1.0, 1.0));
        let a = perspective(mirror, 40.0, PINHOLE);
        let b = perspective(Affine3A::IDENTITY, 40.0, PINHOLE);
        let p = Vec2::new(30.0, 20.0);
        let (ra, rb) = (a.ray(p, [0.5; 2], 0.5), b.ray(p, [0.5; 2], 0.5));
        near(ra.ray.d, rb.ray.d * Vec3::new(-1.0, 1.0, 1.0));
        near(ra.ray.o, Vec3::new(1.0, 2.0, 3.0));
        assert_eq!((ra.spread, ra.weight), (rb.spread, 1.0));
    }

    #[test]
    fn spreads_are_the_angles_of_pixels() {
        let mut stream = pcg32([4, 4, 4]);
        let spherical = |mapping| Camera::spherical(Affine3A::IDENTITY, [200, 100], mapping);
        for camera in [
            perspective(Affine3A::IDENTITY, 100.0, PINHOLE),
            spherical(SphericalMapping::EquiRectangular),
            spherical(SphericalMapping::EqualArea),
        ] {
            for _ in 0..100 {
                let u = stream.random::<[f32; 2]>();
                let p = Vec2::new(10.0 + u[0] * 75.0, 5.0 + u[1] * 40.0);
                let d = |x, y| camera.ray(p + Vec2::new(x, y), [0.5; 2], 0.5).ray.d.as_dvec3();
                let h = 0.25;
                let solid_angle = (d(h, 0.0) - d(-h, 0.0)).cross(d(0.0, h) - d(0.0, -h)).length() / 0.25;
                let spread = f64::from(camera.ray(p, [0.5; 2], 0.5).spread);
                assert!((spread / solid_angle.sqrt() - 1.0).abs() < 0.02, "{camera:?} {p} {spread}");
            }
        }
        let ortho = orthographic(Affine3A::from_scale(Vec3::splat(3.0)), [-2.0, 2.0, -1.0, 1.0], PINHOLE);
        let r = |x| ortho.ray(Vec2::new(x, 10.0), [0.5; 2], 0.5);
        assert!((r(10.0).width0 - (r(11.0).ray.o - r(10.0).ray.o).length()).abs() < 1e-5 && r(10.0).spread == 0.0);
    }

    #[test]
    fn rays_through_the_lens_meet_in_the_plane_of_focus() {
        let lens = Lens { radius: 0.3, focal_distance: 4.0 };
        let placement =
            Affine3A::from_rotation_translation(lumiris_numbers::math::Quat::from_rotation_y(0.7), Vec3::ONE);
        let inverse = placement.inverse();
        let ortho = orthographic(placement, default_screen_window(2.0), lens);
        for (camera, pinhole) in [
            (perspective(placement, 50.0, lens), perspective(placement, 50.0, PINHOLE)),
            (ortho, orthographic(placement, default_screen_window(2.0), PINHOLE)),
        ] {
            let mut stream = pcg32([5, 4, 4]);
            let mut observed = vec![0.0; 64];
            for i in 0..20_000 {
                let p = Vec2::new(i as f32 * 0.01, 30.0);
                let at_focus = |ray: &Ray| {
                    let o = inverse.transform_point3(ray.o);
                    let d = inverse.transform_vector3(ray.d);
                    o + d * ((4.0 - o.z) / d.z)
                };
                let ray = camera.ray(p, stream.random::<[f32; 2]>(), 0.5).ray;
                let center = pinhole.ray(p, [0.5; 2], 0.5).ray;
                assert!((at_focus(&ray) - at_focus(&center)).length() < 1e-4);
                let on_lens = inverse.transform_point3(ray.o) - inverse.transform_point3(center.o);
                assert!(on_lens.z.abs() < 1e-5 && on_lens.length() <= 0.3001);
                let u = invert_uniform_disk_concentric(on_lens.truncate() / 0.3);
                let cell = u.map(|x| ((x * 8.0).max(0.0) as usize).min(7));
                observed[cell[1] * 8 + cell[0]] += 1.0;
            }
            assert_chi_squared(&observed, &[20_000.0 / 64.0; 64], 1e-5);
        }
    }

    #[test]
    fn lens_points_are_uniform_in_rings_and_sectors() {
        let camera = perspective(Affine3A::IDENTITY, 50.0, Lens { radius: 2.0, focal_distance: 4.0 });
        let mut stream = pcg32([6, 4, 4]);
        let mut observed = vec![0.0; 80];
        for _ in 0..40_000 {
            let o = camera.ray(Vec2::new(100.0, 50.0), stream.random::<[f32; 2]>(), 0.5).ray.o / 2.0;
            let ring = ((o.length_squared() * 5.0) as usize).min(4);
            let sector = ((lumiris_numbers::math::warp::azimuth(o) / (2.0 * PI) * 16.0) as usize).min(15);
            observed[ring * 16 + sector] += 1.0;
        }
        assert_chi_squared(&observed, &[500.0; 80], 1e-5);
    }

    #[test]
    fn orthographic_rays_are_parallel() {
        let camera = orthographic(Affine3A::IDENTITY, [-2.0, 2.0, -1.0, 1.0], PINHOLE);
        let r = |x, y| camera.ray(Vec2::new(x, y), [0.5; 2], 0.5).ray;
        near(r(0.0, 0.0).o, Vec3::new(-2.0, 1.0, 0.0));
        near(r(200.0, 100.0).o, Vec3::new(2.0, -1.0, 0.0));
        near(r(17.0, 3.0).d, Vec3::Z);
    }

    #[test]
    fn spherical_cameras_look_everywhere_with_y_up() {
        let camera = |mapping| Camera::spherical(Affine3A::IDENTITY, [100, 100], mapping);
        let d = |mapping, x, y| camera(mapping).ray(Vec2::new(x, y), [0.5; 2], 0.5).ray.d;
        use SphericalMapping::{EqualArea, EquiRectangular};
        near(d(EquiRectangular, 10.0, 0.0), Vec3::Y);
        near(d(EquiRectangular, 0.0, 50.0), Vec3::X);
        near(d(EquiRectangular, 25.0, 50.0), Vec3::Z);
        near(d(EquiRectangular, 50.0, 50.0), -Vec3::X);
        near(d(EqualArea, 50.0, 50.0), Vec3::Y);
        near(d(EqualArea, 100.0, 50.0), Vec3::X);
        near(d(EqualArea, 50.0, 100.0), Vec3::Z);
        // Filters extend over the edge.
        assert!((d(EqualArea, -0.5, 20.0) - d(EqualArea, 0.5, 80.0)).length() < 1e-5);
    }

    #[test]
    fn a_moving_camera_is_where_its_time_says() {
        let samples = [0.0, 1.0, 4.0].map(|x| Affine3A::from_translation(Vec3::X * x));
        let camera = perspective(Affine3A::IDENTITY, 50.0, PINHOLE);
        assert!(!camera.is_moving() && camera.pinhole().is_some());
        let camera = camera.moving(&samples);
        assert!(camera.is_moving() && camera.pinhole().is_none());
        let o = |u| camera.ray(Vec2::new(100.0, 50.0), [0.5; 2], u).ray.o;
        near(o(0.0), Vec3::ZERO);
        near(o(0.5), Vec3::X);
        near(o(0.75), Vec3::X * 2.5);
        near(o(1.0), Vec3::X * 4.0);
        assert_eq!(camera.ray(Vec2::ZERO, [0.5; 2], 0.75).ray.time, 0.75);
    }
}
