//! Random numbers, samples per pixel, and the texture footprints that follow from them.

use lumiris_numbers::samplers::SamplerKind;
use strum::{EnumString, IntoStaticStr, VariantNames};

/// Minimum width of a texture footprint, in pixels, as in pbrt-v4.
const MIN_FOOTPRINT: f32 = 0.125;

/// Random numbers.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SamplingSettings {
    /// The sequence.
    pub sampler: SamplerKind,
    /// Camera samples per pixel.
    pub spp: u32,
    /// Images of different seeds are independent estimates of the same image.
    pub seed: u32,
    /// Samples per pixel that texture footprints are computed for; `None` for `spp`.
    pub footprint_spp: Option<u32>,
    /// Samples per pixel that pilots are made for; `None` for `spp`.
    pub pilot_spp: Option<u32>,
    /// Distribution of camera samples over the pixels.
    pub allocation: Allocation,
    /// Target relative standard error of every block of the image; `spp` is then the maximum number of samples.
    pub noise: Option<f32>,
}

/// Distribution of the camera samples over the pixels.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, EnumString, IntoStaticStr, VariantNames)]
#[strum(serialize_all = "kebab-case")]
pub enum Allocation {
    /// Adaptive with the estimator `auto`, otherwise uniform.
    #[default]
    Auto,
    /// The same number for every pixel.
    Uniform,
    /// More samples in pixels where a pilot measures more noise per time. If directly visible lights cause most of the
    /// noise, also more emission rays per sample.
    Adaptive,
}

impl Default for SamplingSettings {
    fn default() -> Self {
        SamplingSettings {
            sampler: SamplerKind::default(),
            spp: 16,
            seed: 0,
            footprint_spp: None,
            pilot_spp: None,
            allocation: Allocation::Auto,
            noise: None,
        }
    }
}

impl SamplingSettings {
    /// Samples per pixel that texture footprints are computed for.
    pub fn footprint_spp(&self) -> u32 {
        self.footprint_spp.unwrap_or(self.spp).max(1)
    }

    /// Samples per pixel that pilots are made for: a pilot takes a fraction of their time.
    pub fn pilot_spp(&self) -> u32 {
        self.pilot_spp.map_or(self.spp, |n| n.min(self.spp)).max(1)
    }

    /// Width of a texture footprint in pixels: the distance of neighbouring samples, 1/√spp, but at least an eighth
    /// [Pharr et al. 2023, §5.1.3]. The pixel filter averages over the samples.
    #[inline]
    pub fn footprint(&self) -> f32 {
        (1.0 / (self.footprint_spp() as f32).sqrt()).max(MIN_FOOTPRINT)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn footprints_are_as_wide_as_samples_lie_apart() {
        let mut s = SamplingSettings { sampler: SamplerKind::Sobol, ..SamplingSettings::default() };
        assert_eq!((s.footprint_spp(), s.footprint()), (16, 0.25));
        for (spp, width) in [(1, 1.0), (2, 0.5_f32.sqrt()), (4, 0.5), (64, 0.125), (65, 0.125), (u32::MAX, 0.125)] {
            s.footprint_spp = Some(spp);
            assert_eq!((s.footprint_spp(), s.footprint()), (spp, width), "{spp}");
        }
        // Zero samples requested
        assert_eq!(SamplingSettings { spp: 0, footprint_spp: None, ..s }.footprint(), 1.0);
    }
}
