//! Number of images per row, the power of its t-test, and the table of both.
//!
//! The noise of a row is the relative standard deviation of one camera sample. It is stored in
//! `docs/measurements/power/rows.csv`, and determines the number of images, with different seeds, that a test needs to
//! detect a bias. The means of the images are independent, whatever the sampler does within an image. Student's t-test
//! compares them with the answer. The detectable bias is computed from the spread of the rendered images: if the table
//! is out of date, the test detects less, which is an error.

use super::Scene;
use super::rows::{Configuration, SPP, configurations, job};
use lumiris::render::{RenderSettings, render};
use lumiris::settings::Cached;
use lumiris_numbers::estimators::stats::{Welford, sidak, t_test};
use lumiris_test_support::significance::{detectable_bias, detectable_deviation};
use std::collections::{BTreeMap, HashMap};
use std::path::{Path, PathBuf};
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};

/// Probability that any test of the whole set rejects a correct renderer.
const SIGNIFICANCE: f64 = 1e-3;
/// Probability of detecting a bias of the stated size.
pub(super) const POWER: f64 = 0.99;
/// Relative error of f32 arithmetic, allowed for rows without noise.
const ROUNDING: f64 = 3e-5;
/// Factor by which the standard error is smaller than necessary, so that most rows have a much higher power.
const MARGIN: f64 = 1.2;
/// Images of rows without noise.
const EXACT_IMAGES: u32 = 8;
/// Maximum number of attempts to render enough images for a row.
const ATTEMPTS: u32 = 4;
/// Environment variable: measure the noise again and write the table.
pub(super) const MEASURE: &str = "MEASURE_POWER";
/// Images for the first measurement of a row's noise.
const PILOT_IMAGES: u32 = 32;

/// Images of a row.
#[derive(Clone, Copy, Debug)]
pub(super) struct Budget {
    /// Pixels along an edge.
    pub edge: u32,
    /// Images, each with its own seed.
    pub images: u32,
}

/// Amount of rendering.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Effort {
    /// Detectable bias of the rows over their scene's.
    pub goal: f64,
    /// Smallest number of images of a noisy row; twice as many before images get more pixels.
    pub min_images: u32,
}

/// A scene with a configuration.
pub(super) struct Row<'a> {
    pub scene: &'a Scene,
    pub configuration: Configuration,
}

/// The rendered images of a row.
pub(super) struct Outcome<'a> {
    pub row: Row<'a>,
    pub budget: Budget,
    /// Means of the images.
    pub images: Vec<[f64; 3]>,
}

/// Significance level of each test of the set.
pub(super) fn level(scenes: &[Scene]) -> f64 {
    let rows: usize = scenes.iter().map(|scene| configurations(&scene.name).len()).sum();
    sidak(SIGNIFICANCE, rows * 3)
}

/// Means of images with the seeds `seed`, `seed` + 1, ….
pub(super) fn image_means(path: &Path, c: &Configuration, budget: Budget, seed: u32) -> Vec<[f64; 3]> {
    let mut job = job(path, c, budget.edge);
    let settings = RenderSettings { threads: Some(1), spp: SPP, ..RenderSettings::default() };
    let mut image = |i: u32| {
        job.change(|s| s.sampling.seed = seed.wrapping_add(i));
        let film = render(&job, &settings, &AtomicBool::new(false), &|_| ()).unwrap().film;
        let mean = |c: usize| film.pixels().iter().map(|p| p.mean()[c]).sum::<f64>() / film.len() as f64;
        [mean(0), mean(1), mean(2)]
    };
    (0..budget.images).map(&mut image).collect()
}

/// Moments of a channel of images, multiplied by `factor`.
pub(super) fn moments(images: &[[f64; 3]], channel: usize, factor: f64) -> Welford {
    images.iter().map(|p| p[channel] * factor).collect()
}

