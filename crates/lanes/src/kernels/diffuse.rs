//! Lambertian reflection: f = ρ/π on the side of `wo`. Parameters: ρ.

use super::bsdf_kernel::{BsdfKernel, Drawn, Value, flags, lobe, same_side};
use lumiris_numbers::math::elementary::cosine_hemisphere;
use lumiris_numbers::math::number::Number;
use lumiris_numbers::math::v3::V3;
use std::f32::consts::FRAC_1_PI;

/// The kernel.
#[derive(Debug)]
pub struct Diffuse;

impl BsdfKernel for Diffuse {
    const PARAMS: usize = 3;

    #[inline(always)]
    fn evaluate<N: Number>(p: &[N], _tables: &[f32], wo: V3<N>, wi: V3<N>) -> Value<N> {
        let pdf = (wi.z.magnitude() * FRAC_1_PI).or_zero(same_side(wo, wi));
        Value { f_cos: [p[0] * pdf, p[1] * pdf, p[2] * pdf], pdf }
    }

    #[inline(always)]
    fn sample<N: Number>(p: &[N], _tables: &[f32], wo: V3<N>, u: [N; 3]) -> Drawn<N> {
        let wi = cosine_hemisphere([u[1], u[2]]);
        let pdf = wi.z * FRAC_1_PI;
        let value = Value { f_cos: [p[0] * pdf, p[1] * pdf, p[2] * pdf], pdf };
        let wi = wi.with_z(wi.z.signed_as(wo.z));
        let is_seen = wo.z.magnitude().above(wo.z.constant(0.0));
        Drawn::new(wi, value, flags(pdf, lobe::DIFFUSE | lobe::REFLECTION), pdf.constant(1.0)).kept(is_seen)
    }
}
