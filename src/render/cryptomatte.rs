//! Cryptomatte: coverage of each pixel by objects and materials [Friedman and Jones 2015; Cryptomatte
//! specification 1.2].
//!
//! Coverage is computed from the camera samples of the image: their rays are traced again, to the first surface only,
//! and weighted by the pixel filter. Integrators and the film are not involved, so an image without these layers takes
//! no extra time.
//!
//! An id is the 32-bit MurmurHash3 of a name, reinterpreted as a float. A pixel stores the [`RANKS`] ids with the
//! largest coverage, two in each group of four channels.

use super::render_settings::RenderSettings;
use crate::accel::{Coherence, Hit};
use crate::film::{Film, PixelBounds};
use crate::imaging::TextEntries;
use crate::integrators::CameraSamples;
use crate::integrators::camera_sampler::{CameraSampler, PixelSampleRange, Scratch};
use crate::integrators::path::BATCH_PATHS;
use crate::planning::preparation::{ThreadError, thread_pool};
use crate::scene::{RenderJob, Scene};
use rayon::prelude::*;
use std::collections::{BTreeMap, HashSet};
use std::io::Cursor;
use std::ops::Range;
use strum::{EnumString, IntoStaticStr, VariantNames};

/// Ids per pixel.
pub const RANKS: usize = 6;

/// Kind of a Cryptomatte.
#[derive(Clone, Copy, Debug, PartialEq, Eq, EnumString, IntoStaticStr, VariantNames)]
#[strum(serialize_all = "kebab-case")]
pub enum Cryptomatte {
    /// Shapes, and instances of shapes.
    Object,
    /// Materials.
    Material,
}

/// The image of one Cryptomatte.
#[derive(Clone, Debug)]
pub struct Layer {
    /// Its name, `CryptoObject` or `CryptoMaterial`.
    pub name: &'static str,
    /// Names of the channels: `CryptoObject00.R` is the first id and `.G` its coverage, `.B` and `.A` are the second.
    pub channels: Vec<String>,
    /// The crop window.
    bounds: PixelBounds,
    /// Sorted by rows, then columns.
    tiles: Vec<LayerTile>,
    /// Metadata entries `cryptomatte/…`, with the names of all ids.
    pub metadata: TextEntries,
}

/// 32-bit MurmurHash3 of a name.
pub fn hash(name: &str) -> u32 {
    // Reading from memory cannot fail
    murmur3::murmur3_32(&mut Cursor::new(name), 0).unwrap_or_default()
}

/// The float with the bits of a hash. The exponent is changed if it would not be a normal number.
pub fn id(hash: u32) -> f32 {
    let exponent = (hash >> 23 & 0xff).clamp(1, 254);
    f32::from_bits(hash & 0x807f_ffff | exponent << 23)
}

impl Cryptomatte {
    /// Name of the layer.
    pub fn layer(self) -> &'static str {
        match self {
            Cryptomatte::Object => "CryptoObject",
            Cryptomatte::Material => "CryptoMaterial",
        }
    }

    /// Key of a hit: geometry and instance, or material.
    fn key(self, scene: &Scene, hit: &Hit) -> Key {
        match self {
            Cryptomatte::Object => (hit.geometry, hit.instance),
            Cryptomatte::Material => (scene.surfaces[hit.geometry as usize].material, Hit::NO_INSTANCE),
        }
    }

    /// Names, indexed by the first part of the key.
    fn names(self, scene: &Scene) -> Vec<String> {
        match self {
            Cryptomatte::Object => unique(scene.surfaces.iter().map(|s| &*s.name)),
            Cryptomatte::Material => unique(scene.materials.entries().iter().map(|m| m.name.as_str())),
        }
    }

    fn finish(self, bounds: PixelBounds, mut tiles: Vec<LayerTile>) -> Layer {
        let mut hashes = BTreeMap::new();
        tiles.iter_mut().for_each(|tile| hashes.extend(std::mem::take(&mut tile.hashes)));
        let names =
            (0..RANKS / 2).flat_map(|group| ["R", "G", "B", "A"].map(|c| format!("{}{group:02}.{c}", self.layer())));
        Layer { name: self.layer(), channels: names.collect(), bounds, tiles, metadata: self.metadata(&hashes) }
    }

    /// The metadata entries of the specification. The manifest is JSON, ordered by name.
    fn metadata(self, hashes: &BTreeMap<String, u32>) -> TextEntries {
        let names: Vec<String> =
            hashes.iter().map(|(name, hash)| format!("{}:\"{hash:08x}\"", json_text(name))).collect();
        let key = format!("{:08x}", hash(self.layer()));
        let entry = |name: &str, value: String| (format!("cryptomatte/{}/{name}", &key[..7]), value);
        vec![
            entry("name", self.layer().to_owned()),
            entry("hash", "MurmurHash3_32".to_owned()),
            entry("conversion", "uint32_to_float32".to_owned()),
            entry("manifest", format!("{{{}}}", names.join(","))),
        ]
    }
}

