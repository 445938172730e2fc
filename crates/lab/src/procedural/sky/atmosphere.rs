//! Sunlight scattered by a spherical atmosphere of air, haze and ozone.
//!
//! Single scattering is integrated along the view ray [Nishita et al. 1993]: L(ω) = E ∫ T(x) T_sun(x) Σ βₖ ρₖ(h) pₖ(cos
//! γ) dx over air (Rayleigh) and haze (Cornette and Shanks), where T are the transmittances, and E is the sun's
//! irradiance outside the atmosphere. All higher orders are approximated as isotropic and uniform, by a geometric
//! series [Hillaire 2020]: they add ∫ T(x) Ψ(x) Σ βₖ ρₖ dx, Ψ = L₂/(1 − f), where L₂ is the second-order light that
//! arrives at x from all directions, and f is the fraction of an isotropic unit radiance that returns after one
//! scattering event.

use super::spectrum::{BANDS, Spectrum, table, wavelength};
use std::f32::consts::{PI, TAU};

/// Radius of the ground (km).
const GROUND: f32 = 6371.0;
/// Thickness of the atmosphere (km).
const THICKNESS: f32 = 80.0;
/// Height of the observer (km).
const OBSERVER: f32 = 0.05;
/// Scale heights of air and haze (km): the density decreases to 1/e.
const SCALE_HEIGHTS: [f32; 2] = [8.0, 1.2];
/// Asymmetry of the haze.
const ASYMMETRY: f32 = 0.76;
/// Absorption cross-section of ozone by wavelength (nm, 10⁻²⁵ m²), rounded from [Serdyuchenko et al. 2014].
const OZONE: [(f32, f32); 15] = [
    (400.0, 0.015),
    (425.0, 0.07),
    (450.0, 0.23),
    (475.0, 0.63),
    (500.0, 1.4),
    (525.0, 2.45),
    (550.0, 3.5),
    (575.0, 4.8),
    (600.0, 5.1),
    (625.0, 3.8),
    (650.0, 2.5),
    (675.0, 1.5),
    (700.0, 0.87),
    (725.0, 0.5),
    (750.0, 0.3),
];
/// Molecules of ozone where it is densest (10²⁵/m² per km): 300 Dobson units over a tent of 30 km.
const OZONE_DENSITY: f32 = 300.0 * 2.687e20 / 15.0 * 1e-25;
/// Steps of the integration along a view ray, and towards the sun.
const STEPS: [usize; 2] = [40, 16];
/// Entries of the table of Ψ over heights and over the cosine of the sun.
const TABLE: [usize; 2] = [16, 32];

/// Scattered light along a view, per unit of irradiance of the sun in each band, without the phase functions.
#[derive(Clone, Copy, Debug)]
pub struct Scattered {
    /// By air, to be multiplied by its phase function.
    pub air: Spectrum,
    /// By haze, to be multiplied by its phase function.
    pub haze: Spectrum,
    /// Of all higher orders.
    pub multiple: Spectrum,
    /// Transmittance of the whole view.
    pub transmittance: Spectrum,
}

/// An atmosphere.
pub struct Atmosphere {
    /// Scattering coefficients of air and haze at the ground (1/km).
    scattering: [Spectrum; 2],
    /// Extinction of haze at the ground, and of ozone where it is densest (1/km).
    haze_extinction: Spectrum,
    ozone: Spectrum,
    ground_albedo: f32,
    multiple: Vec<Spectrum>,
}

/// Phase function of air (1/sr) [Rayleigh 1871].
pub fn phase_air(cos: f32) -> f32 {
    3.0 / (16.0 * PI) * (1.0 + cos * cos)
}

/// Phase function of haze (1/sr) [Cornette and Shanks 1992].
pub fn phase_haze(cos: f32) -> f32 {
    let g2 = ASYMMETRY * ASYMMETRY;
    let base = (1.0 + g2 - 2.0 * ASYMMETRY * cos).max(1e-6);
    3.0 / (8.0 * PI) * (1.0 - g2) * (1.0 + cos * cos) / ((2.0 + g2) * base * base.sqrt())
}

