//! Scenes whose answer is known: every one with every integrator, estimator, light choice, sampler and ray tracer.
//!
//! The answer stands in the scene file beside its derivation, with the bias that each test of the scene has to notice.
//! `make test` renders as much as finds [`QUICK`]`.goal` times that bias with a power of 0.99, `make test-power` as much as finds
//! the bias itself; both then multiply what they rendered by a wrong factor, which the same tests have to reject. The
//! significance is that of the whole set of tests (Šidák-corrected); seeds are fixed.
//!
//! In reading order: [`rows`] (the configurations), [`power`] (how much is rendered, and what its t-test notices).

mod power;
mod rows;

use power::{Effort, Outcome, POWER, level, picture_means, print_table, render_rows, write_table};
use std::io::Write;
use std::path::{Path, PathBuf};

/// What `make test` renders.
const QUICK: Effort = Effort { goal: 3.0, least_pictures: 32, has_pilot: false };
/// What `make test-power` renders.
const FULL: Effort = Effort { goal: 1.0, least_pictures: 64, has_pilot: false };

/// A scene of `scenes/analytic`.
pub struct Scene {
    name: String,
    path: PathBuf,
    /// Radiance of every pixel.
    answer: [f64; 3],
    /// Relative bias that every row has to notice.
    detects: f64,
}

pub fn scene_files() -> Vec<PathBuf> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/analytic");
    let mut files: Vec<PathBuf> = std::fs::read_dir(folder).unwrap().map(|e| e.unwrap().path()).collect();
    files.retain(|p| p.extension().is_some_and(|e| e == "pbrt"));
    files.sort();
    assert!(files.len() >= 25, "the analytic scenes are there");
    files
}

/// The numbers of a comment of a scene file.
fn numbers(path: &Path, key: &str) -> Vec<f64> {
    let text = std::fs::read_to_string(path).unwrap();
    let line = text.lines().find_map(|l| l.strip_prefix(key)).unwrap_or_else(|| panic!("{} has {key}", path.display()));
    line.split_whitespace().map(|v| v.parse().unwrap()).collect()
}

pub fn answer(path: &Path) -> [f64; 3] {
    numbers(path, "# answer:").try_into().unwrap()
}

fn scenes() -> Vec<Scene> {
    let scene = |path: PathBuf| Scene {
        name: path.file_stem().unwrap().to_str().unwrap().to_owned(),
        answer: answer(&path),
        detects: numbers(&path, "# detects:")[0],
        path,
    };
    scene_files().into_iter().map(scene).collect()
}
#[test]
#[ignore = "explore"]
fn explore() {
    let mut all = scenes();
    let step: usize = std::env::var("STEP").unwrap().parse().unwrap();
    if let Ok(only) = std::env::var("ONLY") { all.retain(|s| s.name == only); }
    let level = 1.6e-7;
    let outcomes = power::pilots(&all, step);
    let mut out = std::io::stdout();
    for (o, seconds) in &outcomes {
        writeln!(out, "{},{:.3e},{:.4},{:.3}", o.row.name(), o.noise(), o.detectable(level), seconds).unwrap();
    }
}
