//! Merges the parts of an image. Sums are exact, so the result is bit-identical to the image rendered at once.
//!
//! First all headers are read, to check that the parts belong together and have every sample of every pixel exactly
//! once. Then the parts are read one by one, a chunk of tiles at a time, and added to tiles that cover the image.

use super::error::PartError;
use super::file::FilmReader;
use super::header::FilmHeader;
use super::notes::{SCENE_NOTE, SECONDS, asked_aovs, has_features};
use super::stored_tile::StoredTile;
use crate::direct::Fits;
use crate::film::accumulator::PixelAccumulator;
use crate::film::fixed_sums::FixedSum;
use crate::film::light_layers::{LayerScratch, PackedLayers, PixelLight};
use crate::film::packed::PackedSums;
use crate::film::{Film, PixelBounds};
use crate::imaging::TextEntries;
use crate::render::control_variates;
use crate::render::output::{Aov, default_aovs};
use crate::render::tile_share::SHARE_TILE;
use crate::render::tiles::{Tile, film};
use std::collections::BTreeMap;
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Maximum lines of a message about many parts.
const MAX_LINES: usize = 8;

/// The image of merged parts.
#[derive(Debug)]
pub struct Merged {
    /// The film.
    pub film: Film,
    /// The header of the first part.
    pub header: FilmHeader,
    /// Missing samples, if these are allowed.
    pub missing: Vec<String>,
    /// Range of sample indices of the whole image.
    pub samples: Range<u32>,
    /// Total time of all parts (s).
    pub seconds: f64,
}

impl Merged {
    /// The layers that the parts were rendered for.
    pub fn aovs(&self) -> Vec<Aov> {
        match asked_aovs(&self.header) {
            Some(list) => list.into_iter().filter(|aov| *aov != Aov::Ratio).collect(),
            None => default_aovs(&self.film, false, self.film.summary().has_records),
        }
    }

    /// True if the film has albedos and normals.
    pub fn has_features(&self) -> bool {
        has_features(&self.header)
    }

    /// Metadata, as for an image rendered at once.
    pub fn metadata(&self) -> TextEntries {
        let settings = self.header.settings.iter().filter(|(key, _)| key.starts_with("lumiris:")).cloned();
        let mut metadata: TextEntries = settings.collect();
        let mut add = |key: &str, value: String| metadata.push((format!("lumiris:{key}"), value));
        add("scene", self.header.note(SCENE_NOTE).unwrap_or_default().to_owned());
        add("complete", self.missing.is_empty().to_string());
        add("samples_done", self.film.summary().samples_text("per pixel"));
        add("seconds", format!("{:.3}", self.seconds));
        if !self.missing.is_empty() {
            add("missing", self.missing.join("; "));
        }
        metadata
    }
}

/// Merges parts, in any order.
pub fn merge(paths: &[PathBuf], allows_missing: bool) -> Result<Merged, PartError> {
    let readers = paths.iter().map(|path| FilmReader::open(path)).collect::<Result<Vec<_>, _>>()?;
    let parts: Vec<Part> =
        readers.iter().map(|r| Part { path: r.path().to_owned(), header: r.header().clone() }).collect();
    // The files are opened again one by one: there may be more parts than a process can have open files
    drop(readers);
    let first = parts.first().ok_or_else(|| PartError::Parts("there are no parts to merge".to_owned()))?;
    check_same_image(&parts)?;
    let samples = samples_of_all(&parts);
    let mut missing = coverage(&parts, &samples)?;
    missing.extend(parts.iter().filter(|p| !p.header.is_finished).map(|p| {
        format!("the rest of {}, which is not finished (render it to the end with --resume)", p.path.display())
    }));
    if !missing.is_empty() && !allows_missing {
        let message = format!("parts are missing:\n{}\n--allow-missing merges what there is", listed(&missing));
        return Err(PartError::Parts(message));
    }

    let bounds = first.header.bounds;
    let mut whole = Whole::empty(&first.header);
    for part in &parts {
        let mut reader = FilmReader::open(&part.path)?;
        if *reader.header() != part.header {
            return Err(PartError::damaged(&part.path, "it became another file while it was read"));
        }
        while let Some(tiles) = reader.tiles()? {
            tiles.iter().try_for_each(|tile| whole.add(tile, part))?;
        }
    }
    let mut film = film(first.header.resolution, bounds, &whole.tiles, &first.header.light_layers);
    control_variates::correct(&mut film, &whole.tiles);
    let seconds = parts.iter().filter_map(|p| p.header.note(SECONDS)?.parse::<f64>().ok()).sum();
    Ok(Merged { film, header: first.header.clone(), missing, samples, seconds })
}

/// A part whose tiles are not read yet.
struct Part {
    path: PathBuf,
    header: FilmHeader,
}

/// The lines of a message; only the first [`MAX_LINES`] are shown.
fn listed(lines: &[String]) -> String {
    let mut text: Vec<String> = lines.iter().take(MAX_LINES).map(|line| format!("  {line}")).collect();
    if lines.len() > MAX_LINES {
        text.push(format!("  and {} more", lines.len() - MAX_LINES));
    }
    text.join("\n")
}

