//! Media of NanoVDB files: the same images as with dense grids of the same values, and errors of files.

use crate::media::{Answer, BOX, assert_answer, assert_they_agree, camera, choose, estimators, means};
use lumiris::import::cache::FileCache;
use lumiris::import::{LoadOptions, load_text};
use lumiris::media::Medium;
use lumiris::render::{RenderSettings, render};
use lumiris::scene::{AccelKind, RenderJob};
use lumiris_test_support::nanovdb::{NanoSpec, plain_nano_file};
use std::path::Path;
use std::sync::atomic::AtomicBool;

/// The number of voxels along an axis, the index of the first one, and their spacing.
const VOXELS: i32 = 20;
const FIRST: [i32; 3] = [-13, -12, -9];
const STEP: f64 = 0.125;

fn job(text: &str, folder: &Path) -> RenderJob {
    let loaded = load_text(text, "volumes", folder, &LoadOptions::default(), &FileCache::default());
    loaded.map_err(|d| d.to_string()).unwrap().job(AccelKind::Embree, None).unwrap()
}

/// The density of voxel x, y, z of a box: empty in a third of it, and constant in one cube.
fn density([x, y, z]: [i32; 3]) -> f32 {
    let index = [x + FIRST[0], y + FIRST[1], z + FIRST[2]];
    match index.map(|i| i >> 3) {
        [-1, -1, -1] => 0.75,
        [0, ..] | [_, _, -2] => 0.0,
        _ => 0.1 + ((x * 37 + y * 11 + z * 5) % 17) as f32 / 10.0,
    }
}

fn kelvin([x, y, z]: [i32; 3]) -> f32 {
    1000.0 + 100.0 * ((x * 3 + y * 7 + z) % 19) as f32
}

/// A grid of these values whose box is about the origin. Indices are rotated about z by `degrees` and stretched along
/// x.
fn spec(name: &str, value: fn([i32; 3]) -> f32, degrees: f64, stretch: f64) -> NanoSpec {
    let mut spec = NanoSpec::new(name);
    let end = FIRST.map(|i| i + VOXELS);
    spec.fill(FIRST, end, |p| value([0, 1, 2].map(|a| p[a] - FIRST[a])));
    // A leaf of a constant value is a tile
    let (tiles, leaves): (Vec<_>, Vec<_>) = spec.leaves.into_iter().partition(|(_, v)| v.iter().all(|x| *x == v[0]));
    spec.tiles = tiles.into_iter().map(|(origin, values)| (origin, 8, values[0])).collect();
    spec.leaves = leaves;
    let (sin, cos) = degrees.to_radians().sin_cos();
    // The scene text undoes these: first the rotation, then the stretch
    let moved = |[x, y, z]: [f64; 3]| [stretch * (cos * x - sin * y), sin * x + cos * y, z];
    let middle = f64::from(VOXELS - 1) / 2.0;
    let shift = FIRST.map(|i| -STEP * (f64::from(i) + middle));
    spec.space_from_index = [moved([STEP, 0.0, 0.0]), moved([0.0, STEP, 0.0]), moved([0.0, 0.0, STEP]), moved(shift)];
    spec
}

/// The same values as text, x first.
fn values(value: impl Fn([i32; 3]) -> f32) -> String {
    let n = VOXELS;
    (0..n * n * n).map(|i| format!("{} ", value([i % n, i / n % n, i / n / n]))).collect()
}

const COLORS: &str = r#""rgb sigma_s" [1.5 1 0.5] "rgb sigma_a" [0.2 0.5 0.9] "float g" 0.3"#;
/// Emission of a few times the light from outside.
const HEAT: &str = r#""float temperatureoffset" 400 "float temperaturescale" 2.5"#;

fn scene(medium: &str) -> String {
    camera("0.31 0.22 3", "", 5)
        + &format!(
            r#"{medium} LightSource "infinite" "rgb L" [0.3 0.3 0.3] LightSource "distant" "rgb L" [1 1 1] "point3 from" [1 2 3]
            Material "interface" MediumInterface "m" "" {BOX}"#
        )
}

