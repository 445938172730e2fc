//! Texture files with their own pyramids, as texture converters write them: tiled TIFF files with all levels.

use lumiris::imaging::tiles::TileStore;
use lumiris::imaging::{ColorEncoding, Filter, MipMap, Wrap};
use lumiris::import::cache::FileCache;
use lumiris::import::images::{ImageChannels, ImageEncoding, ImageRequest, load_map, load_tiled_map};
use lumiris::import::{LoadOptions, load_with};
use lumiris::render::output::channels;
use lumiris::render::{RenderSettings, render};
use lumiris::scene::AccelKind;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

/// Not a multiple of the tile size, and with a side that rounds down.
const SIZE: [usize; 2] = [300, 201];

/// Sizes of all levels.
fn sizes() -> Vec<[usize; 2]> {
    let next = |size: &[usize; 2]| (*size != [1, 1]).then(|| size.map(|n| (n / 2).max(1)));
    std::iter::successors(Some(SIZE), next).collect()
}

/// The stored value of a pixel: no mean of the level before.
fn byte(level: usize, x: usize, y: usize, c: usize) -> u8 {
    ((x * 3 + y * 7 + c * 50 + level * 37) % 256) as u8
}

/// Type, number and bytes of the values of a tag.
type Values = (u16, usize, Vec<u8>);

/// A TIFF file of `levels` levels, with tiles of `tile` × `tile` pixels, of bytes or of floats.
fn tiff(levels: usize, tile: usize, is_float: bool) -> Vec<u8> {
    let mut file = b"II*\0\0\0\0\0".to_vec();
    let mut link = 4;
    for (level, [width, height]) in sizes().into_iter().enumerate().take(levels) {
        let sample = |x: usize, y: usize, c: usize| -> Vec<u8> {
            let v = if x < width && y < height { byte(level, x, y, c) } else { 99 };
            if is_float { (f32::from(v) / 64.0).to_le_bytes().to_vec() } else { vec![v] }
        };
        let [columns, rows] = [width, height].map(|n| n.div_ceil(tile));
        let mut offsets = Vec::new();
        for i in 0..columns * rows {
            let (x0, y0) = (i % columns * tile, i / columns * tile);
            offsets.push(file.len() as u32);
            for k in 0..tile * tile * 3 {
                file.extend(sample(x0 + k / 3 % tile, y0 + k / 3 / tile, k % 3));
            }
        }
        let tile_bytes = (tile * tile * 3 * if is_float { 4 } else { 1 }) as u32;
        let (short, long, ascii) = (3_u16, 4_u16, 2_u16);
        let shorts = |value: u16| (short, 3, [value; 3].iter().flat_map(|v| v.to_le_bytes()).collect::<Vec<_>>());
        let one = |value: usize| (long, 1, (value as u32).to_le_bytes().to_vec());
        let longs = |values: Vec<u32>| (long, values.len(), values.iter().flat_map(|v| v.to_le_bytes()).collect());
        let name = b"Plain Texture\0".to_vec();
        let tags: [(u16, Values); 13] = [
            (256, one(width)),
            (257, one(height)),
            (258, shorts(if is_float { 32 } else { 8 })),
            (259, one(1)),
            (262, one(2)),
            (277, one(3)),
            (284, one(1)),
            (322, one(tile)),
            (323, one(tile)),
            (324, longs(offsets.clone())),
            (325, longs(vec![tile_bytes; offsets.len()])),
            (339, shorts(if is_float { 3 } else { 1 })),
            // A texture: the images after the first are its levels
            (33302, (ascii, name.len(), name)),
        ];
        let mut directory = (tags.len() as u16).to_le_bytes().to_vec();
        for (tag, (kind, count, data)) in tags {
            directory.extend(tag.to_le_bytes());
            directory.extend(kind.to_le_bytes());
            directory.extend((count as u32).to_le_bytes());
            if data.len() <= 4 {
                directory.extend(data.iter().copied().chain([0; 4]).take(4));
            } else {
                directory.extend((file.len() as u32).to_le_bytes());
                file.extend(data);
                file.resize(file.len().next_multiple_of(2), 0);
            }
        }
        let at = (file.len() as u32).to_le_bytes();
        file[link..link + 4].copy_from_slice(&at);
        file.extend(&directory);
        link = file.len();
        file.extend([0; 4]);
    }
    file
}

fn request(path: &Path, encoding: ImageEncoding) -> ImageRequest {
    let path = path.to_owned();
    ImageRequest { path, channels: ImageChannels::Color, encoding, wrap: Wrap::Repeat, filter: Filter::Trilinear }
}

