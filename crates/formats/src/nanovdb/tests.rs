//! Reading grids with known values in every storage type, files of nanovdb_convert, and damaged files.

use super::*;
use flate2::Compression;
use flate2::write::ZlibEncoder;
use lumiris_test_support::nanovdb::{NanoSpec, VERSION, nano_file, plain_nano_file};
use lumiris_test_support::random::{RngExt, pcg32};
use std::collections::HashMap;
use std::io::Write;
use std::path::Path;

/// The value of any voxel.
fn values(grid: &NanoGrid) -> impl Fn([i32; 3]) -> f32 + '_ {
    let leaves: HashMap<[i32; 3], usize> = grid.leaves.iter().enumerate().map(|(i, o)| (*o, i)).collect();
    let tiles: HashMap<([i32; 3], i32), f32> = grid.tiles.iter().map(|t| ((t.origin, t.size), t.value)).collect();
    move |p| {
        if let Some(leaf) = leaves.get(&p.map(|i| i & !7)) {
            let [x, y, z] = p.map(|i| (i & 7) as usize);
            return grid.leaf_values[512 * leaf + 64 * x + 8 * y + z];
        }
        let found = [8, 128, 4096].into_iter().find_map(|size| tiles.get(&(p.map(|i| i & -size), size)));
        found.copied().unwrap_or(grid.background)
    }
}

/// The density of the files of `tests/nanovdb/make.py`.
fn known(p: [i32; 3]) -> f32 {
    let inside = |low: [i32; 3], high: [i32; 3]| (0..3).all(|a| (low[a]..=high[a]).contains(&p[a]));
    if inside([-11, -5, -30], [8, 7, -22]) {
        return ((p[0] + 11) * 37 + (p[1] + 5) * 11 + (p[2] + 30) * 5).rem_euclid(16) as f32 / 16.0;
    }
    match p {
        [-4000, 3, 77] => 0.375,
        [9000, -9000, 123] => 0.875,
        _ if inside([40; 3], [63, 55, 47]) => 0.75,
        _ if inside([512, 0, 0], [639, 127, 127]) => 0.5,
        _ => 0.0,
    }
}

#[test]
fn headers_tell_the_size_of_a_grid() {
    for name in ["zip", "blosc", "fpn"] {
        let path = format!("{}/../../tests/nanovdb/{name}.nvdb", env!("CARGO_MANIFEST_DIR"));
        let grid = read_nanovdb(Path::new(&path), "density").unwrap();
        let size = nanovdb_size(Path::new(&path), "density").unwrap();
        assert_eq!(size.leaves, grid.leaves.len() as u64, "{name}");
        assert!(
            size.bytes > 160 * size.leaves && size.nodes.iter().all(|&n| (1..=size.leaves).contains(&n)),
            "{size:?}"
        );
    }
}

#[test]
fn files_of_nanovdb_convert_have_the_values_that_went_in() {
    let files: [(&str, &[u8], f32); 3] = [
        ("zip", include_bytes!("../../../../tests/nanovdb/zip.nvdb"), 0.0),
        ("blosc", include_bytes!("../../../../tests/nanovdb/blosc.nvdb"), 0.0),
        ("fpn", include_bytes!("../../../../tests/nanovdb/fpn.nvdb"), 0.001),
    ];
    let near = |p: [i32; 3]| (-2..=2).flat_map(move |x| (-2..=2).map(move |z| [p[0] + x, p[1], p[2] + z]));
    let box_of_values = (-13..11).flat_map(|x| (-7..10).flat_map(move |y| (-32..-20).map(move |z| [x, y, z])));
    let edges = [[40; 3], [63, 55, 47], [512, 0, 0], [639, 127, 127], [-4000, 3, 77], [9000, -9000, 123], [4096, 0, 0]];
    let places: Vec<[i32; 3]> = box_of_values.chain(edges.into_iter().flat_map(near)).collect();
    for (name, file, tolerance) in files {
        let density = parse_nanovdb(file, "density").unwrap();
        let temperature = parse_nanovdb(file, "temperature").unwrap();
        for &p in &places {
            let (is, t) = (values(&density)(p), values(&temperature)(p));
            assert!((is - known(p)).abs() <= tolerance, "{name} {p:?} {is}");
            let warm = if p[2] < 0 && p[0] < 100 { 2000.0 * known(p) } else { 0.0 };
            // At most 16 bits
            assert!((t - warm).abs() <= 20.0 * tolerance, "{name} {p:?} {t}");
        }
        assert_eq!(density.class, GridClass::FOG_VOLUME);
        assert_eq!(density.index_bounds, Some([[-4000, -9000, -30], [9000, 127, 127]]));
        let columns = [[0.1, 0.02, 0.0], [-0.03, 0.2, 0.01], [0.0, 0.05, 0.3], [1.0, 2.0, 3.0]];
        assert_eq!(density.space_from_index, columns);
        // Both corners are indices; the second one is after the last voxel
        let [low, high] = temperature.bounds.unwrap();
        assert_eq!((low, high), ([-5.5, -2.5, -15.0], [4.5, 4.0, -10.5]));
    }
    let surface = parse_nanovdb(include_bytes!("../../../../tests/nanovdb/level-set.nvdb"), "surface").unwrap();
    assert_eq!(surface.class.to_string(), "a level set");
}

