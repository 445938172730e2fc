//! Random-number domains of a shading point. Numbers from different domains are independent.

/// Light samples.
pub(super) const LIGHT: u32 = 0;
/// BSDF samples.
pub(super) const BSDF: u32 = 1;
/// Choice of the technique of a single sample.
pub(super) const TECHNIQUE: u32 = 2;
/// Allocation of samples to mixture groups.
pub(super) const GROUPS: u32 = 3;
/// Delta lights, where they are sampled separately.
pub(super) const DELTA: u32 = 4;
/// Non-contributing lights.
pub(super) const NONCONTRIBUTING: u32 = 5;
/// Sample counts of the contributing lights.
pub(super) const COUNTS: u32 = 6;
/// Positions of proposals, and the draws from them.
pub(super) const RESAMPLE: u32 = 8;
/// Bounds of strata of proposals.
pub(super) const STRATA: u32 = 9;
/// Mixture group g uses the domain `GROUP + g`.
pub(super) const GROUP: u32 = 16;
/// Contributing light number k uses the domain `CONTRIBUTING + k`.
pub(super) const CONTRIBUTING: u32 = 64;
/// The transmittance of segment number k of a point uses the domain `TRANSMITTANCE + k`.
pub(super) const TRANSMITTANCE: u32 = 1 << 20;
