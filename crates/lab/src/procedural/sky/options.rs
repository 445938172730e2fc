//! Parameters of the sky.

use std::f32::consts::PI;

/// Parameters of the sky.
#[derive(Clone, Copy, Debug)]
pub struct SkyOptions {
    /// Texels on each side, 8..=8192.
    pub resolution: usize,
    /// Height of the sun above the horizon (radians), 0..=π/2.
    pub elevation: f32,
    /// Direction of the sun, from +x to +y (radians).
    pub azimuth: f32,
    /// Amount of haze: 0 none, 1 a clear day, 10 a very hazy one.
    pub haze: f32,
    /// Ratio of the sun's radius to the real one, at most 60. Its irradiance is unchanged.
    pub sun_size: f32,
    /// Reflectance of the ground, 0..=1.
    pub ground_albedo: f32,
    /// Approximate fraction of the sky covered by clouds: 0..=1.
    pub cloud_cover: f32,
    /// Irradiance of a horizontal surface (luminance); with π, a white surface has the radiance 1.
    pub irradiance: f32,
    /// Seed of the clouds.
    pub seed: u32,
}

impl Default for SkyOptions {
    fn default() -> Self {
        SkyOptions {
            resolution: 1024,
            elevation: 25.0 / 180.0 * PI,
            azimuth: 225.0 / 180.0 * PI,
            haze: 1.5,
            sun_size: 1.0,
            ground_albedo: 0.25,
            cloud_cover: 0.0,
            irradiance: PI,
            seed: 1,
        }
    }
}

impl SkyOptions {
    /// Returns `Err` with a message if a value is out of range.
    pub(super) fn check(&self) -> Result<(), String> {
        let range = |name: &str, value: f32, low: f32, high: f32| {
            if (low..=high).contains(&value) {
                return Ok(());
            }
            Err(format!("the {name} must be {low} to {high}, not {value}"))
        };
        range("resolution", self.resolution as f32, 8.0, 8192.0)?;
        range("elevation of the sun", self.elevation.to_degrees(), 0.0, 90.001)?;
        range("azimuth of the sun", self.azimuth.to_degrees(), -3600.0, 3600.0)?;
        range("haze", self.haze, 0.0, 50.0)?;
        range("size of the sun", self.sun_size, 0.1, 60.0)?;
        range("albedo of the ground", self.ground_albedo, 0.0, 1.0)?;
        range("cloud cover", self.cloud_cover, 0.0, 1.0)?;
        range("irradiance", self.irradiance, 1e-6, 1e9)
    }
}
