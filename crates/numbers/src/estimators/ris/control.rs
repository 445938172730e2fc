//! Estimated visibility as a control variate of resampling.
//!
//! Proposal j contributes c_j·V_j to Σ c_j V_j, with the visibility V_j in {0, 1}. Let V̂_j in 0..=1 be any estimate of
//! V_j that is independent of the proposals. Then
//!
//! > Î = Σ over all proposals of c_j V̂_j + Σ over draws of scale·c_j (V_j − V̂_j)
//!
//! has the expectation Σ c_j V_j for any V̂, as a draw has the scale 1/E[number of times that j is drawn]. The first
//! sum needs no rays and has the noise of M proposals instead of N samples. The second sum only has the noise of the
//! unknown part of the visibility. If V_j is 1 with the probability V̂_j, the mean square of V_j − V̂_j is V̂_j (1 −
//! V̂_j), and the optimal density of the draws is proportional to |c_j|·√(V̂_j (1 − V̂_j)). A V̂ of 0 or 1 may be
//! wrong, so every proposal is drawn with a positive weight.

use crate::math::Rgb;

/// ε: the minimum variance of visibility in the weights.
const LEAST_VARIANCE: f32 = 0.01;

/// √(V̂(1 − V̂) + ε): the factor of the weight of a proposal with the estimated visibility `v`.
#[inline]
pub fn doubt(v: f32) -> f32 {
    (v * (1.0 - v) + LEAST_VARIANCE).sqrt()
}

/// The part of Î that needs no visibility: Σ c_j V̂_j over all proposals minus Σ scale·c_j V̂_j over the draws.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ControlSum {
    sum: Rgb,
}

impl ControlSum {
    /// Adds a proposal with the unshadowed contribution `c`. It must have a positive weight.
    #[inline]
    pub fn propose(&mut self, c: Rgb, v: f32) {
        self.sum += c * v;
    }

    /// Adds a draw with the unshadowed contribution `scaled` = scale·c.
    #[inline]
    pub fn draw(&mut self, scaled: Rgb, v: f32) {
        self.sum += scaled * -v;
    }

    /// The sum.
    #[inline]
    pub fn sum(&self) -> Rgb {
        self.sum
    }
}
