//! Options of a reproduction.

use super::error::ReproduceError;
use crate::procedural::files::ProceduralError;
use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;

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

/// The folder of the scenes: from the options, or inside the page's folder, filled by `make`.
pub(super) fn scenes_folder(
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
