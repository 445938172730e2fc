//! Rendering: tiles × sample ranges on all cores, and the film that comes out.
//!
//! The image is a function of the scene, its settings, the seed and the sample range. A pixel's samples are drawn
//! by its coordinates and their index, traced independently of what else is in their batch, and added to exact sums; so
//! neither threads, nor tiles, nor passes, nor [`parts`] of the image change a bit.

pub mod batches;
pub mod cell_progress;
mod control_variates;
pub mod cryptomatte;
mod looks;
pub mod memory;
pub mod output;
mod pace;
pub mod parts;
pub mod phases;
mod run;
mod shared_cells;
mod tiles;
mod worker;

use crate::direct::Estimator;
use crate::film::Film;
pub use crate::integrators::CacheReport;
use crate::integrators::features::{self, Conflict, Feature};
pub use crate::integrators::path::BATCH_PATHS;
use crate::integrators::{LightPathStats, MapStats, PathStats, reuse};
use crate::photons::PhotonError;
use crate::planning::PlanError;
pub use crate::planning::preparation::{ThreadError, thread_pool};
use crate::scene::RenderJob;
use crate::settings::Settings;
use cell_progress::CellProgress;
use parts::{Checkpoints, PartError, StoredTile};
use phases::Phase;
use run::Run;
use std::sync::atomic::AtomicBool;
use std::time::Duration;
use tiles::position;
pub use tiles::{TileShare, Tiles};

/// How to render. Only the sample range affects the image.
#[derive(Clone, Copy, Debug)]
pub struct RenderSettings {
    /// Threads; all cores if `None`.
    pub threads: Option<usize>,
    /// Edge of a tile in pixels.
    pub tile_size: u32,
    /// First sample index.
    pub first_sample: u32,
    /// Samples per pixel from there on.
    pub spp: u32,
    /// How many of these are left out at the beginning, to be rendered elsewhere: the samples of an estimator that is fitted to
    /// earlier ones cannot be.
    pub skip: u32,
    /// The pixels that are rendered; all if `None`.
    pub share: Option<TileShare>,
    /// No tile is begun later than this; without a sample, half a second later, or 3 %.
    pub time_limit: Option<Duration>,
    /// Estimates some pixels twice, which gives the variance of pixel means; see [`crate::film::replicas`].
    pub with_replicas: bool,
    /// Whether the film holds features of the first surfaces: albedo, normal, depth, material and object.
    pub with_features: bool,
}

impl Default for RenderSettings {
    fn default() -> Self {
        RenderSettings {
            threads: None,
            tile_size: 16,
            first_sample: 0,
            spp: 1,
            skip: 0,
            share: None,
            time_limit: None,
            with_replicas: false,
            with_features: true,
        }
    }
}

/// Progress reported after every tile.
#[derive(Clone, Copy, Debug)]
pub struct Progress {
    /// Camera samples done, as if every pixel had the same number.
    pub samples_done: u64,
    /// Camera samples requested.
    pub samples_total: u64,
    /// Rays of all kinds traced so far.
    pub rays: u64,
    /// Time since the start.
    pub elapsed: Duration,
    /// Passes over the whole image that are done.
    pub passes: u32,
    /// Median noise of the blocks ([`crate::film::noise`]) after the last pass for which it was determined, if there was one.
    pub noise: Option<f64>,
}

/// A finished or stopped rendering.
#[derive(Debug)]
pub struct Rendering {
    /// The film.
    pub film: Film,
    /// Counts and times, summed over threads.
    pub stats: PathStats,
    /// The irradiance cache, if there is one.
    pub cache: Option<CacheReport>,
    /// The photon maps, if there are any.
    pub photons: Option<MapStats>,
    /// Light paths, if there were any.
    pub light: Option<LightPathStats>,
    /// Wall-clock time.
    pub elapsed: Duration,
    /// Processor time of its tiles and of the noise on the way, by phases.
    pub phases: Vec<Phase>,
    /// True if every pixel has all its samples.
    pub complete: bool,
    /// Threads used.
    pub threads: usize,
    /// The exact sums, if they were to be kept.
    pub sums: Option<Tiles>,
}

/// Gets the film of a tile that has new samples; called from worker threads.
pub type TileObserver<'a> = dyn Fn(&Film) + Sync + 'a;

/// Called after every pass over the whole image, before the next begins; gets the progress, and may stop the rendering.
pub type PassObserver<'a> = dyn Fn(&Progress) + Sync + 'a;

/// What a rendering goes on from, where its sums are stored, and who watches it.
#[derive(Default)]
pub struct Continuation<'a> {
    /// The sums of an earlier rendering by the same settings. Their tiles are those of the rendering.
    pub stored: Option<Vec<StoredTile>>,
    /// How far its cells are.
    pub cells: CellProgress,
    /// Stores the sums from time to time, and in the end.
    pub checkpoints: Option<&'a mut Checkpoints>,
    /// Whether the exact sums are part of the result.
    pub keeps_sums: bool,
    /// Whether the progress has the noise even where nobody watches tiles or passes.
    pub tells_noise: bool,
    /// Gets tiles on the way.
    pub watch: Option<&'a TileObserver<'a>>,
    /// Waits between passes.
    pub passes: Option<&'a PassObserver<'a>>,
}

/// Why a rendering ended without an image.
#[derive(Debug, thiserror::Error)]
pub enum RenderError {
    /// The threads could not be started.
    #[error(transparent)]
    Threads(#[from] ThreadError),
    /// The integrator could not prepare its photon maps.
    #[error(transparent)]
    Photons(#[from] PhotonError),
    /// The settings leave out something of the scene, or the image cannot be divided.
    #[error(transparent)]
    Features(#[from] Conflict),
    /// It was stopped before the first sample.
    #[error("stopped before the first sample")]
    Stopped,
    /// Texels could not be read while rendering.
    #[error("{0}")]
    Texels(String),
    /// The sums to go on from are those of something else.
    #[error(transparent)]
    Stored(#[from] PartError),
}

impl From<PlanError> for RenderError {
    fn from(error: PlanError) -> Self {
        match error {
            PlanError::Threads(error) => RenderError::Threads(error),
            PlanError::Features(conflict) => conflict.into(),
            PlanError::Stopped => RenderError::Stopped,
        }
    }
}

/// Renders. `stop` ends it after the tiles under way; `observe` is called from worker threads.
pub fn render(
    job: &RenderJob,
    settings: &RenderSettings,
    stop: &AtomicBool,
    observe: &(dyn Fn(&Progress) + Sync),
) -> Result<Rendering, RenderError> {
    go_on(job, settings, stop, observe, Continuation::default())
}

/// The same, from what an earlier rendering has left.
pub fn go_on(
    job: &RenderJob,
    settings: &RenderSettings,
    stop: &AtomicBool,
    observe: &(dyn Fn(&Progress) + Sync),
    continuation: Continuation<'_>,
) -> Result<Rendering, RenderError> {
    let is_divided = settings.share.is_some() && reuse::edge(job) > 1;
    let division = is_divided.then(|| features::between(Feature::Sharing, Feature::TileShare)).flatten();
    if let Some(conflict) = features::refusal(job, &job.settings().integrator).or(division) {
        return Err(conflict.into());
    }
    let pool = thread_pool(settings.threads)?;
    let threads = pool.current_num_threads();
    pool.install(|| Run::new(job, settings, stop, observe).run(threads, continuation))
}

/// True if the samples of a pixel depend on earlier ones: it cannot be divided into parts.
pub fn depends_on_earlier_samples(settings: &Settings) -> bool {
    Estimator::at_vertex(&settings.integrator, 0).is_progressive()
}
