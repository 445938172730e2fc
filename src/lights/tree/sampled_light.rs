//! Results of light samplers: a chosen light, or a run of consecutive positions that choose the same light.

use crate::lights::LightId;

/// A chosen light.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SampledLight {
    /// The light.
    pub light: LightId,
    /// Probability of the choice.
    pub pmf: f32,
    /// The random number, remapped to be uniform in [0, 1) again.
    pub u: f32,
}

/// Consecutive positions, of a sorted list in [0, 1), that choose the same light.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LightRun {
    /// The light.
    pub light: LightId,
    /// Probability of the choice.
    pub pmf: f32,
    /// Index range in the list, end exclusive.
    pub range: [u32; 2],
    /// The part of [0, 1) that chooses the light.
    pub interval: [f64; 2],
}

impl LightRun {
    /// Remaps a position of the run to be uniform in [0, 1) again. Both are in units of 2⁻³².
    #[inline]
    pub fn within(&self, position: u32) -> u32 {
        let [start, end] = self.interval;
        // Casts saturate.
        ((f64::from(position) * UNIT - start) / (end - start) / UNIT) as u32
    }
}

/// 2⁻³².
pub(in crate::lights) const UNIT: f64 = 1.0 / 4_294_967_296.0;
