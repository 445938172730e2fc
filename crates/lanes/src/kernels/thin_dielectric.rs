//! A thin dielectric sheet without refraction: the sum of all reflections between its two parallel faces,
//! R' = R + T²R/(1 − R²), T' = 1 − R' [Pharr et al. 2023, §9.5.1]. Parameters: η.

use super::bsdf_kernel::{BsdfKernel, Drawn, Value, flags, lobe};
use super::fresnel::fr_dielectric;
use lumiris_numbers::math::number::Number;
use lumiris_numbers::math::v3::V3;

/// The kernel.
#[derive(Debug)]
pub struct ThinDielectric;

/// Reflectance of the sheet for the cosine of incidence `cos`, of either sign.
#[inline(always)]
pub fn reflectance<N: Number>(cos: N, eta: N) -> N {
    let (r, one) = (fr_dielectric(cos.magnitude(), eta), cos.constant(1.0));
    let t = one - r;
    one.if_above(r, r + t * t * r / (one - r * r), r)
}

impl BsdfKernel for ThinDielectric {
    const PARAMS: usize = 1;

    #[inline(always)]
    fn evaluate<N: Number>(_p: &[N], _tables: &[f32], wo: V3<N>, _wi: V3<N>) -> Value<N> {
        Value::grey(wo.z.constant(0.0), wo.z.constant(0.0))
    }

    #[inline(always)]
    fn sample<N: Number>(p: &[N], _tables: &[f32], wo: V3<N>, u: [N; 3]) -> Drawn<N> {
        let r = reflectance(wo.z, p[0]);
        let reflects = r.above(u[0]);
        let probability = N::choose(reflects, r, -r + 1.0);
        let wi = V3 { x: -wo.x, y: -wo.y, z: N::choose(reflects, wo.z, -wo.z) };
        let kind = N::choose(
            reflects,
            flags(r, lobe::SPECULAR | lobe::REFLECTION),
            flags(r, lobe::SPECULAR | lobe::TRANSMISSION),
        );
        let one = r.constant(1.0);
        Drawn::new(wi, Value::grey(probability, probability), kind, one).kept(one.above(one.constant(0.0)))
    }
}
