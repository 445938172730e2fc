//! Encoding of the sums of a tile.

use super::error::PartError;
use super::header::FilmHeader;
use crate::film::PixelBounds;
use crate::film::encoding::{Decoder, Encoder};
use crate::film::light_layers::{LayerScratch, PackedLayers};
use crate::film::packed::{PackedRows, PackedSums};
use crate::film::replicas::ReplicaAccumulator;
use crate::render::tiles::Tile;
use std::sync::Arc;

/// The sums of a tile as read from a file.
#[derive(Debug)]
pub struct StoredTile {
    /// The pixels.
    pub bounds: PixelBounds,
    /// Index of the next sample of its pixels.
    pub done: u32,
    pub(super) sums: PackedSums,
    /// Sums of the light-group layers.
    pub(super) layers: PackedLayers,
    pub(super) replicas: Vec<ReplicaAccumulator>,
    /// Sums of values and control variates, of the pixels and then of the replicas.
    pub(super) controls: PackedRows,
    /// State of the fits that later samples depend on.
    memory: [Vec<f32>; 2],
}

impl StoredTile {
    /// Converts to a tile that continues from here. `empty` makes a tile without samples. Cache records are counted
    /// again.
    pub(in crate::render) fn restore(self, empty: impl Fn(PixelBounds) -> Tile) -> Result<Tile, PartError> {
        let mut tile = empty(self.bounds);

        // The replicas have to be of the same pixels
        let pixels = |replicas: &[ReplicaAccumulator]| replicas.iter().map(|r| r.pixel).collect::<Vec<_>>();
        if pixels(&tile.replicas) != pixels(&self.replicas) {
            return Err(PartError::Sums("the pixels that are estimated twice are not the same"));
        }

        // Fits
        if !tile.fits.restore(self.memory) || tile.fits.sum_count() != self.controls.len() {
            return Err(PartError::Sums("there are not as many control variates"));
        }
        let row = 3 + tile.fits.controls();
        (0..).zip(self.controls.unpacked().chunks(row)).for_each(|(fit, sums)| {
            tile.fits.merge_sums(fit, sums);
        });
        tile.fits.pack(&mut Vec::new());
        (tile.replicas, tile.done) = (self.replicas, self.done);

        // Light-group layers
        if tile.layers.len() != self.layers.len() {
            return Err(PartError::Sums("there are not as many light groups"));
        }
        tile.layers = Arc::new(self.layers);

        // Pixels
        let mut sums = self.sums.unpacked();
        sums.iter_mut().for_each(|sums| sums.records = 0);
        tile.set_sums(&sums, &mut Vec::new());
        Ok(tile)
    }

    /// Reads a tile within the extent of the header; `None` if it is invalid.
    pub(super) fn read(decoder: &mut Decoder<'_>, header: &FilmHeader) -> Option<Self> {
        let (image, samples) = (&header.bounds, &header.samples);
        let mut word = || decoder.word();
        let bounds = PixelBounds { x0: word()?, x1: word()?, y0: word()?, y1: word()? };
        let done = word()?;
        let (layers, replicas, controls) = (word()? as usize, word()? as usize, word()? as usize);
        let is_inside =
            image.x0 <= bounds.x0 && bounds.x1 <= image.x1 && image.y0 <= bounds.y0 && bounds.y1 <= image.y1;
        if !is_inside || bounds.area() == 0 || done < samples.start || done > samples.end {
            return None;
        }
        // Counts are not trusted: memory grows with the bytes that are read
        let sums = PackedSums::of(&(0..bounds.area()).map(|_| decoder.pixel()).collect::<Option<Vec<_>>>()?);
        let lit = (0..layers).map(|_| decoder.light(bounds.area())).collect::<Option<Vec<_>>>()?;
        let (mut layers, mut scratch) = (PackedLayers::new(layers, bounds.area()), LayerScratch::default());
        lit.iter().enumerate().for_each(|(layer, pixels)| layers.merge(layer, pixels, &mut scratch));
        let replicas: Vec<_> = (0..replicas).map(|_| decoder.replica()).collect::<Option<_>>()?;
        let is_in_order = replicas.windows(2).all(|pair| pair[0].pixel < pair[1].pixel);
        if !is_in_order || replicas.iter().any(|r| r.pixel as usize >= bounds.area()) {
            return None;
        }
        let numbers = (0..controls).map(|_| decoder.fixed()).collect::<Option<Vec<_>>>()?;
        let rows = bounds.area() + replicas.len();
        let mut controls = PackedRows::new(rows, numbers.len() / rows);
        if controls.len() != numbers.len() {
            return None;
        }
        controls.set(&numbers, &mut Vec::new());
        let memory = [decoder.floats()?, decoder.floats()?];
        Some(StoredTile { bounds, done, sums, layers, replicas, controls, memory })
    }
}

/// Writes a tile.
pub(super) fn write(tile: &Tile, encoder: &mut Encoder) {
    let b = &tile.bounds;
    let controls = tile.fits.exact_sums();
    [b.x0, b.x1, b.y0, b.y1, tile.done].into_iter().for_each(|n| encoder.word(n));
    encoder.word(tile.layers.len() as u32);
    encoder.word(tile.replicas.len() as u32);
    encoder.word(controls.len() as u32);
    tile.sums.unpacked().iter().for_each(|sums| encoder.pixel(sums));
    (0..tile.layers.len()).for_each(|layer| encoder.light(&tile.layers.lit(layer, 0..tile.bounds.area())));
    tile.replicas.iter().for_each(|replica| encoder.replica(replica));
    controls.iter().for_each(|sum| encoder.fixed(sum));
    tile.fits.memory().into_iter().for_each(|values| encoder.floats(values));
}
