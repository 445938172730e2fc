//! The interface of kernels, and their values and samples.

use lumiris_numbers::math::number::Number;
use lumiris_numbers::math::v3::V3;

/// Flags of samples. A sum of flags is a whole number.
pub mod lobe {
    /// To the side of `wo`.
    pub const REFLECTION: u8 = 1;
    /// To the other side.
    pub const TRANSMISSION: u8 = 2;
    /// Lambertian or similarly wide.
    pub const DIFFUSE: u8 = 4;
    /// A rough lobe.
    pub const GLOSSY: u8 = 8;
    /// A delta. The density is a probability; values and densities of other directions do not include it.
    pub const SPECULAR: u8 = 16;
}

/// Value and density for one direction.
#[derive(Clone, Copy, Debug)]
pub struct Value<N> {
    /// f·|cos θi| by channel (1/sr), without deltas.
    pub f_cos: [N; 3],
    /// Density of the samples (1/sr), without deltas.
    pub pdf: N,
}

/// As [`Value`], the same in all channels.
#[derive(Clone, Copy, Debug)]
pub struct GreyValue<N> {
    /// f·|cos θi| (1/sr), without deltas.
    pub f_cos: N,
    /// Density of the samples (1/sr), without deltas.
    pub pdf: N,
}

/// A sampled direction. The weight of the path is `f_cos`/`pdf`.
#[derive(Clone, Copy, Debug)]
pub struct Drawn<N> {
    /// Direction to the light.
    pub wi: V3<N>,
    /// f·|cos θi| by channel (1/sr). For a delta, its weight times `pdf`.
    pub f_cos: [N; 3],
    /// Density (1/sr). For a delta, its probability. 0 if there is no sample.
    pub pdf: N,
    /// Sum of [`lobe`] flags.
    pub lobe: N,
    /// Index of refraction on the side of `wi` relative to the side of `wo`; 1 for reflection.
    pub eta: N,
}

/// A BSDF. `p` are its parameters, `tables` its tabulated values.
pub trait BsdfKernel {
    /// Number of parameters.
    const PARAMS: usize;

    /// Value and density for a pair of directions.
    fn evaluate<N: Number>(p: &[N], tables: &[f32], wo: V3<N>, wi: V3<N>) -> Value<N>;

    /// Samples a direction: `u[0]` chooses the lobe, `u[1]` and `u[2]` the direction within it. Directions with a value
    /// of zero are samples, too.
    fn sample<N: Number>(p: &[N], tables: &[f32], wo: V3<N>, u: [N; 3]) -> Drawn<N>;
}

impl<N: Number> Value<N> {
    /// The same value for all channels.
    #[inline(always)]
    pub fn grey(f_cos: N, pdf: N) -> Self {
        Value { f_cos: [f_cos, f_cos, f_cos], pdf }
    }

    /// Zero where the mask is false. Values with a non-finite channel, and non-finite densities, become 0, too.
    #[inline(always)]
    pub fn kept(self, mask: N::Mask) -> Self {
        let [r, g, b] = self.f_cos;
        let is_value = mask & r.finite() & g.finite() & b.finite();
        let pdf = self.pdf.or_zero(mask & self.pdf.finite());
        Value { f_cos: [r.or_zero(is_value), g.or_zero(is_value), b.or_zero(is_value)], pdf }
    }
}

impl<N: Number> Drawn<N> {
    /// A sample with the given value and density.
    #[inline(always)]
    pub fn new(wi: V3<N>, value: Value<N>, lobe: N, eta: N) -> Self {
        Drawn { wi, f_cos: value.f_cos, pdf: value.pdf, lobe, eta }
    }

    /// Removes samples where the mask is false, and directions along the surface.
    #[inline(always)]
    pub fn kept(self, mask: N::Mask) -> Self {
        let zero = self.pdf.constant(0.0);
        let mask = mask & self.pdf.above(zero) & self.wi.z.magnitude().above(zero);
        let Value { f_cos, pdf } = Value { f_cos: self.f_cos, pdf: self.pdf }.kept(mask);
        Drawn { f_cos, pdf, ..self }
    }
}

/// A sum of flags as a number.
#[inline(always)]
pub(super) fn flags<N: Number>(like: N, flags: u8) -> N {
    like.constant(f32::from(flags))
}

/// True if both directions are on the same side.
#[inline(always)]
pub(super) fn same_side<N: Number>(wo: V3<N>, wi: V3<N>) -> N::Mask {
    (wo.z * wi.z).above(wo.z.constant(0.0))
}
