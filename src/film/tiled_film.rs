//! The film: tiles of packed sums, read by rows.

use super::accumulator::PixelAccumulator;
use super::fixed_sums::FixedSum;
use super::image_noise;
use super::light_layers::{LightSums, PackedLayers};
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
        let read = |tile: &FilmTile, range, sums: &mut [PixelAccumulator]| tile.sums.read(range, sums);
        self.read_tiles(pixels, out, read, PixelAccumulator::sums);

        // Corrections
        if !self.corrections.is_empty() && !out.is_empty() {
            for (y, row) in (pixels.y0..).zip(out.chunks_exact_mut(pixels.width() as usize)) {
                let corrections = &self.corrections[self.index(pixels.x0, y)..];
                row.iter_mut().zip(corrections).for_each(|(pixel, off)| pixel.subtract(*off));
            }
        }
    }

    /// Reads Σ radiance of the pixels of some rows of a light-group layer.
    pub fn read_light(&self, layer: usize, rows: Range<u32>, out: &mut Vec<[f64; 3]>) {
        let pixels = PixelBounds { y0: rows.start, y1: rows.end, ..self.bounds };
        let read = |tile: &FilmTile, range, sums: &mut [LightSums]| tile.layers.read(layer, range, sums);
        self.read_tiles(&pixels, out, read, |sums| sums.each_ref().map(FixedSum::value));
    }

    /// Reads values from the tiles that overlap a rectangle, row by row.
    fn read_tiles<S: Clone + Default, T: Clone + Default>(
        &self,
        pixels: &PixelBounds,
        out: &mut Vec<T>,
        read: impl Fn(&FilmTile, Range<usize>, &mut [S]),
        value: impl Fn(&S) -> T,
    ) {
        out.clear();
        out.resize(pixels.area(), T::default());
        let first = self.tiles.partition_point(|t| t.bounds.y1 <= pixels.y0);
        let mut sums = Vec::new();
        for tile in self.tiles[first..].iter().take_while(|t| t.bounds.y0 < pixels.y1) {
            let bounds = &tile.bounds;
            let [left, right] = [bounds.x0.max(pixels.x0), bounds.x1.min(pixels.x1)];
            if left >= right {
                continue;
            }

            // Whole rows of the tile, since sums are packed row by row
            let (top, bottom, len) = (bounds.y0.max(pixels.y0), bounds.y1.min(pixels.y1), bounds.width() as usize);
            let start = (top - bounds.y0) as usize * len;
            sums.resize((bottom - top) as usize * len, S::default());
            read(tile, start..start + sums.len(), &mut sums);

            // Their common pixels
            for (y, row) in (top..bottom).zip(sums.chunks_exact(len)) {
                let at = pixels.index_of([left, y]);
                let row = &row[(left - bounds.x0) as usize..(right - bounds.x0) as usize];
                out[at..at + row.len()].iter_mut().zip(row).for_each(|(pixel, sums)| *pixel = value(sums));
            }
        }
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
