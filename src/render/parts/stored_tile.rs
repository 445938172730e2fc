//! The sums of a tile in a file.

use super::error::PartError;
use crate::film::PixelBounds;
use crate::film::encoding::{Decoder, Encoder};
use crate::film::exact::FixedSum;
use crate::film::packed::PackedSums;
use crate::film::replicas::ReplicaAccumulator;
use crate::render::tiles::Tile;

/// The sums of a tile, as they were stored.
#[derive(Debug)]
pub struct StoredTile {
    /// Its pixels.
    pub bounds: PixelBounds,
    /// Index of the next sample of its pixels.
    pub done: u32,
    pub(super) sums: PackedSums,
    pub(super) replicas: Vec<ReplicaAccumulator>,
    /// Sums of values and control variates, of the pixels and then of the replicas.
    pub(super) controls: Vec<FixedSum>,
    /// What later samples follow from.
    memory: [Vec<f32>; 2],
}

impl StoredTile {
    /// The tile that goes on from here; `empty` is one without samples. The records of a cache are counted anew.
    pub(in crate::render) fn restore(self, empty: impl Fn(PixelBounds) -> Tile) -> Result<Tile, PartError> {
        let mut tile = empty(self.bounds);
        let pixels = |replicas: &[ReplicaAccumulator]| replicas.iter().map(|r| r.pixel).collect::<Vec<_>>();
        if pixels(&tile.replicas) != pixels(&self.replicas) {
            return Err(PartError::Sums("the pixels that are estimated twice are not the same"));
        }
        if !tile.fits.restore(self.memory) || tile.fits.exact_sums().len() != self.controls.len() {
            return Err(PartError::Sums("there are not as many control variates"));
        }
        let row = 3 + tile.fits.controls();
        (0..).zip(self.controls.chunks(row)).for_each(|(fit, sums)| {
            tile.fits.merge_sums(fit, sums);
        });
        (tile.replicas, tile.done) = (self.replicas, self.done);
        let mut sums = self.sums.unpacked();
        sums.iter_mut().for_each(|sums| sums.records = 0);
        tile.set_sums(&sums, &mut Vec::new());
        Ok(tile)
    }

    /// Reads a tile inside `image`; `None` if it is none.
    pub(super) fn read(decoder: &mut Decoder<'_>, image: &PixelBounds) -> Option<Self> {
        let mut word = || decoder.word();
        let (bounds, done) = (PixelBounds { x0: word()?, x1: word()?, y0: word()?, y1: word()? }, word()?);
        let (replicas, controls) = (word()? as usize, word()? as usize);
        let is_inside =
            image.x0 <= bounds.x0 && bounds.x1 <= image.x1 && image.y0 <= bounds.y0 && bounds.y1 <= image.y1;
        if !is_inside || bounds.area() == 0 {
            return None;
        }
        // As many as there are bytes for, whatever the numbers say
        let sums = (0..bounds.area()).map(|_| decoder.pixel()).collect::<Option<Vec<_>>>()?;
        let sums = PackedSums::of(&sums);
        let replicas: Vec<_> = (0..replicas).map(|_| decoder.replica()).collect::<Option<_>>()?;
        if replicas.iter().any(|r| r.pixel as usize >= bounds.area()) {
            return None;
        }
        let controls = (0..controls).map(|_| decoder.fixed()).collect::<Option<_>>()?;
        Some(StoredTile { bounds, done, sums, replicas, controls, memory: [decoder.floats()?, decoder.floats()?] })
    }
}

/// Writes a tile.
pub(super) fn write(tile: &Tile, encoder: &mut Encoder) {
    let b = &tile.bounds;
    let controls = tile.fits.exact_sums();
    [b.x0, b.x1, b.y0, b.y1, tile.done].into_iter().for_each(|n| encoder.word(n));
    encoder.word(tile.replicas.len() as u32);
    encoder.word(controls.len() as u32);
    tile.sums.unpacked().iter().for_each(|sums| encoder.pixel(sums));
    tile.replicas.iter().for_each(|replica| encoder.replica(replica));
    controls.iter().for_each(|sum| encoder.fixed(sum));
    tile.fits.memory().into_iter().for_each(|values| encoder.floats(values));
}
