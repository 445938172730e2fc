//! The reflectance of a scattering interior, and its inverse: the interior with a given reflectance.
//!
//! The interior fills the half-space below a smooth boundary of relative index η and scatters isotropically with the
//! single-scattering albedo α. Uniform light from outside, after refraction, has the radiance S(μ) below the boundary,
//! where μ is the cosine to the normal. There, the downward radiance D and the upward radiance U satisfy
//!
//! U(μ) = α/2 H(μ) ∫₀¹ μ'/(μ + μ') H(μ') D(μ') dμ',  D = S + F U,
//!
//! with F the reflectance of the boundary from below and H the function of [Chandrasekhar 1960, ch. IV and V], for
//! which 1/H(μ) = √(1 − α) + α/2 ∫₀¹ μ' H(μ')/(μ + μ') dμ'. The reflectance ρ(α) is the flux ∫ (1 − F) U μ dμ of the
//! light that leaves over the flux ∫ S μ dμ of the light that entered: 0 for α = 0, 1 for α = 1, and monotone between.
//! It excludes the reflection of the boundary on the outside. A phase function of asymmetry g is equivalent to an
//! isotropic one with (1 − g) σ_s, by the similarity relation [van de Hulst 1980].
//!
//! Called by `import/pbrt/subsurface.rs` to turn a reflectance into an interior. `integrators/interior.rs` walks there.

use crate::bsdfs::fresnel::fr_dielectric;

/// Nodes of the quadrature on either side of the critical angle.
const NODES: usize = 24;
/// Maximum number of iterations for H, and for interreflections between boundary and interior.
const MAX_STEPS: usize = 2000;

/// A boundary, with precomputed data for any albedo.
#[derive(Clone, Debug)]
pub struct HalfSpace {
    /// Cosines and their weights, ∫₀¹ f dμ = Σ w f(μ).
    nodes: Vec<[f64; 2]>,
    /// Reflectance from below at the nodes.
    fresnel: Vec<f64>,
    /// S at the nodes.
    entered: Vec<f64>,
}

impl HalfSpace {
    /// The half-space below a boundary of relative index `eta` > 0.
    pub fn new(eta: f32) -> Self {
        // F has a kink at the onset of total reflection, and S at the onset of refraction
        let critical = (1.0 - f64::from(eta).min(1.0 / f64::from(eta)).powi(2)).sqrt();
        let mut nodes = Vec::new();
        for (from, to) in [(0.0, critical), (critical, 1.0)] {
            nodes.extend(gauss_legendre().map(|[x, w]| [from + (to - from) * x, (to - from) * w]));
        }
        nodes.retain(|[_, w]| *w > 0.0);
        let fresnel: Vec<f64> = nodes.iter().map(|[mu, _]| f64::from(fr_dielectric(-*mu as f32, eta))).collect();
        let entered = fresnel.iter().map(|f| 1.0 - f).collect();
        HalfSpace { nodes, fresnel, entered }
    }

    /// ρ for a single-scattering albedo (0..=1).
    pub fn reflectance(&self, albedo: f64) -> f64 {
        let h = self.h(albedo);
        let n = self.nodes.len();

        // Fixed-point iteration of the upward radiance below the boundary
        let (mut up, mut next) = (vec![0.0; n], vec![0.0; n]);
        for _ in 0..MAX_STEPS {
            let mut change: f64 = 0.0;
            for (i, next) in next.iter_mut().enumerate() {
                let mu = self.nodes[i][0];
                let below = |j: usize| {
                    let [m, w] = self.nodes[j];
                    w * m / (mu + m) * h[j] * (self.entered[j] + self.fresnel[j] * up[j])
                };
                *next = 0.5 * albedo * h[i] * (0..n).map(below).sum::<f64>();
                change = change.max((*next - up[i]).abs());
            }
            std::mem::swap(&mut up, &mut next);
            if change < 1e-9 {
                break;
            }
        }

        // ρ: flux through the boundary over incident flux
        let flux = |radiance: &dyn Fn(usize) -> f64| {
            self.nodes.iter().enumerate().map(|(i, [mu, w])| w * mu * radiance(i)).sum::<f64>()
        };
        flux(&|i| (1.0 - self.fresnel[i]) * up[i]) / flux(&|i| self.entered[i])
    }

