//! Writing of texture files.

use super::directories::directories;
use super::layout::{DIRECTORIES, Layout};
use crate::imaging::mipmap::MipMap;
use crate::imaging::texels::Texels;
use crate::imaging::tiles::TILE;
use std::io::{self, Write};

/// Writes pyramids of one size that are in memory, their channels side by side. They are written as bytes if all of
/// them are bytes, and as linear floats otherwise.
pub fn write_texture(out: &mut dyn Write, maps: &[&MipMap]) -> io::Result<()> {
    let Some(first) = maps.first() else { return Err(io::Error::other("a texture has a channel")) };
    let is_bytes = maps.iter().all(|map| matches!(map.levels[0].texels, Texels::Bytes(_)));
    let channels = maps.iter().map(|map| map.channels()).sum();
    let mut layout = Layout::new(first.resolution(), channels, if is_bytes { 1 } else { 4 });
    layout.tiles_begin = DIRECTORIES + directories(&layout).len() as u64;
    out.write_all(&layout.header(&first.table))?;
    out.write_all(&directories(&layout))?;
    for level in 0..layout.sizes.len() {
        let [columns, rows] = layout.grid(level);
        for index in 0..columns * rows {
            let tile = tile(&layout, maps, level, [index % columns * TILE, index / columns * TILE]);
            out.write_all(&tile)?;
            out.write_all(&crc32fast::hash(&tile).to_le_bytes())?;
        }
    }
    Ok(())
}

/// A tile, row by row; zeros outside the level.
fn tile(layout: &Layout, maps: &[&MipMap], level: usize, [x0, y0]: [usize; 2]) -> Vec<u8> {
    let [width, height] = layout.sizes[level];
    let mut tile = Vec::with_capacity(layout.tile_bytes());
    let columns = x0..width.min(x0 + TILE);
    // Rows of one map are contiguous, pixels of several are not
    let step = if maps.len() == 1 { columns.len() } else { 1 };
    for (row, y) in (y0..height.min(y0 + TILE)).enumerate() {
        for x in columns.clone().step_by(step) {
            for map in maps {
                let begin = y * width + x;
                let values = map.channels() * begin..map.channels() * (begin + step);
                append(&mut tile, map, level, values, layout.channel_bytes);
            }
        }
        tile.resize((row + 1) * layout.tile_bytes() / TILE, 0);
    }
    tile.resize(layout.tile_bytes(), 0);
    tile
}

/// Appends values of a level as bytes or floats.
fn append(out: &mut Vec<u8>, map: &MipMap, level: usize, values: std::ops::Range<usize>, channel_bytes: usize) {
    match &map.levels[level].texels {
        Texels::Bytes(v) if channel_bytes == 1 => out.extend_from_slice(&v[values]),
        Texels::Bytes(v) => out.extend(v[values].iter().flat_map(|&byte| map.table[usize::from(byte)].to_le_bytes())),
        Texels::Floats(v) => out.extend(v[values].iter().flat_map(|v| v.to_le_bytes())),
        // Only pyramids in memory are written
        Texels::Tiled(_) => {}
    }
}
