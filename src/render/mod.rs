//! Rendering: tiles × sample ranges on all cores, accumulated in a [`Film`](crate::film::Film).
//!
//! The image is a function of the scene, its settings, the seed and the sample range. A pixel's samples are a function
//! of its coordinates and their indices, independent of the rest of their batch, and are added to exact sums. Threads,
//! tiles, passes and [`parts`] of the image therefore do not change a bit.
//!
//! Inputs and outputs: [`RenderSettings`], [`Continuation`], [`Rendering`], [`RenderError`]. Passes:
//! `render_or_resume` (entry points), `run`, `pace`, `shared_cells`, [`cell_progress`]. Tiles, threads and batches:
//! `tile_share`, `tiles`, `tile_samples`, `worker`, `emission_rays`. Finished film: `control_variates`,
//! [`cryptomatte`], [`output`]. Files: [`parts`], [`film_file`]. Costs: [`memory`], [`phases`], [`measured_batches`].

pub mod cell_progress;
mod continuation;
mod control_variates;
pub mod cryptomatte;
mod emission_rays;
pub mod film_file;
pub mod measured_batches;
pub mod memory;
pub mod output;
mod pace;
pub mod parts;
pub mod phases;
mod render_error;
mod render_or_resume;
mod render_settings;
mod rendering;
mod run;
mod shared_cells;
mod tile_samples;
mod tile_share;
mod tiles;
mod worker;

pub use crate::integrators::CacheReport;
pub use crate::integrators::path::BATCH_PATHS;
pub use crate::planning::preparation::{ThreadError, thread_pool};
pub use continuation::{Continuation, PassObserver, TileObserver};
pub use film_file::{FilmFile, Storage};
pub use render_error::RenderError;
pub use render_or_resume::{render, resume};
pub use render_settings::{RenderSettings, depends_on_earlier_samples};
pub use rendering::{Progress, Rendering};
pub use tile_share::TileShare;
pub use tiles::Tiles;
