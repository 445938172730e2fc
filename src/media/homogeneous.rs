//! A medium that is the same everywhere: all in closed form.

use super::track::{End, Flight};
use lumiris_numbers::math::Rgb;

/// A homogeneous medium.
#[derive(Clone, Copy, Debug)]
pub struct Homogeneous {
    /// Absorption (1/m).
    pub sigma_a: Rgb,
    /// Scattering (1/m).
    pub sigma_s: Rgb,
    /// Emitted radiance.
    pub le: Rgb,
    /// Asymmetry of the phase function.
    pub g: f32,
}

/// exp(−σd), where σ = 0 is no attenuation even over an infinite distance.
#[inline]
fn attenuation(sigma: f32, distance: f32) -> f32 {
    if sigma > 0.0 { (-sigma * distance).exp() } else { 1.0 }
}

impl Homogeneous {
    /// True if it sends out light.
    pub fn is_emissive(&self) -> bool {
        !(self.le * self.sigma_a).is_black()
    }

    /// T over a distance (m), which may be infinite.
    #[inline]
    pub fn transmittance(&self, distance: f32) -> Rgb {
        (self.sigma_a + self.sigma_s).map(|sigma| attenuation(sigma, distance))
    }

    /// The light that it sends out along a segment, towards its origin: ∫ T σ_a L_e = L_e σ_a/σ_t (1 − T).
    fn emitted(&self, transmittance: Rgb) -> Rgb {
        let sigma_t = self.sigma_a + self.sigma_s;
        let of = |c: usize| {
            let share = if sigma_t[c] > 0.0 { self.sigma_a[c] / sigma_t[c] } else { 0.0 };
            self.le[c] * share * (1.0 - transmittance[c])
        };
        Rgb::new(of(0), of(1), of(2))
    }

    /// A flight over `length` (m) of a path of throughput `beta`.
    ///
    /// The distance follows σ_c exp(−σ_c t), where σ_c is σ_t of a channel that `u[1]` chooses in proportion to |β_c|; the
    /// density is the sum over the channels, as the balance heuristic for one sample wants it. So no channel gets a
    /// weight above 1/|β_c| relative to all. What only absorbs is passed for certain.
    #[inline]
    pub fn fly(&self, length: f32, beta: Rgb, u: [f32; 2]) -> Flight {
        let through = self.transmittance(length);
        let emitted = if self.is_emissive() { self.emitted(through) } else { Rgb::BLACK };
        let p = beta.map(f32::abs);
        let sum = p.r + p.g + p.b;
        if self.sigma_s.is_black() || !(sum > 0.0 && sum.is_finite()) {
            return Flight { emitted, end: End::Through { weight: through } };
        }
        let p = (p / sum).to_array();
        let sigma_t = self.sigma_a + self.sigma_s;
        let channel = if u[1] < p[0] {
            0
        } else if u[1] < p[0] + p[1] || p[2] == 0.0 {
            1
        } else {
            2
        };
        let t = if sigma_t[channel] > 0.0 { -(-u[0]).ln_1p() / sigma_t[channel] } else { f32::INFINITY };
        let mean = |values: Rgb| p[0] * values.r + p[1] * values.g + p[2] * values.b;
        let end = if t < length {
            let here = self.transmittance(t);
            let weight = self.sigma_s * here / mean(sigma_t * here);
            let albedo = self.sigma_s / sigma_t.max_component();
            End::Scattered { t, weight: if weight.is_finite() { weight } else { albedo } }
        } else {
            let weight = through / mean(through);
            End::Through { weight: if weight.is_finite() { weight } else { Rgb::BLACK } }
        };
        Flight { emitted, end }
    }
}
