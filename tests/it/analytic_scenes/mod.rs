//! Scenes with known answers: each with every integrator, estimator, light choice, sampler and ray tracer.
//!
//! The answer is in the scene file with its derivation, together with the bias that every row of the scene must detect
//! at the level of the whole set (Šidák-corrected) with a power of 0.99. `make test-power` renders enough samples for
//! that; `make test` renders enough to detect a bias [`QUICK`]`.goal` times as large. Both then multiply the rendered
//! values by a wrong factor, which the same tests must reject. Seeds are fixed.
//!
//! Reading order: [`rows`] (the configurations), [`power`] (amounts of samples and the power of the t-tests),
//! [`biased`] (biased forms and their bias).

mod biased;
mod power;
mod rows;

use lumiris::film::{Film, PixelSums};
use lumiris::render::{RenderSettings, render};
use lumiris::settings::IntegratorKind;
use lumiris_test_support::power::by_power;
use power::{Effort, MEASURE, Outcome, POWER, level, print_table, render_rows, write_table};
use rows::{BASE, job};
use std::io::Write;
use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;

/// Effort of `make test`.
const QUICK: Effort = Effort { goal: 6.0, min_images: 16 };
/// Effort of `make test-power`.
const FULL: Effort = Effort { goal: 1.0, min_images: 64 };

/// Environment variable with the names of the scenes to render; all if it is not set. It does not change the level.
const ONLY: &str = "POWER_SCENES";

/// A scene of `scenes/analytic`.
struct Scene {
    name: String,
    path: PathBuf,
    /// Radiance of every pixel.
    answer: [f64; 3],
    /// Relative bias that every row must detect.
    detects: f64,
}

impl Scene {
    fn named(name: &str) -> Scene {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/analytic").join(name).with_extension("pbrt");
        Scene { name: name.to_owned(), answer: answer(&path), detects: numbers(&path, "# detects:")[0], path }
    }
}

/// Parses the numbers of a comment in a scene file.
fn numbers(path: &Path, key: &str) -> Vec<f64> {
    let text = std::fs::read_to_string(path).unwrap();
    let line = text.lines().find_map(|l| l.strip_prefix(key)).unwrap_or_else(|| panic!("{} has {key}", path.display()));
    line.split_whitespace().map(|v| v.parse().unwrap()).collect()
}

/// The known radiance in a scene file.
pub(crate) fn answer(path: &Path) -> [f64; 3] {
    numbers(path, "# answer:").try_into().unwrap()
}

fn scenes() -> Vec<Scene> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/analytic");
    let files = std::fs::read_dir(folder).unwrap().map(|e| e.unwrap().path());
    let scene_files = files.filter(|p| p.extension().is_some_and(|e| e == "pbrt"));
    let mut scenes: Vec<_> = scene_files.map(|p| Scene::named(p.file_stem().unwrap().to_str().unwrap())).collect();
    scenes.sort_by(|a, b| a.name.cmp(&b.name));
    assert!(scenes.len() >= 25, "the analytic scenes are there");
    scenes
}

/// Faults of a row: a wrong answer, or too little power.
fn faults(outcome: &Outcome<'_>, effort: &Effort, level: f64) -> Vec<String> {
    let mut faults = Vec::new();
    let name = outcome.row.name();
    if outcome.rejected(1.0, level).contains(&true) {
        faults.push(format!("{name}: {:?}, not {:?}", outcome.means(), outcome.row.scene.answer));
    }
    let (found, goal) = (outcome.detectable(level), outcome.row.goal(effort));
    if found > goal {
        faults.push(format!(
            "{name}: notices a bias of {found:.4}, not {goal}; `make measure-power` counts its samples anew"
        ));
    }
    faults
}

