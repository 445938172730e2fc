//! The pixels where the pilot of `--estimator auto` measures: more of them where there is more noise.
//!
//! Few pixels have most of the noise of an image, so that of pixels that are spread evenly few tell nearly all that is
//! measured. A few samples of more pixels show where the noise is. Of these a pixel is drawn in proportion to the standard
//! deviation around it, and to a part that all have, since few samples do not see everything; it counts as much as that
//! was improbable. So the mean over pixels is that of the image, as in importance sampling.

use super::auto_reuse::{BLOCK, EDGE};
use crate::film::PixelBounds;
use lumiris_numbers::math::hash::{pcg4d, unit_f32};

/// Combined with the number of the round, and for its samples with the seed of the image.
pub(super) const SEED: u32 = 0x61_75_74_6f;
/// Part of the probability that is the same for all pixels.
const EVEN: f64 = 0.3;
/// One in so many blocks is looked at before the others, if those are so many at least.
const SOME: usize = 3;
const MIN_SOME: usize = 6;
/// Steps by which probabilities converge of which none is above 1.
const ITERATIONS: usize = 8;

/// A pixel where a round measures.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Place {
    pub(super) pixel: [u32; 2],
    /// How much it counts in a mean over all pixels of the round.
    pub(super) weight: f64,
}

/// Pixels in columns and rows over the image, and what few samples show of their noise.
pub(super) struct Scouted {
    pixels: Vec<[u32; 2]>,
    /// What is drawn in proportion to.
    densities: Vec<f64>,
}

impl Scouted {
    /// Of the pixels of a [`grid`] with so many columns and their relative variances.
    pub(super) fn new(pixels: Vec<[u32; 2]>, columns: usize, variances: &[f64]) -> Self {
        let rows = pixels.len() / columns.max(1);
        let around = |i: usize| {
            let window = |i: usize, len: usize| i.saturating_sub(1)..(i + 2).min(len);
            let of_row = |y: usize| window(i % columns, columns).map(move |x| variances[y * columns + x]);
            let all = window(i / columns, rows).flat_map(of_row);
            let (sum, count) = all.fold((0.0, 0.0), |(sum, count), v| (sum + v, count + 1.0));
            (sum / count).sqrt()
        };
        let deviations: Vec<f64> = (0..pixels.len()).map(around).collect();
        let mean = deviations.iter().sum::<f64>() / deviations.len().max(1) as f64;
        let density = |d: f64| if mean > 0.0 { EVEN + (1.0 - EVEN) * d / mean } else { 1.0 };
        Scouted { densities: deviations.into_iter().map(density).collect(), pixels }
    }

    /// How many pixels there are.
    pub(super) fn len(&self) -> usize {
        self.pixels.len()
    }

    /// About so many of the pixels, those of like weights beside each other. They depend on the round.
    pub(super) fn draw(&self, count: usize, round: u32) -> Vec<Place> {
        let mut places = self.drawn(count, round);
        by_weight(&mut places);
        places
    }

    /// As many pixels in blocks, or somewhat less; none where there is no room for any.
    pub(super) fn draw_blocks(&self, bounds: &PixelBounds, count: usize, round: u32) -> Vec<Place> {
        let room = [bounds.width() / EDGE, bounds.height() / EDGE];
        if room.contains(&0) {
            return Vec::new();
        }
        let mut blocks: Vec<Place> = Vec::new();
        let drawn = self.drawn(count / BLOCK, round);
        for &Place { pixel: [x, y], weight } in &drawn {
            let place = |x: u32, x0: u32, room: u32| x0 + EDGE * ((x - x0) / EDGE).min(room - 1);
            let pixel = [place(x, bounds.x0, room[0]), place(y, bounds.y0, room[1])];
            match blocks.iter_mut().find(|block| block.pixel == pixel) {
                Some(block) => block.weight += weight,
                None => blocks.push(Place { pixel, weight }),
            }
        }
        let each = blocks.len() as f64 / drawn.len() as f64;
        blocks.iter_mut().for_each(|block| block.weight *= each);
        by_weight(&mut blocks);
        let of_block = |Place { pixel: [x, y], weight }: Place| {
            (0..EDGE * EDGE).map(move |i| Place { pixel: [x + i % EDGE, y + i / EDGE], weight })
        };
        blocks.into_iter().flat_map(of_block).collect()
    }

