//! A layer of broken clouds: optical depths by noise, illumination by the optical depth towards the sun.
//!
//! The layer is evaluated at the intersection of the view ray with a plane at unit height. With τ the optical depth of
//! the view ray and τₛ the optical depth towards the sun inside the layer, a cloud has the radiance (1 − e^(−τ)) (E (a
//! p(γ) e^(−τₛ) + b/(1 + τₛ)) + S): light of single forward scattering, diffuse light of multiple scattering, and
//! skylight S. The background is attenuated by e^(−τ). Clouds fade into the air at the horizon.

use crate::procedural::gradient_noise::{fractal, noise, smoothstep};
use lumiris_numbers::math::{Rgb, Vec2, Vec3};
use std::f32::consts::PI;

/// Maximum optical depth of the layer, seen from below.
const THICKNESS: f32 = 9.0;
/// Steps towards the sun.
const STEPS: usize = 5;

/// A layer of clouds.
pub struct Clouds {
    threshold: f32,
    seed: u32,
    to_sun: Vec3,
    /// Irradiance of a surface facing the sun.
    beam: Rgb,
    /// Mean radiance of the sky.
    sky: Rgb,
}

/// Forward scattering of droplets (1/sr) [Henyey and Greenstein 1941].
fn phase(cos: f32) -> f32 {
    let g = 0.85_f32;
    let base = (1.0 + g * g - 2.0 * g * cos).max(1e-6);
    (1.0 - g * g) / (4.0 * PI * base * base.sqrt())
}

impl Clouds {
    /// Clouds that cover about the fraction `cover` of the sky.
    pub fn new(cover: f32, seed: u32, to_sun: Vec3, beam: Rgb, sky: Rgb) -> Self {
        // The noise is approximately normal, with a standard deviation of about 0.2.
        let threshold = if cover >= 1.0 { -1.0 } else { 0.45 * (0.5 - cover) };
        Clouds { threshold, seed, to_sun, beam, sky }
    }

    /// Optical depth of the layer at a point of the plane.
    fn depth(&self, p: Vec2) -> f32 {
        let q = Vec3::new(p.x, p.y, 0.37) * 1.3;
        let drift = noise(q * 0.6 + 3.7, self.seed.wrapping_add(50));
        let n = fractal(q + drift * 0.7, 6, self.seed) + 0.12 * drift;
        THICKNESS * smoothstep(self.threshold, self.threshold + 0.42, n)
    }

    /// The clouds in the direction `w` (up) in front of `behind`; `air` is the colour that they fade to at a distance.
    pub fn over(&self, w: Vec3, behind: Rgb, air: Rgb) -> Rgb {
        let p = w.truncate() / w.z.max(0.02);
        let depth = self.depth(p) * smoothstep(0.03, 0.2, w.z);
        if depth <= 0.0 {
            return behind;
        }
        // The path to the sun leaves the layer after about half its thickness.
        let step = self.to_sun.truncate() * (0.4 / STEPS as f32 / self.to_sun.z.max(0.25));
        let to_sun = (1..=STEPS).map(|i| self.depth(p + step * i as f32)).sum::<f32>() * (0.45 / STEPS as f32);
        let light = self.beam * (0.6 * phase(w.dot(self.to_sun)) * (-to_sun).exp() + 0.3 / (1.0 + 0.8 * to_sun))
            + self.sky * 0.8;
        let through = (-depth).exp();
        let cloud = behind * through + light * (1.0 - through);
        let near = smoothstep(0.0, 0.3, w.z);
        // Distant clouds take the colour of the air but still occlude the sun.
        (air * (1.0 - through) + behind * through).lerp(cloud, near)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cover_grows_with_its_parameter() {
        let part = |cover: f32| {
            let clouds = Clouds::new(cover, 3, Vec3::Z, Rgb::WHITE, Rgb::WHITE);
            let n = 60;
            let place = |i: usize| Vec2::new((i % n) as f32, (i / n) as f32) * 0.31;
            (0..n * n).filter(|&i| clouds.depth(place(i)) > 1.0).count() as f32 / (n * n) as f32
        };
        let parts = [0.1, 0.5, 0.9, 1.0].map(part);
        assert!(parts.windows(2).all(|p| p[0] < p[1]), "{parts:?}");
        assert!(parts[0] < 0.2 && (0.2..0.8).contains(&parts[1]) && parts[3] > 0.95, "{parts:?}");
    }
}
