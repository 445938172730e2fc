//! Data shared by all figures.

use crate::procedural::keller_wald::write_scenes;
use crate::reproduce::options::scenes_folder;
use crate::reproduce::{Observer, Options, ReproduceError};
use lumiris::render::{RenderError, thread_pool};
use std::path::PathBuf;

/// Maximum number of pixels along an edge of an image: normal and quick.
const SIZE: [u32; 2] = [400, 128];
/// Width and height of the images of rooms.
pub(super) const SHAPE: [u32; 2] = [4, 3];

/// Options, scenes and size of the images.
pub(super) struct Setup<'a> {
    pub(super) options: &'a Options,
    pub(super) observer: Observer<'a>,
    /// Folder with the scenes.
    pub(super) scenes: PathBuf,
    /// Maximum number of pixels along an edge.
    pub(super) size: u32,
    /// Threads for photons.
    pub(super) pool: rayon::ThreadPool,
}

impl<'a> Setup<'a> {
    /// Generates the scenes in the folder of the page, unless the options name others.
    pub(super) fn new(options: &'a Options, observer: Observer<'a>) -> Result<Self, ReproduceError> {
        let scenes = scenes_folder(options, write_scenes)?;
        let size = options.size.unwrap_or(SIZE[usize::from(options.quick)]);
        Ok(Setup { options, observer, scenes, size, pool: thread_pool(options.threads).map_err(RenderError::from)? })
    }
}