#[test]
fn a_file_without_a_box_gets_that_of_its_leaves_and_tiles() {
    let mut written = spec(1, 8);
    written.space_from_index = [[0.5, 0.0, 0.0], [0.0, 0.0, 2.0], [0.0, -1.0, 0.0], [1.0, 2.0, 3.0]];
    let grid = parse_nanovdb(&plain_nano_file(std::slice::from_ref(&written)), "fog").unwrap();
    assert_eq!(grid.space_bounds(), Some(written.space_bounds()));
    let indices = NanoGrid { bounds: None, ..grid.clone() };
    assert_eq!(indices.space_bounds(), grid.space_bounds());
    let content = NanoGrid { index_bounds: None, ..indices };
    assert_eq!(content.space_bounds(), grid.space_bounds());
    let nothing = NanoGrid { leaves: Vec::new(), tiles: Vec::new(), ..content };
    assert_eq!(nothing.space_bounds(), None);
}

/// A grid with leaves and tiles of all sizes.
fn spec(ty: u32, bits: u32) -> NanoSpec {
    let mut spec = NanoSpec { ty, bits, background: 0.125, ..NanoSpec::new("fog") };
    spec.fill([-9, -3, 4], [3, 9, 15], |[x, y, z]| ((x * 7 + y * 3 + z).rem_euclid(2)) as f32);
    spec.tiles = vec![([16, 0, 0], 8, 0.5), ([-256, 128, 0], 128, 2.0), ([-8192, 4096, 0], 4096, 3.0)];
    spec
}

#[test]
fn every_type_of_values_is_read() {
    let (low, high) = ([-9, -3, 4], [3, 9, 15]);
    for (ty, bits, kind) in [
        (1, 8, ValueType::Float),
        (2, 8, ValueType::Double),
        (13, 8, ValueType::Fixed(4)),
        (14, 8, ValueType::Fixed(8)),
        (15, 8, ValueType::Fixed(16)),
        (16, 1, ValueType::FixedByLeaf),
        (16, 2, ValueType::FixedByLeaf),
        (16, 4, ValueType::FixedByLeaf),
        (16, 16, ValueType::FixedByLeaf),
    ] {
        let mut written = spec(ty, bits);
        if ty > 2 {
            // Quantisation represents the minimum and maximum of a leaf exactly
            written.leaves.iter_mut().flat_map(|(_, v)| v).filter(|v| **v == 0.125).for_each(|v| *v = 0.0);
        }
        let grid = parse_nanovdb(&plain_nano_file(&[written]), "fog").unwrap();
        assert_eq!((grid.values, grid.background), (kind, 0.125));
        let at = values(&grid);
        for x in -18..26_i32 {
            for y in -9..17 {
                for z in -1..17 {
                    let is_inside = (0..3).all(|a| (low[a]..high[a]).contains(&[x, y, z][a]));
                    let is_in_leaf = (-16..8).contains(&x) && (-8..16).contains(&y) && (0..16).contains(&z);
                    let is_in_tile = (16..24).contains(&x) && (0..8).contains(&y) && (0..8).contains(&z);
                    let expected = match (is_inside, is_in_leaf, is_in_tile) {
                        (true, ..) => (x * 7 + y * 3 + z).rem_euclid(2) as f32,
                        (_, true, _) if ty > 2 => 0.0,
                        (_, _, true) => 0.5,
                        _ => 0.125,
                    };
                    assert_eq!(at([x, y, z]), expected, "{kind:?} {bits} {:?}", [x, y, z]);
                }
            }
        }
        for (p, expected) in
            [([-129, 255, 127], 2.0), ([-128, 255, 127], 0.125), ([-4097, 8191, 4095], 3.0), ([-4096, 5000, 0], 0.125)]
        {
            assert_eq!(at(p), expected, "{kind:?} {p:?}");
        }
        assert_eq!(grid.tiles.len(), 3);
    }
}

