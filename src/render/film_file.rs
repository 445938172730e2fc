//! Storage of a rendering: checkpoints while it runs, a part at the end.

use super::cell_progress::CellProgress;
use super::continuation::Continuation;
use super::parts::notes::SECONDS;
use super::parts::{Asked, Checkpoints, FilmHeader, PartError, Stored, StoredTile, write_film};
use super::render_settings::RenderSettings;
use super::rendering::Rendering;
use crate::import::fingerprint::SceneFiles;
use crate::scene::RenderJob;
use std::path::{Path, PathBuf};
use std::time::Duration;

/// Storage options of a rendering.
#[derive(Debug, Default)]
pub struct Storage {
    /// Path of checkpoints and the time between two of them.
    pub checkpoint: Option<(PathBuf, Duration)>,
    /// True if the sums are kept to be written as a part.
    pub keeps_sums: bool,
    /// Stored sums to resume from.
    pub stored: Option<Stored>,
}

/// Header, checkpoints and stored sums of a rendering.
pub struct FilmFile {
    header: FilmHeader,
    checkpoints: Option<Checkpoints>,
    stored: Option<Vec<StoredTile>>,
    cells: CellProgress,
    keeps_sums: bool,
}

impl FilmFile {
    /// Storage of a rendering with `spp` samples per pixel. Fails if the stored sums belong to another rendering.
    /// `warn` receives errors of checkpoints.
    pub fn new(
        asked: &Asked,
        job: &RenderJob,
        files: &SceneFiles,
        settings: &RenderSettings,
        spp: u32,
        storage: Storage,
        warn: impl Fn(&str) + Send + Sync + 'static,
    ) -> Result<FilmFile, PartError> {
        let fingerprint = files.fingerprint().map_err(|file| PartError::io(&file.path, file.error))?;
        let described = asked.described(job, settings);
        let notes = asked.notes(&job.world.scene.camera);
        let header = FilmHeader::new(job, settings, spp, fingerprint, [described, notes]);
        if let Some(stored) = &storage.stored {
            check_resumable(stored, &header)?;
        }
        let checkpoints =
            storage.checkpoint.map(|(path, interval)| Checkpoints::new(path, interval, header.clone(), warn));
        let (stored, cells) = storage.stored.map(|s| (s.tiles, s.cells)).unzip();
        let cells = cells.unwrap_or_default();
        Ok(FilmFile { header, checkpoints, stored, cells, keeps_sums: storage.keeps_sums })
    }

    /// The inputs to resume the rendering.
    pub fn continuation(&mut self) -> Continuation<'_> {
        let (stored, cells) = (self.stored.take(), std::mem::take(&mut self.cells));
        let checkpoints = self.checkpoints.as_mut();
        Continuation { stored, cells, checkpoints, keeps_sums: self.keeps_sums, ..Continuation::default() }
    }

    /// Records the end of the rendering in the header.
    pub fn end(&mut self, rendering: &Rendering) {
        self.header.is_finished = rendering.complete;
        self.header.notes.push((SECONDS.to_owned(), rendering.elapsed.as_secs_f64().to_string()));
    }

    /// Writes the rendered part.
    pub fn write(&self, path: &Path, rendering: &Rendering) -> Result<(), PartError> {
        let sums = rendering.sums.as_ref().ok_or(PartError::Sums("they were not kept"))?;
        write_film(path, &self.header, sums)
    }

    /// The checkpoints, if there are any.
    pub fn checkpoints(&self) -> Option<&Checkpoints> {
        self.checkpoints.as_ref()
    }
}

/// Fails if the stored sums belong to another scene or to other settings.
fn check_resumable(stored: &Stored, header: &FilmHeader) -> Result<(), PartError> {
    let differences = stored.header.differences_of_rendering(header);
    if differences.is_empty() {
        return Ok(());
    }
    let path = stored.path.display();
    let lines = differences.join("\n  ");
    Err(PartError::Parts(format!("{path} is of another scene or of other settings:\n  {lines}")))
}