/// Densities of air, haze and ozone at a height (km), relative to their maxima.
fn densities(height: f32) -> [f32; 3] {
    let thin = |scale: f32| (-height.max(0.0) / scale).exp();
    [thin(SCALE_HEIGHTS[0]), thin(SCALE_HEIGHTS[1]), (1.0 - (height - 25.0).abs() / 15.0).max(0.0)]
}

/// Distance from radius `r` along a direction of cosine `mu` to the sphere of `radius`: the first intersection from
/// outside, the last from inside.
fn way_to_sphere(r: f32, mu: f32, radius: f32) -> Option<f32> {
    // (radius − r)(radius + r) avoids the cancellation of radius² − r².
    let discriminant = f64::from((radius - r) * (radius + r)) + f64::from(r * mu).powi(2);
    if discriminant < 0.0 {
        return None;
    }
    let root = discriminant.sqrt();
    let near = -f64::from(r * mu) - root;
    let t = if r > radius { near } else { -f64::from(r * mu) + root };
    (t > 0.0).then_some(t as f32)
}

/// Radius after a distance `t` from radius `r` along cosine `mu`.
fn radius_at(r: f32, mu: f32, t: f32) -> f32 {
    (f64::from(r).powi(2) + f64::from(t).powi(2) + 2.0 * f64::from(r * mu) * f64::from(t)).sqrt() as f32
}

/// The local zenith cosine, at radius `r_t` after a distance `t` from radius `r`, of a direction with the zenith cosine
/// `mu_s` at the start and the cosine `nu` to the ray.
fn cosine_at(r_t: f32, r: f32, t: f32, mu_s: f32, nu: f32) -> f32 {
    ((r * mu_s + t * nu) / r_t).clamp(-1.0, 1.0)
}

/// Light along a ray.
struct March {
    scattered: Scattered,
    /// f.
    returned: Spectrum,
    /// Radiance of the sunlit ground.
    lit: Spectrum,
}

impl Atmosphere {
    /// An atmosphere. `haze` 1 is a clear day (optical depth 0.06 at 550 nm), 0 air alone; the ground is Lambertian.
    pub fn new(haze: f32, ground_albedo: f32) -> Self {
        let each = |f: &dyn Fn(f32) -> f32| -> Spectrum { std::array::from_fn(|band| f(wavelength(band))) };
        // Rayleigh's λ⁻⁴ with the dispersion of air [Bucholtz 1995]; Ångström's exponent 1.3 for haze.
        let air = each(&|l| 0.01162 * (l / 550.0).powf(-4.08));
        let haze_extinction = each(&|l| 0.05 * haze * (l / 550.0).powf(-1.3));
        let mut atmosphere = Atmosphere {
            scattering: [air, haze_extinction.map(|x| 0.93 * x)],
            haze_extinction,
            ozone: each(&|l| OZONE_DENSITY * table(&OZONE, l)),
            ground_albedo,
            multiple: Vec::new(),
        };
        atmosphere.multiple = atmosphere.multiple_table();
        atmosphere
    }

    /// Extinction at relative densities (1/km).
    fn extinction(&self, [air, haze, ozone]: [f32; 3], band: usize) -> f32 {
        self.scattering[0][band] * air + self.haze_extinction[band] * haze + self.ozone[band] * ozone
    }

