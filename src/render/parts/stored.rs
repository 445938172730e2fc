//! Stored sums that a rendering resumes from: a checkpoint or an unfinished part.

use super::error::PartError;
use super::file::FilmReader;
use super::header::FilmHeader;
use super::stored_tile::StoredTile;
use crate::render::cell_progress::CellProgress;
use crate::settings::Settings;
use crate::settings::table::rows;
use std::path::{Path, PathBuf};

/// The contents of a file of sums.
#[derive(Debug)]
pub struct Stored {
    /// The file.
    pub path: PathBuf,
    /// Scene, settings, samples and pixels.
    pub header: FilmHeader,
    /// The sums.
    pub tiles: Vec<StoredTile>,
    /// Progress of cells, where pixels share paths.
    pub cells: CellProgress,
}

impl Stored {
    /// Reads a file. Returns `None` if the file does not exist and is also the path for the checkpoints of the
    /// rendering, which then starts from the beginning.
    pub fn read(path: &Path, checkpoint: Option<&Path>) -> Result<Option<Stored>, PartError> {
        if checkpoint == Some(path) && !path.exists() {
            return Ok(None);
        }
        let mut reader = FilmReader::open(path)?;
        let header = reader.header().clone();
        let tiles = reader.all_tiles()?;
        Ok(Some(Stored { path: path.to_owned(), header, tiles, cells: reader.cells() }))
    }

    /// Applies the stored settings, in the order of the table. Settings that are not stored stay unchanged.
    pub fn apply(&self, settings: &mut Settings) -> Result<(), PartError> {
        for row in rows() {
            if let Some(value) = self.header.setting(&format!("lumiris:{}", row.key)) {
                let set = row.set_text(settings, value);
                set.map_err(|e| self.foreign(&format!("`{}`: expected {e}, not `{value}`", row.key)))?;
            }
        }
        Ok(())
    }

    /// Samples per pixel that the rendering was prepared for.
    pub fn spp(&self) -> Result<u32, PartError> {
        let spp = self.header.setting("lumiris:spp").and_then(|text| text.parse().ok());
        spp.ok_or_else(|| self.foreign("there is no number of samples"))
    }

    pub(super) fn foreign(&self, reason: &str) -> PartError {
        PartError::foreign(&self.path, reason)
    }
}