/// A tree and a dense grid of the same values are the same medium: with voxels of negative indices, empty space, a
/// tile, temperatures, and maps with rotation and stretch. The lit box lies between the outermost voxels.
#[test]
fn a_volume_is_lit_like_the_dense_grid_of_its_values() {
    let folder = tempfile::tempdir().unwrap();
    let edge = STEP * f64::from(VOXELS) / 2.0;
    let dense = |more: &str| {
        scene(&format!(
            r#"MakeNamedMedium "m" "string type" "uniformgrid" {COLORS} "float density" [{}] "integer nx" {VOXELS}
            "integer ny" {VOXELS} "integer nz" {VOXELS} "point3 p0" [-{edge} -{edge} -{edge}] "point3 p1" [{edge} {edge} {edge}] {more}"#,
            values(density)
        ))
    };
    let write =
        |file: &str, grids: &[NanoSpec]| std::fs::write(folder.path().join(file), plain_nano_file(grids)).unwrap();
    write("plain.nvdb", &[spec("density", density, 0.0, 1.0)]);
    write("hot.nvdb", &[spec("fog", density, 0.0, 1.0), spec("heat", kelvin, 20.0, 1.0)]);
    write("turned.nvdb", &[spec("density", density, 35.0, 3.0), spec("temperature", kelvin, 35.0, 3.0)]);
    let sparse = |file: &str, more: &str| {
        format!(r#"MakeNamedMedium "m" "string type" "nanovdb" "string filename" "{file}" {COLORS} {more}"#)
    };
    let turn = format!("AttributeBegin Rotate -35 0 0 1 Scale {} 1 1", 1.0 / 3.0);
    let glow = format!(r#"{HEAT} "float temperature" [{}] "float Lescale" [{}]"#, values(kelvin), values(|_| 2.0));
    let cold = [
        ("dense", dense("")),
        ("sparse", scene(&sparse("plain.nvdb", ""))),
        ("turned", scene(&format!("{turn} {} AttributeEnd", sparse("turned.nvdb", "\"float Lescale\" 0")))),
    ];
    let hot = [
        ("dense", dense(&glow)),
        (
            "turned",
            scene(&format!("{turn} {} AttributeEnd", sparse("turned.nvdb", &format!("{HEAT} \"float Lescale\" 2")))),
        ),
    ];
    for (what, scenes) in [("lit", &cold[..]), ("glowing", &hot[..])] {
        let answers: Vec<(String, Answer)> = scenes
            .iter()
            .map(|(name, text)| {
                let mut job = job(text, folder.path());
                choose(&mut job, &estimators()[1].1);
                (format!("{what}, {name}"), means(&mut job, 96))
            })
            .collect();
        assert_they_agree(&answers, 0.06);
    }
    // Temperatures have their own map
    let named = scene(&sparse("hot.nvdb", r#""string gridname" "fog" "string temperaturename" "heat""#));
    assert!(job(&named, folder.path()).world.scene.media.is_emissive());
}

/// The cost of a sample, which determines the adaptive sample counts.
#[test]
fn collisions_are_counted_of_flights_and_of_shadow_segments() {
    let collisions = |factor: f32| {
        let edge = STEP * f64::from(VOXELS) / 2.0;
        let medium = format!(
            r#"MakeNamedMedium "m" "string type" "uniformgrid" {COLORS} "float density" [{}] "integer nx" {VOXELS} "integer ny" {VOXELS}
            "integer nz" {VOXELS} "point3 p0" [-{edge} -{edge} -{edge}] "point3 p1" [{edge} {edge} {edge}]"#,
            values(|_| factor)
        );
        let mut job = job(&scene(&medium), Path::new("."));
        choose(&mut job, &estimators()[1].1);
        let settings = RenderSettings { spp: 16, ..RenderSettings::default() };
        let stats = render(&job, &settings, &AtomicBool::new(false), &|_| ()).unwrap().stats;
        [stats.collisions, stats.direct.collisions]
    };
    let (thin, dense) = (collisions(0.1), collisions(4.0));
    assert!((0..2).all(|k| thin[k] > 0 && dense[k] > 2 * thin[k]), "{thin:?} {dense:?}");
}

/// Under uniform light, a purely scattering volume is invisible with every estimator.
#[test]
fn a_volume_that_only_scatters_is_invisible_in_even_light() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/nanovdb");
    // The transformation undoes the map of the file, except for a factor
    let text = camera("0.3 0.2 3", "", 60)
        + &format!(
            r#"AttributeBegin Scale 0.25 0.3 0.3 Translate 0 0 12.5
            MakeNamedMedium "m" "string type" "nanovdb" "string filename" "zip.nvdb" "string gridname" "temperature"
            "float Lescale" 0 "rgb sigma_a" [0 0 0] "rgb sigma_s" [0.0012 0.0006 0.0002] AttributeEnd
            LightSource "infinite" "rgb L" [1 1 1] Material "interface" MediumInterface "m" "" {BOX}"#
        );
    let mut job = job(&text, &folder);
    assert_eq!(job.world.scene.media.media[0].kind_name(), "nanovdb");
    for (estimator, settings) in estimators() {
        choose(&mut job, &settings);
        assert_answer(&mut job, 48, [1.0; 3], 0.13, &estimator);
    }
    // The tree, its nodes and majorants, but not all voxels of the box
    let bytes = job.world.scene.media.media.iter().map(Medium::bytes).sum::<usize>();
    assert!((1 << 15..1 << 22).contains(&bytes), "{bytes}");
}

#[test]
fn faults_in_volumes_are_reported_with_their_places() {
    let folder = tempfile::tempdir().unwrap();
    let write = |file: &str, bytes: &[u8]| std::fs::write(folder.path().join(file), bytes).unwrap();
    let fog = spec("density", density, 0.0, 1.0);
    write("fog.nvdb", &plain_nano_file(std::slice::from_ref(&fog)));
    write("half.nvdb", &plain_nano_file(&[NanoSpec { ty: 9, ..fog.clone() }]));
    write("surface.nvdb", &plain_nano_file(&[NanoSpec { class: 1, ..fog.clone() }]));
    write("flat.nvdb", &plain_nano_file(&[NanoSpec { space_from_index: [[1.0; 3]; 4], ..fog.clone() }]));
    write("cut.nvdb", &plain_nano_file(std::slice::from_ref(&fog))[..5000]);
    write("text.nvdb", b"WorldBegin");
    let load = |medium: &str| {
        let text = format!("WorldBegin\nMakeNamedMedium \"m\" \"string type\" \"nanovdb\" {medium}");
        let loaded = load_text(&text, "volumes", folder.path(), &LoadOptions::default(), &FileCache::default());
        loaded.map_or_else(|report| report.to_string(), |loaded| loaded.warnings.to_string())
    };
    for (medium, fault) in [
        ("", "a nanovdb medium needs `string filename`"),
        (r#""string filename" "gone.nvdb""#, "gone.nvdb: No such file"),
        (r#""string filename" "text.nvdb""#, "text.nvdb is not a NanoVDB file"),
        (r#""string filename" "half.nvdb""#, "has values of the type half"),
        (r#""string filename" "cut.nvdb""#, "is damaged"),
        (r#""string filename" "surface.nvdb""#, "grid `density` is a level set, and no fog volume"),
        (r#""string filename" "flat.nvdb""#, "the map of a grid has no inverse"),
        (r#""string filename" "fog.nvdb" "string gridname" "smoke""#, "has no grid `smoke`: its grids are density"),
        (r#""string filename" "fog.nvdb" "string temperaturename" "heat""#, "has no grid `heat`"),
        (r#""string filename" "fog.nvdb" "float Lescale" -1"#, "Lescale must be finite and not negative"),
        (r#""string filename" "fog.nvdb" "float density" 1"#, "density"),
    ] {
        let text = load(medium);
        assert!(text.contains(fault), "{medium}: {text}");
        assert!(text.contains("volumes:2:"), "{medium}: {text}");
    }
    assert!(!load(r#""string filename" "fog.nvdb""#).contains("temperature"), "no temperature is no fault");
    // Invalid values
    let mut odd = fog;
    odd.leaves[0].1[..3].copy_from_slice(&[f32::NAN, -1.0, f32::INFINITY]);
    write("odd.nvdb", &plain_nano_file(&[odd]));
    assert!(load(r#""string filename" "odd.nvdb""#).contains("grid `density`: 3 values"));
}
