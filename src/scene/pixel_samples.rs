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
    /// Camera rays of each sample that see lights directly, row by row, at least 1; if none are given, 1 everywhere. The path of
    /// a sample begins with one of them.
    pub looks: Vec<u8>,
}

impl PixelSamples {
    /// Samples of a pixel when a pixel of the mean number would have `done` of [`Self::spp`]: an image that is stopped has
    /// its samples distributed in the same way.
    #[inline]
    pub fn until(&self, pixel: [u32; 2], done: u32) -> u32 {
        let all = u64::from(self.count(pixel));
        (all * u64::from(done)).div_ceil(u64::from(self.spp)).min(u64::from(u32::MAX)) as u32
    }

    /// When sample `index` of a pixel is taken: the number of samples that a pixel of the mean number has by then, and in the
    /// upper bits which of those it is that the pixel takes meanwhile. So samples of one turn are taken together.
    #[inline]
    pub fn turn(&self, pixel: [u32; 2], index: u32) -> u32 {
        let all = u64::from(self.count(pixel));
        let done = (u64::from(index) * u64::from(self.spp) / all.max(1)) as u32;
        done ^ (index - self.until(pixel, done)) << 20
    }

    /// All samples of a pixel.
    fn count(&self, pixel: [u32; 2]) -> u32 {
        self.counts[self.index(pixel)]
    }

    /// Camera rays of each sample of a pixel.
    #[inline]
    pub fn looks(&self, pixel: [u32; 2]) -> u32 {
        if self.looks.is_empty() { 1 } else { u32::from(self.looks[self.index(pixel)]) }
    }

    fn index(&self, [x, y]: [u32; 2]) -> usize {
        (y - self.bounds.y0) as usize * self.bounds.width() as usize + (x - self.bounds.x0) as usize
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
