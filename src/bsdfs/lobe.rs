//! BSDF samples and their lobes.

use super::microfacet::TrowbridgeReitz;
use lumiris_lanes::kernels::lobe;
use lumiris_numbers::math::{Rgb, Vec3};
use std::ops::BitOr;

/// The kind of scattering of a sample: a set of flags.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Lobe(u8);

impl Lobe {
    /// From a sum of flags of [`lobe`].
    #[inline]
    pub const fn of_flags(flags: u8) -> Lobe {
        Lobe(flags)
    }

    /// The sum of its flags.
    #[inline]
    pub const fn flags(self) -> u8 {
        self.0
    }

    /// On the side of `wo`.
    pub const REFLECTION: Lobe = Lobe(lobe::REFLECTION);
    /// On the other side.
    pub const TRANSMISSION: Lobe = Lobe(lobe::TRANSMISSION);
    /// Lambertian, or similarly wide.
    pub const DIFFUSE: Lobe = Lobe(lobe::DIFFUSE);
    /// A rough peak.
    pub const GLOSSY: Lobe = Lobe(lobe::GLOSSY);
    /// A delta: `pdf` is a probability. The methods for f and pdf exclude it.
    pub const SPECULAR: Lobe = Lobe(lobe::SPECULAR);

    /// True if all flags of `other` are set.
    #[inline]
    pub const fn contains(self, other: Lobe) -> bool {
        self.0 & other.0 == other.0
    }

    /// True if the direction is a delta.
    #[inline]
    pub const fn is_specular(self) -> bool {
        self.contains(Lobe::SPECULAR)
    }
}

impl BitOr for Lobe {
    type Output = Lobe;
    #[inline]
    fn bitor(self, other: Lobe) -> Lobe {
        Lobe(self.0 | other.0)
    }
}

/// A sampled direction. The weight of the path is `f·|cos θi|/pdf` for all lobes.
#[derive(Clone, Copy, Debug)]
pub struct BsdfSample {
    /// Value without cosine (1/sr). For a delta, its weight over |cos θi|, times `pdf`.
    pub f: Rgb,
    /// Direction to the light.
    pub wi: Vec3,
    /// Density per steradian; the probability of a delta.
    pub pdf: f32,
    /// Kind of scattering.
    pub lobe: Lobe,
    /// Index of refraction on the side of `wi` relative to the side of `wo`; 1 for reflection.
    pub eta: f32,
}

/// Value and density of a BSDF for a pair of directions, without deltas.
#[derive(Clone, Copy, Debug)]
pub struct BsdfValue {
    /// f·|cos θi| (1/sr).
    pub f_cos: Rgb,
    /// Density of sampling `wi` (1/sr).
    pub pdf: f32,
}

impl BsdfValue {
    /// No scattering.
    pub const ZERO: BsdfValue = BsdfValue { f_cos: Rgb::BLACK, pdf: 0.0 };
}

/// A rough lobe about the mirror direction.
#[derive(Clone, Copy, Debug)]
pub struct LobeWidth {
    /// α, the greater one if the lobe is anisotropic.
    pub alpha: f32,
    /// Fraction of the albedo (0 to 1).
    pub share: f32,
}

/// A lobe of microfacets, with its fraction of the albedo (0 to 1).
#[derive(Clone, Copy, Debug)]
pub(super) struct MicrofacetLobe {
    pub(super) distribution: TrowbridgeReitz,
    pub(super) share: f32,
}
