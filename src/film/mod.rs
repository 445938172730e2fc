//! The film: sums per pixel, for means, variances and AOVs.
//!
//! Pixel filters are importance-sampled: a sample belongs to one pixel, and its weight is the sign of the filter
//! ([`filter`]). Samples are added to exact sums ([`exact`], [`accumulator`]), so that the film does not depend on
//! their order and division. [`packed`] compresses the sums of a tile in memory, and [`encoding`] in files.
//! [`variance`] estimates the variance of pixel means by [`replicas`], and [`noise`] the noise of the image.

pub mod accumulator;
pub mod encoding;
pub mod exact;
pub mod filter;
pub mod noise;
pub mod packed;
pub mod replicas;
pub mod variance;

use accumulator::PixelAccumulator;
use lumiris_numbers::math::{Rgb, Vec3};
use noise::{Block, Noise};
use packed::PackedSums;
use rayon::prelude::*;
use replicas::Replica;
use std::ops::Range;
use std::sync::{Arc, OnceLock};
use variance::VarianceScale;

/// The result of one camera sample.
#[derive(Clone, Copy, Debug, Default)]
pub struct PixelSample {
    /// Radiance times the filter weight.
    pub radiance: Rgb,
    /// Added to the mean of a replica, but not to the spread of its samples: the difference of the light paths that it
    /// shares with its pixel ([`replicas`]).
    pub offset: Rgb,
    /// Features of the first surface; `None` if the ray hits nothing.
    pub features: Option<Features>,
}

/// The features recorded by samples.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum FeatureSet {
    /// None.
    None,
    /// All but the albedo, whose estimation may be slow.
    NoAlbedo,
    /// All.
    #[default]
    All,
}

/// Features of the first surface hit by a camera ray.
#[derive(Clone, Copy, Debug, Default)]
pub struct Features {
    /// Albedo estimate.
    pub albedo: Rgb,
    /// Shading normal, world space, towards the viewer.
    pub normal: Vec3,
    /// Distance from the camera along the ray.
    pub depth: f32,
    /// Material index.
    pub material: u32,
    /// Geometry index.
    pub object: u32,
}

/// Sums over the samples of a pixel, as floating-point numbers.
#[derive(Clone, Copy, Debug, Default)]
pub struct PixelSums {
    /// Number of samples.
    pub count: u64,
    /// Σ radiance.
    pub radiance: [f64; 3],
    /// Σ radiance², per channel.
    pub radiance_squared: [f64; 3],
    /// Number of samples that hit a surface.
    pub hits: u64,
    /// Σ albedo.
    pub albedo: [f64; 3],
    /// Σ normal.
    pub normal: [f64; 3],
    /// Σ depth of the samples that hit a surface.
    pub depth: f64,
    /// Material index of the first sample (by index) that hit a surface, plus one; 0 if there is none.
    pub material: u32,
    /// Geometry index of that sample, plus one; 0 if there is none.
    pub object: u32,
    /// Samples with a radiance that is not finite, or beyond [`exact::LIMIT`]. They count as black.
    pub invalid: u64,
    /// Records of the irradiance cache requested by this pixel.
    pub records: u32,
}

impl PixelSums {
    /// Mean radiance; black without samples.
    pub fn mean(&self) -> [f64; 3] {
        self.radiance.map(|s| s / self.count.max(1) as f64)
    }

    /// Variance of the mean per channel, from the spread of the samples, if they are independent. 0 with fewer than two
    /// samples. See [`Film::read_rows_with_variances`] for dependent samples.
    pub fn variance_of_mean(&self) -> [f64; 3] {
        if self.count < 2 {
            return [0.0; 3];
        }
        let n = self.count as f64;
        std::array::from_fn(|c| {
            let mean = self.radiance[c] / n;
            ((self.radiance_squared[c] / n - mean * mean).max(0.0)) / (n - 1.0)
        })
    }

    /// Subtracts `off` from the mean. The spread of the samples remains.
    fn subtract(&mut self, off: [f32; 3]) {
        let count = self.count.max(1) as f64;
        for ((sum, squares), off) in self.radiance.iter_mut().zip(&mut self.radiance_squared).zip(off) {
            let before = *sum;
            *sum -= count * f64::from(off);
            *squares += (*sum * *sum - before * before) / count;
        }
    }
}

/// A rectangle of pixels `x0 ≤ x < x1`, `y0 ≤ y < y1` in raster coordinates, y downwards.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PixelBounds {
    /// Left.
    pub x0: u32,
    /// Right, exclusive.
    pub x1: u32,
    /// Top.
    pub y0: u32,
    /// Bottom, exclusive.
    pub y1: u32,
}

impl PixelBounds {
    /// Width in pixels.
    pub fn width(&self) -> u32 {
        self.x1.saturating_sub(self.x0)
    }

    /// Height in pixels.
    pub fn height(&self) -> u32 {
        self.y1.saturating_sub(self.y0)
    }

    /// Number of pixels.
    pub fn area(&self) -> usize {
        self.width() as usize * self.height() as usize
    }