/// Rows that pass although their values are multiplied by a factor which the test must reject.
fn missed(outcomes: &[Outcome<'_>], effort: &Effort, level: f64) -> Vec<String> {
    let factors = |o: &Outcome<'_>| [1.0 + o.row.goal(effort), 1.0 - o.row.goal(effort)];
    let misses = outcomes.iter().flat_map(|o| {
        let passing = factors(o).into_iter().filter(|&factor| o.rejected(factor, level).contains(&false));
        passing.map(|factor| format!("{} times {factor}: {:?}", o.row.name(), o.means()))
    });
    misses.collect()
}

/// The share of noisy rows that reject a bias which they should detect with a probability of [`POWER`].
fn share_found(outcomes: &[Outcome<'_>], level: f64) -> (f64, usize) {
    let noisy: Vec<_> = outcomes.iter().filter(|o| o.has_noise()).collect();
    let found = noisy.iter().filter(|o| o.rejected(1.0 + o.detectable(level), level)[o.channel()]);
    (found.count() as f64 / noisy.len() as f64, noisy.len())
}

/// Prints one line per scene with the bias that its rows detect.
fn print_summary(out: &mut dyn Write, outcomes: &[Outcome<'_>], level: f64) {
    writeln!(out, "| scene | rows | camera samples | notices, median | notices, worst row |\n|---|---|---|---|---|")
        .unwrap();
    for rows in outcomes.chunk_by(|a, b| a.row.scene.name == b.row.scene.name) {
        let mut found: Vec<f64> = rows.iter().map(|o| 100.0 * o.detectable(level)).collect();
        found.sort_by(f64::total_cmp);
        let samples: u64 = rows.iter().map(Outcome::samples).sum();
        let (name, count, last) = (&rows[0].row.scene.name, rows.len(), found[found.len() - 1]);
        writeln!(out, "| {name} | {count} | {samples} | {:.2} % | {last:.2} % |", found[count / 2]).unwrap();
    }
}

/// Renders every row, prints the detectable biases, and fails with a list of all faults.
fn check(effort: &Effort) {
    let mut scenes = scenes();
    let level = level(&scenes);
    if let Ok(only) = std::env::var(ONLY) {
        scenes.retain(|s| only.split(' ').any(|name| name == s.name));
    }
    let outcomes = render_rows(&scenes, effort, level);

    // Standard output itself, which is visible although the test passes
    let mut out = std::io::stdout().lock();
    if effort.goal == FULL.goal {
        print_table(&mut out, &outcomes, level);
    }
    print_summary(&mut out, &outcomes, level);
    let (share, noisy) = share_found(&outcomes, level);
    let (rows, missed) = (outcomes.len(), missed(&outcomes, effort, level));
    writeln!(out, "{rows} known answers, at a level of {level:.1e} each").unwrap();
    writeln!(
        out,
        "found: {} of {} injected biases; {share:.4} of {noisy} at the limit",
        2 * rows - missed.len(),
        2 * rows
    )
    .unwrap();
    missed.iter().for_each(|m| writeln!(out, "not found: {m}").unwrap());
    if std::env::var_os(MEASURE).is_some() {
        write_table(&outcomes, level);
    }

    let faults: Vec<_> = outcomes.iter().flat_map(|o| faults(o, effort, level)).collect();
    assert!(faults.is_empty(), "{} faults of {rows} rows:\n{}", faults.len(), faults.join("\n"));
    assert!(missed.len() as f64 <= (1.0 - POWER) * 2.0 * rows as f64, "{}", missed.join("\n"));
    let error = (POWER * (1.0 - POWER) / noisy as f64).sqrt();
    assert!(noisy == 0 || share > POWER - 4.0 * error, "{share} notice what {POWER} ± {error} should");
}

#[test]
fn every_row_gives_the_known_answer() {
    check(&by_power(FULL, QUICK));
}

#[test]
fn rows_have_names_of_their_own() {
    for scene in scenes() {
        let mut names: Vec<_> = rows::configurations(&scene.name).iter().map(ToString::to_string).collect();
        names.sort();
        assert_eq!(names.iter().zip(&names[1..]).find(|(a, b)| a == b), None);
    }
}

#[test]
fn direct_is_path_of_one_bounce() {
    let mut job = job(&Scene::named("furnace-closed-4").path, &BASE, 4);
    let mut image = |kind| {
        job.change(|s| s.integrator.kind = kind);
        job.change(|s| s.integrator.max_depth = if kind == IntegratorKind::Path { 1 } else { 4 });
        let settings = RenderSettings { spp: 4, ..RenderSettings::default() };
        let film: Film = render(&job, &settings, &AtomicBool::new(false), &|_| ()).unwrap().film;
        film.pixels().iter().map(PixelSums::mean).collect::<Vec<_>>()
    };
    assert_eq!(image(IntegratorKind::Direct), image(IntegratorKind::Path));
}
