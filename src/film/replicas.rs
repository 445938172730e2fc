//! The variance of pixel means for any sampler, from pixels that are estimated twice.
//!
//! The mean of N independent samples has the variance s²/N, where s² is the variance of the samples. Points of a net
//! are distributed more evenly, and their mean varies less. How much less cannot be determined from a single net. So
//! some pixels, the *replicas*, are estimated a second time, with as many samples and an independent scrambling. Of two
//! such means A and B, (A − B)²/2 is an unbiased estimate of their variance, and a class of pixels is assigned the
//! variances
//!
//! V = f s²/N, with f = Σ (A − B)²/2 / Σ s²/N over the replicas of the class.
//!
//! f depends on what is seen: stratification gains much at edges and in soft shadows, and little for light of many
//! bounces. Classes are intervals of the mean of s²/N over the surrounding 3 × 3 pixels, which is less noisy than a
//! pixel's own value. Whatever the classes, the sum of V over the image is that of the replicas, scaled to all pixels.

use super::accumulator::RadianceAccumulator;
use super::{Film, PixelBounds, PixelSums};
use lumiris_numbers::math::hash::{pcg4d, unit_f32};
use rayon::prelude::*;
use std::ops::Range;

/// Number of replicas per image: more if [`MIN_FRACTION`] of the pixels are more, and fewer only if the image has fewer
/// pixels.
const WANTED: f64 = 512.0;
/// Minimum fraction of the pixels that are replicated.
const MIN_FRACTION: f64 = 1.0 / 64.0;
/// Maximum number of classes of pixels.
const MAX_CLASSES: usize = 8;
/// Minimum number of replicas in a class: f then has a relative standard error of √(2/64) = 18 % if means are normal.
const MIN_CLASS_SIZE: usize = 64;
/// Distinguishes the choice of replicas from other hashes of pixels.
const CHOICE: u32 = 0x72_65_70_6c;

/// Exact sums of the second estimate of a pixel.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ReplicaAccumulator {
    /// Index of the pixel in the tile.
    pub pixel: u32,
    /// Samples and Σ radiance.
    pub sums: RadianceAccumulator,
}

impl ReplicaAccumulator {
    /// The sums as numbers, of a pixel with the given index in the film.
    pub fn replica(&self, pixel: u32) -> Replica {
        Replica { pixel, count: self.sums.count.into(), radiance: self.sums.values() }
    }
}

/// The second estimate of a pixel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Replica {
    /// Index of the pixel in the film.
    pub pixel: u32,
    /// Number of samples.
    pub count: u64,
    /// Σ radiance.
    pub radiance: [f64; 3],
}

impl Replica {
    /// Σ (A − B)²/2 over channels.
    fn half_square(&self, pixel: &PixelSums) -> f64 {
        let difference = |c: usize| (pixel.radiance[c] - self.radiance[c]) / self.count as f64;
        (0..3).map(|c| 0.5 * difference(c) * difference(c)).sum()
    }
}

/// Replicas, without samples, for the pixels of a tile that are estimated twice, in an image with the given bounds: whole
/// blocks of `edge` × `edge` pixels. Their indices are those of the tile.
pub fn replicas(image: &PixelBounds, tile: &PixelBounds, edge: u32) -> Vec<ReplicaAccumulator> {
    let fraction = (WANTED / image.area().max(1) as f64).max(MIN_FRACTION);
    let is_chosen = |i: &u32| {
        let (x, y) = (tile.x0 + i % tile.width(), tile.y0 + i / tile.width());
        let (x, y) = if edge > 1 { ((x - image.x0) / edge, (y - image.y0) / edge) } else { (x, y) };
        f64::from(unit_f32(pcg4d([x, y, CHOICE, 0])[0])) < fraction
    };
    let none = |pixel| ReplicaAccumulator { pixel, ..ReplicaAccumulator::default() };
    (0..tile.area() as u32).filter(is_chosen).map(none).collect()
}

/// Pixels whose s²/N, averaged over their neighbours, is at most `limit` and above that of the previous class.
#[derive(Clone, Debug)]
struct Class {
    limit: f64,
    /// f.
    factor: f64,
}

/// The variances estimated at a replica.
#[derive(Clone, Copy)]
struct ReplicaVariance {
    /// s²/N, averaged over neighbours.
    key: f64,
    /// s²/N.
    independent: f64,
    /// (A − B)²/2.
    measured: f64,
}

/// What the variances of independent samples are multiplied by, from the replicas of a film.
#[derive(Clone, Debug, Default)]
pub struct VarianceScale {
    /// By rising limits. Without any, variances remain as they are.
    classes: Vec<Class>,
}

