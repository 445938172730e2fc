//! The procedural cloud of pbrt-v4: gradient noise of five frequencies at positions displaced by noise. Its density
//! decreases with height.

use lumiris_numbers::math::noise::{gradient, noise};
use lumiris_numbers::math::{DVec3, Rgb};

/// A cloud in its own space, where y is the height: dense below 0, and empty above 1.
#[derive(Clone, Copy, Debug)]
pub struct Cloud {
    /// Absorption where the density is 1 (1/m).
    pub sigma_a: Rgb,
    /// Scattering where the density is 1 (1/m).
    pub sigma_s: Rgb,
    /// Factor of the noise.
    pub density: f32,
    /// Displacement of the positions.
    pub wispiness: f32,
    /// Frequency of the noise (1/unit).
    pub frequency: f32,
}

/// Ratio of successive noise frequencies: not quite 2, so that the lattices have no points in common.
const OCTAVE: f32 = 1.99;

impl Cloud {
    /// Density at a point, 0..=1.
    pub fn density_at(&self, p: DVec3) -> f32 {
        // Displace the position
        let mut place = p * f64::from(self.frequency);
        if self.wispiness > 0.0 {
            let (mut amplitude, mut frequency) = (0.05 * self.wispiness, 10.0);
            for _ in 0..2 {
                place += (gradient(place * f64::from(frequency)) * amplitude).as_dvec3();
                amplitude *= 0.5;
                frequency *= OCTAVE;
            }
        }

        // Add up noise
        let (mut sum, mut amplitude, mut frequency) = (0.0, 0.5, 1.0);
        for _ in 0..5 {
            sum += amplitude * noise(place * f64::from(frequency));
            amplitude *= 0.5;
            frequency *= OCTAVE;
        }
        let height = p.y as f32;
        let wisps = ((1.0 - height) * 4.5 * self.density * sum).clamp(0.0, 1.0);
        (wisps + 2.0 * (0.5 - height).max(0.0)).clamp(0.0, 1.0)
    }
}
