//! Camera samples of each pixel, where pixels have different numbers.

use crate::film::PixelBounds;

/// Numbers of camera samples, pixel by pixel.
#[derive(Clone, Debug, PartialEq)]
pub struct PixelSamples {
    /// The pixels.
    pub bounds: PixelBounds,
    /// Samples per pixel that the numbers were made for: about their mean.
    pub spp: u32,
    /// Numbers, row by row, at least 1.
    pub counts: Vec<u32>,
}

impl PixelSamples {
    /// Samples of a pixel when a pixel of the mean number would have `done` of [`Self::spp`]: an image that is stopped has
    /// its samples distributed in the same way.
    #[inline]
    pub fn until(&self, [x, y]: [u32; 2], done: u32) -> u32 {
        let row = (y - self.bounds.y0) as usize * self.bounds.width() as usize;
        let all = u64::from(self.counts[row + (x - self.bounds.x0) as usize]);
        (all * u64::from(done)).div_ceil(u64::from(self.spp)).min(u64::from(u32::MAX)) as u32
    }

    /// All samples of the image.
    pub fn total(&self) -> u64 {
        self.counts.iter().map(|&n| u64::from(n)).sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_part_of_the_passes_takes_that_part_of_the_samples_of_every_pixel() {
        let bounds = PixelBounds { x0: 3, x1: 5, y0: 7, y1: 8 };
        let samples = PixelSamples { bounds, spp: 16, counts: vec![4, 50] };
        assert_eq!([0, 1, 4, 8, 16].map(|done| samples.until([3, 7], done)), [0, 1, 1, 2, 4]);
        assert_eq!([0, 1, 4, 8, 16, 32].map(|done| samples.until([4, 7], done)), [0, 4, 13, 25, 50, 100]);
        assert_eq!(samples.total(), 54);
    }
}