impl Film {
    /// Reads some rows as [`Film::read_rows`], and the estimated variance of each pixel's mean per channel. Without
    /// replicas it is that of independent samples.
    pub fn read_rows_with_variances(
        &self,
        rows: Range<u32>,
        pixels: &mut Vec<PixelSums>,
        variances: &mut Vec<[f64; 3]>,
    ) {
        variances.clear();
        let classes = &self.variance_scale().classes;
        if classes.is_empty() {
            self.read_rows(rows, pixels);
            variances.extend(pixels.iter().map(PixelSums::variance_of_mean));
            return;
        }
        let surroundings = self.read_surroundings(&rows, pixels);
        pixels.drain(..surroundings.before);
        pixels.truncate(rows.len() * surroundings.width);
        for (i, pixel) in pixels.iter().enumerate() {
            let key = surroundings.mean(surroundings.before + i);
            let class = classes.partition_point(|c| c.limit < key).min(classes.len() - 1);
            variances.push(pixel.variance_of_mean().map(|v| v * classes[class].factor));
        }
    }

    /// Estimated variance of each pixel's mean per channel: 24 bytes each, which is much for large images.
    pub fn variances(&self) -> Vec<[f64; 3]> {
        let mut variances = Vec::new();
        self.read_rows_with_variances(self.bounds.y0..self.bounds.y1, &mut Vec::new(), &mut variances);
        variances
    }

    pub(super) fn variance_scale(&self) -> &VarianceScale {
        if let Some(scale) = self.variance_scale.get() {
            return scale;
        }
        // Not while others wait for it: a thread that works on this may take up work that asks for it as well
        let scale = if self.replicas.is_empty() {
            VarianceScale::default()
        } else {
            let bands = self.bands().map_init(Vec::new, |pixels, rows| self.measured_twice(rows, pixels));
            VarianceScale { classes: classes(bands.collect::<Vec<_>>().concat()) }
        };
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
            let (pixel, key) = (&pixels[i], surroundings.mean(i));
            let variance =
                ReplicaVariance { key, independent: surroundings.values[i], measured: replica.half_square(pixel) };
            (pixel.count == replica.count && pixel.count > 1).then_some(variance)
        });
        measured.collect()
    }

    /// Reads some rows and those above and below, as far as the image has any.
    fn read_surroundings(&self, rows: &Range<u32>, pixels: &mut Vec<PixelSums>) -> Surroundings {
        let around = rows.start.saturating_sub(1).max(self.bounds.y0)..(rows.end + 1).min(self.bounds.y1);
        let width = self.bounds.width() as usize;
        let before = (rows.start - around.start) as usize * width;
        self.read_rows(around, pixels);
        Surroundings { width, before, values: pixels.iter().map(|p| p.variance_of_mean().iter().sum()).collect() }
    }
}

/// s²/N of the pixels of some rows, and of one row above and below, as far as the image has them.
struct Surroundings {
    width: usize,
    /// Number of pixels of the row above.
    before: usize,
    values: Vec<f64>,
}

impl Surroundings {
    /// Mean over the 3 × 3 pixels around a pixel, clipped to the image.
    fn mean(&self, i: usize) -> f64 {
        let around = |i: usize, len: usize| i.saturating_sub(1)..(i + 2).min(len);
        let (columns, rows) =
            (around(i % self.width, self.width), around(i / self.width, self.values.len() / self.width));
        let count = columns.len() * rows.len();
        let sum: f64 = rows.map(|y| self.values[y * self.width..][columns.clone()].iter().sum::<f64>()).sum();
        sum / count as f64
    }
}