fn zip(bytes: &[u8]) -> Vec<u8> {
    let mut encoder = ZlibEncoder::new(Vec::new(), Compression::fast());
    encoder.write_all(bytes).unwrap();
    let zipped = encoder.finish().unwrap();
    [&(zipped.len() as u64).to_le_bytes()[..], &zipped].concat()
}

/// LZ4 data without repetitions, in one block, shuffled or not.
fn blosc(bytes: &[u8], width: usize) -> Vec<u8> {
    let mut shuffled = Vec::new();
    (0..width).for_each(|byte| shuffled.extend(bytes.chunks_exact(width).map(|number| number[byte])));
    shuffled.extend(&bytes[bytes.len() / width * width..]);
    let mut literals = vec![0xf0];
    let mut rest = shuffled.len() - 15;
    while rest >= 255 {
        literals.push(255);
        rest -= 255;
    }
    literals.push(rest as u8);
    literals.extend(&shuffled);
    // A single LZ4 stream with shuffled bytes
    let mut chunk = vec![2, 1, 1 << 5 | 16 | u8::from(width > 1), width as u8];
    chunk.extend((bytes.len() as u32).to_le_bytes());
    chunk.extend((bytes.len() as u32).to_le_bytes());
    chunk.extend((literals.len() as u32 + 24).to_le_bytes());
    chunk.extend(20_u32.to_le_bytes());
    chunk.extend((literals.len() as u32).to_le_bytes());
    chunk.extend(&literals);
    [&(chunk.len() as u64).to_le_bytes()[..], &chunk].concat()
}

#[test]
fn a_grid_is_found_in_any_kind_of_file() {
    let other = NanoSpec { ty: 9, ..NanoSpec::new("other") };
    let specs = [other, spec(1, 8)];
    let expected = parse_nanovdb(&plain_nano_file(&specs[1..]), "fog").unwrap();
    let raw = |number: u8| {
        let mut bytes = specs[1].bytes();
        bytes[7] = number;
        bytes
    };
    let second = [plain_nano_file(&specs[..1]), plain_nano_file(&specs[1..])].concat();
    let mut newer = second.clone();
    newer[7] = b'2';
    for (what, file) in [
        ("the second of a segment", plain_nano_file(&specs)),
        ("zip", nano_file(&specs, 1, zip)),
        ("blosc", nano_file(&specs, 2, |bytes| blosc(bytes, 4))),
        ("blosc without shuffled bytes", nano_file(&specs, 2, |bytes| blosc(bytes, 1))),
        ("of a second segment", second),
        ("of segments of two versions", newer),
        ("grids alone", [raw(b'1'), raw(b'1')].concat()),
    ] {
        assert_eq!(parse_nanovdb(&file, "fog").unwrap(), expected, "{what}");
    }
}

#[test]
fn what_is_not_read_is_named() {
    let file = plain_nano_file(&[spec(1, 8)]);
    let fault = |file: &[u8], name: &str| parse_nanovdb(file, name).unwrap_err().to_string();
    assert_eq!(fault(&file, "smoke"), "has no grid `smoke`: its grids are fog");
    assert_eq!(fault(&plain_nano_file(&[]), "smoke"), "has no grid `smoke`: it has no grids");
    let half = plain_nano_file(&[NanoSpec { ty: 9, ..spec(1, 8) }]);
    assert!(fault(&half, "fog").contains("`fog` has values of the type half"), "{}", fault(&half, "fog"));
    assert!(fault(b"ply\nformat ascii", "fog").contains("does not begin with `NanoVDB`"));
    assert!(fault(b"", "fog").contains("has no grid"));
    assert!(fault(b"Nano", "fog").contains("does not begin with"));
    assert!(fault(&[0x20, b'B', b'D', b'V', 0, 0, 0, 0, 224], "fog").contains("OpenVDB"));
    assert!(fault(b"0BDVonaN        ", "fog").contains("high bytes first"));
    let with = |at: usize, bytes: &[u8]| {
        let mut file = file.clone();
        file[at..at + bytes.len()].copy_from_slice(bytes);
        file
    };
    assert!(fault(&with(8, &(VERSION - (1 << 21)).to_le_bytes()), "fog").contains("has version 31.4"));
    assert!(fault(&with(14, &[7]), "fog").contains("codec 7"));
    assert!(fault(&with(14, &[1]), "fog").contains("zip"));
    // blosclz
    let wrong = nano_file(&[spec(1, 8)], 2, |bytes| {
        let mut chunk = blosc(bytes, 4);
        chunk[10] &= 0x1f;
        chunk
    });
    assert!(fault(&wrong, "fog").contains("Blosc with blosclz"), "{}", fault(&wrong, "fog"));
    assert!(matches!(read_nanovdb(Path::new("/nowhere/fog.nvdb"), "fog"), Err(NanoError::Io { .. })));
}

