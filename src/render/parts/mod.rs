//! Films in files: parts of an image, which are merged to the bits of the whole, and checkpoints, from which a rendering
//! goes on.
//!
//! Both are one format ([`mod@file`]): the exact sums of some samples of some pixels, tile by tile ([`stored_tile`]), with
//! the settings that they belong to ([`header`]). [`checkpoint`] stores them while an image is rendered; [`mod@merge`] adds
//! them up.

pub mod checkpoint;
pub mod error;
pub mod file;
pub mod header;
pub mod merge;
pub mod stored_tile;

pub use checkpoint::Checkpoints;
pub use error::PartError;
pub use file::{FilmReader, write_film};
pub use header::FilmHeader;
pub use merge::{Merged, merge};
pub use stored_tile::StoredTile;
