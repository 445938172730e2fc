//! Stanford PLY meshes: ASCII and binary of both byte orders, plain or gzip.
//!
//! The file is streamed through a small buffer, which is faster than memory mapping (no page faults), needs no
//! `unsafe`, and allocates only the mesh. Counts in the header are compared with the size of the file before anything
//! is allocated, and every index is checked. Faces with three vertices become triangles, faces with four become quads
//! (bilinear patches in pbrt), larger ones triangle fans; triangle strips are expanded. If corners of faces have
//! texture coordinates, vertices at seams are split.
//!
//! Reading order: `mesh`, `error`, `header`, `stream`, `numbers`, `vertices`, `faces`, `wedges`, `unread`, `read`,
//! `size`.

mod error;
mod faces;
mod header;
mod mesh;
mod numbers;
mod read;
mod size;
mod stream;
mod unread;
mod vertices;
mod wedges;

#[cfg(test)]
mod tests;

pub use error::{Place, PlyError};
pub use mesh::{PlyMesh, PlySize};
pub use read::{parse_ply, read_ply};
pub use size::ply_size;
