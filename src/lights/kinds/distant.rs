//! Parallel light from infinity.

use super::environment::infinite_sample;
use crate::lights::LightSample;
use lumiris_numbers::math::{Rgb, Vec3};

/// Parallel light from infinity.
#[derive(Clone, Copy, Debug)]
pub struct DistantLight {
    /// Unit direction to the light.
    pub wi: Vec3,
    /// Irradiance on a surface that faces it.
    pub irradiance: Rgb,
}

impl DistantLight {
    #[inline]
    pub(in crate::lights) fn sample_li(&self) -> Option<LightSample> {
        let s = infinite_sample(self.wi, self.irradiance, 1.0);
        (!self.irradiance.is_black()).then_some(LightSample { is_delta: true, ..s })
    }
}
