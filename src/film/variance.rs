//! The variance of pixel means, for all estimators and samplers, from pixels that are estimated twice.
//!
//! The mean of N independent samples has the variance s²/N, where s² is the variance of the samples. Stratified samples
//! and control variates reduce the variance of the mean; shared light paths increase it. One set of samples does not
//! determine this effect. [`super::replicas`] are a second, independent set. For two such means A and B, (A − B)²/2 is
//! an unbiased estimate of their variance. The variance of a pixel mean is estimated as
//!
//! V = f s²/N, with f = Σ (A − B)²/2 / Σ (s_A²/N + s_B²/N)/2 over similar replicas.
//!
//! An outlier has the same effect on both sums of f, whichever of the two means contains it: it moves f of a few
//! replicas towards 1, and nothing else.
//!
//! f depends on the content of the image: stratification gains much at edges and in smooth light, and little in light
//! of many bounces. So replicas are partitioned by position in the image and by level, the logarithm of s²/N averaged
//! over 3 × 3 pixels to reduce noise. A set is split at the middle of its longest dimension as long as both parts have
//! enough replicas.
//!
//! `render/output.rs` writes these variances; the noise of an image ([`super::image_noise`]) follows from them.

use super::pixel::PixelSums;
use super::tiled_film::Film;
use super::variance_scale::{Position, ReplicaVariance, VarianceScale};
use rayon::prelude::*;
use std::ops::Range;

/// Factor of s²/N, as a power of two, that is weighted like the extent of the image.
const LEVELS: f64 = 3.0;

/// log₂ with an error of at most 0.09 and an additive constant, identical on every machine. Tiny variances are clamped.
fn level(variance: f64) -> f64 {
    // Exponent and mantissa as a fixed-point number
    variance.max(1e-30).to_bits() as f64 / (1_u64 << 52) as f64
}

impl Film {
    /// Reads some rows like [`Film::read_rows`], with the estimated variance of each pixel mean per channel. Without
    /// replicas, samples are assumed to be independent.
    pub fn read_rows_with_variances(
        &self,
        rows: Range<u32>,
        pixels: &mut Vec<PixelSums>,
        variances: &mut Vec<[f64; 3]>,
    ) {
        variances.clear();
        let scale = self.variance_scale();
        if let VarianceScale::One(factor) = scale {
            self.read_rows(rows, pixels);
            variances.extend(pixels.iter().map(|pixel| pixel.variance_of_mean().map(|v| v * factor)));
            return;
        }

        // The level of a pixel depends on its neighbours
        let surroundings = self.read_surroundings(&rows, pixels);
        pixels.drain(..surroundings.before);
        pixels.truncate(rows.len() * surroundings.width);

        // Variances
        for (i, pixel) in pixels.iter().enumerate() {
            let factor = scale.factor(&surroundings.position(surroundings.before + i));
            variances.push(pixel.variance_of_mean().map(|v| v * factor));
        }
    }

    /// Estimated variance of each pixel mean per channel. Takes 24 bytes per pixel.
    pub fn variances(&self) -> Vec<[f64; 3]> {
        let mut variances = Vec::new();
        self.read_rows_with_variances(self.bounds.y0..self.bounds.y1, &mut Vec::new(), &mut variances);
        variances
    }

    pub(super) fn variance_scale(&self) -> &VarianceScale {
        if let Some(scale) = self.variance_scale.get() {
            return scale;
        }
        // Not inside `get_or_init`: a thread that computes this may steal work that needs it as well, and would wait
        // for itself
        let bands = self.bands().map_init(Vec::new, |pixels, rows| self.measured_twice(rows, pixels));
        let tell = self.replicas.iter().any(|replica| replica.count > 1);
        let replicas = if tell { bands.collect::<Vec<_>>().concat() } else { Vec::new() };
        let scale = VarianceScale::of(replicas);
        self.variance_scale.get_or_init(|| scale)
    }

    /// The variances estimated at the replicas of some rows.
    fn measured_twice(&self, rows: Range<u32>, pixels: &mut Vec<PixelSums>) -> Vec<ReplicaVariance> {
        let first = self.index(self.bounds.x0, rows.start);
        let end = first + rows.len() * self.bounds.width() as usize;
        let index = |at: usize| self.replicas.partition_point(|r| (r.pixel as usize) < at);
        let replicas = &self.replicas[index(first)..index(end)];
        let surroundings = self.read_surroundings(&rows, pixels);
        let measured = replicas.iter().filter_map(|replica| {
            let i = surroundings.before + replica.pixel as usize - first;
            let (pixel, position) = (&pixels[i], surroundings.position(i));
            let independent = 0.5 * (surroundings.values[i] + replica.independent);
            let variance = ReplicaVariance { position, independent, measured: replica.half_square(pixel) };
            (pixel.count == replica.count && pixel.count > 1).then_some(variance)
        });
        measured.collect()
    }

    /// Reads some rows, with one row above and below if the image has them.
    fn read_surroundings(&self, rows: &Range<u32>, pixels: &mut Vec<PixelSums>) -> Surroundings {
        let around = rows.start.saturating_sub(1).max(self.bounds.y0)..(rows.end + 1).min(self.bounds.y1);
        let width = self.bounds.width() as usize;
        let before = (rows.start - around.start) as usize * width;
        let top = around.start - self.bounds.y0;
        let size = self.bounds.width().max(self.bounds.height());
        self.read_rows(around, pixels);
        let values = pixels.iter().map(|p| p.variance_of_mean().iter().sum()).collect();
        Surroundings { width, before, top: top.into(), unit: LEVELS / f64::from(size.max(1)), values }
    }
}