impl<'a> Row<'a> {
    /// Renders enough images to detect the bias. If they are noisier than in the table, a larger set replaces them.
    fn render_until_noticed(self, mut noise: f64, effort: &Effort, level: f64) -> Outcome<'a> {
        let goal = self.goal(effort);
        let mut outcome = Outcome { row: self, budget: Budget { edge: 4, images: 0 }, images: Vec::new() };
        for attempt in 0..ATTEMPTS {
            outcome.budget = outcome.row.budget(noise, effort, level);
            outcome.images = outcome.row.render(outcome.budget, attempt << 24);
            if outcome.detectable(level) <= goal {
                break;
            }
            noise = 1.1 * outcome.noise();
        }
        outcome
    }

    /// Name of scene and settings.
    pub(super) fn name(&self) -> String {
        format!("{},{}", self.scene.name, self.configuration)
    }

    /// The bias that must be detected.
    pub(super) fn goal(&self, effort: &Effort) -> f64 {
        effort.goal * self.scene.detects + 2.0 * self.tolerance()
    }

    /// The first seed, far from other rows' seeds.
    fn seed(&self) -> u32 {
        // FNV-1a
        self.name().bytes().fold(0x811c_9dc5, |hash, byte| (hash ^ u32::from(byte)).wrapping_mul(0x0100_0193))
    }

    /// Allowed relative error of the mean without noise.
    fn tolerance(&self) -> f64 {
        // An image shows so little of its scene that the interpolation error is negligible, except for a spot whose
        // falloff is steeper than the gradients of its sources
        match self.configuration.cached {
            None => ROUNDING,
            Some(Cached::All) if self.scene.name == "spot-falloff" => 5e-3,
            Some(_) => 1e-4,
        }
    }

    /// The images needed to detect the bias, for a row with this noise.
    fn budget(&self, noise: f64, effort: &Effort, level: f64) -> Budget {
        if noise <= self.tolerance() {
            return Budget { edge: 4, images: EXACT_IMAGES };
        }
        let bias = effort.goal * self.scene.detects;
        let errors = MARGIN * detectable_deviation(level, POWER, u64::from(effort.min_images - 1));
        let samples = (errors * noise * (1.0 + bias) / bias).powi(2);
        let images = |edge: u32| (samples / f64::from(edge * edge * SPP)).ceil() as u32;
        let edge = self.edges().iter().copied().find(|&edge| images(edge) >= 2 * effort.min_images).unwrap_or(4);
        Budget { edge, images: images(edge).max(effort.min_images) }
    }

    /// Possible numbers of pixels along an edge.
    fn edges(&self) -> &[u32] {
        // All pixels of an image use the same irradiance records, so more pixels add no information
        if self.configuration.cached.is_some() { &[4] } else { &[16, 8, 4] }
    }

    /// Measures the noise with other images than those that are tested.
    fn pilot(&self) -> f64 {
        let budget = Budget { edge: self.edges()[self.edges().len() / 2], images: PILOT_IMAGES };
        self.noise(budget, &self.render(budget, 1 << 31))
    }

    fn render(&self, budget: Budget, salt: u32) -> Vec<[f64; 3]> {
        image_means(&self.scene.path, &self.configuration, budget, self.seed().wrapping_add(salt))
    }

    /// Relative standard deviation of a camera sample; the largest of the channels.
    fn noise(&self, budget: Budget, images: &[[f64; 3]]) -> f64 {
        let samples = f64::from(budget.edge * budget.edge * SPP);
        let relative = |c: usize| moments(images, c, 1.0).variance().sqrt() / self.scene.answer[c];
        (0..3).map(relative).fold(0.0, f64::max) * samples.sqrt()
    }
}

impl Outcome<'_> {
    /// True for each channel whose t-test rejects the rendered values multiplied by `factor`.
    pub(super) fn rejected(&self, factor: f64, level: f64) -> [bool; 3] {
        std::array::from_fn(|c| {
            let (values, answer) = (moments(&self.images, c, factor), self.row.scene.answer[c]);
            let is_exact = (values.mean() - answer).abs() <= self.row.tolerance() * answer.abs();
            !is_exact && t_test(&values, answer).p_value < level
        })
    }

    /// True if the answer has noise, not only rounding or interpolation errors.
    pub(super) fn has_noise(&self) -> bool {
        self.images.len() > EXACT_IMAGES as usize
    }

    /// Camera samples.
    pub(super) fn samples(&self) -> u64 {
        self.images.len() as u64 * u64::from(self.budget.edge.pow(2) * SPP)
    }

    /// Mean of each channel with its standard error.
    pub(super) fn means(&self) -> [(f64, f64); 3] {
        std::array::from_fn(|c| moments(&self.images, c, 1.0)).map(|w| (w.mean(), w.standard_error()))
    }

    /// The channel with the most noise.
    pub(super) fn channel(&self) -> usize {
        let relative = |c: &usize| moments(&self.images, *c, 1.0).standard_error() / self.row.scene.answer[*c];
        (0..3).max_by(|a, b| relative(a).total_cmp(&relative(b))).unwrap()
    }

    /// The bias that is detected in every channel.
    pub(super) fn detectable(&self, level: f64) -> f64 {
        let error = moments(&self.images, self.channel(), 1.0).standard_error();
        let relative = error / self.row.scene.answer[self.channel()];
        // The mean may be off by the tolerance in the other direction
        detectable_bias(relative, self.images.len() as u64, level, POWER) + 2.0 * self.row.tolerance()
    }

    fn noise(&self) -> f64 {
        self.row.noise(self.budget, &self.images)
    }

    /// A line of the table.
    fn line(&self, level: f64) -> String {
        let channel = self.channel();
        let mean = moments(&self.images, channel, 1.0);
        let truth = self.row.scene.answer[channel];
        let error = mean.standard_error();
        let (name, samples, noise) = (self.row.name(), self.samples(), self.noise());
        let detectable = 100.0 * self.detectable(level);
        format!("{name},{samples},{:.7},{truth:.7},{error:.2e},{detectable:.4},{noise:.3e}", mean.mean())
    }
}

