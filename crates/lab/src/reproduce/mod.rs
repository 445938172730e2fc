//! Figures of papers, reproduced by rendering and measuring, as a page with images and a JSON file with all numbers.
//!
//! Reading order: [`method`] (an estimator of light), [`measure`] (alternating methods on one scene, variances and
//! times), [`calibrate`] (sample counts for equal time), [`talbot`] (resampled importance sampling), [`fan`]
//! (optimizing control variates), [`keller_wald`] (photon maps), [`verdicts`] (criteria of reproduction); then the
//! parts of a page: [`figure`], [`page`], [`images`], [`chart`].

pub mod calibrate;
pub mod chart;
pub mod fan;
pub mod figure;
pub mod images;
pub mod keller_wald;
pub mod measure;
pub mod method;
pub mod page;
pub mod talbot;
pub mod verdicts;

use crate::procedural::files::ProceduralError;
use lumiris_formats::output::write_text;
use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;
use std::time::{Duration, Instant};

/// Options of a reproduction.
#[derive(Clone, Debug)]
pub struct Options {
    /// Output folder of the page.
    pub out: PathBuf,
    /// Folder with scenes that replace the generated ones.
    pub scenes: Option<PathBuf>,
    /// True for a tenth of the time.
    pub quick: bool,
    /// Number of threads; `None` for all cores.
    pub threads: Option<usize>,
    /// Maximum number of pixels along an edge of an image.
    pub size: Option<u32>,
    /// The command as it was typed, for the page.
    pub command: String,
}

impl Options {
    /// Number of threads.
    pub fn threads(&self) -> usize {
        self.threads.unwrap_or_else(|| std::thread::available_parallelism().map_or(1, usize::from))
    }
}

/// Receives progress, and may stop the reproduction.
#[derive(Clone, Copy)]
pub struct Observer<'a> {
    /// Receives a line of progress.
    pub say: &'a (dyn Fn(&str) + Sync),
    /// Stops everything once it is true.
    pub stop: &'a AtomicBool,
}

/// Errors of a reproduction.
#[derive(Debug, thiserror::Error)]
pub enum ReproduceError {
    /// A scene could not be read.
    #[error("{path} could not be loaded:\n{report}")]
    Scene {
        /// Its file.
        path: PathBuf,
        /// Errors and warnings.
        report: Box<lumiris_formats::diagnostic::Report>,
    },
    /// A scene could not be generated.
    #[error(transparent)]
    Procedural(#[from] ProceduralError),
    /// A ray tracer could not be built.
    #[error("cannot build a ray tracer: {0}")]
    Accel(#[from] lumiris::accel::embree::EmbreeError),
    /// A rendering ended without an image.
    #[error(transparent)]
    Render(#[from] lumiris::render::RenderError),
    /// A photon map could not be built.
    #[error(transparent)]
    Photons(#[from] lumiris::photons::PhotonError),
    /// An image could not be written.
    #[error(transparent)]
    Image(#[from] lumiris::imaging::oiio::ImageError),
    /// A file could not be written.
    #[error("{path}: {cause}")]
    File {
        /// Its path.
        path: PathBuf,
        /// The reason.
        cause: std::io::Error,
    },
    /// The observer stopped it.
    #[error("ended before it was done")]
    Stopped,
}

/// Size (width, height) of an image with the aspect ratio of `shape`, whose longer edge has `size` pixels.
fn scaled(shape: [u32; 2], size: u32) -> [u32; 2] {
    let longer = shape[0].max(shape[1]).max(1);
    shape.map(|s| (s * size / longer).max(1))
}

/// Writes a file; errors contain its path.
pub(crate) fn write_file(path: PathBuf, text: &str) -> Result<(), ReproduceError> {
    write_text(&path, text).map_err(|cause| ReproduceError::File { path, cause })
}

/// Creates a folder; errors contain its path.
pub(crate) fn make_folder(path: &std::path::Path) -> Result<(), ReproduceError> {
    std::fs::create_dir_all(path).map_err(|cause| ReproduceError::File { path: path.to_owned(), cause })
}

/// A time budget that is divided among parts.
#[derive(Clone, Copy, Debug)]
pub struct Budget {
    start: Instant,
    total: Duration,
    /// Weights of the remaining parts; the weights of all parts add up to 100.
    left: f64,
}

impl Budget {
    /// Starts now.
    pub fn new(total: Duration) -> Self {
        Budget { start: Instant::now(), total, left: 100.0 }
    }

    /// Elapsed time.
    pub fn elapsed(&self) -> Duration {
        self.start.elapsed()
    }

    /// Time for the next part, whose weight is `weight` of 100: its fraction of the remaining time.
    pub fn share(&mut self, weight: f64) -> Duration {
        let share = (weight / self.left.max(1e-9)).clamp(0.0, 1.0);
        self.left -= weight;
        self.total.saturating_sub(self.elapsed()).mul_f64(share)
    }
}

/// The folder of the scenes: from the options, or inside the page's folder, filled by `make`.
fn scenes_folder(
    options: &Options,
    make: impl FnOnce(&Path) -> Result<(), ProceduralError>,
) -> Result<PathBuf, ReproduceError> {
    if let Some(folder) = &options.scenes {
        return Ok(folder.clone());
    }
    let folder = options.out.join("scenes");
    make(&folder)?;
    Ok(folder)
}
