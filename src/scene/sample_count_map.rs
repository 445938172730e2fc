//! The optimal sample and proposal counts of `ris` in each pixel, made by `planning/proposals.rs`.

use crate::film::PixelBounds;
use crate::settings::SampleCounts;
use lumiris_numbers::estimators::ris::sample_counts::{Costs, counts};

/// M/N of every pixel, with equal time per estimate [Talbot 2005, §4.3; Talbot et al. 2005, Fig. 3].
#[derive(Clone, Debug, PartialEq)]
pub struct SampleCountMap {
    /// The pixels.
    pub bounds: PixelBounds,
    /// M/N, row by row, at least 1.
    pub ratios: Vec<f32>,
    /// Time of a proposal.
    pub t1: f64,
    /// Time of a sample, in the same unit.
    pub t2: f64,
    /// Time of an estimate, in the same unit.
    pub time: f64,
}

impl SampleCountMap {
    /// M/N of a pixel.
    pub fn ratio(&self, pixel: [u32; 2]) -> f32 {
        self.ratios[self.bounds.index_of(pixel)]
    }

    /// Sample counts of one estimate in a pixel, rounded stochastically by `u`, so that their expectations are exact.
    pub fn sample_counts(&self, pixel: [u32; 2], u: [f32; 2]) -> SampleCounts {
        let costs = Costs { t1: self.t1, t2: self.t2 };
        let counts = counts(f64::from(self.ratio(pixel)), costs, self.time, u);
        SampleCounts { samples: counts.n, proposals: counts.m }
    }
}
