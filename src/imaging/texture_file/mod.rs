//! Pyramids in files: tiled TIFF files that hold our own levels and are read by tiles, without OpenImageIO.
//!
//! Other programs read them as tiled textures with levels (BigTIFF, not compressed). In front of the directories is a
//! header of our own, so that opening reads about 1 kB; behind each tile is its checksum.
//!
//! Reading order: `layout`, `directories` (for other programs), `write`, `read`.

mod directories;
mod layout;
mod read;
mod write;

pub use read::{Repair, TextureFile};
pub use write::write_texture;
