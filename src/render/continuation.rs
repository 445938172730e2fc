//! Inputs of a resumed rendering, and observers of a rendering.

use super::cell_progress::CellProgress;
use super::parts::{Checkpoints, StoredTile};
use super::rendering::Progress;
use crate::film::Film;

/// Receives the film of a tile that has new samples. Called from worker threads.
pub type TileObserver<'a> = dyn Fn(&Film) + Sync + 'a;

/// Called after every pass over the whole image, before the next one starts. Receives the progress and may stop the
/// rendering.
pub type PassObserver<'a> = dyn Fn(&Progress) + Sync + 'a;

/// Inputs of a resumed rendering, its checkpoints, and its observers.
#[derive(Default)]
pub struct Continuation<'a> {
    /// The sums of an earlier rendering with the same settings. The rendering uses the same tiles.
    pub stored: Option<Vec<StoredTile>>,
    /// Progress of its cells.
    pub cells: CellProgress,
    /// Stores the sums at intervals and at the end.
    pub checkpoints: Option<&'a mut Checkpoints>,
    /// True to return the exact sums with the result.
    pub keeps_sums: bool,
    /// True to report the noise with the progress even if nobody observes tiles or passes.
    pub tells_noise: bool,
    /// Receives tiles during the rendering.
    pub watch: Option<&'a TileObserver<'a>>,
    /// Called between passes.
    pub passes: Option<&'a PassObserver<'a>>,
}