/// s²/N of the pixels of some rows, with one row above and below if the image has them.
struct Surroundings {
    width: usize,
    /// Number of pixels in the row above.
    before: usize,
    /// The first row, from the top of the image.
    top: f64,
    /// Difference of levels that is weighted like one pixel.
    unit: f64,
    values: Vec<f64>,
}

impl Surroundings {
    fn position(&self, i: usize) -> Position {
        let (x, y) = ((i % self.width) as f64, self.top + (i / self.width) as f64);
        [level(self.mean(i)), x * self.unit, y * self.unit]
    }

    /// Mean of s²/N over 3 × 3 pixels, clipped to the image.
    fn mean(&self, i: usize) -> f64 {
        let around = |i: usize, len: usize| i.saturating_sub(1)..(i + 2).min(len);
        let (columns, rows) =
            (around(i % self.width, self.width), around(i / self.width, self.values.len() / self.width));
        let count = columns.len() * rows.len();
        let sum: f64 = rows.map(|y| self.values[y * self.width..][columns.clone()].iter().sum::<f64>()).sum();
        sum / count as f64
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::film::accumulator::PixelAccumulator;
    use crate::film::packed::PackedSums;
    use crate::film::replicas::Replica;
    use crate::film::{FilmTile, PixelBounds, PixelSample};
    use lumiris_numbers::math::Rgb;
    use lumiris_numbers::math::hash::pcg4d;
    use std::sync::Arc;

    /// A film of 64 × 64 pixels with a replica each; means of two samples. Means are 1 ± σ, and s²/N is `independent`.
    /// Both functions depend on the column of the pixel.
    fn film(sigma: impl Fn(u32) -> f64, independent: impl Fn(u32) -> f64) -> Film {
        let bounds = PixelBounds { x0: 0, x1: 64, y0: 0, y1: 64 };
        let mut replicas = Vec::new();
        let mut pixel = |i: u32| {
            let bits = pcg4d([i, 3, 1, 4]);
            let mean = |bit: u32| 1.0 + if bit & 1 == 0 { sigma(i % 64) } else { -sigma(i % 64) };
            let (a, b) = (mean(bits[0]), mean(bits[1]));
            let independent = independent(i % 64);
            replicas.push(Replica { pixel: i, count: 2, radiance: [2.0 * b; 3], independent: 3.0 * independent });
            // s²/N is a quarter of the squared difference of two samples
            let half = independent.sqrt();
            let mut sums = PixelAccumulator::default();
            for (index, value) in [(0, a - half), (1, a + half)] {
                sums.add(index, &PixelSample { radiance: Rgb::splat(value as f32), ..PixelSample::default() });
            }
            sums
        };
        let pixels: Vec<PixelAccumulator> = (0..4096).map(&mut pixel).collect();
        let tile = FilmTile { bounds, sums: Arc::new(PackedSums::of(&pixels)), layers: Arc::default() };
        Film::new([64, 64], bounds, vec![tile], replicas)
    }

    #[test]
    fn variances_are_those_that_replicas_show() {
        let film = film(|_| 0.1, |_| 0.05);
        let mean = film.variances().iter().map(|v| v[1]).sum::<f64>() / 4096.0;
        // (A − B)²/2 is 0 or 2σ²: its mean over 4096 replicas has the standard error σ²/64.
        assert!((mean / 0.01 - 1.0).abs() < 4.0 / 64.0, "{mean}");
        let film = Film::new(film.resolution, film.bounds, film.tiles().to_vec(), Vec::new());
        assert!(film.variances().iter().all(|v| (v[1] - 0.05).abs() < 1e-6), "as if independent");
    }

    #[test]
    fn rows_that_are_read_apart_have_the_variances_of_the_whole() {
        let film = film(|x| 0.01 * f64::from(x % 7), |x| 0.02 * f64::from(x % 5));
        let (all, mut some) = (film.variances(), Vec::new());
        for rows in [0..1, 1..17, 17..63, 63..64] {
            let mut variances = Vec::new();
            film.read_rows_with_variances(rows, &mut Vec::new(), &mut variances);
            some.extend(variances);
        }
        assert!(some == all);
    }

    #[test]
    fn parts_of_an_image_that_gain_unlike_are_told_apart() {
        // s²/N is `left` and 1; the variances are 1 and 1/64. All of them are f32 numbers.
        for left in [4.0, 1.0] {
            let film = film(|x| if x < 32 { 1.0 } else { 0.125 }, |x| if x < 32 { left } else { 1.0 });
            let variances = film.variances();
            for (columns, expected) in [(0..28, 1.0), (36..64, 1.0 / 64.0)] {
                let inside = |i: &usize| columns.contains(&(i % 64));
                let values: Vec<f64> = (0..4096).filter(inside).map(|i| variances[i][0]).collect();
                let mean = values.iter().sum::<f64>() / values.len() as f64;
                // Some 1800 replicas: a standard error of 1/42
                assert!((mean / expected - 1.0).abs() < 4.0 / 42.0, "{mean}, not {expected}, by {left}");
            }
        }
    }

    #[test]
    fn a_bright_sample_of_a_replica_changes_the_variance_of_no_other_pixel() {
        let quiet = film(|_| 0.1, |_| 0.01);
        let sum = |film: &Film| film.variances().iter().map(|v| v[1]).sum::<f64>();
        let expected = sum(&quiet);
        // One of two samples is brighter by 2000: the mean is brighter by 1000, and √(s²/N) as well
        let mut replicas = quiet.replicas.clone();
        replicas[1234].radiance = [2.0 * 1000.0; 3];
        replicas[1234].independent = 3.0 * 1e6;
        let film = Film::new(quiet.resolution, quiet.bounds, quiet.tiles().to_vec(), replicas);
        assert!((sum(&film) / expected - 1.0).abs() < 0.02, "{} {expected}", sum(&film));
    }
}