    /// Transmittance from radius `r` along cosine `mu` out of the atmosphere; 0 if the ray hits the ground.
    fn transmittance(&self, r: f32, mu: f32) -> Spectrum {
        if mu < 0.0 && way_to_sphere(r, mu, GROUND).is_some() {
            return [0.0; BANDS];
        }
        let Some(way) = way_to_sphere(r, mu, GROUND + THICKNESS) else { return [1.0; BANDS] };
        let mut depth = [0.0_f32; 3];
        for i in 0..STEPS[1] {
            // Steps that increase with distance: the air is densest near the start.
            let edge = |i: usize| way * (i as f32 / STEPS[1] as f32).powi(2);
            let (low, high) = (edge(i), edge(i + 1));
            let here = densities(radius_at(r, mu, 0.5 * (low + high)) - GROUND);
            for (sum, x) in depth.iter_mut().zip(here) {
                *sum += x * (high - low);
            }
        }
        std::array::from_fn(|band| (-self.extinction(depth, band)).exp())
    }

    /// Transmittance from the observer to the sun.
    pub fn sun_transmittance(&self, mu: f32) -> Spectrum {
        self.transmittance(GROUND + OBSERVER, mu)
    }

    /// Ψ at a height and a cosine of the sun, from the table.
    fn multiple_at(&self, height: f32, mu_s: f32) -> Spectrum {
        if self.multiple.is_empty() {
            return [0.0; BANDS];
        }
        let x = (height / THICKNESS).clamp(0.0, 1.0).sqrt() * (TABLE[0] - 1) as f32;
        let y = (0.5 + 0.5 * mu_s).clamp(0.0, 1.0) * (TABLE[1] - 1) as f32;
        let (i, j) = ((x as usize).min(TABLE[0] - 2), (y as usize).min(TABLE[1] - 2));
        let (fx, fy) = (x - i as f32, y - j as f32);
        let at = |i: usize, j: usize| &self.multiple[i * TABLE[1] + j];
        std::array::from_fn(|b| {
            let row = |i: usize| at(i, j)[b] + (at(i, j + 1)[b] - at(i, j)[b]) * fy;
            row(i) + (row(i + 1) - row(i)) * fx
        })
    }

    /// Light scattered into the observer's view ray with the zenith cosine `mu`. The sun has the zenith cosine `mu_s`
    /// and the cosine `nu` to the view ray, which ends at the ground.
    pub fn scattered(&self, mu: f32, mu_s: f32, nu: f32) -> Scattered {
        self.march(GROUND + OBSERVER, mu, mu_s, nu).scattered
    }

    /// As [`scattered`](Self::scattered) from radius `r`.
    fn march(&self, r: f32, mu: f32, mu_s: f32, nu: f32) -> March {
        let zero = [0.0; BANDS];
        let mut out = Scattered { air: zero, haze: zero, multiple: zero, transmittance: [1.0; BANDS] };
        let mut returned = zero;
        let ground = if mu < 0.0 { way_to_sphere(r, mu, GROUND) } else { None };
        let way = ground.or_else(|| way_to_sphere(r, mu, GROUND + THICKNESS)).unwrap_or(0.0);
        let edge = |i: usize| way * (i as f32 / STEPS[0] as f32).powi(2);
        for i in 0..STEPS[0] {
            let (low, high) = (edge(i), edge(i + 1));
            let t = 0.5 * (low + high);
            let r_t = radius_at(r, mu, t);
            let mu_t = cosine_at(r_t, r, t, mu_s, nu);
            let here = densities(r_t - GROUND);
            let sun = self.transmittance(r_t.max(GROUND + 1e-3), mu_t);
            let multiple = self.multiple_at(r_t - GROUND, mu_t);
            for b in 0..BANDS {
                let extinction = self.extinction(here, b).max(1e-9);
                let step = (-extinction * (high - low)).exp();
                // Closed-form integral of the transmittance over the step
                let weight = out.transmittance[b] * (1.0 - step) / extinction;
                let (air, haze) = (self.scattering[0][b] * here[0], self.scattering[1][b] * here[1]);
                out.air[b] += weight * air * sun[b];
                out.haze[b] += weight * haze * sun[b];
                out.multiple[b] += weight * (air + haze) * multiple[b];
                returned[b] += weight * (air + haze);
                out.transmittance[b] *= step;
            }
        }
        let mut lit = zero;
        if let Some(t) = ground {
            let mu_t = cosine_at(radius_at(r, mu, t), r, t, mu_s, nu);
            if mu_t > 0.0 {
                let sun = self.transmittance(GROUND + 1e-3, mu_t);
                lit = std::array::from_fn(|b| self.ground_albedo / PI * mu_t * sun[b]);
            }
        }
        March { scattered: out, returned, lit }
    }

