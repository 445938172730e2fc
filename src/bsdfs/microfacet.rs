//! The GGX (Trowbridge-Reitz) distribution of microfacet normals with Smith's height-correlated shadowing.
//!
//! The formulas are in [`lumiris_lanes::kernels::facets`].

use lumiris_lanes::kernels::facets::Facets;
pub use lumiris_lanes::kernels::facets::SMOOTH_ALPHA;
use lumiris_numbers::math::Vec3;

/// GGX distribution over the normals m with m.z > 0.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TrowbridgeReitz {
    /// Roughness along x; 0 is smooth.
    pub alpha_x: f32,
    /// Roughness along y; 0 is smooth.
    pub alpha_y: f32,
}

impl TrowbridgeReitz {
    /// From the alphas. Unless the surface is smooth, both are raised to at least 1e-4. Negative alphas and NaN become
    /// 0.
    pub fn new(alpha_x: f32, alpha_y: f32) -> Self {
        let raw = TrowbridgeReitz { alpha_x: alpha_x.max(0.0), alpha_y: alpha_y.max(0.0) };
        if raw.is_smooth() {
            return raw;
        }
        TrowbridgeReitz { alpha_x: raw.alpha_x.max(1e-4), alpha_y: raw.alpha_y.max(1e-4) }
    }

    /// The alpha of pbrt-v4's roughness parameter: √roughness.
    #[inline]
    pub fn roughness_to_alpha(roughness: f32) -> f32 {
        roughness.max(0.0).sqrt()
    }

    /// True if the surface is treated as a perfect mirror.
    #[inline]
    pub fn is_smooth(&self) -> bool {
        self.alpha_x.max(self.alpha_y) < SMOOTH_ALPHA
    }

    #[inline]
    fn facets(&self) -> Facets<f32> {
        Facets { alpha_x: self.alpha_x, alpha_y: self.alpha_y }
    }

    /// Density of microfacet area per steradian of `m`, per unit area of the macrosurface (1/sr).
    #[inline]
    pub fn d(&self, m: Vec3) -> f32 {
        self.facets().d(m.into())
    }

    /// Fraction of the microfacets facing `w` that are visible from `w`.
    #[inline]
    pub fn g1(&self, w: Vec3) -> f32 {
        4.0 * w.z.abs() * Facets::g1_over_cos(w.z, self.facets().l(w.into()))
    }

    /// Fraction visible from both `wo` and `wi`.
    #[inline]
    pub fn g(&self, wo: Vec3, wi: Vec3) -> f32 {
        let [l_o, l_i] = [wo, wi].map(|w| self.facets().l(w.into()));
        4.0 * wo.z.abs() * Facets::g_cos(wo.z, wi.z, l_o, l_i)
    }

    /// Density of [`Self::sample_m`] per steradian of `m`; `m` is in the upper hemisphere.
    #[inline]
    pub fn pdf_m(&self, w: Vec3, m: Vec3) -> f32 {
        4.0 * Facets::g1_over_cos(w.z, self.facets().l(w.into())) * self.d(m) * w.dot(m).abs()
    }

    /// Density of reflection by the normals visible from `wo` (1/sr), on its side.
    #[inline]
    pub fn pdf_reflection(&self, wo: Vec3, wi: Vec3) -> f32 {
        self.facets().pdf_reflection(wo.into(), wi.into())
    }

    /// Samples a normal visible from `w` (or from `-w` if `w` is below the horizon), in the upper hemisphere.
    #[inline]
    pub fn sample_m(&self, w: Vec3, u: [f32; 2]) -> Vec3 {
        self.facets().sample_m(w.into(), u).into()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use lumiris_numbers::math::warp;
    use std::f32::consts::{PI, TAU};

    #[test]
    fn projected_microfacet_area_is_the_macro_area() {
        // ∫ D(m) m.z dm = 1.
        for (ax, ay) in [(0.1, 0.1), (0.5, 0.2), (1.0, 0.7)] {
            let t = TrowbridgeReitz::new(ax, ay);
            let (n, mut sum) = (1000, 0.0_f64);
            for i in 0..n {
                for j in 0..200 {
                    let theta = (i as f32 + 0.5) / n as f32 * PI * 0.5;
                    let m = warp::direction(theta.cos(), TAU * (j as f32 + 0.5) / 200.0);
                    let area = PI * 0.5 / n as f32 * TAU / 200.0 * theta.sin();
                    sum += f64::from(t.d(m) * m.z * area);
                }
            }
            assert!((sum - 1.0).abs() < 2e-3, "{ax} {ay} {sum}");
        }
    }

    #[test]
    fn visible_normals_project_to_the_cosine() {
        // ∫ G1(w) D(m) max(0, w·m) dm = cos θ_w, which means ∫ pdf_m = 1; m is sampled by its own cosine.
        let t = TrowbridgeReitz::new(0.4, 0.25);
        for cos in [0.05, 0.3, 0.8, 1.0] {
            let w = warp::direction(cos, 0.7);
            let n = 400;
            let mut sum = 0.0_f64;
            for i in 0..n * n {
                let u = [((i % n) as f32 + 0.5) / n as f32, ((i / n) as f32 + 0.5) / n as f32];
                let m = warp::sample_uniform_hemisphere(u);
                if m.dot(w) > 0.0 {
                    sum += f64::from(t.pdf_m(w, m) * TAU);
                }
            }
            assert!((sum / f64::from(n * n) - 1.0).abs() < 5e-3, "{cos} {sum}");
        }
    }

    #[test]
    fn samples_are_unit_upper_and_visible() {
        let t = TrowbridgeReitz::new(0.3, 0.01);
        for i in 0..10_000 {
            let r = lumiris_numbers::math::hash::pcg4d([i, 1, 2, 3]).map(lumiris_numbers::math::hash::unit_f32);
            let w = warp::direction(r[2] * 1e-3 + 1e-7, r[3] * TAU);
            let m = t.sample_m(w, [r[0], r[1]]);
            assert!((m.length() - 1.0).abs() < 1e-5 && m.z > 0.0);
            assert!(m.dot(w) > -1e-5, "{m} {w}");
        }
        assert!(t.sample_m(Vec3::X, [0.0, 1.0]).is_finite());
    }
}