/// Classes of about equally many replicas, by rising keys; none if nothing varies.
fn classes(mut measured_twice: Vec<ReplicaVariance>) -> Vec<Class> {
    // Where all samples are equal, there is nothing to scale
    measured_twice.retain(|t| t.key > 0.0 || t.measured > 0.0);
    measured_twice.sort_by(|a, b| a.key.total_cmp(&b.key));
    let size = measured_twice.len().div_ceil(MAX_CLASSES).max(MIN_CLASS_SIZE);
    let mut classes = Vec::new();
    let (mut members, mut independent, mut measured) = (0, 0.0, 0.0);
    for (i, t) in measured_twice.iter().enumerate() {
        members += 1;
        independent += t.independent;
        measured += t.measured;
        let rest = &measured_twice[i + 1..];
        let is_full = members >= size && 2 * rest.len() >= size && independent > 0.0;
        if rest.is_empty() || is_full && rest[0].key > t.key {
            let factor = if independent > 0.0 { measured / independent } else { 1.0 };
            classes.push(Class { limit: t.key, factor });
            (members, independent, measured) = (0, 0.0, 0.0);
        }
    }
    classes
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::film::accumulator::PixelAccumulator;
    use crate::film::packed::PackedSums;
    use crate::film::{FilmTile, PixelSample};
    use lumiris_numbers::math::Rgb;
    use std::sync::Arc;

    /// A film of 64 × 64 pixels and as many replicas, means of two samples each. Means are 1 ± σ, and s²/N is
    /// `independent`; both are given for the column of a pixel.
    fn film(sigma: impl Fn(u32) -> f64, independent: impl Fn(u32) -> f64) -> Film {
        let bounds = PixelBounds { x0: 0, x1: 64, y0: 0, y1: 64 };
        let mut replicas = Vec::new();
        let mut pixel = |i: u32| {
            let bits = pcg4d([i, 3, 1, 4]);
            let mean = |bit: u32| 1.0 + if bit & 1 == 0 { sigma(i % 64) } else { -sigma(i % 64) };
            let (a, b) = (mean(bits[0]), mean(bits[1]));
            replicas.push(Replica { pixel: i, count: 2, radiance: [2.0 * b; 3] });
            // s²/N is a quarter of the squared difference of two samples
            let half = independent(i % 64).sqrt();
            let mut sums = PixelAccumulator::default();
            for (index, value) in [(0, a - half), (1, a + half)] {
                sums.add(index, &PixelSample { radiance: Rgb::splat(value as f32), features: None });
            }
            sums
        };
        let pixels: Vec<PixelAccumulator> = (0..4096).map(&mut pixel).collect();
        let tile = FilmTile { bounds, sums: Arc::new(PackedSums::of(&pixels)) };
        Film::new([64, 64], bounds, vec![tile], replicas)
    }

    #[test]
    fn variances_are_those_that_replicas_show() {
        let film = film(|_| 0.1, |_| 0.05);
        let mean = film.variances().iter().map(|v| v[1]).sum::<f64>() / 4096.0;
        // (A − B)²/2 is 0 or 2σ²: its mean over 4096 replicas has the standard error σ²/64.
        assert!((mean / 0.01 - 1.0).abs() < 4.0 / 64.0, "{mean}");
        let film = Film::new(film.resolution, film.bounds, film.tiles, Vec::new());
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
        // s²/N is 4 on the left and 1 on the right; the variances are 1 and 1/64. All of them are f32 numbers.
        let film = film(|x| if x < 32 { 1.0 } else { 0.125 }, |x| if x < 32 { 4.0 } else { 1.0 });
        let variances = film.variances();
        for (columns, expected) in [(0..31, 1.0), (33..64, 1.0 / 64.0)] {
            let inside = |i: &usize| columns.contains(&(i % 64));
            let values: Vec<f64> = (0..4096).filter(inside).map(|i| variances[i][0]).collect();
            let mean = values.iter().sum::<f64>() / values.len() as f64;
            // Some 2000 replicas: a standard error of 1/45
            assert!((mean / expected - 1.0).abs() < 4.0 / 45.0, "{mean}, not {expected}");
        }
    }

    #[test]
    fn differences_between_pixels_that_do_not_vary_are_not_lost() {
        // One pixel in four varies within itself; means vary everywhere.
        let film = film(|_| 0.1, |x| if x % 16 < 4 { 0.05 } else { 0.0 });
        let total = film.variances().iter().map(|v| v[1]).sum::<f64>();
        assert!((total / (4096.0 * 0.01) - 1.0).abs() < 4.0 / 64.0, "{total}");
    }

    #[test]
    fn replicas_are_the_same_pixels_for_all_tiles_and_few_in_large_images() {
        let image = PixelBounds { x0: 10, x1: 410, y0: 7, y1: 307 };
        let position = |tile: &PixelBounds, r: &ReplicaAccumulator| {
            [tile.x0 + r.pixel % tile.width(), tile.y0 + r.pixel / tile.width()]
        };
        let mut whole: Vec<_> = replicas(&image, &image, 1).iter().map(|r| position(&image, r)).collect();
        let tiles = image.tiles(13);
        let mut parts: Vec<_> =
            tiles.iter().flat_map(|t| replicas(&image, t, 1).into_iter().map(|r| position(t, &r))).collect();
        whole.sort_unstable();
        parts.sort_unstable();
        assert_eq!(whole, parts);
        // 120,000/64 = 1875 with a standard deviation of 43
        assert!((whole.len() as f64 - 1875.0).abs() < 4.0 * 43.0, "{}", whole.len());
        let small = PixelBounds { x0: 0, x1: 20, y0: 0, y1: 20 };
        assert_eq!(replicas(&small, &small, 1).len(), 400);
    }
}
