//! Images that must not change by a bit: a list of scenes × integrators × estimators × samplers, each with the hash of
//! its raw film.
//!
//! The list is `list.txt`. A change that is meant to change images writes the list again with `LUMIRIS_BLESS=1 cargo
//! test --test it image_hashes`, and reports the changed rows and the reason. The rows are valid for every machine,
//! Embree and operating system, since they depend only on arithmetic defined by IEEE 754.

use lumiris::film::Film;
use lumiris::import::{LoadOptions, load};
use lumiris::planning::{Preparation, prepare};
use lumiris::render::{RenderSettings, render};
use lumiris::scene::AccelKind;
use std::fmt::Write;
use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;

/// Scenes: name, file, width and height. The scenes of `scenes/analytic` are open and lose nearly all photons, so they
/// have no rows with photons.
const SCENES: [(&str, &str, [u32; 2]); 5] = [
    ("gallery", "scenes/demo/gallery.pbrt", [40, 24]),
    ("materials", "tests/it/image_hashes/materials.pbrt", [48, 32]),
    ("rooms", "scenes/keller-wald/rooms.pbrt", [24, 24]),
    ("hidden", "scenes/analytic/hidden-lights.pbrt", [8, 8]),
    ("half-sky", "scenes/analytic/half-environment.pbrt", [8, 8]),
];

