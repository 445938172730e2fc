//! The environment map.

use super::atmosphere::{Atmosphere, Scattered, phase_air, phase_haze};
use super::clouds::Clouds;
use super::options::SkyOptions;
use super::spectrum::{self, BANDS, Spectrum, color, color_weights};
use super::sun_disc::SunDisc;
use super::view_table::{lookup, view_table};
use lumiris::imaging::Image;
use lumiris_numbers::math::sphere_map::equal_area_square_to_sphere;
use lumiris_numbers::math::{Rgb, Vec2, Vec3};
use rayon::prelude::*;
use std::f32::consts::{FRAC_PI_2, PI, TAU};

/// Angular radius of the sun (radians).
const SUN_RADIUS: f32 = 0.2665 / 180.0 * PI;
/// Points across a texel that the sun may overlap.
const SUN_SAMPLES: usize = 64;
/// The environment map: channels R, G, B, linear Rec.709.
///
/// Returns `Err` with a message if an option is out of range.
pub fn sky(options: &SkyOptions) -> Result<Image, String> {
    options.check()?;
    let sky = Sky::new(options);
    let n = options.resolution;
    let rows: Vec<Vec<Rgb>> = (0..n).into_par_iter().map(|y| (0..n).map(|x| sky.texel(x, y)).collect()).collect();

    // Irradiance of a horizontal surface: texels have equal solid angles.
    let mut irradiance = 0.0_f64;
    for (y, row) in rows.iter().enumerate() {
        for (x, texel) in row.iter().enumerate() {
            let cos = direction(x as f32 + 0.5, y as f32 + 0.5, n).z.max(0.0);
            irradiance += f64::from(texel.luminance() * cos) * f64::from(2.0 * TAU) / (n * n) as f64;
        }
    }
    let scale = (f64::from(options.irradiance) / irradiance.max(1e-30)) as f32;
    let mut image = Image::new(n, n, &["R", "G", "B"]);
    image.data = rows.iter().flatten().flat_map(|c| c.to_array()).map(|v| v * scale).collect();
    Ok(image)
}

/// Direction of a position in the image, in texels.
fn direction(x: f32, y: f32, resolution: usize) -> Vec3 {
    equal_area_square_to_sphere(Vec2::new(x, y) / resolution as f32)
}

/// Data for the texels.
struct Sky {
    resolution: usize,
    to_sun: Vec3,
    weights: [Rgb; BANDS],
    sun: Spectrum,
    sun_disc: SunDisc,
    views: Vec<Scattered>,
    ground: Rgb,
    clouds: Option<Clouds>,
}

impl Sky {
    fn new(options: &SkyOptions) -> Self {
        let (sin, cos) = options.elevation.sin_cos();
        let to_sun = Vec3::new(cos * options.azimuth.cos(), cos * options.azimuth.sin(), sin);
        let (sun, weights) = (spectrum::sun(), color_weights());
        let atmosphere = Atmosphere::new(options.haze, options.ground_albedo);
        let views = view_table(&atmosphere, to_sun.z);
        // Half of a sun on the horizon is above it.
        let arriving = atmosphere.sun_transmittance(to_sun.z.max(1e-3));
        let beam: Spectrum = std::array::from_fn(|b| arriving[b] * sun[b]);
        let mut sky = Sky {
            resolution: options.resolution,
            to_sun,
            weights,
            sun,
            sun_disc: SunDisc::new(&beam, &weights, options.sun_size * SUN_RADIUS),
            views,
            ground: Rgb::BLACK,
            clouds: None,
        };
        let mean = sky.irradiance_of_clear_sky() / PI;
        let beam = color(&beam, &weights);
        if options.cloud_cover > 0.0 {
            sky.clouds = Some(Clouds::new(options.cloud_cover, options.seed, to_sun, beam, mean));
        }
        sky.ground = (beam * to_sun.z + mean * PI) * (options.ground_albedo / PI);
        sky
    }

    /// Irradiance of a horizontal surface by the clear sky without the sun.
    fn irradiance_of_clear_sky(&self) -> Rgb {
        let [rows, columns] = [24, 32];
        let mut sum = Rgb::BLACK;
        for i in 0..rows * columns {
            // Uniform in sin²: cosine-weighted
            let z = (((i / columns) as f32 + 0.5) / rows as f32).sqrt();
            let (sin, cos) = (TAU * ((i % columns) as f32 + 0.5) / columns as f32).sin_cos();
            let r = (1.0 - z * z).sqrt();
            sum += self.clear(Vec3::new(r * cos, r * sin, z)) * (PI / (rows * columns) as f32);
        }
        sum
    }

    /// Radiance of the air alone.
    fn clear(&self, w: Vec3) -> Rgb {
        let view = lookup(&self.views, w, self.to_sun);
        let nu = w.dot(self.to_sun);
        let (air, haze) = (phase_air(nu), phase_haze(nu));
        let light = std::array::from_fn(|b| self.sun[b] * (view.air[b] * air + view.haze[b] * haze + view.multiple[b]));
        color(&light, &self.weights)
    }

    /// Radiance from a direction, with or without the disc of the sun.
    fn radiance(&self, w: Vec3, with_sun: bool) -> Rgb {
        let air = self.clear(w);
        if w.z <= 0.0 {
            let through = lookup(&self.views, w, self.to_sun).transmittance[BANDS / 2];
            return self.ground * through + air;
        }
        let sun = if with_sun {
            self.sun_disc.radiance(w.cross(self.to_sun).length(), w.dot(self.to_sun))
        } else {
            Rgb::BLACK
        };
        let behind = air + sun;
        match &self.clouds {
            Some(clouds) => clouds.over(w, behind, air),
            None => behind,
        }
    }

