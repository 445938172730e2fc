//! The figures of importance sampling for photon maps [Keller and Wald 2000].
//!
//! [`above`] plots points on the floor plan. [`seen`] has the diffuse surfaces visible to the camera, and the error of
//! images that visualise a map directly. [`maps`] renders such images. The figures are [`rooms`] (1 and 2), [`ring`]
//! (3), [`slit`] (4) and [`direct`] (5).

mod above;
mod direct;
mod maps;
mod ring;
mod rooms;
mod seen;
mod slit;

use super::figure::{Study, write};
use super::{Budget, Observer, Options, ReproduceError, make_folder, scenes_folder};
use crate::procedural::keller_wald::write_scenes;
use lumiris::render::{RenderError, thread_pool};
use std::path::PathBuf;
use std::time::Duration;

/// Time for everything, normal and `quick` (a tenth); less than documented, as a reserve for steps that cannot be
/// interrupted.
const TIME: [Duration; 2] = [Duration::from_secs(1080), Duration::from_secs(80)];
/// Maximum number of pixels along an edge of an image: normal and quick.
const SIZE: [u32; 2] = [400, 128];
/// Width and height of the images of rooms.
const SHAPE: [u32; 2] = [4, 3];

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

/// Data shared by all figures.
struct Setup<'a> {
    options: &'a Options,
    observer: Observer<'a>,
    /// Folder with the scenes.
    scenes: PathBuf,
    /// Maximum number of pixels along an edge.
    size: u32,
    /// Threads for photons.
    pool: rayon::ThreadPool,
}

impl<'a> Setup<'a> {
    /// Generates the scenes in the folder of the page, unless the options name others.
    fn new(options: &'a Options, observer: Observer<'a>) -> Result<Self, ReproduceError> {
        let scenes = scenes_folder(options, write_scenes)?;
        let size = options.size.unwrap_or(SIZE[usize::from(options.quick)]);
        Ok(Setup { options, observer, scenes, size, pool: thread_pool(options.threads).map_err(RenderError::from)? })
    }
}

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
