//! The distribution of photon paths over lights: p_i = (1 − a) Φ_i/Σ Φ + a/L over the L lights with emission. Φ are
//! their powers and a is the floor, so that no light has less than a/L of the paths.
//!
//! Lights are chosen by inversion, so that with stratified random numbers each light gets its expected number of paths
//! up to a few. `trace` draws from it.

use crate::lights::sample_columns::ChosenLight;
use crate::lights::{LightId, LightSet};
use lumiris_numbers::math::cumulative;

/// Probabilities of the lights.
#[derive(Clone, Debug)]
pub struct LightDistribution {
    lights: Vec<LightId>,
    /// Σ p_j for j ≤ i.
    cumulative: Vec<f64>,
}

impl LightDistribution {
    /// `floor`: a in 0..1. `None` if no light has emission.
    pub fn new(lights: &LightSet, floor: f32) -> Option<Self> {
        Self::by_weights(lights, floor, |light| lights.lights[light as usize].power_luminance(lights.scene_radius))
    }

    /// The same with weights instead of powers; `None` if the weights of all lights with emission are 0.
    pub fn by_weights(lights: &LightSet, floor: f32, weight: impl Fn(LightId) -> f32) -> Option<Self> {
        let lit: Vec<(LightId, f64)> = lights.lit.iter().map(|&light| (light, f64::from(weight(light)))).collect();
        let total: f64 = lit.iter().map(|(_, phi)| phi).sum();
        if !(total > 0.0 && total.is_finite()) {
            return None;
        }
        let floor = f64::from(floor.clamp(0.0, 1.0));
        let mut sum = 0.0;
        let cumulative = lit
            .iter()
            .map(|(_, phi)| {
                sum += (1.0 - floor) * phi / total + floor / lit.len() as f64;
                sum
            })
            .collect();
        Some(LightDistribution { lights: lit.into_iter().map(|(light, _)| light).collect(), cumulative })
    }

    /// Chooses a light by two random numbers of 24 bits: `u[1]` fills the gaps between the values of
    /// `u[0]`, which exceed the probabilities if there are many lights.
    #[inline]
    pub fn sample(&self, u: [f32; 2]) -> ChosenLight {
        const STEPS: f64 = 16_777_216.0;
        let u = ((f64::from(u[0]) * STEPS).floor() + f64::from(u[1])) / STEPS;
        let last = self.lights.len() - 1;
        let i = cumulative::find(&self.cumulative, u * self.cumulative[last]).min(last);
        ChosenLight { light: self.lights[i], pmf: self.pmf_at(i) }
    }

    /// Probability of a light; 0 if it has no emission.
    pub fn pmf(&self, light: LightId) -> f32 {
        self.lights.binary_search(&light).map_or(0.0, |i| self.pmf_at(i))
    }

    #[inline]
    fn pmf_at(&self, i: usize) -> f32 {
        cumulative::weight(&self.cumulative, i) as f32
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lights::{Light, LightSetBuilder, PointLight};
    use lumiris_numbers::math::{Bounds3, Rgb, Vec3};
    use lumiris_numbers::samplers::{SampleStream, SamplerKind};

    fn points(intensities: &[f32]) -> LightSet {
        let mut builder = LightSetBuilder::default();
        for &i in intensities {
            builder.add(Light::Point(PointLight { p: Vec3::ZERO, intensity: Rgb::splat(i) }));
        }
        builder.build(&Bounds3 { min: Vec3::ZERO, max: Vec3::ONE })
    }

    #[test]
    fn shares_are_by_power_with_a_floor_and_black_lights_have_none() {
        let light_distribution = LightDistribution::new(&points(&[3.0, 0.0, 1.0, 0.0]), 0.1).unwrap();
        let expected = [0.9 * 0.75 + 0.05, 0.0, 0.9 * 0.25 + 0.05, 0.0];
        for (i, e) in expected.into_iter().enumerate() {
            assert!((light_distribution.pmf(i as LightId) - e).abs() < 1e-6, "{i}");
        }
        assert!(LightDistribution::new(&points(&[]), 0.1).is_none());
        assert!(LightDistribution::new(&points(&[0.0]), 0.1).is_none());
    }

    #[test]
    fn a_stratified_sequence_gives_each_light_its_share() {
        let intensities: Vec<f32> = (0..1000).map(|i| 0.01 + (i % 17) as f32).collect();
        let light_distribution = LightDistribution::new(&points(&intensities), 0.05).unwrap();
        let count = 1 << 16;
        let mut counts = vec![0.0_f64; intensities.len()];
        for i in 0..count {
            let ChosenLight { light, pmf } =
                light_distribution.sample(SampleStream::new(SamplerKind::Sobol, [0, 0], i, 5).draw::<2>());
            assert_eq!(pmf, light_distribution.pmf(light));
            counts[light as usize] += 1.0;
        }
        for (i, counted) in counts.into_iter().enumerate() {
            let expected = f64::from(light_distribution.pmf(i as LightId)) * f64::from(count);
            // An interval of a (0, 1)-sequence's 2¹⁶ points: at most one more or less at each end
            assert!((counted - expected).abs() <= 2.0, "{i} {counted} {expected}");
        }
    }
}
