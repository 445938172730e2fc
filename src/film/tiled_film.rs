//! The film: tiles of packed sums, read by rows.

use super::accumulator::PixelAccumulator;
use super::fixed_sums::FixedSum;
use super::image_noise;
use super::light_layers::{PackedLayers, PixelLight};
use super::packed::PackedSums;
use super::pixel::PixelSums;
use super::pixel_bounds::PixelBounds;
use super::replicas::Replica;
use super::summary::{BandSummary, Summary};
use super::variance_scale::VarianceScale;
use rayon::prelude::*;
use std::ops::Range;
use std::sync::{Arc, OnceLock};

/// Number of rows that are read together: the height of a noise block.
pub const BAND: u32 = image_noise::BLOCK;

/// A tile of a film: its pixels, row by row.
#[derive(Clone, Debug)]
pub struct FilmTile {
    /// The pixels.
    pub bounds: PixelBounds,
    /// Their sums.
    pub sums: Arc<PackedSums>,
    /// The light-group layers; empty if there are none.
    pub layers: Arc<PackedLayers>,
}

/// A pixel with light in a light-group layer.
#[derive(Clone, Copy, Debug)]
pub struct LayerPixel {
    /// The layer.
    pub layer: usize,
    /// Index of the pixel among those read, row by row.
    pub pixel: usize,
    /// Σ radiance.
    pub radiance: [f64; 3],
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
    pub(super) replicas: Vec<Replica>,
    /// Subtracted from the mean of each pixel; empty if there are no corrections.
    corrections: Vec<[f32; 3]>,
    /// Names of the light-group layers.
    light_layers: Vec<String>,
    pub(super) variance_scale: OnceLock<VarianceScale>,
    summary: OnceLock<Summary>,
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

    /// Names the light-group layers of the tiles.
    #[must_use]
    pub fn with_light_layers(self, light_layers: Vec<String>) -> Self {
        Film { light_layers, ..self }
    }

    /// Names of the light-group layers, whose sum is the image.
    pub fn light_layers(&self) -> &[String] {
        &self.light_layers
    }

    /// A film of a single tile.
    pub fn of_pixels(resolution: [u32; 2], bounds: PixelBounds, pixels: &[PixelAccumulator]) -> Self {
        let (sums, layers) = (Arc::new(PackedSums::of(pixels)), Arc::default());
        Film::new(resolution, bounds, vec![FilmTile { bounds, sums, layers }], Vec::new())
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
        self.bounds.index_of([x, y])
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
        let tiles: usize = self.tiles.iter().map(|t| t.sums.bytes() + t.layers.bytes() + size_of_val(t)).sum();
        tiles + size_of_val(&self.replicas[..]) + size_of_val(&self.corrections[..])
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
        let mut sums = Vec::new();
        for (tile, range) in self.tiles_of(pixels) {
            sums.resize(range.len(), PixelAccumulator::default());
            tile.sums.read(range.clone(), &mut sums);

            // The common pixels of each row
            let (bounds, width) = (&tile.bounds, tile.bounds.width() as usize);
            let [left, right] = [bounds.x0.max(pixels.x0), bounds.x1.min(pixels.x1)];
            let top = bounds.y0 + (range.start / width) as u32;
            for (y, row) in (top..).zip(sums.chunks_exact(width)) {
                let at = pixels.index_of([left, y]);
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

    /// Passes the pixels of some rows that have light in some of the light-group layers to `each`, tile by tile.
    pub fn read_light(&self, layers: Range<usize>, rows: Range<u32>, mut each: impl FnMut(LayerPixel)) {
        let pixels = PixelBounds { y0: rows.start, y1: rows.end, ..self.bounds };
        for (tile, range) in self.tiles_of(&pixels) {
            let PixelBounds { x0, y0, .. } = tile.bounds;
            for layer in layers.clone() {
                for PixelLight { pixel, sums } in tile.layers.lit(layer, range.clone()) {
                    let [x, y] = [x0 + pixel % tile.bounds.width(), y0 + pixel / tile.bounds.width()];
                    if (pixels.x0..pixels.x1).contains(&x) {
                        let radiance = sums.each_ref().map(FixedSum::value);
                        each(LayerPixel { layer, pixel: pixels.index_of([x, y]), radiance });
                    }
                }
            }
        }
    }

    /// The tiles that overlap a rectangle, and the pixels of their common rows. These are whole rows of the tile, since
    /// sums are packed row by row.
    fn tiles_of(&self, pixels: &PixelBounds) -> impl Iterator<Item = (&FilmTile, Range<usize>)> {
        let &PixelBounds { x0, x1, y0, y1 } = pixels;
        let first = self.tiles.partition_point(|t| t.bounds.y1 <= y0);
        let in_rows = self.tiles[first..].iter().take_while(move |t| t.bounds.y0 < y1);
        in_rows.filter(move |t| t.bounds.x0.max(x0) < t.bounds.x1.min(x1)).map(move |tile| {
            let row = |y: u32| (y - tile.bounds.y0) as usize * tile.bounds.width() as usize;
            (tile, row(tile.bounds.y0.max(y0))..row(tile.bounds.y1.min(y1)))
        })
    }

    /// Statistics of the film.
    pub fn summary(&self) -> &Summary {
        self.summary.get_or_init(|| {
            // Computed once here, not by all threads at the same time
            self.variance_scale();
            let bands = self.bands().map_init(Default::default, |(pixels, variances), rows| {
                self.read_rows_with_variances(rows.clone(), pixels, variances);
                let blocks = image_noise::of_blocks(
                    &PixelBounds { y0: rows.start, y1: rows.end, ..self.bounds },
                    pixels,
                    variances,
                );
                BandSummary::new(pixels, blocks)
            });
            BandSummary::of_all(&bands.collect::<Vec<_>>())
        })
    }
}