    /// Ψ for all heights and sun directions.
    fn multiple_table(&self) -> Vec<Spectrum> {
        // An entry of the table: uniform in the square root of the height and in the cosine of the sun's zenith angle
        let entry = |i: usize| {
            let height = ((i / TABLE[1]) as f32 / (TABLE[0] - 1) as f32).powi(2) * THICKNESS;
            let mu_s = 2.0 * (i % TABLE[1]) as f32 / (TABLE[1] - 1) as f32 - 1.0;
            let r = GROUND + height.clamp(0.01, THICKNESS - 0.01);
            let (mut second, mut f) = ([0.0; BANDS], [0.0; BANDS]);
            let [rows, columns] = [8, 4];

            // Averages over directions: the second order and f
            for k in 0..rows * columns {
                let mu = 2.0 * ((k / columns) as f32 + 0.5) / rows as f32 - 1.0;
                let phi = PI * ((k % columns) as f32 + 0.5) / columns as f32;
                let nu = mu * mu_s + ((1.0 - mu * mu) * (1.0 - mu_s * mu_s)).max(0.0).sqrt() * phi.cos();
                let March { scattered: s, returned, lit } = self.march(r, mu, mu_s, nu);
                for b in 0..BANDS {
                    let isotropic = (s.air[b] + s.haze[b]) / (2.0 * TAU);
                    second[b] += (isotropic + s.transmittance[b] * lit[b]) / (rows * columns) as f32;
                    f[b] += returned[b] / (rows * columns) as f32;
                }
            }

            // The geometric series over all orders
            std::array::from_fn(|b| second[b] / (1.0 - f[b].min(0.98)))
        };
        use rayon::prelude::*;
        (0..TABLE[0] * TABLE[1]).into_par_iter().map(entry).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn phase_functions_integrate_to_one() {
        for phase in [phase_air, phase_haze] {
            let n = 20_000;
            let sum: f64 = (0..n).map(|i| f64::from(phase(2.0 * (i as f32 + 0.5) / n as f32 - 1.0))).sum();
            assert!((sum / f64::from(n) * 2.0 * std::f64::consts::TAU - 1.0).abs() < 1e-4);
        }
    }

    #[test]
    fn optical_depths_are_those_of_a_clear_day() {
        let clear = Atmosphere::new(0.0, 0.0).sun_transmittance(1.0);
        // Bands 5 and 6 are green: at 550 nm the optical depth of air is about 0.095, and of ozone 0.03.
        let depth = -clear[6].ln();
        assert!((0.09..0.15).contains(&depth), "{depth}");
        let hazy = Atmosphere::new(1.0, 0.0).sun_transmittance(1.0);
        assert!((-hazy[5].ln() + clear[5].ln() - 0.062).abs() < 0.006);
        assert!(clear[0] < clear[11]);
    }

    #[test]
    fn the_zenith_is_blue_and_the_setting_sun_is_red() {
        let air = Atmosphere::new(1.0, 0.2);
        let s = air.scattered(1.0, 0.5, 0.5);
        assert!(s.air[1] > 3.0 * s.air[10] && s.multiple[1] > 0.0);
        let sunset = air.sun_transmittance(0.03);
        assert!(sunset[10] > 10.0 * sunset[1], "{sunset:?}");
        assert_eq!(air.sun_transmittance(-0.2), [0.0; BANDS]);
    }
}
