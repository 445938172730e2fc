//! What an error in a pixel counts: coarse means of the image.

use crate::film::PixelBounds;
use lumiris_numbers::math::Rgb;

/// Added to the square of a pixel's value where errors are relative to it; that of relMSE.
const FLOOR: f32 = 0.01;

/// Means of the image over square blocks.
#[derive(Clone, Debug)]
pub(in crate::integrators) struct PixelMeans {
    bounds: PixelBounds,
    /// Edge of a block in pixels.
    edge: u32,
    columns: u32,
    rows: u32,
    sums: Vec<(Rgb, f32)>,
    means: Vec<Rgb>,
}

impl PixelMeans {
    /// Blocks of `edge` × `edge` pixels.
    pub(in crate::integrators) fn new(bounds: PixelBounds, edge: u32) -> Self {
        let edge = edge.max(1);
        let (columns, rows) = (bounds.width().div_ceil(edge), bounds.height().div_ceil(edge));
        let count = (columns * rows) as usize;
        PixelMeans { bounds, edge, columns, rows, sums: vec![Default::default(); count], means: Vec::new() }
    }

    #[inline]
    fn block(&self, [x, y]: [u32; 2]) -> usize {
        let at = |v: u32, first: u32, count: u32| (v.saturating_sub(first) / self.edge).min(count.saturating_sub(1));
        (at(y, self.bounds.y0, self.rows) * self.columns + at(x, self.bounds.x0, self.columns)) as usize
    }

    /// Adds a sample of a pixel.
    pub(in crate::integrators) fn add(&mut self, pixel: [u32; 2], radiance: Rgb) {
        let block = self.block(pixel);
        self.sums[block].0 += radiance;
        self.sums[block].1 += 1.0;
    }

    /// Determines the means, smoothed by a tent over adjacent blocks.
    pub(in crate::integrators) fn finish(&mut self) {
        let (columns, rows) = (self.columns as i64, self.rows as i64);
        let mean = |x: i64, y: i64| {
            let (mut sum, mut count) = (Rgb::BLACK, 0.0);
            for (dx, dy) in (-1..=1).flat_map(|dy| (-1..=1).map(move |dx| (dx, dy))) {
                if (0..columns).contains(&(x + dx)) && (0..rows).contains(&(y + dy)) {
                    let (l, n) = self.sums[((y + dy) * columns + x + dx) as usize];
                    let tent = ((2 - dx.abs()) * (2 - dy.abs())) as f32;
                    (sum, count) = (sum + l * tent, count + n * tent);
                }
            }
            sum / f32::max(count, 1.0)
        };
        self.means = (0..rows).flat_map(|y| (0..columns).map(move |x| (x, y))).map(|(x, y)| mean(x, y)).collect();
    }

    /// The mean around a pixel.
    #[inline]
    pub(super) fn mean(&self, pixel: [u32; 2]) -> Rgb {
        self.means.get(self.block(pixel)).copied().unwrap_or_default()
    }

    /// 1/(I² + 0.01): what the square of an error counts in a pixel.
    #[inline]
    pub(in crate::integrators) fn weight(&self, pixel: [u32; 2]) -> Rgb {
        self.mean(pixel).map(|i| 1.0 / (i * i + FLOOR))
    }
}
