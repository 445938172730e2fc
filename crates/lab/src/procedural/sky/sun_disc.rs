//! The disc of the sun.

use super::spectrum::{self, BANDS, Spectrum, color};
use lumiris_numbers::math::Rgb;
use std::f32::consts::PI;

/// The disc of the sun, darker towards the rim.
pub(super) struct SunDisc {
    pub(super) radius: f32,
    sin_radius: f32,
    /// Radiance by distance from the centre, 0..=1, in equal steps of its square.
    pub(super) profile: Vec<Rgb>,
}

impl SunDisc {
    /// A disc with the irradiance `beam`.
    pub(super) fn new(beam: &Spectrum, weights: &[Rgb; BANDS], radius: f32) -> Self {
        // ∫ (1 − s)^(α/2) ds over s = (sin γ/sin a)² is 2/(α + 2), and dω = π sin² a ds up to cos γ, which is included
        // in the radiance: the irradiance of a surface facing the sun is then exact.
        let sin_radius = radius.sin();
        let entries = 256;
        let profile = (0..=entries).map(|i| {
            let s = i as f32 / entries as f32;
            let light = std::array::from_fn(|b| {
                let alpha = -0.023 + 292.0 / spectrum::wavelength(b);
                beam[b] * (1.0 - s).powf(0.5 * alpha) * (0.5 * alpha + 1.0) / (PI * sin_radius * sin_radius)
            });
            color(&light, weights)
        });
        SunDisc { radius, sin_radius, profile: profile.collect() }
    }

    /// Radiance at an angle from the centre, given by its sine and cosine.
    pub(super) fn radiance(&self, sin: f32, cos: f32) -> Rgb {
        let s = (sin / self.sin_radius).powi(2);
        if cos <= 0.0 || s >= 1.0 {
            return Rgb::BLACK;
        }
        let x = s * (self.profile.len() - 1) as f32;
        let i = (x as usize).min(self.profile.len() - 2);
        self.profile[i].lerp(self.profile[i + 1], x - i as f32)
    }
}
