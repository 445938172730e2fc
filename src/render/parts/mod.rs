//! Film sums in files: parts of an image, whose merged image is bit-identical to the whole, and checkpoints, from which
//! a rendering is resumed.
//!
//! Both have one format ([`mod@file`]): exact sums of some samples of some pixels, tile by tile ([`stored_tile`]), with
//! the settings that they belong to ([`header`], [`notes`]). [`extent`] selects samples and pixels.
//! [`super::film_file`] is the storage of one rendering, with [`checkpoint`] while it runs. [`stored`] is the input of
//! a resumed rendering. [`mod@merge`] adds parts. `partial` is a file with a temporary name.

pub mod checkpoint;
pub mod error;
pub mod extent;
pub mod file;
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
pub use header::FilmHeader;
pub use merge::{Merged, merge};
pub use notes::{Asked, CameraMatrices};
pub use stored::Stored;
pub use stored_tile::StoredTile;
