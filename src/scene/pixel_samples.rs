//! Numbers of camera samples, if they vary between pixels.

use crate::film::PixelBounds;

/// Numbers of camera samples, pixel by pixel.
#[derive(Clone, Debug, PartialEq)]
pub struct PixelSamples {
    /// The pixels.
    pub bounds: PixelBounds,
    /// Number of samples per pixel that was asked for: approximately the mean of `counts`.
    pub spp: u32,
    /// Sample counts, row by row, at least 1.
    pub counts: Vec<u32>,
    /// Emission rays: camera rays per sample that measure the emission of directly visible lights, row by row, never 0.
    /// If the list is empty, the count is 1 everywhere. One of the rays continues as the path of the sample.
    pub looks: Vec<u8>,
}

impl PixelSamples {
    /// Number of samples of a pixel at the time when a pixel with the mean count has `done` of [`Self::spp`]. A stopped
    /// image therefore has the same relative sample distribution.
    #[inline]
    pub fn until(&self, pixel: [u32; 2], done: u32) -> u32 {
        let all = u64::from(self.count(pixel));
        (all * u64::from(done)).div_ceil(u64::from(self.spp)).min(u64::from(u32::MAX)) as u32
    }

    /// Order of sample `index` of a pixel. The lower bits hold the number of samples that a pixel with the mean count
    /// has by then. The upper bits count the samples that the pixel itself takes at that step. Samples of the same step
    /// are processed together.
    #[inline]
    pub fn turn(&self, pixel: [u32; 2], index: u32) -> u32 {
        let all = u64::from(self.count(pixel));
        let done = (u64::from(index) * u64::from(self.spp) / all.max(1)) as u32;
        done ^ (index - self.until(pixel, done)) << 20
    }

    /// Number of samples of a pixel.
    fn count(&self, pixel: [u32; 2]) -> u32 {
        self.counts[self.index(pixel)]
    }

    /// Emission rays per sample of a pixel.
    #[inline]
    pub fn looks(&self, pixel: [u32; 2]) -> u32 {
        if self.looks.is_empty() { 1 } else { u32::from(self.looks[self.index(pixel)]) }
    }

    fn index(&self, [x, y]: [u32; 2]) -> usize {
        (y - self.bounds.y0) as usize * self.bounds.width() as usize + (x - self.bounds.x0) as usize
    }

    /// Number of samples of the image.
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
        let samples = PixelSamples { bounds, spp: 16, counts: vec![4, 50], looks: Vec::new() };
        assert_eq!([0, 1, 4, 8, 16].map(|done| samples.until([3, 7], done)), [0, 1, 1, 2, 4]);
        assert_eq!([0, 1, 4, 8, 16, 32].map(|done| samples.until([4, 7], done)), [0, 4, 13, 25, 50, 100]);
        assert_eq!(samples.total(), 54);
    }

    #[test]
    fn a_sample_has_the_turn_in_which_it_is_taken() {
        let bounds = PixelBounds { x0: 3, x1: 6, y0: 7, y1: 8 };
        let samples = PixelSamples { bounds, spp: 16, counts: vec![4, 50, 16], looks: Vec::new() };
        for pixel in [[3, 7], [4, 7], [5, 7]] {
            for done in 0..40 {
                let of_pass = samples.until(pixel, done)..samples.until(pixel, done + 1);
                for (k, index) in of_pass.enumerate() {
                    assert_eq!(samples.turn(pixel, index), done ^ (k as u32) << 20, "{pixel:?} {index}");
                }
            }
        }
        assert_eq!((0..9).map(|index| samples.turn([5, 7], index)).collect::<Vec<_>>(), Vec::from_iter(0..9));
    }
}