/// Integrators: name, and directive as in a scene file.
const INTEGRATORS: [(&str, &str); 22] = [
    ("direct mc", r#""direct" "string estimator" "mc" "integer samples" 2"#),
    ("direct mis", r#""direct" "string estimator" "mis""#),
    (
        "direct mis balance by power",
        r#""direct" "string estimator" "mis" "string heuristic" "balance" "string lightsampler" "power""#,
    ),
    (
        "direct mis maximum uniform",
        r#""direct" "string estimator" "mis" "string heuristic" "maximum" "string lightsampler" "uniform""#,
    ),
    ("direct ris", r#""direct" "string estimator" "ris" "integer samples" 4 "integer proposals" 32"#),
    (
        "direct ris strata of proposals",
        r#""direct" "string estimator" "ris" "integer samples" 2 "integer proposals" 12 "string strata" "proposals""#,
    ),
    (
        "direct ris strata of weights",
        r#""direct" "string estimator" "ris" "integer samples" 3 "integer proposals" 12 "string strata" "weights""#,
    ),
    (
        "direct ris independent",
        r#""direct" "string estimator" "ris" "integer proposals" 16 "string strata" "none"
           "string proposalpoints" "independent" "string target" "gvl""#,
    ),
    ("direct ocv progressive", r#""direct" "string estimator" "ocv" "integer samples" 4 "string ocv" "progressive""#),
    ("irradiance-cache", r#""irradiance-cache" "integer maxdepth" 3 "integer cachesamples" 64"#),
    ("photon-map", r#""photon-map" "integer maxdepth" 4 "integer photons" 2000 "integer gather" 8"#),
    ("direct ocv paper", r#""direct" "string estimator" "ocv" "integer samples" 8 "string ocv" "paper""#),
    ("direct optimal-mis", r#""direct" "string estimator" "optimal-mis" "integer samples" 4"#),
    ("direct optimal-mis direct", r#""direct" "string estimator" "optimal-mis" "string optimalmis" "direct""#),
    ("direct correlated", r#""direct" "string estimator" "correlated""#),
    ("photon-map progressive", r#""photon-map" "integer maxdepth" 4 "integer photons" 500 "float radius" 0.2"#),
    (
        "direct contributing",
        r#""direct" "string estimator" "contributing" "string lightsampler" "photons" "integer visibilityphotons" 3000"#,
    ),
    (
        "direct ris by photons",
        r#""direct" "string estimator" "ris" "integer proposals" 16 "string lightsampler" "photons"
           "string target" "visibility" "integer visibilityphotons" 3000"#,
    ),
    ("path mis", r#""path" "integer maxdepth" 5 "string estimator" "mis""#),
    ("path ris", r#""path" "integer maxdepth" 4 "string estimator" "ris" "integer proposals" 16"#),
    ("path ocv", r#""path" "integer maxdepth" 3 "string estimator" "ocv""#),
    ("direct ocv pixels", r#""direct" "string estimator" "ocv" "integer samples" 4"#),
];

/// Samplers, distributed over scenes and integrators in turn.
const SAMPLERS: [&str; 4] = ["zsobol", "independent", "sobol", "stratified"];

/// Samples per pixel: the smallest number with blocks of three lengths, for estimators that fit in blocks.
const SPP: u32 = 4;

/// FNV-1a, 64 bits: a hash with a fixed definition.
struct Hash(u64);

impl Hash {
    fn add(&mut self, value: u64) {
        for byte in value.to_le_bytes() {
            self.0 = (self.0 ^ u64::from(byte)).wrapping_mul(0x0000_0100_0000_01b3);
        }
    }
}

/// The hash of all sums of a film.
fn hash(film: &Film) -> u64 {
    let mut hash = Hash(0xcbf2_9ce4_8422_2325);
    for p in film.pixels() {
        let sums = [p.radiance, p.albedo, p.normal, [p.depth, 0.0, 0.0]];
        sums.as_flattened().iter().for_each(|v| hash.add(v.to_bits()));
        let counts = [p.count, p.hits, p.invalid, u64::from(p.material), u64::from(p.object)];
        counts.into_iter().for_each(|v| hash.add(v));
    }
    hash.0
}

/// An image of 64 × 64 pixels with coloured tiles of many sizes, as text.
fn tiles() -> String {
    let mut text = String::from("P3\n64 64\n255\n");
    for y in 0..64_u32 {
        for x in 0..64_u32 {
            let bits = (x ^ y) * 37 + (x / 8) * 101 + (y / 16) * 59;
            writeln!(text, "{} {} {}", bits % 256, (bits / 3) % 256, (x * y) % 256).unwrap();
        }
    }
    text
}

/// Writes a copy of the scene with another sampler and integrator.
fn scene_file(folder: &Path, scene: &str, sampler: &str, integrator: &str) -> PathBuf {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join(scene);
    let text = std::fs::read_to_string(file).unwrap();
    let is_kept = |line: &&str| !line.starts_with("Integrator") && !line.starts_with("Sampler");
    let kept: Vec<&str> = text.lines().filter(is_kept).collect();
    let options = format!("Sampler \"{sampler}\" \"integer pixelsamples\" {SPP}\nIntegrator {integrator}\n");
    let path = folder.join("scene.pbrt");
    std::fs::write(&path, options + &kept.join("\n")).unwrap();
    path
}

fn row(folder: &Path, scene: &str, size: [u32; 2], sampler: &str, integrator: &str) -> u64 {
    let path = scene_file(folder, scene, sampler, integrator);
    let options = LoadOptions { resolution: Some(size), ..LoadOptions::default() };
    let loaded = load(&path, &options).map_err(|report| report.to_string()).unwrap();
    let mut job = loaded.job(AccelKind::Embree, None).unwrap();
    prepare(&mut job, &Preparation::on(Some(2))).unwrap();
    let settings = RenderSettings { threads: Some(2), spp: SPP, ..RenderSettings::default() };
    hash(&render(&job, &settings, &AtomicBool::new(false), &|_| ()).unwrap().film)
}

#[test]
fn images_have_the_hashes_of_the_list() {
    // Hash all images
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("tiles.ppm"), tiles()).unwrap();
    let mut found = String::new();
    for (s, (scene, file, size)) in SCENES.into_iter().enumerate() {
        for (i, (name, integrator)) in INTEGRATORS.into_iter().enumerate() {
            if integrator.contains("photon") && file.starts_with("scenes/analytic") {
                continue;
            }
            let sampler = SAMPLERS[(s + i) % SAMPLERS.len()];
            let hash = row(folder.path(), file, size, sampler, integrator);
            writeln!(found, "{hash:016x}  {scene}, {name}, {sampler}").unwrap();
        }
    }

    // Compare with the list
    let list = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/it/image_hashes/list.txt");
    if std::env::var_os("LUMIRIS_BLESS").is_some() {
        std::fs::write(&list, &found).unwrap();
    }
    let listed = std::fs::read_to_string(&list).unwrap_or_default();
    let changed: Vec<&str> = found.lines().filter(|row| !listed.lines().any(|l| l == *row)).collect();
    assert!(changed.is_empty(), "{} of {} rows changed:\n{}", changed.len(), found.lines().count(), changed.join("\n"));
    assert_eq!(listed.lines().count(), found.lines().count(), "rows of the list that are no longer rendered");
}
