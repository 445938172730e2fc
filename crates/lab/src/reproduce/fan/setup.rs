//! Data shared by all figures.

use crate::procedural::fan::write_scenes;
use crate::procedural::statue::StatueOptions;
use crate::reproduce::options::scenes_folder;
use crate::reproduce::{Observer, Options, ReproduceError};
use std::path::PathBuf;

/// Maximum number of pixels along an edge of an image: normal and quick.
const SIZE: [u32; 2] = [400, 128];
/// Cells of the grid along the statue's height: normal and quick.
const DETAIL: [u32; 2] = [512, 128];

/// Options, scenes and size of the images.
pub(super) struct Setup<'a> {
    pub(super) options: &'a Options,
    pub(super) observer: Observer<'a>,
    /// Folder with the scenes.
    pub(super) scenes: PathBuf,
    /// Maximum number of pixels along an edge.
    pub(super) size: u32,
}

impl<'a> Setup<'a> {
    /// Generates the scenes in the folder of the page, unless the options name others.
    pub(super) fn new(options: &'a Options, observer: Observer<'a>) -> Result<Self, ReproduceError> {
        let quick = usize::from(options.quick);
        let statue = StatueOptions { detail: DETAIL[quick], ..StatueOptions::default() };
        let scenes = scenes_folder(options, |folder| write_scenes(folder, &statue).map(|_| ()))?;
        Ok(Setup { options, observer, scenes, size: options.size.unwrap_or(SIZE[quick]) })
    }
}
