//! Scenes whose answer is known: every one with every integrator, estimator, light choice, sampler and ray tracer.
//!
//! The answer stands in the scene file beside its derivation, with the bias that every row of the scene has to notice
//! at the level of the whole set (Šidák-corrected) with a power of 0.99. `make test-power` renders as much as that
//! needs, `make test` as much as notices a bias [`QUICK`]`.goal` times as large. Both then multiply what they rendered
//! by a wrong factor, which the same tests have to reject. Seeds are fixed.
//!
//! In reading order: [`rows`] (the configurations), [`power`] (how much is rendered, and what its t-test notices),
//! [`biased`] (forms that are biased, and by how much).

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

/// What `make test` renders.
const QUICK: Effort = Effort { goal: 6.0, min_images: 16 };
/// What `make test-power` renders.
const FULL: Effort = Effort { goal: 1.0, min_images: 64 };

/// An environment variable: the names of the scenes that are rendered, where it is not all of them. The level stays the
/// same.
const ONLY: &str = "POWER_SCENES";

/// A scene of `scenes/analytic`.
struct Scene {
    name: String,
    path: PathBuf,
    /// Radiance of every pixel.
    answer: [f64; 3],
    /// Relative bias that every row has to notice.
    detects: f64,
}

impl Scene {
    fn named(name: &str) -> Scene {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/analytic").join(name).with_extension("pbrt");
        Scene { name: name.to_owned(), answer: answer(&path), detects: numbers(&path, "# detects:")[0], path }
    }
}

/// The numbers in a comment of a scene file.
fn numbers(path: &Path, key: &str) -> Vec<f64> {
    let text = std::fs::read_to_string(path).unwrap();
    let line = text.lines().find_map(|l| l.strip_prefix(key)).unwrap_or_else(|| panic!("{} has {key}", path.display()));
    line.split_whitespace().map(|v| v.parse().unwrap()).collect()
}

/// The known radiance of a scene file.
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

/// What is wrong with a row: its answer, or what it notices.
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

/// What passes although its values are multiplied by a factor that is as wrong as the test has to notice.
fn missed(outcomes: &[Outcome<'_>], effort: &Effort, level: f64) -> Vec<String> {
    let factors = |o: &Outcome<'_>| [1.0 + o.row.goal(effort), 1.0 - o.row.goal(effort)];
    let misses = outcomes.iter().flat_map(|o| {
        let passing = factors(o).into_iter().filter(|&factor| o.rejected(factor, level).contains(&false));
        passing.map(|factor| format!("{} times {factor}: {:?}", o.row.name(), o.means()))
    });
    misses.collect()
}

/// The share of the rows with noise that notice just the bias which they should notice with [`POWER`].
fn share_found(outcomes: &[Outcome<'_>], level: f64) -> (f64, usize) {
    let noisy: Vec<_> = outcomes.iter().filter(|o| o.has_noise()).collect();
    let found = noisy.iter().filter(|o| o.rejected(1.0 + o.detectable(level), level)[o.channel()]);
    (found.count() as f64 / noisy.len() as f64, noisy.len())
}

/// A line for each scene: what its rows notice.
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

/// Renders every row, prints what the tests notice, and complains about what they found.
fn check(effort: &Effort) {
    let mut scenes = scenes();
    let level = level(&scenes);
    if let Ok(only) = std::env::var(ONLY) {
        scenes.retain(|s| only.split(' ').any(|name| name == s.name));
    }
    let outcomes = render_rows(&scenes, effort, level);

    // Standard output itself, which is shown though the test passes
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
