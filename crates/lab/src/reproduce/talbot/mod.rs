//! The figures of resampled importance sampling for direct light [Talbot et al. 2005; Talbot 2005, ch. 5].
//!
//! [`comparison`] compares the methods of [`roster`] at equal time, in the figures of [`cases`]; the measurements are
//! an [`outcome`]. [`classes`] classifies lit and shadowed pixels, [`ratio`] searches the best number of proposals per
//! sample, [`spheres`] samples BSDFs, [`report`] writes the results.

mod cases;
mod classes;
mod comparison;
mod outcome;
mod ratio;
mod report;
mod roster;
mod scenes;
mod spheres;

use super::figure::{Study, write};
use super::{Budget, Observer, Options, ReproduceError, make_folder};
use cases::Case;
use scenes::Scenes;
use std::path::PathBuf;
use std::time::Duration;

/// Time for everything, normal and `quick` (a tenth); less than documented, as a reserve for steps that cannot be
/// interrupted.
const TIME: [Duration; 2] = [Duration::from_secs(1080), Duration::from_secs(80)];
/// Maximum number of pixels along an edge of an image: normal and quick.
const SIZE: [u32; 2] = [400, 160];

/// The page around the figures.
const STUDY: Study = Study {
    title: "Resampled importance sampling: the figures of Talbot, Cline and Egbert (2005), reproduced",
    intro: "Each figure of the paper “Importance Resampling for Global Illumination” and of Talbot's thesis, with \
            similar scenes. The numbers below are from one run on one machine.",
    notes: &[
        "Variance: of the pixel's luminance over independent renderings with the camera rays of one turn each, \
         unbiased, averaged over all pixels; no reference image is used. Camera rays pass through pixel centres, so \
         that the variance is that of lighting; the images, and the variance below them, are with antialiasing. ± is \
         one standard error, from how the turns differ.",
        "Time: processor time of the whole rendering, all threads together. All methods alternate in one run, in an \
         order that rotates from turn to turn; the ratio of times is the median over the turns. At equal time means \
         variance × time, relative to the baseline. M and N of ris are chosen so that times agree within about one \
         percent.",
        "“Same mean, p” is the probability of a difference from the mean luminance of all other methods at least as \
         large as the observed one, if all have the same expectation; all are unbiased, so about one in a hundred \
         should be below 0.01. “No stratification” means independent random numbers throughout.",
    ],
    numbers: "talbot.json",
};

/// Data shared by all figures.
struct Setup<'a> {
    options: &'a Options,
    observer: Observer<'a>,
    scenes: Scenes,
    size: u32,
}

/// Width and height of an image of the statue whose longer edge has `size` pixels.
fn portrait(size: u32) -> [u32; 2] {
    [(size * 3 / 4).max(1), size]
}

/// Renders all figures and writes `index.html` and `talbot.json`; returns the path of the page.
pub fn run(options: &Options, observer: Observer<'_>) -> Result<PathBuf, ReproduceError> {
    let quick = usize::from(options.quick);
    let mut budget = Budget::new(TIME[quick]);
    make_folder(&options.out)?;
    let setup = Setup { options, observer, scenes: Scenes::new(options)?, size: options.size.unwrap_or(SIZE[quick]) };

    let figures = [
        comparison::run(&setup, &Case::PAPER_4, budget.share(26.0))?,
        comparison::run(&setup, &Case::PAPER_4_LIGHTS, budget.share(16.0))?,
        comparison::run(&setup, &Case::THESIS_53, budget.share(22.0))?,
        comparison::run(&setup, &Case::THESIS_54, budget.share(16.0))?,
        ratio::run(&setup, budget.share(18.0))?,
        spheres::run(&setup)?,
    ];
    write(&STUDY, options, &figures, budget.elapsed())
}
