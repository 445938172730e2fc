//! Sheen, see [`lumiris_lanes::kernels::sheen`].

pub use lumiris_lanes::kernels::sheen::LEAST_ALPHA;
use lumiris_numbers::math::Rgb;

/// A layer of sheen.
#[derive(Clone, Copy, Debug)]
pub struct Sheen {
    /// Its colour; black for no sheen.
    pub color: Rgb,
    /// Its roughness, from [`LEAST_ALPHA`] to 1.
    pub alpha: f32,
}

#[cfg(test)]
mod tests {
    use lumiris_lanes::kernels::sheen::{albedo, density, white};
    use lumiris_numbers::math::warp;
    use lumiris_test_support::random::{RngExt, pcg32};
    use std::f32::consts::{PI, TAU};

    #[test]
    fn the_table_has_the_albedo_and_none_exceeds_one() {
        let mut s = pcg32([4, 5, 6]);
        for alpha in [0.04, 0.25, 0.5, 1.0] {
            for mu in [0.1, 0.3, 0.7, 1.0] {
                let wo = warp::direction(mu, 1.0);
                let n = 200_000;
                let mut sum = 0.0;
                for _ in 0..n {
                    let wi = warp::sample_cosine_hemisphere(s.random::<[f32; 2]>());
                    sum += if wi.z > 0.0 { f64::from(white(wo.into(), wi.into(), alpha) / wi.z * PI) } else { 0.0 };
                }
                let (mean, tabulated) = (sum / f64::from(n), f64::from(albedo(mu, alpha)));
                assert!((mean - tabulated).abs() < 0.03 * mean + 0.002, "{alpha} {mu}: {mean} {tabulated}");
                assert!(mean < 1.0, "{alpha} {mu}: {mean}");
            }
        }
    }

    #[test]
    fn facets_cover_the_surface() {
        // ∫ D cos θ = 1, by the normalisation of D
        for alpha in [0.1, 0.5, 1.0_f32] {
            let n = 20_000;
            let sum: f32 = (0..n)
                .map(|i| {
                    let theta = (i as f32 + 0.5) / n as f32 * 0.5 * PI;
                    density(theta.sin().powi(2), alpha) * theta.cos() * theta.sin() * TAU * 0.5 * PI / n as f32
                })
                .sum();
            assert!((sum - 1.0).abs() < 1e-3, "{alpha}: {sum}");
        }
    }
}
