//! The film: sums per pixel, from which means, variances and AOVs are read.
//!
//! Pixel filters work by importance sampling: a sample belongs to one pixel, and its weight is the sign of the
//! filter ([`filter`]). Samples are added to exact sums ([`exact`], [`accumulator`]), so that the film is the same
//! however they are ordered and split. [`replicas`] give the variance of pixel means; [`encoding`] stores sums in files.

pub mod accumulator;
pub mod encoding;
pub mod exact;
pub mod filter;
pub mod replicas;

use accumulator::PixelAccumulator;
use lumiris_numbers::math::{Rgb, Vec3, luminance};
use replicas::{Replica, ReplicaAccumulator};

/// What one camera sample says of its pixel.
#[derive(Clone, Copy, Debug, Default)]
pub struct PixelSample {
    /// Radiance times the filter weight.
    pub radiance: Rgb,
    /// Features of the first surface; `None` if the ray met nothing.
    pub features: Option<Features>,
}

/// Features of the first surface that a camera ray meets.
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

/// Sums over the samples of a pixel, as numbers.
#[derive(Clone, Copy, Debug, Default)]
pub struct PixelSums {
    /// Number of samples.
    pub count: u64,
    /// Σ radiance.
    pub radiance: [f64; 3],
    /// Σ radiance², per channel.
    pub radiance_squared: [f64; 3],
    /// Number of samples that met a surface.
    pub hits: u64,
    /// Σ albedo.
    pub albedo: [f64; 3],
    /// Σ normal.
    pub normal: [f64; 3],
    /// Σ depth of the samples that met a surface.
    pub depth: f64,
    /// Material of the first sample that met a surface, by its index, plus one; 0 if none did.
    pub material: u32,
    /// Geometry of that sample, plus one; 0 if none did.
    pub object: u32,
    /// Samples whose radiance was not finite, or beyond [`exact::LIMIT`]; they count as black.
    pub invalid: u64,
    /// Records of the irradiance cache that this pixel asked for.
    pub records: u32,
}

impl PixelSums {
    /// Mean radiance; black without samples.
    pub fn mean(&self) -> [f64; 3] {
        self.radiance.map(|s| s / self.count.max(1) as f64)
    }

    /// Variance of the mean per channel if the samples are independent, from their spread; see [`Film::variances`] for
    /// others. 0 with fewer than two samples.
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

    /// Rectangles of at most `size` × `size` that cover this one, row by row.
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
}

/// The sums of all pixels inside the crop window.
#[derive(Clone, Debug)]
pub struct Film {
    /// Size of the full image (width, height).
    pub resolution: [u32; 2],
    /// The part that is rendered.
    pub bounds: PixelBounds,
    /// Sums, row-major inside `bounds`.
    pub pixels: Vec<PixelSums>,
    /// Second estimates of some pixels, which are not part of the image; none if samples are independent.
    pub replicas: Vec<Replica>,
}

impl Film {
    /// An empty film.
    pub fn new(resolution: [u32; 2], bounds: PixelBounds) -> Self {
        Film { resolution, bounds, pixels: vec![PixelSums::default(); bounds.area()], replicas: Vec::new() }
    }

    /// Index of a pixel inside `pixels`.
    pub fn index(&self, x: u32, y: u32) -> usize {
        (y - self.bounds.y0) as usize * self.bounds.width() as usize + (x - self.bounds.x0) as usize
    }

    /// Sets the part of an empty film that `tile` covers; pixels of replicas are indexed in the tile.
    pub fn set_tile(&mut self, tile: &PixelBounds, sums: &[PixelAccumulator], replicas: &[ReplicaAccumulator]) {
        for (row, y) in (tile.y0..tile.y1).enumerate() {
            let (start, width) = (self.index(tile.x0, y), tile.width() as usize);
            let pixels = self.pixels[start..start + width].iter_mut();
            pixels.zip(&sums[row * width..]).for_each(|(pixel, sums)| *pixel = sums.sums());
        }
        let width = tile.width().max(1);
        let pixel = |r: &ReplicaAccumulator| self.index(tile.x0 + r.pixel % width, tile.y0 + r.pixel / width) as u32;
        let moved: Vec<Replica> = replicas.iter().map(|r| r.replica(pixel(r))).collect();
        self.replicas.extend(moved);
    }

    /// Mean over pixels of the relative standard error of the luminance of the mean: the noise that a progress bar
    /// shows. Pixels without light do not count.
    pub fn relative_noise(&self) -> f64 {
        let (mut sum, mut count) = (0.0, 0_u64);
        for (pixel, variance) in self.pixels.iter().zip(self.variances()) {
            let mean = luminance(pixel.mean());
            if mean > 0.0 && pixel.count > 1 {
                sum += luminance(variance).sqrt() / mean;
                count += 1;
            }
        }
        if count == 0 { f64::INFINITY } else { sum / count as f64 }
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