/// Path of the table.
fn table_path() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("docs/measurements/power/rows.csv")
}

const HEADER: &str = "scene,integrator estimator sampler,samples,mean,truth,sigma,detectable bias %,noise of a sample";

/// The noise of the rows in the table.
fn measured_noise() -> HashMap<String, f64> {
    let text = std::fs::read_to_string(table_path()).unwrap_or_default();
    let entry = |line: &str| {
        let mut fields = line.split(',');
        let name = format!("{},{}", fields.next()?, fields.next()?);
        Some((name, fields.next_back()?.parse().ok()?))
    };
    text.lines().skip(1).filter_map(entry).collect()
}

/// Replaces the lines of these scenes in the table.
pub(super) fn write_table(outcomes: &[Outcome<'_>], level: f64) {
    let old = std::fs::read_to_string(table_path()).unwrap_or_default();
    let mut scenes: BTreeMap<&str, String> = BTreeMap::new();
    for line in
        old.lines().skip(1).filter(|l| outcomes.iter().all(|o| !l.starts_with(&format!("{},", o.row.scene.name))))
    {
        *scenes.entry(line.split(',').next().unwrap()).or_default() += &format!("{line}\n");
    }
    for outcome in outcomes {
        *scenes.entry(&outcome.row.scene.name).or_default() += &format!("{}\n", outcome.line(level));
    }
    std::fs::create_dir_all(table_path().parent().unwrap()).unwrap();
    std::fs::write(table_path(), format!("{HEADER}\n") + &scenes.into_values().collect::<String>()).unwrap();
}

/// Prints the table.
pub(super) fn print_table(out: &mut dyn std::io::Write, outcomes: &[Outcome<'_>], level: f64) {
    writeln!(out, "{HEADER}").unwrap();
    outcomes.iter().for_each(|o| writeln!(out, "{}", o.line(level)).unwrap());
}

/// Renders all rows of the scenes.
pub(super) fn render_rows<'a>(scenes: &'a [Scene], effort: &Effort, level: f64) -> Vec<Outcome<'a>> {
    // Noise from the table, or measured
    let known = if std::env::var_os(MEASURE).is_some() { HashMap::new() } else { measured_noise() };
    let rows = scenes.iter().flat_map(|scene| configurations(&scene.name).into_iter().map(move |c| (scene, c)));
    let rows: Vec<(&Scene, Configuration)> = rows.collect();

    // Render on all cores, each row on one thread
    let outcomes = Mutex::new(Vec::new());
    let next = AtomicUsize::new(0);
    let work = || {
        loop {
            let index = next.fetch_add(1, Ordering::Relaxed);
            let Some(&(scene, configuration)) = rows.get(index) else { break };
            let row = Row { scene, configuration };
            let noise = known.get(&row.name()).copied().unwrap_or_else(|| row.pilot());
            let outcome = row.render_until_noticed(noise, effort, level);
            outcomes.lock().unwrap().push((index, outcome));
        }
    };
    std::thread::scope(|scope| {
        let threads = std::thread::available_parallelism().map_or(1, usize::from);
        (0..threads).for_each(|_| drop(scope.spawn(work)));
    });

    // In the order of the rows
    let mut outcomes = outcomes.into_inner().unwrap();
    outcomes.sort_by_key(|(index, _)| *index);
    outcomes.into_iter().map(|(_, outcome)| outcome).collect()
}