/// Fails if a part does not belong to the image of the first part.
fn check_same_image(parts: &[Part]) -> Result<(), PartError> {
    for part in &parts[1..] {
        let differences = parts[0].header.differences(&part.header);
        if !differences.is_empty() {
            let (path, first) = (part.path.display(), parts[0].path.display());
            let message = format!("{path} is no part of the image of {first}:\n{}", listed(&differences));
            return Err(PartError::Parts(message));
        }
    }
    Ok(())
}

/// Sample range of the whole image: the requested samples, or more if parts have more.
fn samples_of_all(parts: &[Part]) -> Range<u32> {
    0..parts.iter().map(|p| p.header.samples.end.max(p.header.spp)).max().unwrap_or(0)
}

/// Missing samples. Fails if two parts have the same samples.
fn coverage(parts: &[Part], samples: &Range<u32>) -> Result<Vec<String>, PartError> {
    // Tiles are distinguished only if a part is a share of the tiles
    let bounds = parts[0].header.bounds;
    let count = if parts.iter().any(|p| p.header.share.is_some()) {
        (bounds.width().div_ceil(SHARE_TILE) * bounds.height().div_ceil(SHARE_TILE)) as usize
    } else {
        1
    };

    // Find the gaps of each tile, in the order of samples
    let mut of_tile: Vec<&Part> = Vec::with_capacity(parts.len());
    let mut by_start: Vec<&Part> = parts.iter().collect();
    by_start.sort_by_key(|p| (p.header.samples.start, p.header.samples.end));
    let mut gaps = BTreeMap::<(u32, u32), Vec<usize>>::new();
    for tile in 0..count {
        of_tile.clear();
        of_tile.extend(by_start.iter().copied().filter(|p| p.header.share.is_none_or(|share| share.has(tile))));
        let mut next = samples.start;
        let mut before: Option<&Part> = None;
        for &part in &of_tile {
            let range = &part.header.samples;
            if let Some(before) = before.filter(|_| range.start < next && !range.is_empty()) {
                return Err(double(before, part));
            }
            if range.start > next {
                gaps.entry((next, range.start)).or_default().push(tile);
            }
            (next, before) = (next.max(range.end), Some(part));
        }
        if next < samples.end {
            gaps.entry((next, samples.end)).or_default().push(tile);
        }
    }

    // Describe the gaps, tiles with the same gap together
    Ok(gaps.iter().flat_map(|(&(from, to), tiles)| gap(parts, from..to, tiles, count)).collect())
}

/// The error of two parts with the same samples.
fn double(a: &Part, b: &Part) -> PartError {
    let (x, y) = (&a.header.samples, &b.header.samples);
    let (from, to) = (x.start.max(y.start), x.end.min(y.end));
    let (a, b) = (a.path.display(), b.path.display());
    PartError::Parts(format!("{a} and {b} both have the samples {from} to {to} of the same pixels"))
}

/// Describes samples that are missing in some tiles.
fn gap(parts: &[Part], samples: Range<u32>, tiles: &[usize], count: usize) -> Vec<String> {
    let Range { start, end } = samples;
    let what = format!("samples {start} to {end}");
    if tiles.len() == count {
        return vec![format!("{what} of all pixels")];
    }
    // Name whole shares if all parts are shares
    let shares: Vec<u32> = parts.iter().filter_map(|p| p.header.share.map(|s| s.count)).collect();
    let of = shares.first().copied().filter(|n| shares.iter().all(|other| other == n));
    if let Some(of) = of {
        let share = |index: u32| (0..count).filter(move |tile| tile % of as usize == index as usize);
        let is_whole = |index: &u32| share(*index).all(|tile| tiles.binary_search(&tile).is_ok());
        let whole: Vec<u32> = (0..of).filter(|index| share(*index).next().is_some()).filter(is_whole).collect();
        if whole.iter().map(|&index| share(index).count()).sum::<usize>() == tiles.len() {
            return whole.iter().map(|index| format!("{what} of part {}/{of} by tiles", index + 1)).collect();
        }
    }
    vec![format!("{what} of {} of {count} tiles of {SHARE_TILE} pixels", tiles.len())]
}

/// The merged image so far, in tiles of [`SHARE_TILE`] pixels.
struct Whole {
    bounds: PixelBounds,
    tiles: Vec<Tile>,
    packing: Vec<u8>,
    of_layers: LayerScratch,
}

impl Whole {
    /// Tiles without samples.
    fn empty(header: &FilmHeader) -> Self {
        let image = header.bounds;
        let tile = |bounds: PixelBounds| {
            let replicas = header.replicas.map_or(Vec::new(), |choice| choice.of_tile(&image, &bounds));
            let fits = match header.controls as usize {
                0 => Fits::default(),
                controls => Fits::of_pixels(controls, bounds.area() + replicas.len()),
            };
            let layers = Arc::new(PackedLayers::new(header.light_layers.len(), bounds.area()));
            Tile { bounds, done: 0, sums: Arc::new(PackedSums::new(bounds.area())), layers, replicas, fits }
        };
        let tiles = image.tiles(SHARE_TILE).into_iter().map(tile).collect();
        Whole { bounds: image, tiles, packing: Vec::new(), of_layers: LayerScratch::default() }
    }

