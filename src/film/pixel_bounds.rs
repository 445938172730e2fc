//! Rectangles of pixels.

use std::ops::Range;

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

    /// Index of a pixel, row by row.
    #[inline]
    pub fn index_of(&self, [x, y]: [u32; 2]) -> usize {
        (y - self.y0) as usize * self.width() as usize + (x - self.x0) as usize
    }

    /// Coordinates of the pixel with an index.
    #[inline]
    pub fn pixel_at(&self, index: u32) -> [u32; 2] {
        [self.x0 + index % self.width(), self.y0 + index / self.width()]
    }

    /// True if the pixel is inside.
    #[inline]
    pub fn contains(&self, [x, y]: [u32; 2]) -> bool {
        (self.x0..self.x1).contains(&x) && (self.y0..self.y1).contains(&y)
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
    pub fn common_rows(&self, other: &PixelBounds) -> impl Iterator<Item = [Range<usize>; 2]> + use<> {
        let (a, b) = (*self, *other);
        let (x0, x1) = (a.x0.max(b.x0), a.x1.min(b.x1));
        let row = move |of: &PixelBounds, y: u32| {
            let first = (y - of.y0) as usize * of.width() as usize;
            first + (x0 - of.x0) as usize..first + (x1 - of.x0) as usize
        };
        let rows = if x0 < x1 { a.y0.max(b.y0)..a.y1.min(b.y1) } else { 0..0 };
        rows.map(move |y| [row(&a, y), row(&b, y)])
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
