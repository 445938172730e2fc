//! Whole-program tests; one binary, a module per subject.
#![allow(clippy::unwrap_used)]

mod analytic_scenes;
mod bit_exact;
mod browser;
mod cli;
mod compare;
mod crosscheck;
mod estimators_1d;
mod evaluated;
mod irradiance_cache;
mod layering;
mod light_hints;
mod mutations;
mod photon_map;
mod photons;
mod reproduce;
mod significance;
