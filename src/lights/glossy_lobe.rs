//! What the choice of a light knows of a glossy surface: a lobe about the mirror direction of the viewer, as in many-light
//! sampling that follows the BRDF [Liu et al. 2019].
//!
//! For lights of the irradiance E on a plane towards them, the light that reaches the viewer is nearly
//! E·((1 − s) cos θi + s·π D(h) G₁(wo)/(4 cos θo)), where s is the part of the albedo that is the lobe's and D the density
//! of isotropic GGX microfacets. The mean over lights within the angle b of wi is that of wi with α² + sin²b/4 instead of
//! α², since half vectors turn half as far as directions: no larger than 1/b², whatever α is.

use lumiris_numbers::math::{Vec3, sqr};

/// Greatest part of the lobe: what it leaves out, anisotropy and light reflected several times, keeps a chance.
const MAX_SHARE: f32 = 0.95;

/// A lobe that reflects light to the viewer, beside a diffuse part.
#[derive(Clone, Copy, Debug)]
pub struct GlossyLobe {
    /// Direction to the viewer, unit.
    wo: Vec3,
    /// Its cosine, signed, to the shading normal.
    cos_o: f32,
    /// α² of the microfacets.
    alpha_squared: f32,
    /// s G₁(wo)/(4 |cos θo|); 0 if there is no lobe.
    scale: f32,
    /// 1 − s.
    diffuse: f32,
}

impl GlossyLobe {
    /// No lobe: all is diffuse.
    pub const NONE: GlossyLobe =
        GlossyLobe { wo: Vec3::ZERO, cos_o: 0.0, alpha_squared: 0.0, scale: 0.0, diffuse: 1.0 };

    /// The lobe of microfacets of roughness `alpha`, about the shading normal `ns`, that has `share` (0 to 1) of the
    /// albedo seen from `wo`; all vectors unit.
    pub fn new(wo: Vec3, ns: Vec3, alpha: f32, share: f32) -> Self {
        let (cos_o, alpha_squared, share) = (wo.dot(ns), sqr(alpha), share.min(MAX_SHARE));
        // G₁/|cos θo| of GGX, finite at the horizon
        let visible = 2.0 / (cos_o.abs() + (alpha_squared + (1.0 - alpha_squared) * sqr(cos_o)).sqrt());
        if !(share > 0.0) || !visible.is_finite() {
            return Self::NONE;
        }
        GlossyLobe { wo, cos_o, alpha_squared, scale: 0.25 * share * visible, diffuse: 1.0 - share }
    }

    /// π·f·|cos θi| over the albedo, for lights within an angle of the sine √`sin2_b` of the direction `wi`, whose cosine to
    /// the shading normal is `cos_i`, and whose greatest absolute cosine among these lights is `cos_max`.
    #[inline]
    pub fn reflected(&self, wi: Vec3, cos_i: f32, sin2_b: f32, cos_max: f32) -> f32 {
        let diffuse = self.diffuse * cos_max;
        // On the other side, as far as all of them are there
        if self.scale == 0.0 || cos_i * self.cos_o <= 0.0 && sqr(cos_i) >= sin2_b {
            return diffuse;
        }
        let cos2_h = (sqr(self.cos_o + cos_i) / (2.0 * (1.0 + self.wo.dot(wi))).max(1e-6)).min(1.0);
        let alpha_squared = self.alpha_squared + 0.25 * sin2_b;
        diffuse + self.scale * alpha_squared / sqr(1.0 - cos2_h * (1.0 - alpha_squared))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bsdfs::{Bsdf, Conductor, TrowbridgeReitz};
    use crate::lights::{Light, LightCtx, LightTree};
    use lumiris_numbers::math::Rgb;
    use lumiris_numbers::math::warp::{sample_cosine_hemisphere, sample_uniform_sphere};
    use lumiris_test_support::random::{RngExt, pcg32};

    /// The second moment of a one-light estimate over the square of the mean, of 60 point lights around a metal sample, with
    /// and without the lobe: means over many views.
    fn second_moments(alpha: f32) -> [f64; 2] {
        let mut s = pcg32([alpha.to_bits(), 3, 1]);
        let distribution = TrowbridgeReitz::new(alpha, alpha);
        let metal = Conductor { distribution, eta: Rgb::WHITE, k: Rgb::splat(4.0) };
        let mut sums = [0.0; 2];
        for _ in 0..200 {
            let lights: Vec<Light> = (0..60)
                .map(|_| {
                    let p = sample_uniform_sphere(s.random::<[f32; 2]>()) * (1.0 + 9.0 * s.random::<f32>());
                    Light::Point { p, intensity: Rgb::splat(s.random::<f32>() + 0.1) }
                })
                .collect();
            let tree = LightTree::new(&lights.iter().map(Light::bounds).collect::<Vec<_>>());
            let wo = sample_cosine_hemisphere(s.random::<[f32; 2]>());
            let (alpha, share) = Bsdf::Conductor(metal).glossy_lobe(wo).unwrap();
            let diffuse = LightCtx::on(Vec3::ZERO, Vec3::Z);
            let glossy = LightCtx { lobe: GlossyLobe::new(wo, Vec3::Z, alpha, share), ..diffuse };
            let values = lights.iter().map(|light| {
                let sample = light.sample_li(&diffuse, [0.5; 2]).unwrap();
                f64::from(sample.li.g * metal.f(wo, sample.wi).g * sample.wi.z.max(0.0))
            });
            let values: Vec<f64> = values.collect();
            let mean: f64 = values.iter().sum();
            for (sum, ctx) in sums.iter_mut().zip([glossy, diffuse]) {
                let second = |(i, v): (usize, &f64)| v * v / f64::from(tree.pmf(&ctx, i as u32)).max(1e-30);
                *sum += values.iter().enumerate().map(second).sum::<f64>() / (mean * mean * 200.0);
            }
        }
        sums
    }

    #[test]
    fn lights_in_the_lobe_are_preferred() {
        for (alpha, at_most) in [(0.05, 0.3), (0.2, 0.6), (0.5, 0.85)] {
            let [glossy, diffuse] = second_moments(alpha);
            assert!(glossy < at_most * diffuse, "{alpha}: {glossy} {diffuse}");
        }
    }
}