    fn texel(&self, x: usize, y: usize) -> Rgb {
        let center = direction(x as f32 + 0.5, y as f32 + 0.5, self.resolution);
        // Texels are at most about twice as long as the side of a square of the same area.
        let reach = self.sun_disc.radius + 2.0 * (2.0 * TAU).sqrt() / self.resolution as f32;
        let near_sun = center.dot(self.to_sun) > reach.min(FRAC_PI_2).cos();
        let count = if near_sun { SUN_SAMPLES } else { 2 };
        let mut sum = [0.0_f64; 3];
        for j in 0..count {
            for i in 0..count {
                let at = |base: usize, k: usize| base as f32 + (k as f32 + 0.5) / count as f32;
                let radiance = self.radiance(direction(at(x, i), at(y, j), self.resolution), near_sun);
                for (s, v) in sum.iter_mut().zip(radiance.to_array()) {
                    *s += f64::from(v);
                }
            }
        }
        Rgb::from_array(sum.map(|s| (s / (count * count) as f64) as f32))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn small() -> SkyOptions {
        SkyOptions { resolution: 64, ..SkyOptions::default() }
    }

    /// Irradiance of a surface facing the sun, by texels within 30 degrees of it.
    fn facing(image: &Image, to_sun: Vec3) -> f64 {
        let n = image.width;
        let mut sum = 0.0;
        for y in 0..n {
            for x in 0..n {
                let cos = direction(x as f32 + 0.5, y as f32 + 0.5, n).dot(to_sun);
                if cos > 0.87 {
                    let c = Rgb::new(image.get(x, y, 0), image.get(x, y, 1), image.get(x, y, 2));
                    sum += f64::from(c.luminance() * cos) * f64::from(2.0 * TAU) / (n * n) as f64;
                }
            }
        }
        sum
    }

    #[test]
    fn the_disc_sends_the_energy_of_the_beam_whatever_its_size_and_the_texels() {
        let (beam, weights) = (spectrum::sun(), color_weights());
        let expected = f64::from(color(&beam, &weights).luminance());
        for (size, resolution) in [(1.0, 64), (1.0, 500), (8.0, 128)] {
            let mut sky = Sky::new(&SkyOptions { sun_size: size, resolution, ..small() });
            sky.sun_disc = SunDisc::new(&beam, &weights, size * SUN_RADIUS);
            // The difference of maps with and without the disc
            let (mut with, mut without) = (
                Image::new(resolution, resolution, &["R", "G", "B"]),
                Image::new(resolution, resolution, &["R", "G", "B"]),
            );
            for (image, radius) in [(&mut with, 1.0), (&mut without, 0.0)] {
                sky.sun_disc.profile.iter_mut().for_each(|c| *c *= radius);
                for y in 0..resolution {
                    for x in 0..resolution {
                        if direction(x as f32 + 0.5, y as f32 + 0.5, resolution).dot(sky.to_sun) > 0.9 {
                            let c = sky.texel(x, y).to_array();
                            (0..3).for_each(|k| image.set(x, y, k, c[k]));
                        }
                    }
                }
            }
            let energy = facing(&with, sky.to_sun) - facing(&without, sky.to_sun);
            assert!((energy / expected - 1.0).abs() < 0.01, "{size} {resolution}: {}", energy / expected);
        }
    }

    #[test]
    fn a_horizontal_surface_has_the_irradiance_that_was_asked_for() {
        for cover in [0.0, 0.5] {
            let image = sky(&SkyOptions { irradiance: 2.0, cloud_cover: cover, ..small() }).unwrap();
            let mut sum = 0.0;
            for y in 0..64 {
                for x in 0..64 {
                    let cos = direction(x as f32 + 0.5, y as f32 + 0.5, 64).z.max(0.0);
                    let c = Rgb::new(image.get(x, y, 0), image.get(x, y, 1), image.get(x, y, 2));
                    assert!(c.to_array().iter().all(|v| v.is_finite() && *v >= 0.0));
                    sum += f64::from(c.luminance() * cos);
                }
            }
            assert!((sum * f64::from(2.0 * TAU) / 4096.0 - 2.0).abs() < 1e-3);
        }
    }

    #[test]
    fn the_sky_is_blue_away_from_the_sun_and_brighter_near_it() {
        let sky = Sky::new(&small());
        let away = sky.radiance(Vec3::new(0.5, 0.5, 0.7).normalize(), true);
        assert!(away.b > 1.3 * away.r, "{away:?}");
        let near = sky.radiance((sky.to_sun + Vec3::new(0.05, 0.05, 0.05)).normalize(), true);
        assert!(near.luminance() > 2.0 * away.luminance());
        let disc = sky.radiance(sky.to_sun, true);
        assert!(disc.luminance() > 1000.0 * away.luminance());
    }

    #[test]
    fn the_sky_does_not_depend_on_the_number_of_threads() {
        let make = |threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| sky(&SkyOptions { cloud_cover: 0.4, ..small() })).unwrap()
        };
        assert!(make(1) == make(3));
    }

    #[test]
    fn options_out_of_range_are_errors() {
        assert!(sky(&SkyOptions { resolution: 0, ..small() }).is_err());
        assert!(sky(&SkyOptions { haze: f32::NAN, ..small() }).is_err());
        assert!(sky(&SkyOptions { elevation: -0.1, ..small() }).is_err());
    }
}