/// See [`Cryptomatte::key`].
type Key = (u32, u32);

/// Makes names unique by appending numbers.
fn unique<'a>(names: impl Iterator<Item = &'a str>) -> Vec<String> {
    let mut taken = HashSet::new();
    let mut next = BTreeMap::new();
    let number = |name: &'a str| {
        let mut unique = name.to_owned();
        while !taken.insert(unique.clone()) {
            let n = next.entry(name).and_modify(|n| *n += 1).or_insert(1_u32);
            unique = format!("{name}.{n}");
        }
        unique
    };
    names.map(number).collect()
}

/// Renders the Cryptomattes of a film.
pub fn cryptomattes(
    job: &RenderJob,
    settings: &RenderSettings,
    film: &Film,
    kinds: &[Cryptomatte],
) -> Result<Vec<Layer>, ThreadError> {
    if kinds.is_empty() {
        return Ok(Vec::new());
    }

    // Trace all tiles
    let pool = thread_pool(settings.threads)?;
    let tiles = film.bounds.tiles(settings.tile_size);
    let camera = CameraSampler::new(job, settings.first_sample);
    let names: Vec<Vec<String>> = kinds.iter().map(|kind| kind.names(&job.world.scene)).collect();
    let tracer = CoverageTracer { job, film, camera, first: settings.first_sample, kinds, names: &names };
    let of_tiles: Vec<Vec<LayerTile>> =
        pool.install(|| tiles.par_iter().with_max_len(1).map(|tile| tracer.tile(tile)).collect());

    // Sort the results by kind
    let mut layers: Vec<Vec<LayerTile>> = kinds.iter().map(|_| Vec::with_capacity(tiles.len())).collect();
    for of_tile in of_tiles {
        layers.iter_mut().zip(of_tile).for_each(|(layer, tile)| layer.push(tile));
    }
    Ok(kinds.iter().zip(layers).map(|(kind, tiles)| kind.finish(film.bounds, tiles)).collect())
}

/// Channels per Cryptomatte.
const STRIDE: usize = 2 * RANKS;

/// Keys of a pixel with their coverage.
type Ranked = Vec<(Key, f32)>;

/// One Cryptomatte in one tile.
#[derive(Clone, Debug)]
struct LayerTile {
    bounds: PixelBounds,
    /// Number of ids of each pixel, row by row.
    counts: Vec<u8>,
    /// Ids and coverage, pixel by pixel.
    covers: Vec<[f32; 2]>,
    /// Names and hashes of all keys in the tile.
    hashes: BTreeMap<String, u32>,
}

impl Layer {
    /// The values of some rows, given by their y coordinates, interleaved.
    pub fn rows(&self, rows: Range<u32>) -> Vec<f32> {
        let row = self.bounds.width() as usize * STRIDE;
        let mut data = vec![0.0; rows.len() * row];
        let first = self.tiles.partition_point(|t| t.bounds.y1 <= rows.start);
        for tile in self.tiles[first..].iter().take_while(|t| t.bounds.y0 < rows.end) {
            let mut covers = tile.covers.as_slice();
            for (i, &count) in (0..).zip(&tile.counts) {
                let (of_pixel, others) = covers.split_at(count.into());
                covers = others;
                let [x, y] = tile.bounds.pixel_at(i);
                if rows.contains(&y) {
                    let at = (y - rows.start) as usize * row + (x - self.bounds.x0) as usize * STRIDE;
                    data[at..at + 2 * of_pixel.len()].copy_from_slice(of_pixel.as_flattened());
                }
            }
        }
        data
    }
}

struct CoverageTracer<'a> {
    job: &'a RenderJob,
    film: &'a Film,
    camera: CameraSampler<'a>,
    first: u32,
    kinds: &'a [Cryptomatte],
    /// Names of each kind.
    names: &'a [Vec<String>],
}

