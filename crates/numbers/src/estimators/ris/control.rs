//! What is known of visibility as a control variate of resampling.
//!
//! Let proposal j contribute c_j·V_j to Σ c_j V_j, with the visibility V_j in {0, 1}, and let V̂_j in 0..=1 be any estimate
//! of it that is independent of the proposals. Then
//!
//! > Î = Σ over all proposals of c_j V̂_j + Σ over draws of scale·c_j (V_j − V̂_j)
//!
//! has the expectation Σ c_j V_j whatever V̂ is, as a draw has the scale 1/E[number of times that j is drawn]. The first
//! sum needs no ray and has the noise of M proposals, not that of N samples. The second one is noise about what is not
//! known. If V_j is 1 with the probability V̂_j, the mean square of its difference from V̂_j is V̂_j (1 − V̂_j), and the density
//! of the draws that has the least variance is proportional to |c_j|·√(V̂_j (1 − V̂_j)). A V̂ of 0 or 1 may be
//! wrong, so every proposal is drawn with a positive weight.

use crate::math::Rgb;

/// ε: the least variance of a visibility that is assumed.
const LEAST_VARIANCE: f32 = 0.01;

/// √(V̂(1 − V̂) + ε): the factor of the weight of a proposal whose visibility is estimated as `v`.
#[inline]
pub fn doubt(v: f32) -> f32 {
    (v * (1.0 - v) + LEAST_VARIANCE).sqrt()
}

/// The part of Î that needs no visibility: Σ c_j V̂_j over all proposals less Σ scale·c_j V̂_j over the draws.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Known {
    sum: Rgb,
}

impl Known {
    /// Adds a proposal, which contributes `c` where it is visible. It must have a positive weight.
    #[inline]
    pub fn propose(&mut self, c: Rgb, v: f32) {
        self.sum += c * v;
    }

    /// Adds a draw, which contributes `scaled` = scale·c where it is visible.
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
