//! Textures in a folder for later runs: bit-identical images, whatever happened to the folder.

use lumiris::imaging::oiio::{ImageFile, Part, write_image};
use lumiris::imaging::texture_file::write_texture;
use lumiris::imaging::tiles::TileStore;
use lumiris::imaging::{Filter, MipMap, Wrap};
use lumiris::import::cache::FileCache;
use lumiris::import::images::{ImageChannels, ImageEncoding, ImageRequest, all_maps, load_map};
use lumiris::import::texture_cache::TextureCache;
use lumiris::import::{LoadOptions, load_with};
use lumiris::render::output::channels;
use lumiris::render::{RenderSettings, render};
use lumiris::scene::{AccelKind, RenderJob};
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::time::{Duration, SystemTime};

const SIZE: [usize; 2] = [300, 201];

/// Writes an image of 8 bits or of floats, by its extension, with an opacity. `shift` changes all values.
fn write(path: &Path, shift: usize) {
    let [width, height] = SIZE;
    let value = |i: usize| ((i * 7 + i / 1000 * 13 + shift) % 256) as f32 / 255.0;
    let is_float = path.extension().is_some_and(|extension| extension == "exr");
    let is_large = |i: usize| is_float && i % 4 != 3;
    let data = (0..width * height * 4).map(|i| if is_large(i) { value(i) * 3.3 } else { value(i) }).collect();
    let names = ["R", "G", "B", "A"].map(str::to_owned).to_vec();
    let part = if is_float { Part::linear } else { Part::display };
    write_image(path, &[part(width, height, names, data)]).unwrap();
}

fn request(path: &Path, channels: ImageChannels, encoding: ImageEncoding) -> ImageRequest {
    let path = path.to_owned();
    ImageRequest { path, channels, encoding, wrap: Wrap::Repeat, filter: Filter::Trilinear }
}

fn color(path: &Path) -> ImageRequest {
    request(path, ImageChannels::Color, ImageEncoding::Auto)
}

/// All texels of all levels.
fn texels(map: &MipMap) -> Vec<[f32; 3]> {
    let [width, height] = map.resolution();
    let of_level = |level: usize| {
        let [width, height] = [width, height].map(|n| (n >> level).max(1) as i64);
        (0..width * height).map(move |i| map.texel(level, i % width, i / width).to_array())
    };
    (0..map.levels()).flat_map(of_level).collect()
}

/// The texels of a request by a new cache in `folder`, its warnings, and the number of tiles that were read.
fn cached(folder: &Path, request: &ImageRequest) -> (Vec<[f32; 3]>, Vec<String>, u64) {
    let cache = Arc::new(TextureCache::new(folder).unwrap());
    let store = Arc::new(TileStore::new(u64::MAX).unwrap());
    let map = cache.map(request, &store, None).unwrap();
    assert_eq!(store.counts().read, 0, "no tile is read before it is needed");
    assert!(map.store().is_some());
    let texels = texels(&map);
    assert_eq!(store.failure(), None);
    (texels, cache.take_warnings(), store.counts().read)
}

/// The entries of a cache.
fn entries(folder: &Path) -> Vec<PathBuf> {
    let paths = fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path());
    let mut files: Vec<PathBuf> = paths.filter(|path| path.is_file()).collect();
    files.sort();
    files
}

#[test]
fn texels_of_the_first_and_of_later_runs_are_those_without_a_cache() {
    let folder = tempfile::tempdir().unwrap();
    let cache = folder.path().join("a/cache");
    for name in ["a.png", "a.exr"] {
        let path = folder.path().join(name);
        write(&path, 0);
        for channels in [ImageChannels::Color, ImageChannels::Alpha, ImageChannels::Number] {
            for encoding in [ImageEncoding::Auto, ImageEncoding::Linear, ImageEncoding::Gamma(1.8)] {
                let request = request(&path, channels, encoding);
                let expected = texels(&load_map(&request).unwrap());
                for _run in 0..2 {
                    let (found, warnings, read) = cached(&cache, &request);
                    assert!(found == expected && warnings.is_empty() && read > 0, "{request:?} {warnings:?}");
                }
            }
        }
    }
    assert_eq!(entries(&cache).len(), 2 * 3 * 3);
    // 8 bits stay 8 bits
    let len = |path: &PathBuf| path.metadata().unwrap().len();
    let least = entries(&cache).iter().map(len).min().unwrap();
    let tiles = (5 * 4 + 3 * 2 + 2 + 6) as u64;
    assert!(least < tiles * (64 * 64 + 4) + 8_000, "{least}");
}

