//! Statistics of a film, joined from bands of rows.

use super::image_noise::{Block, Noise};
use super::pixel::PixelSums;

/// Statistics of a film.
#[derive(Clone, Debug, PartialEq)]
pub struct Summary {
    /// Minimum and maximum number of samples of a pixel.
    pub samples: [u64; 2],
    /// Total number of samples.
    pub all_samples: u64,
    /// Number of pixels, and number of pixels with samples.
    pub pixels: [u64; 2],
    /// Minimum number of samples of a pixel with samples.
    pub least_samples: Option<u64>,
    /// Samples that count as black; see [`PixelSums::invalid`].
    pub invalid: u64,
    /// Noise, from the variances of pixel means.
    pub noise: Noise,
    /// Blocks of the noise.
    pub blocks: Vec<Block>,
    /// True if there are records of an irradiance cache.
    pub has_records: bool,
}

impl Summary {
    /// Mean number of samples of a pixel, with the minimum and the maximum if they differ: "12 per pixel", or "11.8 per
    /// pixel (4 to 65)" for the `unit` "per pixel".
    pub fn samples_text(&self, unit: &str) -> String {
        mean_and_range(self.all_samples, self.pixels[0], self.samples, unit)
    }

    /// The same over the pixels with samples: a part of an image by tiles has no others.
    pub fn samples_text_of_sampled(&self, unit: &str) -> String {
        let range = [self.least_samples.unwrap_or(0), self.samples[1]];
        mean_and_range(self.all_samples, self.pixels[1], range, unit)
    }
}

fn mean_and_range(sum: u64, count: u64, [least, most]: [u64; 2], unit: &str) -> String {
    if least == most {
        return format!("{least} {unit}");
    }
    let mean = format!("{:.1}", sum as f64 / count.max(1) as f64);
    format!("{} {unit} ({least} to {most})", mean.trim_end_matches(".0"))
}

/// Statistics of a band of rows.
pub(super) struct BandSummary {
    samples: [u64; 2],
    least_samples: Option<u64>,
    all_samples: u64,
    pixels: [u64; 2],
    invalid: u64,
    blocks: Vec<Block>,
    has_records: bool,
}

impl BandSummary {
    pub(super) fn new(pixels: &[PixelSums], blocks: Vec<Block>) -> Self {
        let counts = || pixels.iter().map(|p| p.count);
        BandSummary {
            samples: [counts().min().unwrap_or(0), counts().max().unwrap_or(0)],
            least_samples: counts().filter(|n| *n > 0).min(),
            all_samples: counts().sum(),
            pixels: [pixels.len() as u64, counts().filter(|n| *n > 0).count() as u64],
            invalid: pixels.iter().map(|p| p.invalid).sum(),
            blocks,
            has_records: pixels.iter().any(|p| p.records > 0),
        }
    }

    pub(super) fn of_all(bands: &[BandSummary]) -> Summary {
        let blocks: Vec<Block> = bands.iter().flat_map(|band| band.blocks.iter().copied()).collect();
        Summary {
            samples: [
                bands.iter().map(|band| band.samples[0]).min().unwrap_or(0),
                bands.iter().map(|band| band.samples[1]).max().unwrap_or(0),
            ],
            least_samples: bands.iter().filter_map(|band| band.least_samples).min(),
            all_samples: bands.iter().map(|band| band.all_samples).sum(),
            pixels: [0, 1].map(|i| bands.iter().map(|band| band.pixels[i]).sum()),
            invalid: bands.iter().map(|band| band.invalid).sum(),
            noise: Noise::of_image(&blocks),
            blocks,
            has_records: bands.iter().any(|band| band.has_records),
        }
    }
}
