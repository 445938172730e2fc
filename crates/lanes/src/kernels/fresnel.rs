//! Reflection, refraction and the Fresnel reflectance of smooth interfaces, unpolarised [Born and Wolf 1999, §1.5].
//!
//! η is the index of refraction of the side that `-n` points to, relative to the side that `+n` points to.

use lumiris_numbers::math::number::Number;
use lumiris_numbers::math::v3::V3;

/// Mirror of `w` about `n`; both point away from the surface.
#[inline(always)]
pub fn reflect<N: Number>(w: V3<N>, n: V3<N>) -> V3<N> {
    n.times(w.dot(n) * 2.0).minus(w)
}

/// A refracted direction.
#[derive(Clone, Copy, Debug)]
pub struct Refracted<N: Number> {
    /// The direction.
    pub wi: V3<N>,
    /// 1/η along the path.
    pub inverse_eta: N,
    /// False at total internal reflection.
    pub passes: N::Mask,
}

/// Refracts `w` at a surface with normal `n`. 1/η is η if `w` is on the side of `-n`.
#[inline(always)]
pub fn refract<N: Number>(w: V3<N>, n: V3<N>, eta: N) -> Refracted<N> {
    let (cos, one) = (w.dot(n), eta.constant(1.0));
    let inverse = inverse_eta(cos, eta);
    let cos_i = cos.magnitude();
    let sin2_t = (one - cos * cos).greater(eta.constant(0.0)) * (inverse * inverse);
    let along = cos_i * inverse - (one - sin2_t).safe_root();
    let along = N::choose(eta.constant(0.0).above(cos), -along, along);
    Refracted { wi: n.times(along).minus(w.times(inverse)), inverse_eta: inverse, passes: one.above(sin2_t) }
}

/// 1/η along a path, one direction of which has the cosine `cos` with the normal.
#[inline(always)]
pub fn inverse_eta<N: Number>(cos: N, eta: N) -> N {
    N::choose(eta.constant(0.0).above(cos), eta, eta.constant(1.0) / eta)
}

/// Reflectance of a dielectric interface for the cosine of incidence `cos`, which is negative for light from the side
/// of `-n`. 1 at total internal reflection.
#[inline(always)]
pub fn fr_dielectric<N: Number>(cos: N, eta: N) -> N {
    fr_inverse(cos, inverse_eta(cos, eta))
}

/// Reflectance of a dielectric interface, given 1/η along the path.
#[inline(always)]
pub fn fr_inverse<N: Number>(cos: N, inverse: N) -> N {
    let one = cos.constant(1.0);
    let cos = cos.magnitude().lesser(one);
    let sin2_t = (one - cos * cos) * (inverse * inverse);
    let cos_t = (one - sin2_t).safe_root();
    let parallel = (cos - inverse * cos_t) / (cos + inverse * cos_t);
    let perpendicular = (inverse * cos - cos_t) / (inverse * cos + cos_t);
    let r = (parallel * parallel + perpendicular * perpendicular) * 0.5;
    one.if_above(sin2_t, r, one)
}

/// Reflectance of an interface to an absorbing medium with the complex index η + ik. With the perpendicular reflectance
/// s = (t1 − t2)/(t1 + t2) and the parallel reflectance s (t3 − t4)/(t3 + t4), their mean is s t3/(t3 + t4).
#[inline(always)]
pub fn fr_complex<N: Number>(cos: N, eta: N, k: N) -> N {
    let (zero, one) = (cos.constant(0.0), cos.constant(1.0));
    let cos = cos.greater(zero).lesser(one);
    let (cos2, eta2, k2) = (cos * cos, eta * eta, k * k);
    let sin2 = one - cos2;
    // a² + b² and a of the refracted wave vector a + ib
    let t0 = eta2 - k2 - sin2;
    let a2_plus_b2 = (t0 * t0 + eta2 * k2 * 4.0).safe_root();
    let a = ((a2_plus_b2 + t0) * 0.5).safe_root();
    let t1 = a2_plus_b2 + cos2;
    let t2 = a * cos * 2.0;
    let t3 = cos2 * a2_plus_b2 + sin2 * sin2;
    let t4 = t2 * sin2;
    // The sums vanish only at grazing incidence without an interface (η = 1, k = 0). The limit is total reflection
    let divisor = (t1 + t2) * (t3 + t4);
    let r = ((t1 - t2) * t3 / divisor).greater(zero).lesser(one);
    divisor.if_above(zero, r, one)
}