#[test]
fn a_later_run_reads_nothing_of_an_unchanged_image() {
    let folder = tempfile::tempdir().unwrap();
    let (cache, path) = (folder.path().join("cache"), folder.path().join("a.png"));
    write(&path, 0);
    let old = SystemTime::now() - Duration::from_secs(100);
    fs::File::options().write(true).open(&path).unwrap().set_modified(old).unwrap();
    // Changed too recently for its times to tell: hashed, but not remembered
    let expected = cached(&cache, &color(&path)).0;
    assert_eq!(entries(&cache.join("sources")).len(), 0);
    std::thread::sleep(Duration::from_millis(2100));
    assert_eq!(cached(&cache, &color(&path)).0, expected);
    let sources = entries(&cache.join("sources"));
    assert_eq!(sources.len(), 1);

    // The hash that is remembered is used: another one leads to another entry
    let line = fs::read_to_string(&sources[0]).unwrap();
    let (state, _) = line.rsplit_once(' ').unwrap();
    fs::write(&sources[0], format!("{state} 17\n")).unwrap();
    assert_eq!(cached(&cache, &color(&path)).0, expected);
    assert_eq!(entries(&cache).len(), 2);

    // A file of the same size and time of modification is not the same
    write(&path, 1);
    fs::File::options().write(true).open(&path).unwrap().set_modified(old).unwrap();
    let changed = cached(&cache, &color(&path)).0;
    assert!(changed == texels(&load_map(&color(&path)).unwrap()) && changed != expected);
}

#[test]
fn the_content_of_a_file_decides_and_not_its_name() {
    let folder = tempfile::tempdir().unwrap();
    let cache = folder.path().join("cache");
    let [a, b] = ["a.png", "b.png"].map(|name| folder.path().join(name));
    write(&a, 0);
    fs::copy(&a, &b).unwrap();
    let [of_a, of_b] = [&a, &b].map(|path| cached(&cache, &color(path)).0);
    assert!(of_a == of_b);
    assert_eq!(entries(&cache).len(), 1);
    write(&a, 5);
    assert!(cached(&cache, &color(&a)).0 == texels(&load_map(&color(&a)).unwrap()));
    assert_eq!(entries(&cache).len(), 2);
}

#[test]
fn damaged_entries_are_reported_and_made_anew() {
    let folder = tempfile::tempdir().unwrap();
    let (cache, path) = (folder.path().join("cache"), folder.path().join("a.png"));
    write(&path, 0);
    let expected = cached(&cache, &color(&path)).0;
    let entry = entries(&cache).remove(0);
    let intact = fs::read(&entry).unwrap();
    let flipped = |at: usize| {
        let mut bytes = intact.clone();
        bytes[at] ^= 4;
        bytes
    };
    // Empty, cut in the header and in a tile, too long; a bit of the header, of the finest level, and of the last
    let cut = [0, 700, intact.len() / 2, intact.len() - 1].map(|len| intact[..len].to_vec());
    let long = [&intact[..], b"x"].concat();
    let damaged = cut.into_iter().chain([long, flipped(30), flipped(30_000), flipped(intact.len() - 100)]);
    for (i, bytes) in damaged.enumerate() {
        fs::write(&entry, bytes).unwrap();
        let (found, warnings, _) = cached(&cache, &color(&path));
        assert!(found == expected, "damage {i}");
        let is_named = warnings.len() == 1 && warnings[0].contains("damaged") && warnings[0].contains("a.png");
        assert!(is_named, "damage {i}: {warnings:?}");
        assert!(fs::read(&entry).unwrap() == intact, "damage {i}");
    }
    let (found, warnings, _) = cached(&cache, &color(&path));
    assert!(found == expected && warnings.is_empty());
}

