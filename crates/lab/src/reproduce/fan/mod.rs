//! The figures of optimizing control variates [Fan et al. 2006, Table 1].
//!
//! [`truth`] computes the paper's error measure, [`roster`] lists the methods, and [`cases`] the scenes of direct
//! light, in which [`direct`] compares them. [`growth`] compares them with more camera rays, and [`cache`] in
//! irradiance caching. [`outcome`] holds the measurements of direct light; [`report`] writes the results.

mod cache;
mod cases;
mod direct;
mod growth;
mod outcome;
mod report;
mod roster;
mod setup;
mod study;
mod truth;

pub use study::run;
