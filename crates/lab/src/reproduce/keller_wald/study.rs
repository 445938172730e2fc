//! Renders all figures: importance sampling for photon maps.

use super::setup::Setup;
use super::{direct, ring, rooms, slit};
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
    title: "Importance sampling for photon maps: the figures of Keller and Wald (2000), reproduced",
    intro: "Each figure of the report “Efficient Importance Sampling Techniques for the Photon Map”. Its scenes are \
            not published; similar ones were made from its text: 10 × 10 rooms with one light each, 50 × 50 rooms with \
            10,000 lights, a polished ring, and a room lit through a slit. The numbers below are from one run on one \
            machine.",
    notes: &[
        "Variance: of the pixel's luminance over independent renderings, unbiased, averaged over all pixels; no \
         reference image is used. Camera rays pass through pixel centres, so that the variance is that of lighting. ± \
         is one standard error, from how the renderings differ.",
        "Time: processor time of the whole rendering, all threads together. All methods alternate in one run, in an \
         order that rotates from turn to turn; the ratio of times is the median over the turns. At equal time means \
         variance × time, relative to another method.",
        "Figures 1 to 4 show maps directly, as the report does: the radiance of a diffuse surface is albedo × \
         irradiance / π, and the irradiance is the density of the power of the nearest photons with the Epanechnikov \
         kernel, direct light included. Pixels that show lights or metal are excluded. Error: root mean square of the \
         difference in luminance from a reference, relative to the mean luminance; the reference's own noise is \
         subtracted.",
        "“Same mean, p” is the probability of a difference from the mean luminance of all other methods at least as \
         large as the observed one, if all have the same expectation.",
    ],
    numbers: "keller-wald.json",
};

/// Renders all figures and writes `index.html` and `keller-wald.json`; returns the path of the page.
pub fn run(options: &Options, observer: Observer<'_>) -> Result<PathBuf, ReproduceError> {
    let mut budget = Budget::new(TIME[usize::from(options.quick)]);
    make_folder(&options.out)?;
    let setup = Setup::new(options, observer)?;
    let figures = [
        rooms::run(&setup, budget.share(30.0))?,
        ring::run(&setup, budget.share(15.0))?,
        slit::run(&setup, budget.share(20.0))?,
        direct::run(&setup, budget.share(35.0))?,
    ];
    write(&STUDY, options, &figures, budget.elapsed())
}