impl CoverageTracer<'_> {
    /// All Cryptomattes of a tile.
    fn tile(&self, tile: &PixelBounds) -> Vec<LayerTile> {
        // Coverage by key
        let mut pixels = vec![vec![Ranked::new(); tile.area()]; self.kinds.len()];
        self.trace(tile, &mut pixels);

        // Keep the largest, and replace keys by ids
        let layers = pixels.into_iter().zip(self.names).map(|(pixels, names)| {
            let (mut counts, mut covers) = (Vec::with_capacity(pixels.len()), Vec::new());
            let mut hashes = BTreeMap::<Key, (String, u32)>::new();
            for mut ranked in pixels {
                rank(&mut ranked);
                counts.push(ranked.len() as u8);
                for (key, coverage) in ranked {
                    let (_, hash) = hashes.entry(key).or_insert_with(|| {
                        let name = name_of(names, key);
                        let hash = hash(&name);
                        (name, hash)
                    });
                    covers.push([id(*hash), coverage]);
                }
            }
            covers.shrink_to_fit();
            LayerTile { bounds: *tile, counts, covers, hashes: hashes.into_values().collect() }
        });
        layers.collect()
    }

    /// Adds the coverage of the camera samples of a tile to its pixels.
    fn trace(&self, tile: &PixelBounds, pixels: &mut [Vec<Ranked>]) {
        let scene = &self.job.world.scene;
        let seed = self.job.settings().sampling.seed;
        let mut sums = Vec::new();
        self.film.read(tile, &mut sums);
        let count = |index: u32| sums[index as usize].count as u32;
        // Ranges of samples, none longer than a batch
        let mut ranges = (0..tile.area() as u32).flat_map(|index| {
            let (first, count) = (self.first, count(index));
            let begins = (0..count).step_by(BATCH_PATHS);
            begins.map(move |begin| (index, first + begin..first + count.min(begin + BATCH_PATHS as u32)))
        });
        let (mut scratch, mut batch, mut samples) = (Scratch::default(), Vec::new(), CameraSamples::default());
        let mut hits = Vec::new();

        // Batches of ranges, the last one shorter
        let mut next = ranges.next();
        while next.is_some() {
            let mut paths = 0;
            while let Some((index, samples)) = next.take_if(|(_, r)| paths + r.len() <= BATCH_PATHS) {
                paths += samples.len();
                batch.push(PixelSampleRange { fit: index, pixel: tile.pixel_at(index), samples });
                next = ranges.next();
            }
            self.camera.samples(batch.drain(..), seed, &mut scratch, &mut samples);
            self.job.world.accel.intersect(&samples.rays, Coherence::Coherent, &mut hits);
            for ((&weight, &fit), hit) in samples.weight.iter().zip(&samples.fit).zip(&hits) {
                let Some(hit) = hit else { continue };
                let weight = weight / (scene.film.scale * count(fit) as f32);
                for (pixels, kind) in pixels.iter_mut().zip(self.kinds) {
                    add(&mut pixels[fit as usize], kind.key(scene, hit), weight);
                }
            }
        }
    }
}

fn add(ranked: &mut Ranked, key: Key, weight: f32) {
    match ranked.iter_mut().find(|(k, _)| *k == key) {
        Some((_, coverage)) => *coverage += weight,
        None => ranked.push((key, weight)),
    }
}

/// Keeps the keys with the largest coverage. Filters with negative lobes can give a negative coverage, which is
/// dropped.
fn rank(ranked: &mut Ranked) {
    ranked.retain(|(_, coverage)| *coverage > 0.0);
    ranked.sort_unstable_by(|a, b| b.1.total_cmp(&a.1).then(a.0.cmp(&b.0)));
    ranked.truncate(RANKS);
}

fn name_of(names: &[String], (index, instance): Key) -> String {
    let name = &names[index as usize];
    if instance == Hit::NO_INSTANCE { name.clone() } else { format!("{name}@{instance}") }
}

/// A JSON string.
fn json_text(text: &str) -> String {
    let mut json = String::from("\"");
    for c in text.chars() {
        match c {
            '"' | '\\' => json.extend(['\\', c]),
            c if c < ' ' => json += &format!("\\u{:04x}", u32::from(c)),
            c => json.push(c),
        }
    }
    json + "\""
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Values of the reference code of the specification.
    #[test]
    fn ids_are_those_of_the_specification() {
        for (name, expected) in [
            ("hello", 6.070_562_7e-17),
            ("cube", -4.084_619_1e15),
            ("sphere", 2.790_186e15),
            ("plane", 3.665_576_2e-11),
        ] {
            assert_eq!(id(hash(name)), expected, "{name}");
        }
        for hash in [0, 0x7f80_0000, 0xffff_ffff, 0x8000_0001, 0x0012_3456] {
            assert!(id(hash).is_normal(), "{hash:08x}");
            assert_eq!(id(hash).to_bits() & 0x807f_ffff, hash & 0x807f_ffff);
        }
    }

    #[test]
    fn equal_names_are_numbered() {
        assert_eq!(unique(["a", "b", "a", "a.1", "a"].into_iter()), ["a", "b", "a.1", "a.1.1", "a.2"]);
        assert_eq!(json_text("a\"b\\c\n"), "\"a\\\"b\\\\c\\u000a\"");
    }
}
