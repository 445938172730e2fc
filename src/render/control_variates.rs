//! Control variates of a finished film. The coefficients of a pixel are fitted to other pixels; its own control
//! variates, multiplied by these coefficients, are subtracted ([`lumiris_numbers::estimators::ocv::pixels`]).
//!
//! A replica is corrected by the coefficients of its pixel, which depend on neither of the two estimates. Given β, the
//! two stay independent, and their difference gives the variance of the corrected pixel.
//!
//! Rows are corrected in bands, together with the surrounding rows that determine their coefficients. Only the
//! corrections are kept for the whole image.

use super::tiles::Tile;
use crate::film::fixed_sums::FixedSum;
use crate::film::replicas::Replica;
use crate::film::{Film, PixelBounds, PixelSums};
use lumiris_numbers::estimators::ocv::pixels::{MARGIN, Memory, Picture, Pixel, correction};
use rayon::prelude::*;
use std::collections::BTreeMap;
use std::ops::Range;

/// Rows of a band.
pub(super) const ROWS: u32 = 32;

/// Corrects all pixels and replicas of `film`, which consists of the tiles.
pub(super) fn correct(film: &mut Film, tiles: &[Tile]) {
    let Some(m) = tiles.first().map(|t| t.fits.controls()).filter(|m| *m > 0) else { return };
    let PixelBounds { y0, y1, .. } = film.bounds;
    let mut corrections = Vec::with_capacity(film.len());
    let mut replicas = film.replicas().to_vec();
    for top in (y0..y1).step_by(ROWS as usize) {
        let rows = top..y1.min(top + ROWS);
        let around = y0.max(top.saturating_sub(MARGIN as u32))..y1.min(rows.end + MARGIN as u32);
        let band = Band::read(film, tiles, rows, around, m);
        band.correct(&mut corrections, &mut replicas);
    }
    film.correct(corrections, replicas);
}

/// A band: some rows of a film and the rows around them.
struct Band {
    picture: Picture,
    components: usize,
    /// The corrected rows, by their index in the picture.
    rows: Range<usize>,
    /// Film index of the first pixel of these rows.
    first: usize,
    /// c̄ of each replica in these rows, by the film index of its pixel.
    of_replicas: BTreeMap<usize, Vec<f32>>,
}

impl Band {
    /// Reads `rows` and the rows `around` them, with `m` control variates.
    fn read(film: &Film, tiles: &[Tile], rows: Range<u32>, around: Range<u32>, m: usize) -> Self {
        let width = film.bounds.width() as usize;
        let mut sums = Vec::new();
        film.read_rows(around.clone(), &mut sums);
        let mut pixels = vec![Pixel::default(); sums.len()];
        let mut controls = vec![0.0; sums.len() * m];
        let mut of_replicas = BTreeMap::new();

        // Pixels and means of their control variates
        let has_rows = |t: &&Tile| t.bounds.y0 < around.end && around.start < t.bounds.y1;
        for tile in tiles.iter().filter(has_rows) {
            let exact = tile.fits.exact_sums();
            let mut fits = exact.chunks_exact(3 + m);
            for (i, fit) in (0..tile.bounds.area() as u32).zip(fits.by_ref()) {
                let [x, y] = tile.bounds.pixel_at(i);
                if !around.contains(&y) {
                    continue;
                }
                let at = film.index(x, y) - film.index(film.bounds.x0, around.start);
                pixels[at] = pixel(&sums[at], [0, 1, 2].map(|c| fit[c].value()));
                let per_sample = 1.0 / sums[at].count.max(1) as f64;
                means(fit, |sum| sum * per_sample, &mut controls[at * m..][..m]);
            }

            // Means of the replicas
            for (replica, fit) in tile.replicas.iter().zip(fits) {
                let [x, y] = tile.bounds.pixel_at(replica.pixel);
                if rows.contains(&y) {
                    let mut controls = vec![0.0; m];
                    let count = f64::from(replica.sums.count.max(1));
                    means(fit, |sum| sum / count, &mut controls);
                    of_replicas.insert(film.index(x, y), controls);
                }
            }
        }
        Band {
            picture: Picture::new(width, m, pixels, controls),
            components: m,
            rows: (rows.start - around.start) as usize..(rows.end - around.start) as usize,
            first: film.index(film.bounds.x0, rows.start),
            of_replicas,
        }
    }

    /// Appends the corrections of the rows, and corrects their replicas.
    fn correct(&self, corrections: &mut Vec<[f32; 3]>, replicas: &mut [Replica]) {
        // Coefficients, row by row
        let beta: Vec<Vec<f32>> = self
            .rows
            .clone()
            .into_par_iter()
            .map_init(Memory::default, |memory, row| {
                let mut beta = Vec::new();
                self.picture.coefficients(row, memory, &mut beta);
                beta
            })
            .collect();
        let beta = beta.concat();

        // Corrections of pixels
        let of_pixel = |i: usize| &beta[i * 3 * self.components..][..3 * self.components];
        let skipped = self.rows.start * self.picture.width();
        let count = self.rows.len() * self.picture.width();
        corrections.extend((0..count).map(|i| self.picture.correction(skipped + i, of_pixel(i))));

        // Replicas
        let begin = replicas.partition_point(|r| (r.pixel as usize) < self.first);
        for replica in replicas[begin..].iter_mut().take_while(|r| (r.pixel as usize) < self.first + count) {
            let Some(controls) = self.of_replicas.get(&(replica.pixel as usize)) else { continue };
            let off = correction(controls, of_pixel(replica.pixel as usize - self.first));
            let samples = replica.count.max(1) as f64;
            replica.radiance.iter_mut().zip(off).for_each(|(sum, off)| *sum -= samples * f64::from(off));
        }
    }
}

/// Means of control variates from the sums of a pixel. `mean_of` converts a sum to a mean.
pub(super) fn means(sums: &[FixedSum], mean_of: impl Fn(f64) -> f64, out: &mut [f32]) {
    out.iter_mut().zip(&sums[3..]).for_each(|(mean, sum)| *mean = mean_of(sum.value()) as f32);
}

/// A pixel whose estimates of direct light have the sum `value`. It is comparable to other pixels if all of its camera
/// rays hit surfaces; the material is its class.
pub(super) fn pixel(sums: &PixelSums, value: [f64; 3]) -> Pixel {
    let count = sums.count.max(1) as f64;
    let is_covered = sums.count > 0 && sums.hits == sums.count;
    Pixel {
        mean: value.map(|v| (v / count) as f32),
        class: is_covered.then_some(sums.material),
        normal: sums.normal.map(|v| (v / count) as f32),
    }
}
