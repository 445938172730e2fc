//! NanoVDB files: sparse grids of numbers [Museth 2021].
//!
//! A file is a sequence of segments, each with a list of its grids and their data, uncompressed or compressed; or it
//! consists of grids only. A grid is the memory image of a tree: a root with blocks of 4096³ voxels, nodes of 32³ and
//! of 16³ entries, and leaves of 8³ voxels. An entry without a child is a *tile*: all of its voxels have the same
//! value. Voxels outside of all blocks have the background value. Numbers are little-endian.
//!
//! All versions 32.x share this layout. Only the list and the requested grid are read from a file. Each offset is
//! checked, no node is visited twice, and allocations are bounded by the size of the file.
//!
//! Reading order: `grid`, `error`, `bytes`, `file`, `blosc`, `tree`, `read`.

mod blosc;
mod bytes;
mod error;
mod file;
mod grid;
mod read;
mod tree;

#[cfg(test)]
mod tests;

pub use error::NanoError;
pub use grid::{GridClass, LEAF, LEAF_VOXELS, NanoGrid, NanoSize, Tile, ValueType};
pub use read::{nanovdb_size, parse_nanovdb, read_nanovdb};
