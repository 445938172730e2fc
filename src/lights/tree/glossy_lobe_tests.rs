//! Tests of the choice of lights on glossy surfaces.

use crate::bsdfs::{Bsdf, Conductor, KernelBsdf as _, LobeWidth, TrowbridgeReitz};
use crate::lights::{GlossyLobe, Light, LightCtx, LightTree, PointLight};
use lumiris_numbers::math::warp::{sample_cosine_hemisphere, sample_uniform_sphere};
use lumiris_numbers::math::{Rgb, Vec3};
use lumiris_test_support::random::{RngExt, pcg32};

/// The relative second moment E[X²]/E[X]² of a one-light estimate of 60 point lights around a metal surface, with and
/// without the lobe, averaged over many views.
fn second_moments(alpha: f32) -> [f64; 2] {
    let mut s = pcg32([alpha.to_bits(), 3, 1]);
    let distribution = TrowbridgeReitz::new(alpha, alpha);
    let metal = Conductor { distribution, eta: Rgb::WHITE, k: Rgb::splat(4.0) };
    let mut sums = [0.0; 2];
    for _ in 0..200 {
        // Lights at random distances
        let lights: Vec<Light> = (0..60)
            .map(|_| {
                let p = sample_uniform_sphere(s.random::<[f32; 2]>()) * (1.0 + 9.0 * s.random::<f32>());
                Light::Point(PointLight { p, intensity: Rgb::splat(s.random::<f32>() + 0.1) })
            })
            .collect();
        let tree = LightTree::new(&lights, |_| true);
        let wo = sample_cosine_hemisphere(s.random::<[f32; 2]>());

        // Contexts with and without the lobe
        let LobeWidth { alpha, share } = Bsdf::Conductor(metal).glossy_lobe(wo).unwrap();
        let diffuse = LightCtx::on(Vec3::ZERO, Vec3::Z);
        let glossy = LightCtx { lobe: GlossyLobe::new(wo, Vec3::Z, alpha, share), ..diffuse };

        // Second moment Σ v²/p of the estimate, relative to the squared mean
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
