//! Kinds of sequences.

use strum::{EnumIter, EnumString, IntoStaticStr, VariantNames};

/// The sequence.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, EnumIter, EnumString, IntoStaticStr, VariantNames)]
#[strum(serialize_all = "kebab-case")]
pub enum SamplerKind {
    /// Independent uniform numbers.
    Independent,
    /// For each sample and decision, a separate Owen-scrambled Sobol' net; samples are independent.
    Stratified,
    /// Owen-scrambled Sobol'; pixels are independent.
    Sobol,
    /// Owen-scrambled Sobol' with blue-noise errors within blocks of 16 × 16 pixels; blocks are independent.
    #[default]
    #[strum(serialize = "zsobol")]
    SobolBlueNoise,
}

impl SamplerKind {
    /// True if the samples of a pixel are independent of each other.
    pub fn has_independent_samples(self) -> bool {
        match self {
            SamplerKind::Independent | SamplerKind::Stratified => true,
            SamplerKind::Sobol | SamplerKind::SobolBlueNoise => false,
        }
    }
}
