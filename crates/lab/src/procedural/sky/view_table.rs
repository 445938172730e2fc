//! A table of the light scattered to the viewer.

use super::atmosphere::{Atmosphere, Scattered};
use super::spectrum::Spectrum;
use lumiris_numbers::math::Vec3;
use rayon::prelude::*;
use std::f32::consts::{FRAC_PI_2, PI};

/// View rays of the table over elevations (both sides of the horizon) and azimuths from the sun.
const TABLE: [usize; 2] = [96, 48];

/// Scattered light of all view rays, by elevation and azimuth from the sun.
pub(super) fn view_table(atmosphere: &Atmosphere, mu_s: f32) -> Vec<Scattered> {
    let entry = |i: usize| {
        let x = 2.0 * (i / TABLE[1]) as f32 / (TABLE[0] - 1) as f32 - 1.0;
        // The horizon has a sky side and a ground side; entries are close to it on both sides.
        let elevation = FRAC_PI_2 * x.abs() * x;
        let phi = PI * (i % TABLE[1]) as f32 / (TABLE[1] - 1) as f32;
        let (mu, r) = (elevation.sin(), elevation.cos());
        let nu = (mu * mu_s + r * (1.0 - mu_s * mu_s).max(0.0).sqrt() * phi.cos()).clamp(-1.0, 1.0);
        atmosphere.scattered(mu, mu_s, nu)
    };
    (0..TABLE[0] * TABLE[1]).into_par_iter().map(entry).collect()
}

/// The table at a direction.
pub(super) fn lookup(views: &[Scattered], w: Vec3, to_sun: Vec3) -> Scattered {
    let elevation = w.z.atan2(w.truncate().length()) / FRAC_PI_2;
    let x = (0.5 + 0.5 * elevation.abs().sqrt().copysign(elevation)) * (TABLE[0] - 1) as f32;
    let (a, b) = (w.truncate(), to_sun.truncate());
    let phi = a.perp_dot(b).abs().atan2(a.dot(b));
    let y = phi / PI * (TABLE[1] - 1) as f32;
    // No interpolation across the horizon: the two rows next to it are extrapolated.
    let (above, middle) = (w.z > 0.0, TABLE[0] / 2);
    let i = if above { (x as usize).clamp(middle, TABLE[0] - 2) } else { (x as usize).min(middle - 2) };
    let j = (y as usize).min(TABLE[1] - 2);
    let (fx, fy) = ((x - i as f32).clamp(0.0, 1.0), y - j as f32);
    let mix = |get: fn(&Scattered) -> &Spectrum| -> Spectrum {
        let at = |i: usize, j: usize| get(&views[i * TABLE[1] + j]);
        let rows = [(at(i, j), at(i, j + 1)), (at(i + 1, j), at(i + 1, j + 1))];
        std::array::from_fn(|k| {
            let [low, high] = rows.map(|(a, b)| a[k] + (b[k] - a[k]) * fy);
            low + (high - low) * fx
        })
    };
    Scattered {
        air: mix(|s| &s.air),
        haze: mix(|s| &s.haze),
        multiple: mix(|s| &s.multiple),
        transmittance: mix(|s| &s.transmittance),
    }
}
