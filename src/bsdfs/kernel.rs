//! BSDFs whose formulas are kernels of `lumiris_lanes::kernels`, here for single directions.

use super::lobe::{BsdfSample, BsdfValue, Lobe};
use lumiris_lanes::kernels::{BsdfKernel, Drawn, Value};
pub use lumiris_lanes::kernels::{Kernel, MAX_PARAMS};
use lumiris_numbers::math::{Rgb, Vec3};

/// A BSDF whose formulas are a kernel with parameters.
pub trait KernelBsdf {
    /// The kernel.
    type Formulas: BsdfKernel;

    /// The parameters, an array.
    type Params: AsRef<[f32]>;

    /// The parameters of the kernel.
    fn params(&self) -> Self::Params;

    /// The tables of the kernel.
    fn tables(&self) -> &[f32] {
        &[]
    }

    /// f·|cos θi| and density (1/sr), without deltas.
    #[inline]
    fn f_cos_and_pdf(&self, wo: Vec3, wi: Vec3) -> BsdfValue {
        evaluate::<Self::Formulas>(self.params().as_ref(), self.tables(), wo, wi)
    }

    /// Value without cosine (1/sr), without deltas.
    #[inline]
    fn f(&self, wo: Vec3, wi: Vec3) -> Rgb {
        without_cos(self.f_cos_and_pdf(wo, wi).f_cos, wi)
    }

    /// Density of the non-specular part of [`Self::sample`] per steradian.
    #[inline]
    fn pdf(&self, wo: Vec3, wi: Vec3) -> f32 {
        self.f_cos_and_pdf(wo, wi).pdf
    }

    /// Samples a direction: a lobe by `uc`, a direction within it by `u`.
    #[inline]
    fn sample(&self, wo: Vec3, uc: f32, u: [f32; 2]) -> Option<BsdfSample> {
        let params = self.params();
        of_drawn(Self::Formulas::sample(params.as_ref(), self.tables(), wo.into(), [uc, u[0], u[1]]))
    }
}

/// f·|cos θi| and density (1/sr) by a kernel.
#[inline]
pub(super) fn evaluate<K: BsdfKernel>(p: &[f32], tables: &[f32], wo: Vec3, wi: Vec3) -> BsdfValue {
    let Value { f_cos, pdf } = K::evaluate(p, tables, wo.into(), wi.into());
    BsdfValue { f_cos: Rgb::from_array(f_cos), pdf }
}

/// f from f·|cos θi|; black along the surface, where the quotient is not finite.
#[inline]
pub(super) fn without_cos(f_cos: Rgb, wi: Vec3) -> Rgb {
    let f = f_cos / wi.z.abs();
    if f.is_finite() { f } else { Rgb::BLACK }
}

/// The sample; `None` if it is invalid.
#[inline]
pub(super) fn of_drawn(drawn: Drawn<f32>) -> Option<BsdfSample> {
    let wi = drawn.wi.into();
    let f = without_cos(Rgb::from_array(drawn.f_cos), wi);
    let lobe = Lobe::of_flags(drawn.lobe as u8);
    (drawn.pdf > 0.0).then_some(BsdfSample { f, wi, pdf: drawn.pdf, lobe, eta: drawn.eta })
}
