//! Replicas: second estimates of some pixels, with the same number of samples and independent scrambling, for
//! [`super::variance`].
//!
//! In each square of k × k pixels, the seed of the image determines one pixel. k is 8 in large images, and less in
//! small ones. So replicas are spread evenly, and differ between seeds.
//!
//! `render/tiles.rs` decides whether an image has replicas, and `render/tile_samples.rs` adds their samples.
//!
//! Light paths are traced for the whole image, so a replica shares the light paths of its pixel. Their contribution has
//! a random sign in the mean of the replica, which stands for the difference ([`PixelSample::offset`]), and no sign in
//! the spread of its samples.

use super::accumulator::RadianceAccumulator;
use super::fixed_sums::{LIMIT, SquareSum};
use super::pixel::{PixelSample, PixelSums};
use super::pixel_bounds::PixelBounds;
use lumiris_numbers::math::hash::pcg4d;

/// With fewer replicas, the squares are smaller than 8 × 8 pixels. Images with fewer than four times this number of
/// pixels have a replica of each pixel. So there are enough replicas where few pixels have most of the variance, such
/// as at the edges of lights.
const WANTED: f64 = 4096.0;
/// Maximum edge of the squares.
const MAX_SQUARE: u32 = 8;
/// Seed of the choice of replicas.
const CHOICE: u32 = 0x72_65_70_6c;

/// The choice of pixels that are estimated twice.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ReplicaChoice {
    /// Pixels are chosen in blocks of `edge` × `edge`; at least 1.
    pub edge: u32,
    /// The seed of the image.
    pub seed: u32,
}

impl ReplicaChoice {
    /// Empty replicas for the pixels of a tile, in an image with the given bounds. Their indices refer to the tile.
    pub fn of_tile(&self, image: &PixelBounds, tile: &PixelBounds) -> Vec<ReplicaAccumulator> {
        let square = ((image.area() as f64 / WANTED).sqrt() as u32).clamp(1, MAX_SQUARE);
        let is_chosen = |i: &u32| {
            let [x, y] = tile.pixel_at(*i);
            let [x, y] = [(x - image.x0) / self.edge, (y - image.y0) / self.edge];
            let [dx, dy, ..] = pcg4d([x / square, y / square, CHOICE, self.seed]);
            [x % square, y % square] == [dx % square, dy % square]
        };
        let none = |pixel| ReplicaAccumulator { pixel, ..ReplicaAccumulator::default() };
        (0..tile.area() as u32).filter(is_chosen).map(none).collect()
    }
}

/// Exact sums of the second estimate of a pixel.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ReplicaAccumulator {
    /// Index of the pixel in the tile.
    pub pixel: u32,
    /// Number of samples and Σ radiance.
    pub sums: RadianceAccumulator,
    /// Σ radiance², per channel.
    pub squares: [SquareSum; 3],
}

impl ReplicaAccumulator {
    /// Adds a sample.
    pub fn add(&mut self, sample: &PixelSample) {
        let channels = sample.radiance.to_array();
        if self.sums.add(sample.radiance + sample.offset) && channels.iter().all(|value| value.abs() < LIMIT) {
            self.squares.iter_mut().zip(channels).for_each(|(sum, value)| sum.add_square(value));
        }
    }

    /// Adds other samples of the same pixel.
    pub fn merge(&mut self, other: &ReplicaAccumulator) {
        self.sums.merge(&other.sums);
        self.squares.iter_mut().zip(&other.squares).for_each(|(a, b)| a.merge(b));
    }

    /// The sums as floating-point numbers, for a pixel with the given index in the film.
    pub fn replica(&self, pixel: u32) -> Replica {
        let sums = PixelSums {
            count: self.sums.count.into(),
            radiance: self.sums.values(),
            radiance_squared: self.squares.each_ref().map(SquareSum::value),
            ..PixelSums::default()
        };
        Replica { pixel, count: sums.count, radiance: sums.radiance, independent: sums.variance_of_mean().iter().sum() }
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
    /// Variance of the mean if the samples are independent, Σ over channels.
    pub independent: f64,
}

impl Replica {
    /// Σ (A − B)²/2 over channels.
    pub(super) fn half_square(&self, pixel: &PixelSums) -> f64 {
        let difference = |c: usize| (pixel.radiance[c] - self.radiance[c]) / self.count as f64;
        (0..3).map(|c| 0.5 * difference(c) * difference(c)).sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const IMAGE: PixelBounds = PixelBounds { x0: 10, x1: 810, y0: 7, y1: 607 };

    fn positions(image: &PixelBounds, tile: &PixelBounds, choice: ReplicaChoice) -> Vec<[u32; 2]> {
        choice.of_tile(image, tile).into_iter().map(|r| tile.pixel_at(r.pixel)).collect()
    }

    #[test]
    fn replicas_are_the_same_pixels_for_all_tiles_and_few_in_large_images() {
        for edge in [1, 16] {
            let choice = ReplicaChoice { edge, seed: 3 };
            let mut whole = positions(&IMAGE, &IMAGE, choice);
            let mut parts: Vec<_> = IMAGE.tiles(16).iter().flat_map(|tile| positions(&IMAGE, tile, choice)).collect();
            whole.sort_unstable();
            parts.sort_unstable();
            assert_eq!(whole, parts);
            if edge == 1 {
                assert_eq!(whole.len(), 800 * 600 / 64, "one in each square");
            }
        }
        let small = PixelBounds { x0: 0, x1: 20, y0: 0, y1: 20 };
        assert_eq!(ReplicaChoice { edge: 1, seed: 0 }.of_tile(&small, &small).len(), 400);
    }

    #[test]
    fn other_seeds_choose_other_pixels() {
        // 7500 pixels per seed, each with a probability of 1/64: 117 ± 11 common ones
        let [a, b] = [0, 1].map(|seed| positions(&IMAGE, &IMAGE, ReplicaChoice { edge: 1, seed }));
        let both = a.iter().filter(|pixel| b.contains(pixel)).count();
        assert!((both as f64 - 117.0).abs() < 4.0 * 11.0, "{both}");
    }
}
