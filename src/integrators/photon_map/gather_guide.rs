//! Guiding of the final gather by nearby photons [Jensen 1995].
//!
//! Directions are points of the unit square under the cosine-weighted map of the hemisphere. A histogram over a grid of
//! the square holds the power of the photons by direction of incidence. With a fraction s of guided rays, the density
//! is p(ω) = cos θ/π·(1 − s + s·h), where h is the density of the histogram in the square. So cos θ/p ≤ π/(1 − s) for
//! any photons.

use lumiris_numbers::math::warp::{invert_cosine_hemisphere, pdf_cosine_hemisphere, sample_cosine_hemisphere};
use lumiris_numbers::math::{PiecewiseConstant2D, Vec2, Vec3};

/// Cells of the grid per axis.
const CELLS: usize = 8;

/// A photon near the point of a guide.
#[derive(Clone, Copy, Debug)]
pub struct GuidePhoton {
    /// Direction of incidence, where +z is the normal.
    pub wi: Vec3,
    /// Power.
    pub power: f32,
}

/// A density of directions about a normal (+z).
#[derive(Clone, Debug)]
pub struct GatherGuide {
    histogram: Option<PiecewiseConstant2D>,
    fraction: f32,
}

impl GatherGuide {
    /// A guide by photons. Without photons, the density is the cosine.
    pub fn new(photons: impl IntoIterator<Item = GuidePhoton>, fraction: f32) -> Self {
        let mut cells = [0.0; CELLS * CELLS];
        for GuidePhoton { wi, power } in photons {
            if wi.z > 0.0 && power > 0.0 && power.is_finite() {
                let [x, y] = invert_cosine_hemisphere(wi).map(|u| ((u * CELLS as f32) as usize).min(CELLS - 1));
                cells[y * CELLS + x] += power;
            }
        }
        let is_lit = cells.iter().any(|&power| power > 0.0) && fraction > 0.0;
        GatherGuide { histogram: is_lit.then(|| PiecewiseConstant2D::new(&cells, CELLS)), fraction }
    }

    /// A direction with z > 0, up to rounding.
    pub fn sample(&self, u_choice: f32, u: [f32; 2]) -> Vec3 {
        let by_photons = self.histogram.as_ref().filter(|_| u_choice < self.fraction).and_then(|h| h.sample(u));
        sample_cosine_hemisphere(by_photons.map_or(u, |s| s.p.to_array()))
    }

    /// Density per steradian of [`sample`](Self::sample).
    pub fn pdf(&self, w: Vec3) -> f32 {
        let cosine = pdf_cosine_hemisphere(w);
        match &self.histogram {
            None => cosine,
            Some(h) => {
                let place = Vec2::from_array(invert_cosine_hemisphere(w));
                cosine * (1.0 - self.fraction + self.fraction * h.pdf(place))
            }
        }
    }
}