    /// About so many of the pixels in their order, by systematic sampling.
    fn drawn(&self, count: usize, round: u32) -> Vec<Place> {
        let n = count.min(self.pixels.len()) as f64;
        let probability = |scale: f64, density: f64| (scale * density).min(1.0);
        let total = |scale: f64| self.densities.iter().map(|&d| probability(scale, d)).sum::<f64>();
        let scale =
            (0..ITERATIONS).fold(n / self.pixels.len().max(1) as f64, |scale, _| scale * n / total(scale).max(1e-9));
        let mut next = f64::from(unit_f32(pcg4d([SEED, round, 0, 0])[0]));
        let (mut sum, mut places) = (0.0, Vec::with_capacity(count + 1));
        for (&pixel, &density) in self.pixels.iter().zip(&self.densities) {
            let p = probability(scale, density);
            sum += p;
            if sum > next {
                next += 1.0;
                places.push(Place { pixel, weight: 1.0 / p });
            }
        }
        let each = places.len() as f64 / self.pixels.len() as f64;
        places.iter_mut().for_each(|place| place.weight *= each);
        places
    }
}

/// Some of the blocks, which stand one after the other by their weights, as a round of their own; none if they are too few.
pub(super) fn some_blocks(places: &[Place]) -> Vec<Place> {
    let mut some: Vec<Place> = places.chunks(BLOCK).skip(SOME / 2).step_by(SOME).flatten().copied().collect();
    if some.len() < MIN_SOME * BLOCK {
        return Vec::new();
    }
    let mean = some.iter().map(|place| place.weight).sum::<f64>() / some.len() as f64;
    some.iter_mut().for_each(|place| place.weight /= mean);
    some
}

/// Pixels of like weight are beside each other, so that the time of all of them tells that of each.
fn by_weight(places: &mut [Place]) {
    places.sort_by(|a, b| a.weight.total_cmp(&b.weight));
}

/// About so many pixels, one in each cell of columns and rows, and how many columns there are.
pub(super) fn grid(bounds: &PixelBounds, count: usize) -> (Vec<[u32; 2]>, usize) {
    let (width, height) = (bounds.width(), bounds.height());
    let aspect = f64::from(width) / f64::from(height);
    let columns = ((count as f64 * aspect).sqrt().round() as u32).clamp(1, width);
    let rows = (count as u32 / columns).clamp(1, height);
    let place = |k: u32, cells: u32, size: u32, u: f32| {
        let [start, end] = [k, k + 1].map(|k| u64::from(k) * u64::from(size) / u64::from(cells)).map(|x| x as u32);
        (start + ((end - start) as f32 * u) as u32).min(end - 1)
    };
    let pixel = |row: u32, column: u32| {
        let h = pcg4d([row, column, SEED, 0]);
        let (x, y) = (place(column, columns, width, unit_f32(h[0])), place(row, rows, height, unit_f32(h[1])));
        [bounds.x0 + x, bounds.y0 + y]
    };
    ((0..rows).flat_map(|row| (0..columns).map(move |column| pixel(row, column))).collect(), columns as usize)
}

#[cfg(test)]
mod tests {
    use super::*;

    const BOUNDS: PixelBounds = PixelBounds { x0: 10, x1: 212, y0: 5, y1: 105 };

    /// An image with noise in its left tenth, and a little elsewhere.
    fn variance([x, _]: [u32; 2]) -> f64 {
        if x < BOUNDS.x0 + BOUNDS.width() / 10 { 100.0 } else { 1.0 }
    }

    fn scouted() -> Scouted {
        let (pixels, columns) = grid(&BOUNDS, 3000);
        let variances: Vec<f64> = pixels.iter().map(|&pixel| variance(pixel)).collect();
        Scouted::new(pixels, columns, &variances)
    }

