//! Ptex files (`.ptx`): a texture for each face of a mesh, without texture coordinates [Burley and Lacewell 2008]. The
//! format is specified at <https://ptex.us/PtexFile.html>, version 1.
//!
//! Only level 0 of quadrilateral meshes is read; coarser levels are computed from it. A file consists of a header, and
//! of blocks whose sizes are in the header: face descriptions, means of the faces, sizes of the levels, levels. Each
//! block is compressed separately. All sizes are compared with the size of the file before anything is allocated.
//!
//! Reading order: `file`, `error`, `blocks`, `read`.

mod blocks;
mod error;
mod file;
mod read;

#[cfg(test)]
mod tests;

pub use error::PtexError;
pub use file::{Neighbor, PtexFace, PtexFile, PtexSize, PtexTexels};
pub use read::{parse_ptex, ptex_size, read_ptex};
