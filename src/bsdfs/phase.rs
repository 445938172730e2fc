//! Scattering in a medium, as a BSDF without a surface: the phase function of [Henyey and Greenstein 1941].
//!
//! p(θ) = (1 − g²)/(4π (1 + g² + 2g cos θ)^(3/2)), where θ is the angle between `wo` and `wi`, both away from the
//! point: unscattered light has cos θ = −1. p is a density over the sphere, so the weight of a sample is 1. There is no
//! cosine: [`crate::materials::SurfaceBsdf::cos`] is 1.

use super::lobe::{BsdfSample, Lobe};
use lumiris_numbers::math::{Frame, Rgb, Vec3, safe_sqrt};
use std::f32::consts::{PI, TAU};

/// The phase function of a medium.
#[derive(Clone, Copy, Debug)]
pub struct Phase {
    /// Mean cosine between the directions of propagation before and after scattering, −1..1.
    g: f32,
}

/// Maximum |g| for which f32 can evaluate the density.
const MAX_G: f32 = 0.99;
/// |g| below which the phase function is isotropic.
const ISOTROPIC: f32 = 1e-3;

impl Phase {
    /// With the asymmetry `g`, clamped to −0.99..=0.99.
    pub fn new(g: f32) -> Self {
        Phase { g: g.clamp(-MAX_G, MAX_G) }
    }

    /// The asymmetry.
    pub fn g(&self) -> f32 {
        self.g
    }

    /// p (1/sr), the density of [`Self::sample`].
    #[inline]
    pub fn p(&self, wo: Vec3, wi: Vec3) -> f32 {
        let g = self.g;
        // A squared distance, which is positive
        let square = (1.0 + g * g + 2.0 * g * wo.dot(wi)).max((1.0 - g.abs()) * (1.0 - g.abs()));
        (1.0 - g * g) / (4.0 * PI * square * square.sqrt())
    }

    /// Samples a direction.
    #[inline]
    pub fn sample(&self, wo: Vec3, u: [f32; 2]) -> Option<BsdfSample> {
        let g = self.g;
        let cos = if g.abs() < ISOTROPIC {
            1.0 - 2.0 * u[0]
        } else {
            let ratio = (1.0 - g * g) / (1.0 + g - 2.0 * g * u[0]);
            -(1.0 + g * g - ratio * ratio) / (2.0 * g)
        };
        let cos = cos.clamp(-1.0, 1.0);
        let sin = safe_sqrt(1.0 - cos * cos);
        let (sin_phi, cos_phi) = (TAU * u[1]).sin_cos();
        let wi = Frame::from_z(wo).to_world(Vec3::new(sin * cos_phi, sin * sin_phi, cos));
        let pdf = self.p(wo, wi);
        let lobe = Lobe::DIFFUSE | Lobe::TRANSMISSION;
        Some(BsdfSample { f: Rgb::splat(pdf), wi, pdf, lobe, eta: 1.0 })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use lumiris_numbers::estimators::stats::{Welford, chi_squared_test, sidak, z_test};
    use lumiris_test_support::random::{RngExt, pcg32};

    const COSINES: usize = 64;
    const AZIMUTHS: usize = 16;
    const SAMPLES: usize = 500_000;

    /// ∫ p over cos θ from −1 to c, and all azimuths; in closed form.
    fn up_to(g: f64, c: f64) -> f64 {
        if g.abs() < f64::from(ISOTROPIC) {
            return 0.5 * (1.0 + c);
        }
        let inverse = |c: f64| 1.0 / (1.0 + g * g + 2.0 * g * c).sqrt();
        (1.0 - g * g) / (2.0 * g) * (inverse(-1.0) - inverse(c))
    }

    #[test]
    fn directions_follow_the_phase_function_by_chi_squared() {
        let all = [-0.9, -0.3, 0.0, 0.0005, 0.2, 0.7, 0.95];
        let significance = sidak(0.01, all.len());
        for (k, g) in all.into_iter().enumerate() {
            let phase = Phase::new(g);
            let wo = Vec3::new(0.3, -0.5, 0.81).normalize();
            let frame = Frame::from_z(wo);
            let (mut observed, mut mean) = (vec![0.0; COSINES * AZIMUTHS], Welford::new());
            let mut stream = pcg32([k as u32, 8, 3]);
            for _ in 0..SAMPLES {
                let s = phase.sample(wo, stream.random::<[f32; 2]>()).unwrap();
                assert!((s.pdf - phase.p(wo, s.wi)).abs() <= 1e-6 * s.pdf && s.pdf > 0.0);
                let local = frame.to_local(s.wi);
                let i = ((local.z * 0.5 + 0.5) * COSINES as f32) as usize;
                let j = (lumiris_numbers::math::warp::azimuth(local) / TAU * AZIMUTHS as f32) as usize;
                observed[i.min(COSINES - 1) * AZIMUTHS + j.min(AZIMUTHS - 1)] += 1.0;
                mean.add(-f64::from(local.z));
            }
            let bound = |i: usize| 2.0 * i as f64 / COSINES as f64 - 1.0;
            let of = |i: usize| up_to(f64::from(g), bound(i + 1)) - up_to(f64::from(g), bound(i));
            let expected: Vec<f64> =
                (0..COSINES * AZIMUTHS).map(|b| of(b / AZIMUTHS) / AZIMUTHS as f64 * SAMPLES as f64).collect();
            let chi = chi_squared_test(&observed, &expected, significance);
            assert!(!chi.rejected, "g = {g}: {chi:?}");
            let z = z_test(mean.mean(), f64::from(g), mean.standard_error());
            assert!(z.p_value > 1e-4, "the mean cosine of g = {g}: {mean:?}");
            // The test detects an error of the asymmetry of 0.03 in these
            let wrong = |i: usize| up_to(f64::from(g) + 0.03, bound(i + 1)) - up_to(f64::from(g) + 0.03, bound(i));
            let expected: Vec<f64> =
                (0..COSINES * AZIMUTHS).map(|b| wrong(b / AZIMUTHS) / AZIMUTHS as f64 * SAMPLES as f64).collect();
            assert!(chi_squared_test(&observed, &expected, significance).rejected, "g = {g}");
        }
    }
}
