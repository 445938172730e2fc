//! Writes the files of the island.

use super::kinds::KINDS;
use super::leaves::LEAVES;
use super::meshes::pebble;
use super::patches::{PEBBLES, Planting};
use super::random::Stream;
use super::terrain::Terrain;
use super::text::{View, material_text, view_text, views, write_objects, write_places};
use crate::procedural::files::{ProceduralError, write_sky, write_texts};
use crate::procedural::ply::write_ply;
use crate::procedural::sky::SkyOptions;
use lumiris::geometry::TriangleMesh;
use lumiris::imaging::color::linear_to_srgb;
use lumiris::imaging::oiio::{Part, write_image};
use lumiris_formats::output::write_whole;
use lumiris_numbers::math::{Vec2, Vec3};
use rayon::prelude::*;
use std::f32::consts::TAU;
use std::io::{self, BufWriter, Write};
use std::path::Path;

/// Texels on each side of the maps of the ground and the water, and of the waves.
const MAP: usize = 1024;
const WAVES: usize = 512;

/// Parameters of the island.
#[derive(Clone, Copy, Debug)]
pub struct IslandOptions {
    /// Number of plants and pebbles, 1000..=10⁸.
    pub instances: usize,
    /// Squares of the terrain along each side, 16..=8192. There are two triangles in each.
    pub detail: u32,
    /// Texels on each side of the sky, 8..=8192.
    pub resolution: usize,
    /// Seed of everything.
    pub seed: u32,
}

impl Default for IslandOptions {
    fn default() -> Self {
        IslandOptions { instances: 10_000_000, detail: 1415, resolution: 1024, seed: 1 }
    }
}

/// Statistics of the island.
#[derive(Clone, Copy, Debug)]
pub struct WrittenIsland {
    /// Number of plants.
    pub plants: usize,
    /// Number of pebbles.
    pub pebbles: usize,
    /// Triangles of the terrain.
    pub triangles: usize,
    /// Side of the terrain (m).
    pub side: f32,
}

/// Writes the scenes `island.pbrt` and `beach.pbrt` and their files into a folder, which is created if necessary.
pub fn write_scenes(folder: &Path, options: &IslandOptions) -> Result<WrittenIsland, ProceduralError> {
    let IslandOptions { instances, detail, resolution, seed } = *options;
    if !(1000..=100_000_000).contains(&instances) {
        return Err(ProceduralError::Option(format!("the island has 1000 to 10^8 instances, not {instances}")));
    }
    if !(16..=8192).contains(&detail) {
        return Err(ProceduralError::Option(format!("the detail of the terrain must be 16 to 8192, not {detail}")));
    }

    // Text
    let planting = Planting::new(instances, seed);
    let terrain = planting.terrain;
    let texts = views(&terrain).map(|view: View| (format!("{}.pbrt", view.name), view_text(&view)));
    let mut texts: Vec<(&str, &str)> = texts.iter().map(|(name, text)| (name.as_str(), text.as_str())).collect();
    let materials = material_text(&terrain);
    texts.push(("materials.pbrt", &materials));
    write_texts(folder, &texts)?;
    write_lines(&folder.join("objects.pbrt"), |file| write_objects(file, &planting))?;
    write_lines(&folder.join("places.pbrt"), |file| write_places(file, &planting.placements))?;

    // Images
    write_sky(&folder.join("sky.exr"), &SkyOptions { resolution, ..sky_of_the_island(seed) })?;
    write_map(&folder.join("ground.png"), MAP, |p| terrain.ground_color(p * terrain.side).map(linear_to_srgb))?;
    write_map(&folder.join("water.png"), MAP, |p| terrain.water_color(p * terrain.side).map(linear_to_srgb))?;
    let waves = waves(seed);
    write_map(&folder.join("waves.png"), WAVES, |p| wave_normal(&waves, p) * 0.5 + 0.5)?;
    for leaf in LEAVES {
        write_image(&folder.join(format!("{}.png", leaf.name())), &[leaf.image()])?;
    }

    // Meshes
    let triangles = write_meshes(folder, &terrain, detail)?;
    Ok(WrittenIsland { plants: planting.plants, pebbles: planting.pebbles, triangles, side: terrain.side })
}

/// Writes all meshes; returns the number of triangles of the terrain.
fn write_meshes(folder: &Path, terrain: &Terrain, detail: u32) -> Result<usize, ProceduralError> {
    let write = |name: String, mesh: Result<TriangleMesh, String>| {
        let (path, mesh) = (folder.join(name + ".ply"), mesh.map_err(ProceduralError::Option)?);
        write_ply(&path, &mesh).map_err(|cause| ProceduralError::Io { path, cause })?;
        Ok(mesh.triangle_count())
    };
    for kind in &KINDS {
        let plant = kind.grow(terrain.seed).map_err(ProceduralError::Option)?;
        write(format!("{}-leaves", kind.name), Ok(plant.leaves))?;
        if let Some(wood) = plant.wood {
            write(format!("{}-wood", kind.name), Ok(wood))?;
        }
    }
    for i in 0..PEBBLES {
        write(format!("pebble{i}"), pebble(terrain.seed.wrapping_add(i)))?;
    }
    write("terrain".to_owned(), terrain.mesh(detail))
}

