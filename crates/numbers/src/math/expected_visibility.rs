//! The visibility V̂ of a light, estimated from its photons; derived in the renderer's `lights::learned_visibility`.

use super::number::Number;

/// v₀ and a of the prior of V.
pub const PRIOR_MEAN: f32 = 0.5;
/// See [`PRIOR_MEAN`].
pub const PRIOR_SHAPE: f32 = 1.0;
/// Minimum of V̂, which bounds the weight of a sample.
pub const MIN_VISIBILITY: f32 = 1e-4;

/// V̂ = (c + a)/(μ + a/v₀) of lights of irradiance E = `importance` with c = `count` photons, from [`MIN_VISIBILITY`]
/// (also if it is NaN) to 1. `of_one_photon` is the irradiance per photon, E/μ.
#[inline(always)]
pub fn expected_visibility<N: Number>(importance: N, of_one_photon: N, count: N) -> N {
    let (least, most) = (count.constant(MIN_VISIBILITY), count.constant(1.0));
    let visibility = (count + PRIOR_SHAPE) * of_one_photon / (importance + of_one_photon * (PRIOR_SHAPE / PRIOR_MEAN));
    visibility.greater(least).lesser(most)
}
