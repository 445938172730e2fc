//! A Lambertian base under a dielectric coat, in closed form:
//!
//! f(wo, wi) = f_r(wo, wi) + b T(wo) T(wi),
//!
//! where b is the sum over the reflections at the base, T(w) the transmittance of the coat from outside, and R(w) its
//! reflectance. Both sides of the surface are coated.
//!
//! [`Coated`] has a rough interface, whose T and R are tabulated: rows of [`COSINES`] pairs (T, R), evenly spaced in
//! √cos θ. Parameters: b, the base's albedo over T(wo) for choosing lobes, η, alphas, row of the table, and fraction
//! between this row and the next.
//!
//! [`SmoothCoated`] has a smooth interface. Parameters: b, the albedo as above, η, thickness.

use super::bsdf_kernel::{BsdfKernel, Drawn, GreyValue, Value, flags, lobe, same_side};
use super::facets::Facets;
use super::fresnel::{fr_dielectric, reflect};
use lumiris_numbers::math::elementary::{cosine_hemisphere, exp};
use lumiris_numbers::math::number::{Mask as _, Number};
use lumiris_numbers::math::v3::V3;
use std::f32::consts::FRAC_1_PI;

/// Entries of the tables over √cos θ.
pub const COSINES: usize = 128;

/// A rough, isotropic coat.
#[derive(Debug)]
pub struct Coated;

/// A smooth coat.
#[derive(Debug)]
pub struct SmoothCoated;

/// Interpolates linearly between two entries of a row; `column` counts numbers.
#[inline(always)]
fn between<N: Number>(tables: &[f32], row: N, column: N, t: N) -> N {
    let a = N::entry(tables, row, 2 * COSINES, column);
    let b = N::entry(tables, row, 2 * COSINES, column + 2.0);
    a + (b - a) * t
}

/// T or R for the cosine `cos`, interpolated between `row` and the next row.
#[inline(always)]
fn directional<N: Number>(tables: &[f32], [row, t]: [N; 2], cos: N, is_reflectance: bool) -> N {
    let (zero, one) = (cos.constant(0.0), cos.constant(1.0));
    let x = cos.greater(zero).lesser(one).root() * (COSINES - 1) as f32;
    let first = x.lesser(cos.constant((COSINES - 2) as f32)).whole();
    let column = first * 2.0 + if is_reflectance { 1.0 } else { 0.0 };
    let below = between(tables, row, column, x - first);
    if !t.above(zero).any() {
        return below;
    }
    below + (between(tables, row + 1.0, column, x - first) - below) * t
}

/// [T, R] of a rough coat from its table, for the cosine `cos` ≥ 0.
#[inline(always)]
pub fn rough_directional<N: Number>(tables: &[f32], row: [N; 2], cos: N) -> [N; 2] {
    [directional(tables, row, cos, false), directional(tables, row, cos, true)]
}

/// [T, R] of a smooth coat for the cosine `cos` ≥ 0.
#[inline(always)]
pub fn smooth_directional<N: Number>(cos: N, eta: N, thickness: N) -> [N; 2] {
    let (zero, one) = (cos.constant(0.0), cos.constant(1.0));
    let fresnel = fr_dielectric(cos, eta);
    let cos_t = (one - (one - cos * cos).greater(zero) / (eta * eta)).safe_root();
    let passes = (one - fresnel) * exp(-thickness / cos_t);
    [passes.or_zero(one.above(fresnel) & cos_t.above(zero)), fresnel]
}

/// Probability of sampling the interface, proportional to the albedos; `albedo` is the base's albedo over T(wo).
#[inline(always)]
pub fn p_interface<N: Number>(albedo: N, [t, r]: [N; 2]) -> N {
    let sum = r + albedo * t;
    (r / sum).or_zero(sum.above(r.constant(0.0)))
}

/// Contribution of the base: f·cos θi, and the density of cosine sampling.
#[inline(always)]
fn base<N: Number>(p: &[N], t: N, cos: N) -> Value<N> {
    let factor = t * cos;
    Value { f_cos: [p[0] * factor, p[1] * factor, p[2] * factor], pdf: cos * FRAC_1_PI }
}

/// Reflection by a rough interface. Both directions are in the upper hemisphere.
#[inline(always)]
pub fn interface<N: Number>(p: &[N], wo: V3<N>, wi: V3<N>) -> GreyValue<N> {
    let h = wo.plus(wi);
    let fresnel = fr_dielectric(wo.dot(h).magnitude() / h.dot(h).root(), p[4]);
    let GreyValue { f_cos, pdf } = Facets { alpha_x: p[5], alpha_y: p[6] }.reflection(wo, wi, h);
    GreyValue { f_cos: f_cos * fresnel, pdf: pdf.or_zero(fresnel.above(pdf.constant(0.0))) }
}

/// Value and density of a rough coat for directions in the upper hemisphere, given T and R of `wo` and T of `wi`.
#[inline(always)]
pub fn rough_value<N: Number>(p: &[N], wo: V3<N>, wi: V3<N>, of_wo: [N; 2], t_wi: N) -> Value<N> {
    let GreyValue { f_cos: reflected, pdf: density } = interface(p, wo, wi);
    let Value { f_cos: [r, g, b], pdf } = base(p, of_wo[0] * t_wi, wi.z);
    let choice = p_interface(p[3], of_wo);
    Value { f_cos: [r + reflected, g + reflected, b + reflected], pdf: choice * density + (-choice + 1.0) * pdf }
}

