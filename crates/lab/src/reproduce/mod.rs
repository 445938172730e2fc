//! Figures of papers, reproduced by rendering and measuring, as a page with images and a JSON file with all numbers.
//!
//! Reading order: [`method`] (an estimator of light), [`measure`] (alternating methods on one scene, variances and
//! times), [`calibrate`] (sample counts for equal time), [`talbot`] (resampled importance sampling), [`fan`]
//! (optimizing control variates), [`keller_wald`] (photon maps), [`verdicts`] (when a figure counts as reproduced);
//! then the parts of a page: [`figure`], [`page`], [`images`], [`chart`].

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

/// What to reproduce, and how long it may take.
#[derive(Clone, Debug)]
pub struct Options {
    /// Folder that takes the page.
    pub out: PathBuf,
    /// Folder with scenes in place of those that are made for the purpose.
    pub scenes: Option<PathBuf>,
    /// A tenth of the time.
    pub quick: bool,
    /// Threads; all cores if `None`.
    pub threads: Option<usize>,
    /// Most pixels along an edge of an image.
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

/// Who is told how far it is, and may end it.
#[derive(Clone, Copy)]
pub struct Observer<'a> {
    /// Takes a line for a person.
    pub say: &'a (dyn Fn(&str) + Sync),
    /// Ends everything once it is true.
    pub stop: &'a AtomicBool,
}

/// Why there is no page.
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
    /// A scene could not be made.
    #[error(transparent)]
    Procedural(#[from] ProceduralError),
    /// A ray tracer could not be built.
    #[error("cannot build a ray tracer: {0}")]
    Accel(#[from] lumiris::accel::embree::EmbreeError),
    /// A rendering ended without an image.
    #[error(transparent)]
    Render(#[from] lumiris::render::RenderError),
    /// There is no photon map.
    #[error(transparent)]
    Photons(#[from] lumiris::photons::PhotonError),
    /// An image could not be written.
    #[error(transparent)]
    Image(#[from] lumiris::imaging::oiio::ImageError),
    /// A file could not be written.
    #[error("{path}: {cause}")]
    File {
        /// Which.
        path: PathBuf,
        /// Why.
        cause: std::io::Error,
    },
    /// The observer ended it.
    #[error("ended before it was done")]
    Stopped,
}

/// Width and height of an image of a shape whose longer edge has `size` pixels.
fn scaled(shape: [u32; 2], size: u32) -> [u32; 2] {
    let longer = shape[0].max(shape[1]).max(1);
    shape.map(|s| (s * size / longer).max(1))
}

/// Writes a file, with its name in the error.
pub(crate) fn write_file(path: PathBuf, text: &str) -> Result<(), ReproduceError> {
    write_text(&path, text).map_err(|cause| ReproduceError::File { path, cause })
}

/// Makes a folder, with its name in the error.
pub(crate) fn make_folder(path: &std::path::Path) -> Result<(), ReproduceError> {
    std::fs::create_dir_all(path).map_err(|cause| ReproduceError::File { path: path.to_owned(), cause })
}

/// Time that is shared out among parts.
#[derive(Clone, Copy, Debug)]
pub struct Budget {
    start: Instant,
    total: Duration,
    /// Weights of the parts that are still to come; those of all parts add up to 100.
    left: f64,
}

impl Budget {
    /// Starts now.
    pub fn new(total: Duration) -> Self {
        Budget { start: Instant::now(), total, left: 100.0 }
    }

    /// Since the start.
    pub fn elapsed(&self) -> Duration {
        self.start.elapsed()
    }

    /// What the next part may take, whose weight is `weight` of 100: its share of the time that is left.
    pub fn share(&mut self, weight: f64) -> Duration {
        let share = (weight / self.left.max(1e-9)).clamp(0.0, 1.0);
        self.left -= weight;
        self.total.saturating_sub(self.elapsed()).mul_f64(share)
    }
}

/// The folder of the scenes: that of the options, or one inside the page's, which `make` fills.
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
