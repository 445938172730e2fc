//! Rendering: tiles × sample ranges on all cores, accumulated in a [`Film`].
//!
//! The image is a function of the scene, its settings, the seed and the sample range. A pixel's samples are a function
//! of its coordinates and their indices, independent of the rest of their batch, and are added to exact sums. Threads,
//! tiles, passes and [`parts`] of the image therefore do not change a bit.
//!
//! Passes: `run`, `pace`, `shared_cells`, [`cell_progress`]. Tiles, threads and batches: `tiles`, `tile_samples`,
//! `worker`, [`batches`], `emission_rays`. Finished film: `control_variates`, [`cryptomatte`], [`output`]. Files:
//! [`parts`]. Costs: [`memory`], [`phases`].

pub mod batches;
pub mod cell_progress;
mod control_variates;
pub mod cryptomatte;
mod emission_rays;
pub mod memory;
pub mod output;
mod pace;
pub mod parts;
pub mod phases;
mod run;
mod shared_cells;
mod tile_samples;
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
pub use tiles::{TileShare, Tiles};

/// Parameters of a rendering. Only the sample range affects the image.
#[derive(Clone, Copy, Debug)]
pub struct RenderSettings {
    /// Threads; all cores if `None`.
    pub threads: Option<usize>,
    /// Edge of a tile in pixels.
    pub tile_size: u32,
    /// First sample index.
    pub first_sample: u32,
    /// Samples per pixel, from `first_sample` on.
    pub spp: u32,
    /// Number of samples at the beginning of the range that are skipped, because another part renders them. Must be 0
    /// for estimators that are fitted to earlier samples.
    pub skip: u32,
    /// Pixels to render; all if `None`.
    pub share: Option<TileShare>,
    /// No tile starts after this time. Tiles without any sample may start up to half a second later, or 3 % of the
    /// limit if that is longer.
    pub time_limit: Option<Duration>,
    /// True to estimate some pixels twice, which gives the variance of pixel means; see [`crate::film::replicas`].
    pub with_replicas: bool,
    /// True if the film stores features of the first surfaces: albedo, normal, depth, material and object.
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
    /// Camera samples done, summed over pixels. With adaptive sampling they count as if every pixel had the same
    /// number.
    pub samples_done: u64,
    /// Camera samples requested.
    pub samples_total: u64,
    /// Rays of all kinds traced so far.
    pub rays: u64,
    /// Time since the start.
    pub elapsed: Duration,
    /// Completed passes over the whole image.
    pub passes: u32,
    /// Median noise of the blocks ([`crate::film::noise`]) when it was last computed; `None` before.
    pub noise: Option<f64>,
}

/// The result of a rendering, finished or stopped.
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
    /// Statistics of light paths, if any were traced.
    pub light: Option<LightPathStats>,
    /// Wall-clock time.
    pub elapsed: Duration,
    /// CPU time by phase: tiles, and the noise of the image so far.
    pub phases: Vec<Phase>,
    /// True if every pixel has all its samples.
    pub complete: bool,
    /// Threads used.
    pub threads: usize,
    /// The exact sums, if requested.
    pub sums: Option<Tiles>,
}

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

/// Reason why a rendering ended without an image.
#[derive(Debug, thiserror::Error)]
pub enum RenderError {
    /// The threads could not be started.
    #[error(transparent)]
    Threads(#[from] ThreadError),
    /// The integrator could not prepare its photon maps.
    #[error(transparent)]
    Photons(#[from] PhotonError),
    /// The settings exclude a feature of the scene, or the image cannot be divided.
    #[error(transparent)]
    Features(#[from] Conflict),
    /// The rendering was stopped before the first sample.
    #[error("stopped before the first sample")]
    Stopped,
    /// Texels could not be read during the rendering.
    #[error("{0}")]
    Texels(String),
    /// The stored sums belong to another rendering.
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

/// Renders a job. `stop` ends the rendering after the current tiles. `observe` is called from worker threads.
pub fn render(
    job: &RenderJob,
    settings: &RenderSettings,
    stop: &AtomicBool,
    observe: &(dyn Fn(&Progress) + Sync),
) -> Result<Rendering, RenderError> {
    go_on(job, settings, stop, observe, Continuation::default())
}

/// Like [`render`], but resumes from the sums of an earlier rendering.
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

    // Render in a thread pool of this rendering
    let pool = thread_pool(settings.threads)?;
    let threads = pool.current_num_threads();
    pool.install(|| Run::new(job, settings, stop, observe).run(threads, continuation))
}

/// True if the samples of a pixel depend on earlier ones. Such an image cannot be divided into ranges of samples.
pub fn depends_on_earlier_samples(settings: &Settings) -> bool {
    Estimator::at_vertex(&settings.integrator, 0).is_progressive()
}
