//! The result of a rendering, and its progress.

use super::phases::Phase;
use super::tiles::Tiles;
use crate::film::Film;
use crate::integrators::{CacheReport, LightPathStats, MapStats, PathStats};
use std::time::Duration;

/// Progress reported after every tile.
#[derive(Clone, Copy, Debug)]
pub struct Progress {
    /// Camera samples done, summed over pixels. With adaptive sampling they count as if every pixel had the same
    /// number.
    pub samples_done: u64,
    /// Camera samples requested.
    pub samples_total: u64,
    /// Rays of all kinds traced so far.
    pub rays: u64,
    /// Time since the start.
    pub elapsed: Duration,
    /// Completed passes over the whole image.
    pub passes: u32,
    /// Median noise of the blocks ([`crate::film::image_noise`]) when it was last computed; `None` before.
    pub noise: Option<f64>,
}

/// The result of a rendering, finished or stopped.
#[derive(Debug)]
pub struct Rendering {
    /// The film.
    pub film: Film,
    /// Counts and times, summed over threads.
    pub stats: PathStats,
    /// The irradiance cache, if there is one.
    pub cache: Option<CacheReport>,
    /// The photon maps, if there are any.
    pub photons: Option<MapStats>,
    /// Statistics of light paths, if any were traced.
    pub light: Option<LightPathStats>,
    /// Wall-clock time.
    pub elapsed: Duration,
    /// CPU time by phase: tiles, and the noise of the image so far.
    pub phases: Vec<Phase>,
    /// True if every pixel has all its samples.
    pub complete: bool,
    /// Threads used.
    pub threads: usize,
    /// The exact sums, if requested.
    pub sums: Option<Tiles>,
}