#[test]
fn what_is_lost_while_it_is_used_is_made_anew_unless_its_image_has_changed() {
    let folder = tempfile::tempdir().unwrap();
    let (folder, path) = (folder.path().join("cache"), folder.path().join("a.png"));
    write(&path, 0);
    let expected = cached(&folder, &color(&path)).0;
    for has_changed in [false, true] {
        let cache = Arc::new(TextureCache::new(&folder).unwrap());
        let store = Arc::new(TileStore::new(u64::MAX).unwrap());
        let map = cache.map(&color(&path), &store, None).unwrap();
        entries(&folder).iter().for_each(|entry| fs::remove_file(entry).unwrap());
        if has_changed {
            write(&path, 3);
        }
        let found = texels(&map);
        assert_eq!(found == expected, !has_changed);
        assert_eq!(store.failure().is_some_and(|reason| reason.contains("has changed")), has_changed);
        assert_eq!(cache.take_warnings().len(), 1);
    }
}

#[test]
fn several_users_at_once_share_a_folder() {
    let folder = tempfile::tempdir().unwrap();
    let cache = folder.path().join("cache");
    let paths: Vec<PathBuf> = (0..3).map(|i| folder.path().join(format!("{i}.png"))).collect();
    paths.iter().enumerate().for_each(|(i, path)| write(path, i));
    let expected: Vec<_> = paths.iter().map(|path| texels(&load_map(&color(path)).unwrap())).collect();
    std::thread::scope(|scope| {
        for thread in 0..8 {
            let (cache, paths, expected) = (&cache, &paths, &expected);
            scope.spawn(move || {
                for i in 0..6 {
                    let k = (i + thread) % paths.len();
                    let (found, warnings, _) = cached(cache, &color(&paths[k]));
                    assert!(found == expected[k] && warnings.is_empty(), "{warnings:?}");
                }
            });
        }
    });
    assert_eq!(entries(&cache).len(), paths.len(), "nothing but entries is left");
}

#[test]
fn a_folder_that_cannot_be_written_costs_time_and_a_warning() {
    let folder = tempfile::tempdir().unwrap();
    let (cache, path) = (folder.path().join("cache"), folder.path().join("a.png"));
    write(&path, 0);
    // Even root cannot write a file in place of a folder
    let opened = Arc::new(TextureCache::new(&cache).unwrap());
    fs::remove_dir_all(&cache).unwrap();
    fs::write(&cache, "").unwrap();
    let store = Arc::new(TileStore::new(u64::MAX).unwrap());
    let map = opened.map(&color(&path), &store, None).unwrap();
    assert!(texels(&map) == texels(&load_map(&color(&path)).unwrap()));
    let warnings = opened.take_warnings();
    assert!(warnings.len() == 1 && warnings[0].contains("cannot be stored"), "{warnings:?}");
}

/// A square with two textures, far enough away to use coarser levels in part of the image.
const SCENE: &str = "LookAt 0 0.3 -2  0 0 0  0 1 0\nCamera \"perspective\" \"float fov\" 50\n\
    Film \"rgb\" \"integer xresolution\" 48 \"integer yresolution\" 32\nIntegrator \"direct\"\nWorldBegin\n\
    LightSource \"infinite\"\nTexture \"a\" \"spectrum\" \"imagemap\" \"string filename\" \"a.png\" \
    \"float uscale\" 0.5\nTexture \"b\" \"spectrum\" \"imagemap\" \"string filename\" \"b.exr\"\n\
    Texture \"t\" \"spectrum\" \"mix\" \"texture tex1\" \"a\" \"texture tex2\" \"b\"\n\
    Material \"diffuse\" \"texture reflectance\" \"t\"\n\
    Shape \"bilinearmesh\" \"point3 P\" [ -2 -1 -1  2 -1 -1  -2 1 9  2 1 9 ]\n";

