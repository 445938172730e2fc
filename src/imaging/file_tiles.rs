//! Texels of a file with a pyramid: whole levels, and tiles that are read on demand.

use super::ColorEncoding;
use super::file::ImageError;
use super::oiio::{ImageFile, Values};
use super::texels::{Level, Texels, Tiled};
use super::tiles::{TILE, TileStore};
use std::sync::Arc;

/// Some channels of a pyramid, with their encoding.
#[derive(Clone, Debug)]
pub(super) struct FileTexels {
    pub(super) file: Arc<ImageFile>,
    /// Positions of one or three channels.
    pub(super) channels: Vec<usize>,
    pub(super) encoding: ColorEncoding,
}

impl FileTexels {
    /// Bytes per channel: 1 if values are bytes, converted by a table; else 4.
    fn channel_bytes(&self) -> usize {
        if self.file.is_bytes() { 1 } else { 4 }
    }

    /// A whole level.
    pub(super) fn level(&self, level: usize) -> Result<Level, ImageError> {
        let texels = match self.file.level(level, &self.channels)? {
            Values::Bytes(bytes) => Texels::Bytes(bytes),
            Values::Floats(values) => Texels::linear(values, self.encoding),
        };
        Ok(Level::new(self.file.sizes()[level], texels))
    }

    /// A level whose tiles are read on demand through `store`. A level of at most one tile is read at once.
    pub(super) fn tiled_level(&self, level: usize, store: &Arc<TileStore>) -> Result<Level, ImageError> {
        let [width, height] = self.file.sizes()[level];
        if width * height <= TILE * TILE {
            return self.level(level);
        }
        let [columns, rows] = [width, height].map(|n| n.div_ceil(TILE));
        let texels = self.clone();
        let read = move |index: usize| texels.tile(level, index).map_err(|error| error.to_string());
        let first = store.add_level(columns * rows, self.tile_bytes(), Arc::new(read));
        let tiled = Tiled { store: Arc::clone(store), first, columns, channel_bytes: self.channel_bytes() };
        Ok(Level::new([width, height], Texels::Tiled(tiled)))
    }

    fn tile_bytes(&self) -> usize {
        TILE * TILE * self.channels.len() * self.channel_bytes()
    }

    /// A tile of a level, row by row; zeros outside the level.
    fn tile(&self, level: usize, index: usize) -> Result<Vec<u8>, ImageError> {
        let [width, height] = self.file.sizes()[level];
        let columns = width.div_ceil(TILE);
        let origin = [index % columns * TILE, index / columns * TILE];
        let size = [TILE.min(width - origin[0]), TILE.min(height - origin[1])];
        let values = self.file.region(level, origin, size, &self.channels)?;
        let values = match values {
            Values::Bytes(bytes) => bytes,
            Values::Floats(values) => values.iter().flat_map(|v| self.encoding.to_linear(*v).to_le_bytes()).collect(),
        };
        let mut tile = vec![0; self.tile_bytes()];
        let rows = tile.chunks_exact_mut(self.tile_bytes() / TILE);
        rows.zip(values.chunks_exact(values.len() / size[1])).for_each(|(row, v)| row[..v.len()].copy_from_slice(v));
        Ok(tile)
    }
}
