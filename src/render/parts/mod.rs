//! Films in files: parts of an image, which are merged to the bits of the whole, and checkpoints, from which a rendering
//! goes on.
//!
//! Both are one format ([`mod@file`]): the exact sums of some samples of some pixels, tile by tile ([`stored_tile`]), with
//! the settings that they belong to ([`header`], [`notes`]). [`extent`] says which samples of which pixels; [`film_file`] is all
//! that is stored of a rendering, by [`checkpoint`] while it is under way; [`stored`] is what it goes on from. [`mod@merge`]
//! adds parts up. `partial` is a file that is being written.

pub mod checkpoint;
pub mod error;
pub mod extent;
pub mod file;
pub mod film_file;
pub mod header;
pub mod merge;
pub mod notes;
mod partial;
pub mod stored;
pub mod stored_tile;

pub use checkpoint::Checkpoints;
pub use error::PartError;
pub use extent::{Extent, ExtentError};
pub use file::{FilmReader, write_film};
pub use film_file::{FilmFile, Storage};
pub use header::{FilmHeader, PLAN_NOTE};
pub use merge::{Merged, merge};
pub use notes::{Asked, CameraMatrices};
pub use stored::Stored;
pub use stored_tile::StoredTile;