    /// Coordinates of all pixels, row by row.
    pub fn pixels(&self) -> impl ExactSizeIterator<Item = [u32; 2]> + use<> {
        let PixelBounds { x0, y0, .. } = *self;
        let width = self.width();
        (0..self.area()).map(move |i| [x0 + i as u32 % width, y0 + i as u32 / width])
    }

    /// Tiles of at most `size` × `size` pixels that cover the rectangle, row by row.
    pub fn tiles(&self, size: u32) -> Vec<PixelBounds> {
        let size = size.max(1);
        let mut tiles = Vec::new();
        for y0 in (self.y0..self.y1).step_by(size as usize) {
            for x0 in (self.x0..self.x1).step_by(size as usize) {
                tiles.push(PixelBounds { x0, y0, x1: (x0 + size).min(self.x1), y1: (y0 + size).min(self.y1) });
            }
        }
        tiles
    }

    /// Ranges of indices of the common pixels of two rectangles, in each of them, a row at a time. Indices count row by
    /// row.
    pub fn common_rows(&self, other: &PixelBounds) -> impl Iterator<Item = (Range<usize>, Range<usize>)> + use<> {
        let (a, b) = (*self, *other);
        let (x0, x1) = (a.x0.max(b.x0), a.x1.min(b.x1));
        let row = move |of: &PixelBounds, y: u32| {
            let first = (y - of.y0) as usize * of.width() as usize;
            first + (x0 - of.x0) as usize..first + (x1 - of.x0) as usize
        };
        let rows = if x0 < x1 { a.y0.max(b.y0)..a.y1.min(b.y1) } else { 0..0 };
        rows.map(move |y| (row(&a, y), row(&b, y)))
    }
}

/// A tile of a film: its pixels, row by row.
#[derive(Clone, Debug)]
pub struct FilmTile {
    /// The pixels.
    pub bounds: PixelBounds,
    /// Their sums.
    pub sums: Arc<PackedSums>,
}

/// The sums of all pixels inside the crop window. They remain packed, and are read some rows at a time. Pixels outside
/// all tiles have no samples.
#[derive(Clone, Debug)]
pub struct Film {
    /// Size of the full image (width, height).
    pub resolution: [u32; 2],
    /// The rendered part.
    pub bounds: PixelBounds,
    /// Sorted by rows and columns. Tiles with common rows have the same first and last row.
    tiles: Vec<FilmTile>,
    /// Second estimates of some pixels, sorted by pixel index; not part of the image. Empty if samples are independent.
    replicas: Vec<Replica>,
    /// Subtracted from the mean of each pixel; empty if there are no corrections.
    corrections: Vec<[f32; 3]>,
    /// Light-group layers.
    light_layers: Vec<(String, Film)>,
    variance_scale: OnceLock<VarianceScale>,
    summary: OnceLock<Summary>,
}

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

impl Film {
    /// A film of disjoint tiles, and replicas.
    pub fn new(
        resolution: [u32; 2],
        bounds: PixelBounds,
        mut tiles: Vec<FilmTile>,
        mut replicas: Vec<Replica>,
    ) -> Self {
        tiles.sort_unstable_by_key(|t| (t.bounds.y0, t.bounds.x0));
        replicas.sort_unstable_by_key(|r| r.pixel);
        let (variance_scale, summary) = Default::default();
        let (corrections, light_layers) = Default::default();
        Film { resolution, bounds, tiles, replicas, corrections, light_layers, variance_scale, summary }
    }

    /// Adds light-group layers.
    #[must_use]
    pub fn with_light_layers(self, light_layers: Vec<(String, Film)>) -> Self {
        Film { light_layers, ..self }
    }

    /// Light-group layers by name. Their sum is the image.
    pub fn light_layers(&self) -> &[(String, Film)] {
        &self.light_layers
    }

    /// A film of a single tile.
    pub fn of_pixels(resolution: [u32; 2], bounds: PixelBounds, pixels: &[PixelAccumulator]) -> Self {
        Film::new(resolution, bounds, vec![FilmTile { bounds, sums: Arc::new(PackedSums::of(pixels)) }], Vec::new())
    }

    /// Sets corrections, which are subtracted from the mean of each pixel; the spread of the samples remains.
    /// `replicas` are already corrected.
    pub fn correct(&mut self, corrections: Vec<[f32; 3]>, replicas: Vec<Replica>) {
        (self.corrections, self.replicas) = (corrections, replicas);
        (self.variance_scale, self.summary) = Default::default();
    }

    /// True if pixel means are corrected: they differ from the means of the tiles.
    pub fn is_corrected(&self) -> bool {
        !self.corrections.is_empty()
    }

    /// Index of a pixel, row by row.
    pub fn index(&self, x: u32, y: u32) -> usize {
        (y - self.bounds.y0) as usize * self.bounds.width() as usize + (x - self.bounds.x0) as usize
    }

    /// Number of pixels.
    pub fn len(&self) -> usize {
        self.bounds.area()
    }

    /// True if there are no pixels.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The tiles, sorted by rows and columns.
    pub fn tiles(&self) -> &[FilmTile] {
        &self.tiles
    }

    /// Second estimates of some pixels, sorted by pixel index.
    pub fn replicas(&self) -> &[Replica] {
        &self.replicas
    }