    /// The albedo with the reflectance ρ = `reflectance` (0..=1), for a phase function of asymmetry `g`.
    pub fn albedo(&self, reflectance: f64, g: f64) -> f64 {
        if reflectance >= 1.0 {
            return 1.0;
        }
        let (mut low, mut high) = (0.0, 1.0);
        for _ in 0..40 {
            let middle = 0.5 * (low + high);
            if self.reflectance(middle) < reflectance { low = middle } else { high = middle }
        }
        let isotropic = 0.5 * (low + high);
        isotropic / (1.0 - g + isotropic * g)
    }

    /// H at the nodes.
    fn h(&self, albedo: f64) -> Vec<f64> {
        let n = self.nodes.len();
        let mut h = vec![1.0; n];
        for _ in 0..MAX_STEPS {
            let of = |i: usize| {
                let mu = self.nodes[i][0];
                let sum: f64 =
                    (0..n).map(|j| self.nodes[j][1] * self.nodes[j][0] * h[j] / (mu + self.nodes[j][0])).sum();
                // Average with the next value, which lies on the other side of the solution
                0.5 * (h[i] + 1.0 / ((1.0 - albedo).sqrt() + 0.5 * albedo * sum))
            };
            let next: Vec<f64> = (0..n).map(of).collect();
            let change = next.iter().zip(&h).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
            h = next;
            if change < 1e-10 {
                break;
            }
        }
        h
    }
}

/// Abscissae in 0..1 and weights of Gauss-Legendre quadrature, by Newton's method.
fn gauss_legendre() -> impl Iterator<Item = [f64; 2]> {
    (0..NODES).map(|i| {
        let n = NODES as f64;
        let mut x = (std::f64::consts::PI * (i as f64 + 0.75) / (n + 0.5)).cos();
        let mut slope = 1.0;
        for _ in 0..20 {
            let (mut p0, mut p1) = (1.0, x);
            for k in 2..=NODES {
                let k = k as f64;
                (p0, p1) = (p1, ((2.0 * k - 1.0) * x * p1 - (k - 1.0) * p0) / k);
            }
            slope = n * (x * p1 - p0) / (x * x - 1.0);
            x -= p1 / slope;
        }
        [0.5 * (x + 1.0), 1.0 / ((1.0 - x * x) * slope * slope)]
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn without_a_boundary_the_share_is_that_of_chandrasekhar() {
        // 1 − √(1 − α) H̄, where H̄ = 2 ∫ H μ dμ; H(1) is from Chandrasekhar's table XI
        let space = HalfSpace::new(1.0);
        for albedo in [0.2, 0.5, 0.9, 0.99, 1.0] {
            let h = space.h(albedo);
            let mean: f64 = 2.0 * space.nodes.iter().zip(&h).map(|([mu, w], h)| w * mu * h).sum::<f64>();
            let expected = 1.0 - (1.0 - albedo).sqrt() * mean;
            let found = space.reflectance(albedo);
            assert!((found - expected).abs() < 1e-5, "{albedo}: {found} {expected}");
        }
        let h = space.h(1.0);
        let sum: f64 = space.nodes.iter().zip(&h).map(|([mu, w], h)| w * mu * h / (1.0 + mu)).sum();
        assert!((2.0 / sum - 2.9078).abs() < 2e-3, "H(1) of albedo 1 is 2.9078, not {}", 2.0 / sum);
    }

    #[test]
    fn the_share_is_0_and_1_at_the_ends_and_inverted_between() {
        for eta in [0.8, 1.0, 1.33, 1.5, 2.2] {
            let space = HalfSpace::new(eta);
            assert!(space.reflectance(0.0).abs() < 1e-9);
            assert!((space.reflectance(1.0) - 1.0).abs() < 2e-4, "{eta}: {}", space.reflectance(1.0));
            for rho in [0.02, 0.2, 0.5, 0.8, 0.95] {
                let found = space.reflectance(space.albedo(rho, 0.0));
                assert!((found - rho).abs() < 1e-6, "η = {eta}: {found}, not {rho}");
            }
            assert!(space.albedo(0.5, 0.6) > space.albedo(0.5, 0.0));
        }
    }
}