/// Asserts that all texels of all levels equal those in the file.
fn assert_texels(map: &MipMap, is_float: bool, encoding: ColorEncoding) {
    assert_eq!((map.levels(), map.resolution(), map.channels()), (sizes().len(), SIZE, 3));
    let table = encoding.byte_table();
    for (level, [width, height]) in sizes().into_iter().enumerate() {
        for i in 0..width * height {
            let (x, y) = (i % width, i / width);
            let expected = [0, 1, 2].map(|c| {
                let v = byte(level, x, y, c);
                if is_float { f32::from(v) / 64.0 } else { table[usize::from(v)] }
            });
            assert_eq!(map.texel(level, x as i64, y as i64).to_array(), expected, "level {level}, {x} {y}");
        }
    }
}

#[test]
fn levels_are_those_of_the_file_in_memory_and_by_tiles() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.tx");
    for (tile, is_float) in [(64, false), (64, true), (32, false), (128, true), (16, false)] {
        std::fs::write(&path, tiff(sizes().len(), tile, is_float)).unwrap();
        for (asked, encoding) in
            [(ImageEncoding::Auto, ColorEncoding::Srgb), (ImageEncoding::Linear, ColorEncoding::Linear)]
        {
            let request = request(&path, asked);
            assert_texels(&load_map(&request).unwrap(), is_float, encoding);
            let store = Arc::new(TileStore::new(1 << 20).unwrap());
            let tiled = load_tiled_map(&request, &store).unwrap();
            assert_eq!(store.counts().read, 0, "nothing is read before it is wanted");
            // Levels below 64 × 64 texels are in memory
            let small = (37 * 25 + 18 * 12 + 9 * 6 + 4 * 3 + 2 + 1 + 75 * 50) * 3 * if is_float { 4 } else { 1 };
            assert_eq!(tiled.bytes(), small);
            assert_texels(&tiled, is_float, encoding);
            let counts = store.counts();
            assert!(counts.read >= 5 * 4 + 3 * 2 && counts.stored == 0 && store.failure().is_none(), "{counts:?}");
        }
    }
}

#[test]
fn what_lacks_a_level_has_those_of_its_image() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.tx");
    std::fs::write(&path, tiff(sizes().len() - 1, 64, false)).unwrap();
    let map = load_map(&request(&path, ImageEncoding::Linear)).unwrap();
    assert_eq!(map.levels(), sizes().len());
    let mean = |x: usize| {
        let sum: f32 = (0..4).map(|i| f32::from(byte(0, 2 * x + i % 2, i / 2, 0))).sum();
        (sum / 4.0).round() / 255.0
    };
    assert!((map.texel(1, 5, 0).to_array()[0] - mean(5)).abs() < 0.01);
}

/// A square with the texture, far enough away to use coarser levels in part of the image.
const SCENE: &str = "LookAt 0 0.3 -2  0 0 0  0 1 0\nCamera \"perspective\" \"float fov\" 50\n\
    Film \"rgb\" \"integer xresolution\" 48 \"integer yresolution\" 32\nIntegrator \"direct\"\nWorldBegin\n\
    LightSource \"infinite\"\nTexture \"t\" \"spectrum\" \"imagemap\" \"string filename\" \"a.tx\" \
    \"float uscale\" 0.5\nMaterial \"diffuse\" \"texture reflectance\" \"t\"\n\
    Shape \"bilinearmesh\" \"point3 P\" [ -2 -1 -1  2 -1 -1  -2 1 9  2 1 9 ]\n";

#[test]
fn images_are_the_same_to_the_bit_by_tiles_of_the_file_and_end_where_it_is_cut() {
    // A scene with its texture
    let folder = tempfile::tempdir().unwrap();
    let (scene, path) = (folder.path().join("s.pbrt"), folder.path().join("a.tx"));
    std::fs::write(&scene, SCENE).unwrap();
    std::fs::write(&path, tiff(sizes().len(), 64, false)).unwrap();
    let job = |limit: Option<u64>| {
        let files = FileCache::default();
        limit.into_iter().for_each(|bytes| files.limit_textures(bytes));
        let loaded = load_with(&scene, &LoadOptions::default(), &files).map_err(|d| d.to_string()).unwrap();
        loaded.job(AccelKind::Embree, None).unwrap()
    };
    let image = |limit| {
        let job = job(limit);
        let rendering = render(&job, &RenderSettings::default(), &AtomicBool::new(false), &|_| ());
        rendering
            .map(|rendering| (channels(&rendering.film, &[], None).data, job.world.scene.textures.store().is_some()))
    };

    // With tiles and without: the same bits
    let (whole, by_tiles) = (image(None).unwrap(), image(Some(50_000)).unwrap());
    assert!(!whole.1 && by_tiles.1 && whole.0 == by_tiles.0);

    // A truncated file is an error of the rendering
    let job = job(Some(50_000));
    std::fs::write(&path, tiff(1, 64, false).split_at(40_000).0).unwrap();
    let error = render(&job, &RenderSettings::default(), &AtomicBool::new(false), &|_| ()).unwrap_err().to_string();
    assert!(error.contains("a.tx"), "{error}");
}
