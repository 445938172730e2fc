//! Control variates of a finished film: what the coefficients fitted to other pixels make of each pixel's own controls
//! is subtracted from it ([`lumiris_numbers::estimators::ocv::pixels`]).
//!
//! A replica is corrected by the coefficients of its pixel, which depend on neither of both estimates: so the two remain
//! independent but for β, and their difference gives the variance of the corrected pixel.

use super::tiles::Tile;
use crate::film::{Film, PixelBounds, PixelSums};
use lumiris_numbers::estimators::ocv::pixels::{Memory, Picture, Pixel, correction};
use rayon::prelude::*;

/// Corrects all pixels of `film`, which holds the tiles, and its replicas. `position` is that of a pixel of a tile.
pub(super) fn correct(film: &mut Film, tiles: &[Tile], position: impl Fn(&PixelBounds, u32) -> [u32; 2]) {
    let Some(m) = tiles.first().map(|t| t.fits.controls()).filter(|m| *m > 0) else { return };
    let mut pixels = vec![Pixel::default(); film.len()];
    let mut controls = vec![0.0; film.len() * m];
    let sums_of_film = film.pixels();
    // Σ c of each replica, by the index of its pixel
    let mut of_replicas = std::collections::BTreeMap::<u32, Vec<f64>>::new();
    for tile in tiles {
        let place = |i: u32| {
            let [x, y] = position(&tile.bounds, i);
            film.index(x, y)
        };
        for fit in 0..tile.bounds.area() as u32 {
            let (at, (value, sums)) = (place(fit), tile.fits.sums_of_controls(fit));
            pixels[at] = pixel(&sums_of_film[at], value);
            let per_sample = 1.0 / sums_of_film[at].count.max(1) as f64;
            for (c, sum) in controls[at * m..][..m].iter_mut().zip(sums) {
                *c = (sum * per_sample) as f32;
            }
        }
        for (fit, replica) in (tile.bounds.area() as u32..).zip(&tile.replicas) {
            of_replicas.insert(place(replica.pixel) as u32, tile.fits.sums_of_controls(fit).1.collect());
        }
    }

    drop(sums_of_film);
    let picture = Picture::new(film.bounds.width() as usize, m, pixels, controls);
    let rows = (0..picture.height()).into_par_iter();
    let beta: Vec<Vec<f32>> = rows
        .map_init(Memory::default, |memory, row| {
            let mut beta = Vec::new();
            picture.coefficients(row, memory, &mut beta);
            beta
        })
        .collect();
    let beta: Vec<f32> = beta.concat();
    let of_pixel = |i: usize| &beta[i * 3 * m..][..3 * m];
    let corrections = (0..film.len()).map(|i| picture.correction(i, of_pixel(i))).collect();
    let mut replicas = film.replicas().to_vec();
    for replica in &mut replicas {
        let count = replica.count.max(1) as f64;
        let Some(sums) = of_replicas.get(&replica.pixel) else { continue };
        let controls: Vec<f32> = sums.iter().map(|s| (s / count) as f32).collect();
        let off = correction(&controls, of_pixel(replica.pixel as usize));
        replica.radiance.iter_mut().zip(off).for_each(|(sum, off)| *sum -= count * f64::from(off));
    }
    film.correct(corrections, replicas);
}

/// A pixel with `value` as the sum of its estimates of direct light. What it can be compared to depends on what camera
/// rays have met: all of them one surface of the same material.
fn pixel(sums: &PixelSums, value: [f64; 3]) -> Pixel {
    let count = sums.count.max(1) as f64;
    let is_covered = sums.count > 0 && sums.hits == sums.count;
    Pixel {
        mean: value.map(|v| (v / count) as f32),
        class: is_covered.then_some(sums.material),
        normal: sums.normal.map(|v| (v / count) as f32),
    }
}
