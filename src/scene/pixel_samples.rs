//! Numbers of camera samples, if they vary between pixels. Planned by `planning/allocation.rs` and `noise_target.rs`.

use crate::film::PixelBounds;

/// Lower bits of a share group.
const STEP_BITS: u32 = 20;

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
    pub emission_rays: Vec<u8>,
}

impl PixelSamples {
    /// Number of samples of a pixel at the time when a pixel with the mean count has `done` of [`Self::spp`]. A stopped
    /// image therefore has the same relative sample distribution.
    #[inline]
    pub fn until(&self, pixel: [u32; 2], done: u32) -> u32 {
        let all = u64::from(self.count(pixel));
        (all * u64::from(done)).div_ceil(u64::from(self.spp)).min(u64::from(u32::MAX)) as u32
    }

    /// Share group of sample `index` of a pixel: samples with the same group may share paths, and use the same light
    /// paths. The lower bits hold the [step](Self::step), the number of samples that a pixel with the mean count has by
    /// then. The upper bits count the samples that the pixel itself takes at that step.
    #[inline]
    pub fn share_group(&self, pixel: [u32; 2], index: u32) -> u32 {
        let all = u64::from(self.count(pixel));
        let done = (u64::from(index) * u64::from(self.spp) / all.max(1)) as u32;
        done ^ (index - self.until(pixel, done)) << STEP_BITS
    }

    /// The step of a share group, which all samples that a pixel takes at that step have in common.
    #[inline]
    pub fn step(share_group: u32) -> u32 {
        share_group & ((1 << STEP_BITS) - 1)
    }

    /// Number of samples of a pixel.
    fn count(&self, pixel: [u32; 2]) -> u32 {
        self.counts[self.bounds.index_of(pixel)]
    }

    /// Emission rays per sample of a pixel.
    #[inline]
    pub fn emission_rays(&self, pixel: [u32; 2]) -> u32 {
        if self.emission_rays.is_empty() { 1 } else { u32::from(self.emission_rays[self.bounds.index_of(pixel)]) }
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
        let samples = PixelSamples { bounds, spp: 16, counts: vec![4, 50], emission_rays: Vec::new() };
        assert_eq!([0, 1, 4, 8, 16].map(|done| samples.until([3, 7], done)), [0, 1, 1, 2, 4]);
        assert_eq!([0, 1, 4, 8, 16, 32].map(|done| samples.until([4, 7], done)), [0, 4, 13, 25, 50, 100]);
        assert_eq!(samples.total(), 54);
    }

    #[test]
    fn a_sample_has_the_share_group_of_the_step_in_which_it_is_taken() {
        let bounds = PixelBounds { x0: 3, x1: 6, y0: 7, y1: 8 };
        let samples = PixelSamples { bounds, spp: 16, counts: vec![4, 50, 16], emission_rays: Vec::new() };
        for pixel in [[3, 7], [4, 7], [5, 7]] {
            for done in 0..40 {
                let of_pass = samples.until(pixel, done)..samples.until(pixel, done + 1);
                for (k, index) in of_pass.enumerate() {
                    assert_eq!(samples.share_group(pixel, index), done ^ (k as u32) << 20, "{pixel:?} {index}");
                }
            }
        }
        assert_eq!((0..9).map(|index| samples.share_group([5, 7], index)).collect::<Vec<_>>(), Vec::from_iter(0..9));
    }
}
