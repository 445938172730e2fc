//! Meshes of implicit surfaces: surface nets [Gibson 1998] with one vertex per sheet and cell [Nielson 2004], so that
//! the mesh is closed and every edge has exactly two triangles.
//!
//! The field f is sampled at the corners of a grid of cubes. A cell in which f changes sign gets a vertex for each of
//! its sheets ([`cases`]): the mean of the crossings of the sheet's edges. In cells with a single sheet it is moved
//! onto f = 0 by one Newton step of the trilinear interpolant. Every crossed grid edge gives the polygon of the four
//! vertices around it. If the surface crosses a face of two cells twice, both polygons of each crossing get an
//! additional vertex between the two cells; otherwise the two crossings might share an edge.
//!
//! Cubes of 16³ cells are processed in parallel and merged in order, so the mesh does not depend on the number of
//! threads. Leaves of 4³ cells are skipped if the field's bounds exclude a sign change.
//!
//! Reading order: `field`, `grid`, `cases`, `block`, `mesh`, `piece`.

mod block;
mod cases;
mod field;
mod grid;
mod mesh;
mod piece;

pub use field::{Ball, Field};
pub use grid::Grid;
pub use mesh::mesh_field;
#[cfg(test)]
pub(super) use mesh::tests::assert_closed;
pub use piece::largest_piece;
