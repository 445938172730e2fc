//! Renders all figures: optimizing control variates.

use super::cases::Case;
use super::setup::Setup;
use super::{cache, direct};
use crate::reproduce::error::make_folder;
use crate::reproduce::figure::{Study, write};
use crate::reproduce::{Budget, Observer, Options, ReproduceError};
use std::path::PathBuf;
use std::time::Duration;

/// Time for everything, normal and `quick` (a tenth); less than documented, as a reserve for steps that cannot be
/// interrupted.
const TIME: [Duration; 2] = [Duration::from_secs(1080), Duration::from_secs(85)];
/// The page around the figures.
const STUDY: Study = Study {
    title: "Optimizing control variates: table 1 of Fan et al. (2006), reproduced",
    intro: "The scenes of the paper “Optimizing Control Variate Estimators for Rendering” are not published; similar \
            ones were made from its text and figures: a glossy board under a large and a small light, a statue with \
            tight highlights, a room with small lights, a box. Samples per estimate, and camera rays per pixel, are \
            those of its table 1. The numbers below are from one run on one machine.",
    notes: &[
        "Error: eq. (12) of the paper, the root of the mean of ((L − L_true)/tvi(L_true))², where tvi is the threshold \
         of vision of Ferwerda et al. (1996) and a luminance of 1 counts as 100 cd/m², about white on a display. \
         L_true is the mean of several long renderings by mis with other seeds; its own noise is subtracted from each \
         square. Every method is rendered several times with independent seeds; ± is one standard error, from how \
         these differ. Camera rays pass through pixel centres, so that the error is that of lighting; that of the \
         antialiased image, whose edges add noise of their own, is given beside it.",
        "Time: processor time of the whole rendering, all threads together. All methods alternate in one run, in an \
         order that rotates from turn to turn; the ratio of times is the median over the turns. Efficiency is \
         1/(error² × time).",
        "Half of the samples come from the BSDF and the other half from the lights, all lights with equal probability, \
         as in the paper: ocv gives each light the same number of samples, mis approximately, by well distributed \
         points (with independent samples: on average). The last three rows of each scene, and the tables after the \
         third, choose lights by the light tree instead, as the renderer does by default.",
        "Samples are drawn in three ways, and methods are compared with methods that draw them in the same way. \
         Stratified in each estimate: the samples of each component are well distributed over its whole domain, and \
         camera rays are independent of each other, as in the paper. Stratified over all rays: the samples of all rays \
         of a pixel are one well distributed set, which mis can use; progressive ocv cannot, since its coefficients \
         must be independent of the samples to which they are applied: it has one set for each of its blocks of 1, 1, \
         2, 4, … rays. Independent: all random numbers are.",
        "Bias: mean luminance of the image over that of the reference, less 1, with its 95 % confidence interval. ocv in the form paper \
         and direct optimal-mis are biased by design, as they fit and estimate with the same samples; all others are \
         not.",
        "Progressive ocv cannot improve the first camera ray of a pixel, for which it is mis; with four rays a quarter \
         of the variance is not reduced. The curves show the error with more rays.",
    ],
    numbers: "fan.json",
};

/// Renders all figures and writes `index.html` and `fan.json`; returns the path of the page.
pub fn run(options: &Options, observer: Observer<'_>) -> Result<PathBuf, ReproduceError> {
    let mut budget = Budget::new(TIME[usize::from(options.quick)]);
    make_folder(&options.out)?;
    let setup = Setup::new(options, observer)?;
    let figures = [
        direct::run(&setup, &Case::CHECKERS, budget.share(32.0))?,
        direct::run(&setup, &Case::STATUE, budget.share(32.0))?,
        direct::run(&setup, &Case::ROOM, budget.share(20.0))?,
        cache::run(&setup, budget.share(16.0))?,
    ];
    write(&STUDY, options, &figures, budget.elapsed())
}