/// Samples a direction of the interface or the base; the mask is true for the interface. `wo` is in the upper
/// hemisphere.
#[inline(always)]
pub fn rough_direction<N: Number>(p: &[N], wo: V3<N>, of_wo: [N; 2], u: [N; 3]) -> (V3<N>, N::Mask) {
    let is_interface = p_interface(p[3], of_wo).above(u[0]);
    let u = [u[1], u[2]];
    let facets = Facets { alpha_x: p[5], alpha_y: p[6] };
    // A branch if all lanes agree, else both are computed
    let wi = if is_interface.all() {
        reflect(wo, facets.sample_m(wo, u))
    } else if !is_interface.any() {
        cosine_hemisphere(u)
    } else {
        V3::choose(is_interface, reflect(wo, facets.sample_m(wo, u)), cosine_hemisphere(u))
    };
    (wi, is_interface)
}

/// Flags of a reflection.
#[inline(always)]
pub fn kind<N: Number>(is_interface: N::Mask, of_interface: u8, like: N) -> N {
    N::choose(is_interface, flags(like, of_interface | lobe::REFLECTION), flags(like, lobe::DIFFUSE | lobe::REFLECTION))
}

/// −1 if `w` is in the lower hemisphere, else 1.
#[inline(always)]
pub fn flip<N: Number>(w: V3<N>) -> N {
    let one = w.z.constant(1.0);
    N::choose(w.z.constant(0.0).above(w.z), -one, one)
}

impl BsdfKernel for Coated {
    const PARAMS: usize = 9;

    #[inline(always)]
    fn evaluate<N: Number>(p: &[N], tables: &[f32], wo: V3<N>, wi: V3<N>) -> Value<N> {
        let (flip, is_seen) = (flip(wo), same_side(wo, wi));
        if !is_seen.any() {
            return Value::grey(wo.z.constant(0.0), wo.z.constant(0.0));
        }
        let (wo, wi) = (wo.times(flip), wi.times(flip));
        let row = [p[7], p[8]];
        let (of_wo, t_wi) = (rough_directional(tables, row, wo.z), directional(tables, row, wi.z, false));
        rough_value(p, wo, wi, of_wo, t_wi).kept(is_seen)
    }

    #[inline(always)]
    fn sample<N: Number>(p: &[N], tables: &[f32], wo: V3<N>, u: [N; 3]) -> Drawn<N> {
        let (flip, zero) = (flip(wo), wo.z.constant(0.0));
        let (wo, row) = (wo.times(flip), [p[7], p[8]]);
        let of_wo = rough_directional(tables, row, wo.z);
        let (wi, is_interface) = rough_direction(p, wo, of_wo, u);
        let value = rough_value(p, wo, wi, of_wo, directional(tables, row, wi.z, false));
        let kind = kind(is_interface, lobe::GLOSSY, flip);
        Drawn::new(wi.times(flip), value, kind, wo.z.constant(1.0)).kept(wo.z.above(zero) & wi.z.above(zero))
    }
}

impl BsdfKernel for SmoothCoated {
    const PARAMS: usize = 6;

    #[inline(always)]
    fn evaluate<N: Number>(p: &[N], _tables: &[f32], wo: V3<N>, wi: V3<N>) -> Value<N> {
        let of_wo = smooth_directional(wo.z.magnitude(), p[4], p[5]);
        let [t_wi, _] = smooth_directional(wi.z.magnitude(), p[4], p[5]);
        let Value { f_cos, pdf } = base(p, of_wo[0] * t_wi, wi.z.magnitude());
        Value { f_cos, pdf: (-p_interface(p[3], of_wo) + 1.0) * pdf }.kept(same_side(wo, wi))
    }

    #[inline(always)]
    fn sample<N: Number>(p: &[N], _tables: &[f32], wo: V3<N>, u: [N; 3]) -> Drawn<N> {
        // Choose between mirror and base
        let (cos_o, zero) = (wo.z.magnitude(), wo.z.constant(0.0));
        let of_wo = smooth_directional(cos_o, p[4], p[5]);
        let choice = p_interface(p[3], of_wo);
        let is_mirror = choice.above(u[0]);
        let cosine = cosine_hemisphere([u[1], u[2]]);
        let [t_wi, _] = smooth_directional(cosine.z, p[4], p[5]);
        let Value { f_cos: [r, g, b], pdf } = base(p, of_wo[0] * t_wi, cosine.z);
        let value = Value {
            f_cos: [
                N::choose(is_mirror, of_wo[1], r),
                N::choose(is_mirror, of_wo[1], g),
                N::choose(is_mirror, of_wo[1], b),
            ],
            pdf: N::choose(is_mirror, choice, (-choice + 1.0) * pdf),
        };

        // The base reflects to the side of `wo`
        let cosine = cosine.with_z(cosine.z.signed_as(wo.z));
        let wi = V3::choose(is_mirror, V3 { x: -wo.x, y: -wo.y, z: wo.z }, cosine);
        let kind = kind(is_mirror, lobe::SPECULAR, cos_o);
        Drawn::new(wi, value, kind, wo.z.constant(1.0)).kept(cos_o.above(zero))
    }
}
