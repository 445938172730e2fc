//! Russian roulette of camera paths, applied by `scatter` to each next segment. Elsewhere: `interior` has roulette of
//! walks through the interiors of materials, `media/heterogeneous.rs` of faint shadow segments, and `photons/walk.rs`
//! of photons.

use super::domain;
use crate::settings::IntegratorSettings;
use lumiris_numbers::math::Rgb;
use lumiris_numbers::samplers::SampleStream;

/// Russian roulette before bounce `bounce`, for a path that leaves a vertex with the throughput `beta`; `stream` has
/// the numbers of the vertex. The survival probability is the maximum of β · `eta_scale`, so refraction does not count
/// as a loss. Returns the probability if the path survives, else 0.
#[inline]
pub(super) fn survival(
    beta: Rgb,
    eta_scale: f32,
    stream: impl FnOnce() -> SampleStream,
    bounce: u32,
    settings: &IntegratorSettings,
) -> f32 {
    if !settings.has_roulette(bounce) {
        return 1.0;
    }
    let survival = (beta * eta_scale).map(f32::abs).max_component();
    if !(survival < 1.0) {
        return 1.0;
    }
    if stream().draw_random(domain::ROULETTE) < survival { survival } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use lumiris_numbers::samplers::SamplerKind;

    #[test]
    fn roulette_keeps_the_mean_of_the_throughput() {
        let settings = IntegratorSettings { roulette_depth: Some(3), ..IntegratorSettings::default() };
        let streams = (0..4096).map(|i| SampleStream::new(SamplerKind::Sobol, [i % 64, i / 64], i, 1));
        let (beta, eta_scale) = (Rgb::new(0.1, 0.2, 0.05), 2.25);

        // Refraction does not count as a loss: the survival probability is 0.2·2.25
        let (mut sum, mut count) = (Rgb::BLACK, 0);
        for stream in streams.clone() {
            assert_eq!(survival(beta, eta_scale, || stream, 2, &settings), 1.0);
            let survival = survival(beta, eta_scale, || stream, 3, &settings);
            if survival > 0.0 {
                (sum, count) = (sum + beta / survival, count + 1);
            }
        }
        // Five standard deviations of independent numbers
        let (mean, share) = (sum * (1.0 / 4096.0), count as f32 / 4096.0);
        assert!((share - 0.45).abs() < 0.04, "{share}");
        assert!((mean.g - 0.2).abs() < 0.02 && (mean.r - 0.1).abs() < 0.01, "{mean:?}");

        // A throughput above 1 is unchanged
        let bright = Rgb::splat(1.5);
        assert!(streams.into_iter().all(|stream| survival(bright, 1.0, || stream, 9, &settings) == 1.0));
    }
}
