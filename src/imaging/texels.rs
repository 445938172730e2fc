//! Storage of one level of an image pyramid: texels as bytes or floats, in memory or in tiles. [`super::mipmap`] makes
//! the levels and chooses among them.

use super::ColorEncoding;
use super::tiles::{TILE, TileStore};
use lumiris_lanes::prefetch::prefetch;
use lumiris_numbers::math::{Rgb, Vec2};
use std::sync::Arc;

/// Values of a level, row-major from the top left, channels interleaved.
#[derive(Clone, Debug)]
pub(super) enum Texels {
    /// Stored bytes; the byte table gives linear values.
    Bytes(Vec<u8>),
    /// Linear.
    Floats(Vec<f32>),
    /// Bytes or floats, in tiles.
    Tiled(Tiled),
}

impl Texels {
    /// Stored floats, converted in place.
    pub(super) fn linear(mut values: Vec<f32>, encoding: ColorEncoding) -> Self {
        if encoding != ColorEncoding::Linear {
            values.iter_mut().for_each(|v| *v = encoding.to_linear(*v));
        }
        Texels::Floats(values)
    }

    /// Stored floats; as bytes if all of them are multiples of 1/255 in 0..1.
    pub(super) fn of_floats(values: Vec<f32>, encoding: ColorEncoding) -> Self {
        let byte = |v: &f32| (v * 255.0 + 0.5) as u8;
        // Also false for NaN
        let is_exact = |v: &f32| (0.0..=1.0).contains(v) && (f32::from(byte(v)) / 255.0 - v).abs() < 1e-6;
        if values.iter().all(is_exact) {
            Texels::Bytes(values.iter().map(byte).collect())
        } else {
            Self::linear(values, encoding)
        }
    }
}

/// Tiles of a level, row-major, floats little-endian. Tiles at the right and lower edges have the full size.
#[derive(Clone, Debug)]
pub(super) struct Tiled {
    pub(super) store: Arc<TileStore>,
    /// Key of the first tile.
    pub(super) first: u64,
    /// Tiles per row.
    pub(super) columns: usize,
    /// Bytes per channel: 1 for the byte table, 4 for floats.
    pub(super) channel_bytes: usize,
}

impl Tiled {
    /// The first `N` channels of a pixel.
    fn values<const N: usize>(&self, channels: usize, [x, y]: [usize; 2], table: &[f32; 256]) -> [f32; N] {
        let pixel_bytes = channels * self.channel_bytes;
        let tile_bytes = TILE * TILE * pixel_bytes;
        let tile = (y / TILE) * self.columns + x / TILE;
        let at = (y % TILE * TILE + x % TILE) * pixel_bytes;
        self.store.with_tile(self.first + (tile * tile_bytes) as u64, tile_bytes, |bytes| {
            std::array::from_fn(|c| match self.channel_bytes {
                1 => table[usize::from(bytes[at + c])],
                _ => bytes[at + 4 * c..].first_chunk().map_or(0.0, |word| f32::from_le_bytes(*word)),
            })
        })
    }
}

#[derive(Clone, Debug)]
pub(super) struct Level {
    pub(super) width: usize,
    pub(super) height: usize,
    /// Width and height as floats, for lookups.
    pub(super) size: Vec2,
    pub(super) texels: Texels,
}

impl Level {
    pub(super) fn new([width, height]: [usize; 2], texels: Texels) -> Self {
        Level { width, height, size: Vec2::new(width as f32, height as f32), texels }
    }

    /// The linear value of a channel of a pixel. `table` gives the linear values of bytes.
    #[inline]
    pub(super) fn texel(&self, [x, y]: [usize; 2], c: usize, channels: usize, table: &[f32; 256]) -> f32 {
        let i = (y * self.width + x) * channels + c;
        match &self.texels {
            Texels::Bytes(v) => table[usize::from(v[i])],
            Texels::Floats(v) => v[i],
            Texels::Tiled(_) => self.colors([[x, y]], channels, table)[0][c],
        }
    }