    /// Bytes of memory.
    pub fn bytes(&self) -> usize {
        let tiles: usize = self.tiles.iter().map(|t| t.sums.bytes() + size_of_val(t)).sum();
        let layers: usize = self.light_layers.iter().map(|(_, film)| film.bytes()).sum();
        tiles + layers + size_of_val(&self.replicas[..]) + size_of_val(&self.corrections[..])
    }

    /// All pixels, row by row. Takes 144 bytes per pixel.
    pub fn pixels(&self) -> Vec<PixelSums> {
        let mut all = Vec::new();
        self.read_rows(self.bounds.y0..self.bounds.y1, &mut all);
        all
    }

    /// Ranges of [`BAND`] rows that are read together.
    pub fn bands(&self) -> impl IndexedParallelIterator<Item = Range<u32>> + use<> {
        let PixelBounds { y0, y1, .. } = self.bounds;
        let count = y1.saturating_sub(y0).div_ceil(BAND);
        let band = move |i: u32| y0 + i * BAND..y1.min(y0 + (i + 1) * BAND);
        (0..count).into_par_iter().map(band).with_max_len(1)
    }

    /// Reads the pixels of some rows. The rows are absolute coordinates.
    pub fn read_rows(&self, rows: Range<u32>, out: &mut Vec<PixelSums>) {
        self.read(&PixelBounds { y0: rows.start, y1: rows.end, ..self.bounds }, out);
    }

    /// Reads the pixels of a rectangle inside the film, row by row.
    pub fn read(&self, pixels: &PixelBounds, out: &mut Vec<PixelSums>) {
        out.clear();
        out.resize(pixels.area(), PixelSums::default());

        // Copy from the tiles that overlap the rectangle
        let first = self.tiles.partition_point(|t| t.bounds.y1 <= pixels.y0);
        let mut sums = Vec::new();
        for FilmTile { bounds, sums: packed } in self.tiles[first..].iter().take_while(|t| t.bounds.y0 < pixels.y1) {
            let [left, right] = [bounds.x0.max(pixels.x0), bounds.x1.min(pixels.x1)];
            if left >= right {
                continue;
            }
            let (top, bottom, len) = (bounds.y0.max(pixels.y0), bounds.y1.min(pixels.y1), bounds.width() as usize);
            let start = (top - bounds.y0) as usize * len;
            sums.resize((bottom - top) as usize * len, PixelAccumulator::default());
            packed.read(start..start + sums.len(), &mut sums);
            for (y, row) in (top..bottom).zip(sums.chunks_exact(len)) {
                let at = (y - pixels.y0) as usize * pixels.width() as usize + (left - pixels.x0) as usize;
                let row = &row[(left - bounds.x0) as usize..(right - bounds.x0) as usize];
                out[at..at + row.len()].iter_mut().zip(row).for_each(|(pixel, sums)| *pixel = sums.sums());
            }
        }

        // Corrections
        if !self.corrections.is_empty() && !out.is_empty() {
            for (y, row) in (pixels.y0..).zip(out.chunks_exact_mut(pixels.width() as usize)) {
                let corrections = &self.corrections[self.index(pixels.x0, y)..];
                row.iter_mut().zip(corrections).for_each(|(pixel, off)| pixel.subtract(*off));
            }
        }
    }

    /// Statistics of the film.
    pub fn summary(&self) -> &Summary {
        self.summary.get_or_init(|| {
            // Computed once here, not by all threads at the same time
            self.variance_scale();
            let bands = self.bands().map_init(Default::default, |(pixels, variances), rows| {
                self.read_rows_with_variances(rows.clone(), pixels, variances);
                let blocks =
                    noise::of_blocks(&PixelBounds { y0: rows.start, y1: rows.end, ..self.bounds }, pixels, variances);
                BandSummary::new(pixels, blocks)
            });
            BandSummary::of_all(&bands.collect::<Vec<_>>())
        })
    }
}

/// Number of rows that are read together: the height of a noise block.
pub const BAND: u32 = noise::BLOCK;

/// Statistics of a band of rows.
struct BandSummary {
    samples: [u64; 2],
    least_samples: Option<u64>,
    all_samples: u64,
    pixels: [u64; 2],
    invalid: u64,
    blocks: Vec<Block>,
    has_records: bool,
}

impl BandSummary {
    fn new(pixels: &[PixelSums], blocks: Vec<Block>) -> Self {
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

    fn of_all(bands: &[BandSummary]) -> Summary {
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tiles_cover_each_pixel_once() {
        let bounds = PixelBounds { x0: 3, x1: 40, y0: 5, y1: 23 };
        for size in [1, 7, 8, 64] {
            let mut counts = vec![0; 40 * 23];
            for t in bounds.tiles(size) {
                for y in t.y0..t.y1 {
                    for x in t.x0..t.x1 {
                        counts[(y * 40 + x) as usize] += 1;
                    }
                }
            }
            assert_eq!(counts.iter().sum::<i32>() as usize, bounds.area());
            assert!(counts.iter().all(|&c| c <= 1));
        }
    }
}
