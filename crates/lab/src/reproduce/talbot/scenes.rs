//! Locations of the scenes of the figures.

use super::super::options::scenes_folder;
use super::super::{Options, ReproduceError};
use crate::procedural::statue::StatueOptions;
use crate::procedural::talbot::{TalbotOptions, write_scenes};
use std::path::PathBuf;

/// Cells of the grid along the statue's height: normal and quick.
const DETAIL: [u32; 2] = [512, 128];

/// A statue illuminated by a sky, by two lights, or by both.
#[derive(Clone, Debug)]
pub(super) struct Scenes {
    folder: PathBuf,
}

/// The illumination.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Which {
    /// Sky.
    Environment,
    /// Two area lights.
    Lights,
    /// Both.
    Both,
}

impl Scenes {
    /// Generates the scenes in the folder of the page, unless the options name others.
    pub(super) fn new(options: &Options) -> Result<Self, ReproduceError> {
        let detail = DETAIL[usize::from(options.quick)];
        let statue = StatueOptions { detail, ..StatueOptions::default() };
        let all = TalbotOptions { statue, ..TalbotOptions::default() };
        Ok(Scenes { folder: scenes_folder(options, |folder| write_scenes(folder, &all).map(|_| ()))? })
    }

    /// The scene file.
    pub(super) fn path(&self, which: Which) -> PathBuf {
        self.folder.join(match which {
            Which::Environment => "statue-env.pbrt",
            Which::Lights => "statue-lights.pbrt",
            Which::Both => "statue-env-lights.pbrt",
        })
    }
}