    #[test]
    fn pixels_lie_inside_the_image_and_apart() {
        let (pixels, columns) = grid(&BOUNDS, 300);
        assert!((270..=330).contains(&pixels.len()) && pixels.len().is_multiple_of(columns), "{}", pixels.len());
        assert!(pixels.iter().all(|[x, y]| (10..212).contains(x) && (5..105).contains(y)));
        let different: std::collections::HashSet<_> = pixels.iter().collect();
        assert_eq!(different.len(), pixels.len());
        assert_eq!(grid(&PixelBounds { x0: 0, x1: 2, y0: 0, y1: 1 }, 100).0, [[0, 0], [1, 0]]);
    }

    #[test]
    fn more_are_drawn_where_there_is_noise_and_each_counts_less() {
        let scouted = scouted();
        let is_noisy = |place: &Place| variance(place.pixel) > 1.0;
        let places = scouted.draw(300, 0);
        assert!((299..=301).contains(&places.len()));
        let noisy = places.iter().filter(|place| is_noisy(place)).count();
        // 0.3/10 + 0.7·(10·0.1)/(10·0.1 + 0.9) of them
        assert!((110..=140).contains(&noisy), "{noisy}");
        assert!(places.is_sorted_by(|a, b| a.weight <= b.weight));
        assert_ne!(places, scouted.draw(300, 1), "other pixels in another round");
    }

    #[test]
    fn means_are_those_of_the_image() {
        let scouted = scouted();
        let truth = scouted.pixels.iter().map(|&pixel| variance(pixel)).sum::<f64>() / scouted.pixels.len() as f64;
        let rounds = 400;
        let mut means = [0.0; 2];
        for round in 0..rounds {
            let places = scouted.draw(100, round);
            let blocks = scouted.draw_blocks(&BOUNDS, 1600, round);
            assert!(blocks.len().is_multiple_of(16));
            for (mean, places) in means.iter_mut().zip([places, blocks]) {
                let sum = places.iter().map(|place| place.weight * variance(place.pixel)).sum::<f64>();
                *mean += sum / places.len() as f64 / f64::from(rounds);
            }
        }
        // Blocks also have pixels beside those that were looked at
        assert!((means[0] / truth - 1.0).abs() < 0.01 && (means[1] / truth - 1.0).abs() < 0.05, "{means:?} {truth}");
    }

    #[test]
    fn blocks_lie_inside_the_image_and_none_is_there_twice() {
        let scouted = scouted();
        let places = scouted.draw_blocks(&BOUNDS, 1600, 2);
        let different: std::collections::HashSet<_> = places.iter().map(|place| place.pixel).collect();
        assert_eq!(different.len(), places.len());
        assert!(places.iter().all(|Place { pixel: [x, y], .. }| (10..212).contains(x) && (5..105).contains(y)));
        let narrow = PixelBounds { x0: 0, x1: 100, y0: 0, y1: 3 };
        let (pixels, columns) = grid(&narrow, 100);
        assert!(Scouted::new(pixels, columns, &[1.0; 100]).draw_blocks(&narrow, 64, 0).is_empty(), "no room");
    }

    #[test]
    fn without_noise_all_pixels_are_alike() {
        let (pixels, columns) = grid(&BOUNDS, 3000);
        let still = vec![0.0; pixels.len()];
        let places = Scouted::new(pixels, columns, &still).draw(300, 0);
        assert!((299..=301).contains(&places.len()));
        assert!(places.iter().all(|place| (place.weight - 1.0).abs() < 0.01));
    }

    #[test]
    fn some_blocks_stand_for_all() {
        let blocks = |n: u32| -> Vec<Place> {
            let of_block = |k: u32| (0..16).map(move |i| Place { pixel: [k, i], weight: f64::from(1 + k) });
            (0..n).flat_map(of_block).collect()
        };
        let some = some_blocks(&blocks(24));
        let numbers: Vec<u32> = some.iter().step_by(BLOCK).map(|place| place.pixel[0]).collect();
        assert_eq!(numbers, [1, 4, 7, 10, 13, 16, 19, 22]);
        let mean = some.iter().map(|place| place.weight).sum::<f64>() / some.len() as f64;
        assert!((mean - 1.0).abs() < 1e-9 && some[0].weight < some[BLOCK].weight);
        assert!(some_blocks(&blocks(12)).is_empty() && some_blocks(&[]).is_empty(), "too few");
    }
}