#[test]
fn images_are_the_same_to_the_bit_with_and_without_a_folder() {
    let folder = tempfile::tempdir().unwrap();
    let (scene, cache) = (folder.path().join("s.pbrt"), folder.path().join("cache"));
    fs::write(&scene, SCENE).unwrap();
    write(&folder.path().join("a.png"), 0);
    write(&folder.path().join("b.exr"), 9);
    let job = |limit: Option<u64>, is_cached: bool| -> RenderJob {
        let files = FileCache::default();
        limit.into_iter().for_each(|bytes| files.limit_textures(bytes));
        if is_cached {
            files.cache_textures(&cache).unwrap();
        }
        let loaded = load_with(&scene, &LoadOptions::default(), &files).map_err(|d| d.to_string()).unwrap();
        assert_eq!(loaded.warnings.to_string(), "");
        loaded.job(AccelKind::Embree, None).unwrap()
    };
    let pixels = |job: &RenderJob| {
        let rendering = render(job, &RenderSettings::default(), &AtomicBool::new(false), &|_| ()).unwrap();
        channels(&rendering.film, &[], None).data
    };
    let expected = pixels(&job(None, false));
    for (run, limit) in [None, None, Some(1 << 30), Some(100_000)].into_iter().enumerate() {
        let job = job(limit, true);
        let store = job.world.scene.textures.store().unwrap();
        assert_eq!(store.counts().read, 0);
        assert!(pixels(&job) == expected, "run {run}");
        let counts = store.counts();
        assert!(counts.stored == 0 && counts.read > 0 && counts.held <= store.capacity(), "{counts:?}");
        assert!(store.capacity() <= limit.unwrap_or(u64::MAX) && store.capacity() < 1 << 30);
    }

    // Damage is a warning of the scene
    let entry = entries(&cache).remove(0);
    fs::write(&entry, "damaged").unwrap();
    let files = FileCache::default();
    files.cache_textures(&cache).unwrap();
    let loaded = load_with(&scene, &LoadOptions::default(), &files).map_err(|d| d.to_string()).unwrap();
    assert!(loaded.warnings.to_string().contains("is damaged"), "{}", loaded.warnings);
    assert!(pixels(&loaded.job(AccelKind::Embree, None).unwrap()) == expected);
}

#[test]
fn other_programs_read_the_files_and_they_give_the_texels_of_their_images() {
    let folder = tempfile::tempdir().unwrap();
    let texture = folder.path().join("a.tx");
    for (name, is_bytes) in [("a.png", true), ("a.exr", false)] {
        let path = folder.path().join(name);
        write(&path, 0);
        let maps = all_maps(&path, ImageEncoding::Auto).unwrap();
        let mut bytes = Vec::new();
        write_texture(&mut bytes, &maps.iter().collect::<Vec<_>>()).unwrap();
        fs::write(&texture, bytes).unwrap();

        // By OpenImageIO
        let file = ImageFile::open(&texture).unwrap();
        assert_eq!((file.sizes().len(), file.sizes()[0], file.is_bytes()), (9, SIZE, is_bytes));
        assert!(file.layer().alpha.is_some());
        for channels in [ImageChannels::Color, ImageChannels::Alpha, ImageChannels::Number] {
            let request = |path| request(path, channels, ImageEncoding::Auto);
            let [expected, found] = [&path, &texture].map(|path| texels(&load_map(&request(path)).unwrap()));
            assert!(found == expected, "{name} {channels:?}");
        }
        assert!(all_maps(&texture, ImageEncoding::Auto).unwrap_err().to_string().contains("all levels already"));
    }

    // A file that has its levels needs no entry
    let cache = folder.path().join("cache");
    assert!(cached(&cache, &color(&texture)).0 == texels(&load_map(&color(&texture)).unwrap()));
    assert_eq!(entries(&cache).len(), 0);
}