    /// Adds a stored tile of any size.
    fn add(&mut self, stored: &StoredTile, part: &Part) -> Result<(), PartError> {
        // Check the tile against the header
        let damaged = |reason| PartError::damaged(&part.path, reason);
        if part.header.is_finished && stored.done < part.header.samples.end {
            return Err(damaged("a tile lacks samples that its header says are there"));
        }
        let rows = stored.bounds.area() + stored.replicas.len();
        let controls = stored.controls.unpacked();
        let row = controls.len() / rows;
        let expected = self.tiles.first().map_or(0, |t| t.fits.sum_count() / (t.sums.len() + t.replicas.len()));
        if row * rows != controls.len() || row != expected {
            return Err(damaged("it does not have the control variates that its header says"));
        }
        if stored.layers.len() != part.header.light_layers.len() {
            return Err(damaged("it does not have the light groups that its header says"));
        }

        // Add it to the overlapping tiles
        let sums = stored.sums.unpacked();
        let area = stored.bounds.area();
        let layers: Vec<_> = (0..stored.layers.len()).map(|layer| stored.layers.lit(layer, 0..area)).collect();
        let columns = self.bounds.width().div_ceil(SHARE_TILE) as usize;
        let cells = |from: u32, to: u32, origin: u32| {
            (((from - origin) / SHARE_TILE) as usize)..((to - origin).div_ceil(SHARE_TILE) as usize)
        };
        for y in cells(stored.bounds.y0, stored.bounds.y1, self.bounds.y0) {
            for x in cells(stored.bounds.x0, stored.bounds.x1, self.bounds.x0) {
                let tile = &mut self.tiles[y * columns + x];
                add_to(tile, stored, &sums, &controls[..], &mut self.packing).map_err(damaged)?;
                add_layers_to(tile, &stored.bounds, &layers, &mut self.of_layers);
            }
        }
        Ok(())
    }
}

/// Adds a stored tile to an overlapping tile. `controls` are the sums of its control variates, of all pixels and
/// replicas.
fn add_to(
    tile: &mut Tile,
    stored: &StoredTile,
    sums: &[PixelAccumulator],
    controls: &[FixedSum],
    packing: &mut Vec<u8>,
) -> Result<(), &'static str> {
    let bounds = tile.bounds;
    let index = |i: u32| index_in(&bounds, &stored.bounds, i);
    let row = controls.len() / (sums.len() + stored.replicas.len());
    let controls = |fit: usize| &controls[fit * row..][..row];

    // Pixels
    let mut merged = tile.sums.unpacked();
    for (i, sums) in sums.iter().enumerate() {
        let Some(at) = index(i as u32) else { continue };
        let counts = [merged[at].radiance.count, sums.radiance.count];
        counts[0].checked_add(counts[1]).ok_or("with it, a pixel has more samples than can be counted")?;
        merged[at].merge(sums);
        if row > 0 {
            tile.fits.merge_sums(at as u32, controls(i));
        }
    }
    tile.set_sums(&merged, packing);

    // Replicas
    for (i, replica) in stored.replicas.iter().enumerate() {
        let Some(at) = index(replica.pixel) else { continue };
        let at = tile.replicas.binary_search_by_key(&(at as u32), |r| r.pixel);
        let at = at.map_err(|_| "it has a second estimate of a pixel that should have none")?;
        tile.replicas[at].merge(replica);
        if row > 0 {
            tile.fits.merge_sums((merged.len() + at) as u32, controls(stored.bounds.area() + i));
        }
    }
    tile.fits.pack(packing);
    Ok(())
}

/// Adds the layers of a stored tile to an overlapping tile.
fn add_layers_to(tile: &mut Tile, from: &PixelBounds, layers: &[Vec<PixelLight>], scratch: &mut LayerScratch) {
    for (layer, lit) in layers.iter().enumerate() {
        let inside = |&PixelLight { pixel, sums }: &PixelLight| {
            Some(PixelLight { pixel: index_in(&tile.bounds, from, pixel)? as u32, sums })
        };
        let inside: Vec<_> = lit.iter().filter_map(inside).collect();
        if !inside.is_empty() {
            Arc::make_mut(&mut tile.layers).merge(layer, &inside, scratch);
        }
    }
}

/// Index in the tile `to` of the pixel with index `i` in the tile `from`; `None` if it is outside.
fn index_in(to: &PixelBounds, from: &PixelBounds, i: u32) -> Option<usize> {
    let pixel = from.pixel_at(i);
    to.contains(pixel).then(|| to.index_of(pixel))
}

/// The first path that refers to the same file as an earlier one; `None` if there is none.
pub fn repeated(paths: &[PathBuf]) -> Option<&Path> {
    let identity = |path: &PathBuf| path.canonicalize().unwrap_or_else(|_| path.clone());
    let mut seen = std::collections::HashSet::new();
    paths.iter().find(|path| !seen.insert(identity(path))).map(PathBuf::as_path)
}
