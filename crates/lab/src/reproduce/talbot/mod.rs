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
mod setup;
mod spheres;
mod study;

pub use study::run;
