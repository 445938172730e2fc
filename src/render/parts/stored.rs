//! What a rendering goes on from: a checkpoint or an unfinished part.

use super::error::PartError;
use super::file::FilmReader;
use super::header::FilmHeader;
use super::stored_tile::StoredTile;
use crate::render::cell_progress::CellProgress;
use crate::settings::Settings;
use crate::settings::table::rows;
use std::path::{Path, PathBuf};

/// The sums that a rendering goes on from.
#[derive(Debug)]
pub struct Stored {
    /// The file.
    pub path: PathBuf,
    /// What it belongs to.
    pub header: FilmHeader,
    /// Its sums.
    pub tiles: Vec<StoredTile>,
    /// How far its cells are, where pixels share paths.
    pub cells: CellProgress,
}

impl Stored {
    /// Reads a file. `checkpoint` is where the rendering will store itself: if that is the same file, and there is none yet,
    /// it begins.
    pub fn read(path: &Path, checkpoint: Option<&Path>) -> Result<Option<Stored>, PartError> {
        if checkpoint == Some(path) && !path.exists() {
            return Ok(None);
        }
        let mut reader = FilmReader::open(path)?;
        let header = reader.header().clone();
        let tiles = reader.all_tiles()?;
        Ok(Some(Stored { path: path.to_owned(), header, tiles, cells: reader.cells() }))
    }

    /// Applies its settings, in the order of the table. What it does not have does not apply.
    pub fn apply(&self, settings: &mut Settings) -> Result<(), PartError> {
        for row in rows() {
            if let Some(value) = self.header.setting(&format!("lumiris:{}", row.key)) {
                let set = row.set_text(settings, value);
                set.map_err(|e| self.foreign(&format!("`{}`: expected {e}, not `{value}`", row.key)))?;
            }
        }
        Ok(())
    }

    /// The samples per pixel by which it was prepared.
    pub fn spp(&self) -> Result<u32, PartError> {
        let spp = self.header.setting("lumiris:spp").and_then(|text| text.parse().ok());
        spp.ok_or_else(|| self.foreign("there is no number of samples"))
    }

    pub(super) fn foreign(&self, reason: &str) -> PartError {
        PartError::foreign(&self.path, reason)
    }
}
