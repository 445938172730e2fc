//! Rays of a perspective camera, many at once.

use super::lane::{F, LANES, Vec3s, load, store};
use fearless_simd::{Level, Simd, dispatch, prelude::*};
use lumiris_numbers::math::{Mat3, Vec2, Vec3};

/// A perspective camera without a lens.
#[derive(Clone, Copy, Debug)]
pub struct Pinhole {
    /// Matrix from camera space to world space for directions.
    pub world_from_camera: Mat3,
    /// Size of the image in pixels.
    pub resolution: Vec2,
    /// Screen window: x min, x max, y min, y max.
    pub screen_window: [f32; 4],
    /// Half-width of the image plane z = 1 that corresponds to one screen unit.
    pub tan_half_fov: f32,
    /// Area of a pixel on the screen.
    pub pixel_area: f32,
    /// Origin of all rays in world space.
    pub origin: Vec3,
}

/// Rays of a [`Pinhole`]. Slices have the same length, a multiple of [`LANES`].
#[derive(Debug)]
pub struct PinholeRays<'a> {
    /// Unit directions.
    pub d: [&'a mut [f32]; 3],
    /// Growth of the pixel footprint's width per unit length.
    pub spread: &'a mut [f32],
}

impl Pinhole {
    /// The rays through the raster points `film`.
    pub fn rays(&self, level: Level, film: [&[f32]; 2], out: &mut PinholeRays<'_>) {
        dispatch!(level, simd => self.rays_lanes(simd, film, out));
    }

    #[inline(always)]
    fn rays_lanes<S: Simd>(&self, simd: S, film: [&[f32]; 2], out: &mut PinholeRays<'_>) {
        let (one, [x0, x1, y0, y1]) = (F::splat(simd, 1.0), self.screen_window);
        for i in (0..out.spread.len()).step_by(LANES) {
            let x = (load(simd, film[0], i) / self.resolution.x * (x1 - x0) + x0) * self.tan_half_fov;
            let y = (-(load(simd, film[1], i) / self.resolution.y * (y1 - y0)) + y1) * self.tan_half_fov;
            let d = Vec3s { x, y, z: one };
            // A pixel of area a on the plane z = 1 subtends a·cos³θ
            let cos = one / d.dot(d).sqrt();
            store((cos * self.pixel_area).sqrt() * cos * self.tan_half_fov, out.spread, i);
            let d = d.transformed(&self.world_from_camera);
            d.times(one / d.dot(d).sqrt()).store(&mut out.d, i);
        }
    }
}