    /// The linear colours of pixels; grey if there is one channel.
    #[inline]
    pub(super) fn colors<const N: usize>(
        &self,
        pixels: [[usize; 2]; N],
        channels: usize,
        table: &[f32; 256],
    ) -> [Rgb; N] {
        let index = |[x, y]: [usize; 2]| y * self.width + x;
        // Match the storage once, not for each pixel or channel
        match (&self.texels, channels) {
            (Texels::Bytes(v), 1) => pixels.map(|pixel| Rgb::splat(table[usize::from(v[index(pixel)])])),
            (Texels::Bytes(v), _) => pixels.map(|pixel| {
                let v = &v[3 * index(pixel)..][..3];
                Rgb::new(table[usize::from(v[0])], table[usize::from(v[1])], table[usize::from(v[2])])
            }),
            (Texels::Floats(v), 1) => pixels.map(|pixel| Rgb::splat(v[index(pixel)])),
            (Texels::Floats(v), _) => pixels.map(|pixel| {
                let v = &v[3 * index(pixel)..][..3];
                Rgb::new(v[0], v[1], v[2])
            }),
            (Texels::Tiled(tiled), 1) => pixels.map(|pixel| Rgb::splat(tiled.values::<1>(channels, pixel, table)[0])),
            (Texels::Tiled(tiled), _) => pixels.map(|pixel| Rgb::from_array(tiled.values(channels, pixel, table))),
        }
    }

    /// Requests a pixel that is read soon, if it is in memory.
    #[inline]
    pub(super) fn prefetch(&self, [x, y]: [usize; 2], channels: usize) {
        let i = (y * self.width + x) * channels;
        match &self.texels {
            Texels::Bytes(v) => prefetch(v, i),
            Texels::Floats(v) => prefetch(v, i),
            Texels::Tiled(_) => {}
        }
    }

    /// Bytes in memory.
    pub(super) fn bytes(&self) -> usize {
        match &self.texels {
            Texels::Bytes(v) => v.len(),
            Texels::Floats(v) => v.len() * size_of::<f32>(),
            Texels::Tiled(_) => 0,
        }
    }

    /// The store of its tiles, if it has any.
    pub(super) fn store(&self) -> Option<&Arc<TileStore>> {
        match &self.texels {
            Texels::Tiled(tiled) => Some(&tiled.store),
            Texels::Bytes(_) | Texels::Floats(_) => None,
        }
    }
}

/// The inverse of a table of linear values of bytes.
pub(super) struct NearestByte {
    table: [f32; 256],
    /// For each interval of 0..1, the number of table values below its start.
    below: [u8; NearestByte::PARTS],
}

impl NearestByte {
    const PARTS: usize = 1024;

    pub(super) fn new(table: &[f32; 256]) -> Self {
        let begin = |part: usize| part as f32 / Self::PARTS as f32;
        let below = std::array::from_fn(|part| table.partition_point(|&t| t < begin(part)).min(255) as u8);
        NearestByte { table: *table, below }
    }

    /// Byte whose linear value is nearest to `v`.
    pub(super) fn of(&self, v: f32) -> u8 {
        // The first table value that is not below v
        let part = ((v * Self::PARTS as f32) as usize).min(Self::PARTS - 1);
        let mut above = self.below[part];
        while above < 255 && self.table[usize::from(above)] < v {
            above += 1;
        }
        let under = above.saturating_sub(1);
        let distance = |byte: u8| (v - self.table[usize::from(byte)]).abs();
        if distance(under) < distance(above) { under } else { above }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_inverse_of_a_byte_table_finds_the_nearest_byte() {
        for encoding in
            [ColorEncoding::Linear, ColorEncoding::Srgb, ColorEncoding::Gamma(2.2), ColorEncoding::Gamma(0.5)]
        {
            let table = encoding.byte_table();
            let nearest = NearestByte::new(&table);
            for i in -10..=10_010 {
                let v = i as f32 / 10_000.0;
                let distance = |byte: u8| (table[usize::from(byte)] - v).abs();
                let min = (0..=255).map(distance).fold(f32::INFINITY, f32::min);
                assert_eq!(distance(nearest.of(v)), min, "{encoding:?} {v}");
            }
        }
    }
}