/// The headers of a file with one grid: list, grid, tree and root.
const HEADS: usize = 16 + 176 + 4 + 736 + 64 + 32;

#[test]
fn damaged_files_are_errors_or_other_grids_but_no_panics() {
    let mut stream = pcg32([3, 1, 4]);
    let files = [
        plain_nano_file(&[spec(1, 8)]),
        plain_nano_file(&[spec(16, 4)]),
        nano_file(&[spec(1, 8)], 1, zip),
        nano_file(&[spec(14, 8)], 2, |bytes| blosc(bytes, 4)),
    ];
    let genuine: &[u8] = include_bytes!("../../../../tests/nanovdb/fpn.nvdb");
    for (i, file) in files.iter().map(Vec::as_slice).chain([genuine]).enumerate() {
        let name = if i == files.len() { "temperature" } else { "fog" };
        parse_nanovdb(file, name).unwrap();
        for _ in 0..150 {
            let end = (stream.random::<f32>() * file.len() as f32) as usize;
            assert!(parse_nanovdb(&file[..end.min(file.len() - 1)], name).is_err(), "cut after {end} bytes");
        }
        for turn in 0..600 {
            let mut damaged = file.to_vec();
            let reach = if turn % 2 == 0 { HEADS.min(file.len()) } else { file.len() };
            for _ in 0..=turn % 3 {
                let at = (stream.random::<f32>() * reach as f32) as usize;
                let byte = [0xff, 0x80, 0x7f, 0, 1, (stream.random::<f32>() * 256.0) as u8][turn % 6];
                damaged[at.min(reach - 1)] = byte;
            }
            // If it is still valid, it takes no more memory than its size allows
            if let Ok(grid) = parse_nanovdb(&damaged, name) {
                assert!(grid.leaf_values.len() == 512 * grid.leaves.len() && grid.leaves.len() <= 3000);
            }
        }
    }
}

#[test]
fn nodes_that_share_their_place_and_absurd_sizes_are_errors() {
    let written = spec(1, 8);
    let file = plain_nano_file(std::slice::from_ref(&written));
    let start = 16 + 176 + 4;
    let fault = |at: usize, bytes: &[u8]| {
        let mut file = file.clone();
        file[at..at + bytes.len()].copy_from_slice(bytes);
        parse_nanovdb(&file, "fog").unwrap_err().to_string()
    };
    // All entries of a node of 32³ refer to the same child
    let mut shared = file.clone();
    let uppers = shared[start + 672 + 16..start + 672 + 24].try_into().map(u64::from_le_bytes).unwrap() as usize;
    let upper = start + 672 + uppers;
    let child = (0..32_768).find(|n| shared[upper + 32 + 4096 + n / 8] >> (n % 8) & 1 == 1).unwrap();
    let offset: [u8; 8] = shared[upper + 8256 + 8 * child..][..8].try_into().unwrap();
    for n in 0..32_768 {
        shared[upper + 32 + 4096 + n / 8] = 0xff;
        shared[upper + 8256 + 8 * n..][..8].copy_from_slice(&offset);
    }
    let error = parse_nanovdb(&shared, "fog").unwrap_err().to_string();
    assert!(error.contains("two of its nodes have the same place"), "{error}");
    // Sizes: the grid, the stored data, and the number of root entries
    assert!(fault(16, &u64::MAX.to_le_bytes()).contains("does not fit"));
    assert!(fault(24, &(u64::MAX - 8).to_le_bytes()).contains("does not fit"));
    let mut endless = file.clone();
    endless[24..32].copy_from_slice(&(u64::MAX - 8).to_le_bytes());
    assert!(parse_nanovdb(&endless, "smoke").unwrap_err().to_string().contains("wrong sizes"));
    assert!(fault(start + 736 + 24, &u32::MAX.to_le_bytes()).starts_with("is damaged"));
    assert!(fault(start + 672 + 24, &u64::MAX.to_le_bytes()).contains("the place of a root"));
    assert!(fault(start + 384, &f64::NAN.to_le_bytes()).contains("is not finite"));
    assert!(fault(16 + 136, &u32::MAX.to_le_bytes()).contains("the name of a grid"));
}
