//! The figures of resampled importance sampling for direct light [Talbot et al. 2005; Talbot 2005, ch. 5].
//!
//! [`comparison`] holds methods of equal time against each other, [`classes`] tells lit pixels from shadowed ones,
//! [`ratio`] looks for the best number of proposals per sample, [`spheres`] samples BSDFs, [`report`] writes it down.

mod classes;
mod comparison;
mod ratio;
mod report;
mod scenes;
mod spheres;

use super::page::Block;
use super::{Budget, Observer, Options, ReproduceError, make_folder};
use comparison::Case;
use scenes::Scenes;
use serde_json::Value;
use std::path::PathBuf;
use std::time::Duration;

/// Time for everything, and for the tenth of it that `quick` takes; less than is promised, for what cannot be stopped
/// half-way.
const TIME: [Duration; 2] = [Duration::from_secs(1080), Duration::from_secs(96)];
/// Most pixels along an edge of a picture: usual and quick.
const SIZE: [u32; 2] = [400, 160];

/// What a figure gave.
struct Figure {
    /// Anchor on the page, and name in the file of numbers.
    id: &'static str,
    /// Heading.
    title: &'static str,
    summary: Summary,
    blocks: Vec<Block>,
    numbers: Value,
}

/// The row of a figure in the table at the top.
struct Summary {
    /// What the paper says.
    paper: String,
    /// What is to be reached here.
    target: String,
    /// What was measured.
    measured: String,
    /// Whether that is enough.
    reached: bool,
    /// Why, in numbers.
    reason: String,
}

/// What all figures need.
struct Setup<'a> {
    options: &'a Options,
    observer: Observer<'a>,
    scenes: Scenes,
    threads: usize,
    size: u32,
}

/// Width and height of a picture of the statue whose longer edge has `size` pixels.
fn portrait(size: u32) -> [u32; 2] {
    [(size * 3 / 4).max(1), size]
}

/// Renders all figures and writes `index.html` and `talbot.json`; the answer is the page.
pub fn run(options: &Options, observer: Observer<'_>) -> Result<PathBuf, ReproduceError> {
    let quick = usize::from(options.quick);
    let budget = Budget::new(TIME[quick]);
    make_folder(&options.out)?;
    let setup = Setup {
        options,
        observer,
        scenes: Scenes::new(options)?,
        threads: options.threads.unwrap_or_else(|| std::thread::available_parallelism().map_or(1, usize::from)),
        size: options.size.unwrap_or(SIZE[quick]),
    };

    let mut left = 100.0;
    let mut share = |weight: f64| {
        let time = budget.share(weight, left);
        left -= weight;
        time
    };
    let figures = [
        comparison::run(&setup, &Case::PAPER_4, share(26.0))?,
        comparison::run(&setup, &Case::PAPER_4_LIGHTS, share(16.0))?,
        comparison::run(&setup, &Case::THESIS_53, share(22.0))?,
        comparison::run(&setup, &Case::THESIS_54, share(16.0))?,
        ratio::run(&setup, share(18.0))?,
        spheres::run(&setup)?,
    ];
    report::write(&setup, &figures, budget.elapsed())
}
