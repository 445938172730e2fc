//! Reflection by a metal, smooth or with GGX microfacets: f = D F G / (4 cos θo cos θi) [Cook and Torrance 1982; Walter
//! et al. 2007]. Single scattering only. Parameters: alphas, η, k.

use super::bsdf_kernel::{BsdfKernel, Drawn, GreyValue, Value, flags, lobe, same_side};
use super::facets::Facets;
use super::fresnel::{fr_complex, reflect};
use lumiris_numbers::math::number::{Mask as _, Number};
use lumiris_numbers::math::v3::V3;

/// The kernel.
#[derive(Debug)]
pub struct Conductor;

#[inline(always)]
fn facets<N: Number>(p: &[N]) -> Facets<N> {
    Facets { alpha_x: p[0], alpha_y: p[1] }
}

/// Reflectance of the channels times `factor`.
#[inline(always)]
fn metal<N: Number>(p: &[N], cos: N, factor: N) -> [N; 3] {
    [fr_complex(cos, p[2], p[5]) * factor, fr_complex(cos, p[3], p[6]) * factor, fr_complex(cos, p[4], p[7]) * factor]
}

impl BsdfKernel for Conductor {
    const PARAMS: usize = 8;

    #[inline(always)]
    fn evaluate<N: Number>(p: &[N], _tables: &[f32], wo: V3<N>, wi: V3<N>) -> Value<N> {
        let h = wo.plus(wi);
        let cos_m = wo.dot(h).magnitude() / h.dot(h).root();
        let GreyValue { f_cos: d_g, pdf } = facets(p).reflection(wo, wi, h);
        Value { f_cos: metal(p, cos_m, d_g), pdf }.kept(same_side(wo, wi) & !facets(p).is_smooth())
    }

    #[inline(always)]
    fn sample<N: Number>(p: &[N], _tables: &[f32], wo: V3<N>, u: [N; 3]) -> Drawn<N> {
        // A mirror by default, microfacets where the surface is rough
        let (zero, one) = (wo.z.constant(0.0), wo.z.constant(1.0));
        let is_smooth = facets(p).is_smooth();
        let mirror = V3 { x: -wo.x, y: -wo.y, z: wo.z };
        let (mut wi, mut d_g, mut pdf, mut cos_m) = (mirror, one, one, wo.z.magnitude());
        if !is_smooth.all() {
            let m = facets(p).sample_m(wo, [u[1], u[2]]);
            let rough = reflect(wo, m);
            let GreyValue { f_cos: of_rough, pdf: pdf_rough } = facets(p).reflection(wo, rough, m);
            wi = V3::choose(is_smooth, mirror, rough);
            (d_g, pdf) = (N::choose(is_smooth, one, of_rough), N::choose(is_smooth, one, pdf_rough));
            cos_m = N::choose(is_smooth, cos_m, wo.dot(m).magnitude());
        }

        // Value and flags
        let value = Value { f_cos: metal(p, cos_m, d_g), pdf };
        let kind = N::choose(
            is_smooth,
            flags(one, lobe::SPECULAR | lobe::REFLECTION),
            flags(one, lobe::GLOSSY | lobe::REFLECTION),
        );
        let is_seen = same_side(wo, wi) | (is_smooth & wo.z.magnitude().above(zero));
        Drawn::new(wi, value, kind, one).kept(is_seen)
    }
}
