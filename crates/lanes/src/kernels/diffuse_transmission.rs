//! Lambertian reflection and transmission: f = ρ/π on the side of `wo`, τ/π on the other. Parameters: ρ, τ.

use super::bsdf_kernel::{BsdfKernel, Drawn, Value, flags, lobe};
use lumiris_numbers::math::elementary::cosine_hemisphere;
use lumiris_numbers::math::number::Number;
use lumiris_numbers::math::v3::V3;
use std::f32::consts::FRAC_1_PI;

/// The kernel.
#[derive(Debug)]
pub struct DiffuseTransmission;

/// Probability of sampling reflection, proportional to the largest channels; 1 if the surface is black.
#[inline(always)]
pub fn p_reflect<N: Number>(p: &[N]) -> N {
    let r = p[0].greater(p[1]).greater(p[2]);
    let sum = r + p[3].greater(p[4]).greater(p[5]);
    N::choose(sum.above(r.constant(0.0)), r / sum, r.constant(1.0))
}

/// True unless the surface is black.
#[inline(always)]
fn exists<N: Number>(p: &[N]) -> N::Mask {
    let sum = p[0].greater(p[1]).greater(p[2]) + p[3].greater(p[4]).greater(p[5]);
    sum.above(sum.constant(0.0))
}

/// Value and density of reflection or transmission.
#[inline(always)]
fn of_side<N: Number>(p: &[N], reflects: N::Mask, cos: N) -> Value<N> {
    let density = cos * FRAC_1_PI;
    let p_reflect = p_reflect(p);
    let f_cos = [
        N::choose(reflects, p[0], p[3]) * density,
        N::choose(reflects, p[1], p[4]) * density,
        N::choose(reflects, p[2], p[5]) * density,
    ];
    Value { f_cos, pdf: N::choose(reflects, p_reflect, -p_reflect + 1.0) * density }.kept(exists(p))
}

impl BsdfKernel for DiffuseTransmission {
    const PARAMS: usize = 6;

    #[inline(always)]
    fn evaluate<N: Number>(p: &[N], _tables: &[f32], wo: V3<N>, wi: V3<N>) -> Value<N> {
        let (side, zero) = (wo.z * wi.z, wo.z.constant(0.0));
        of_side(p, side.above(zero), wi.z.magnitude()).kept(side.magnitude().above(zero))
    }

    #[inline(always)]
    fn sample<N: Number>(p: &[N], _tables: &[f32], wo: V3<N>, u: [N; 3]) -> Drawn<N> {
        let wi = cosine_hemisphere([u[1], u[2]]);
        let reflects = p_reflect(p).above(u[0]);
        let value = of_side(p, reflects, wi.z);
        let wi = wi.with_z(wi.z.signed_as(N::choose(reflects, wo.z, -wo.z)));
        let kind = N::choose(
            reflects,
            flags(wo.z, lobe::DIFFUSE | lobe::REFLECTION),
            flags(wo.z, lobe::DIFFUSE | lobe::TRANSMISSION),
        );
        Drawn::new(wi, value, kind, wo.z.constant(1.0)).kept(wo.z.magnitude().above(wo.z.constant(0.0)))
    }
}