fn write_lines(path: &Path, write: impl FnOnce(&mut dyn Write) -> io::Result<()>) -> Result<(), ProceduralError> {
    let written = write_whole(path, |file| {
        let mut file = BufWriter::with_capacity(1 << 20, file);
        write(&mut file)?;
        file.flush()
    });
    written.map_err(|cause| ProceduralError::Io { path: path.to_owned(), cause })
}

/// A sun in the afternoon among some clouds.
fn sky_of_the_island(seed: u32) -> SkyOptions {
    SkyOptions {
        elevation: 38_f32.to_radians(),
        azimuth: 250_f32.to_radians(),
        haze: 1.5,
        sun_size: 3.0,
        ground_albedo: 0.08,
        cloud_cover: 0.35,
        irradiance: 6.0,
        seed,
        ..SkyOptions::default()
    }
}

/// Writes an 8-bit image of a function of −0.5..0.5 in both directions; the second one is up.
fn write_map(path: &Path, size: usize, value: impl Fn(Vec2) -> Vec3 + Sync) -> Result<(), ProceduralError> {
    let texel = |i: usize| {
        let [x, y] = [i % size, i / size].map(|x| (x as f32 + 0.5) / size as f32 - 0.5);
        value(Vec2::new(x, -y)).to_array()
    };
    let data = (0..size * size).into_par_iter().map(texel).collect::<Vec<_>>().into_flattened();
    Ok(write_image(path, &[Part::display(size, size, ["R", "G", "B"].map(str::to_owned).to_vec(), data)])?)
}

/// A sine wave that repeats with the unit square.
struct Wave {
    /// Numbers of periods.
    periods: Vec2,
    phase: f32,
    /// Maximum slope.
    slope: f32,
}

/// Waves, most of which run in about the same direction.
fn waves(seed: u32) -> Vec<Wave> {
    let mut stream = Stream::new([seed, 4, 0]);
    let wave = |i: u32| {
        let frequency = 2.0 * 1.09_f32.powi(i as i32);
        let direction = Vec2::from_angle(0.9 + stream.within(-1.0, 1.0));
        Wave { periods: (direction * frequency).round(), phase: stream.angle(), slope: 0.016 }
    };
    (0..36).map(wave).collect()
}

fn wave_normal(waves: &[Wave], p: Vec2) -> Vec3 {
    let slope = |w: &Wave| w.periods.normalize_or_zero() * (w.slope * (TAU * w.periods.dot(p) + w.phase).cos());
    let slope: Vec2 = waves.iter().map(slope).sum();
    (-slope).extend(1.0).normalize()
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::{BTreeMap, HashMap};

    const SMALL: IslandOptions = IslandOptions { instances: 2000, detail: 64, resolution: 32, seed: 5 };

    /// The files of an island, by name.
    fn island(options: &IslandOptions) -> (WrittenIsland, BTreeMap<String, Vec<u8>>) {
        let folder = tempfile::tempdir().unwrap();
        let written = write_scenes(folder.path(), options).unwrap();
        let entries = std::fs::read_dir(folder.path()).unwrap().map(|entry| entry.unwrap());
        let files = entries.map(|e| (e.file_name().into_string().unwrap(), std::fs::read(e.path()).unwrap())).collect();
        (written, files)
    }

    /// Numbers of plants and pebbles that an object or the scene holds.
    fn count(lines: &mut dyn Iterator<Item = &str>, objects: &HashMap<String, usize>) -> usize {
        let name = |line: &str| line.strip_prefix("ObjectInstance ").map(|name| name.trim_matches('"').to_owned());
        lines.filter_map(name).map(|name| objects.get(&name).copied().unwrap_or(1)).sum()
    }

    #[test]
    fn an_island_has_the_requested_number_of_instances() {
        for instances in [1000, 2000, 30_001] {
            let (written, files) = island(&IslandOptions { instances, ..SMALL });
            let text = |name: &str| String::from_utf8(files[name].clone()).unwrap();
            let (text, places) = (text("objects.pbrt"), text("places.pbrt"));
            let patches = text.split("ObjectBegin ").filter(|object| object.contains("ObjectInstance"));
            let sizes = patches.map(|object| {
                let name = object.lines().next().unwrap().trim_matches('"').to_owned();
                (name, count(&mut object.lines(), &HashMap::new()))
            });
            assert_eq!(count(&mut places.lines(), &sizes.collect()), instances);
            assert_eq!(written.plants + written.pebbles, instances);
            assert_eq!(written.triangles, 2 * 64 * 64);
        }
    }

    #[test]
    fn the_same_seed_gives_the_same_bytes_and_another_one_another_island() {
        let [a, b] = [(); 2].map(|()| island(&SMALL).1);
        assert!(a == b);
        assert_eq!(a.len(), 53);
        let other = island(&IslandOptions { seed: 6, ..SMALL }).1;
        assert!(a.keys().eq(other.keys()));
        for name in ["terrain.ply", "places.pbrt", "sky.exr", "coconut-leaves.ply"] {
            assert!(a[name] != other[name], "{name}");
        }
    }

    #[test]
    fn options_out_of_range_are_errors() {
        let folder = tempfile::tempdir().unwrap();
        for options in [
            IslandOptions { instances: 999, ..SMALL },
            IslandOptions { instances: 100_000_001, ..SMALL },
            IslandOptions { detail: 15, ..SMALL },
        ] {
            assert!(matches!(write_scenes(folder.path(), &options), Err(ProceduralError::Option(_))));
        }
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0);
    }
}
