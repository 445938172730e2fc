//! Lumiris: an offline CPU renderer for lighting integrals that are hard to sample.
//!
//! Numerics without scenes are in the crate `lumiris_numbers`, file parsers in `lumiris_formats`. The code here is
//! layered; a module imports only from layers above it in this list (checked by `tests/it/layering`):
//!
//! | layer | modules |
//! |---|---|
//! | 1 | [`imaging`], [`huge_pages`] |
//! | 2 | [`textures`], [`geometry`], [`bsdfs`], [`media`], [`cameras`], [`film`] |
//! | 3 | [`materials`], [`lights`], [`accel`] |
//! | 4 | [`settings`] |
//! | 5 | [`scene`] |
//! | 6 | [`import`], [`direct`], [`photons`] |
//! | 7 | [`integrators`] |
//! | 8 | [`planning`] |
//! | 9 | [`render`] |

pub mod accel;
pub mod bsdfs;
pub mod cameras;
pub mod direct;
pub mod film;
pub mod geometry;
pub mod huge_pages;
pub mod imaging;
pub mod import;
pub mod integrators;
pub mod lights;
pub mod materials;
pub mod media;
pub mod photons;
pub mod planning;
pub mod render;
pub mod scene;
pub mod settings;
pub mod textures;
