//! Renders all figures: resampled importance sampling.

use super::cases::Case;
use super::setup::Setup;
use super::{comparison, ratio, spheres};
use crate::reproduce::error::make_folder;
use crate::reproduce::figure::{Study, write};
use crate::reproduce::{Budget, Observer, Options, ReproduceError};
use std::path::PathBuf;
use std::time::Duration;

/// Time for everything, normal and `quick` (a tenth); less than documented, as a reserve for steps that cannot be
/// interrupted.
const TIME: [Duration; 2] = [Duration::from_secs(1080), Duration::from_secs(80)];
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

/// Renders all figures and writes `index.html` and `talbot.json`; returns the path of the page.
pub fn run(options: &Options, observer: Observer<'_>) -> Result<PathBuf, ReproduceError> {
    let mut budget = Budget::new(TIME[usize::from(options.quick)]);
    make_folder(&options.out)?;
    let setup = Setup::new(options, observer)?;
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
