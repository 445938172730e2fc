//! The pbrt-v4 scene format.
//!
//! Reading order: [`state`] (the state machine over `lumiris_formats::pbrt`'s directives) with a file for each kind of directive:
//! [`transform`], [`options`], [`settings`], [`film`], [`spectrum`], [`textures`], [`materials`], [`lights`], [`shapes`]; and
//! [`finish`] (files are read, and the scene is put together).

pub mod film;
pub mod finish;
pub mod lights;
pub mod materials;
pub mod options;
pub mod settings;
pub mod shapes;
pub mod spectrum;
pub mod state;
pub mod textures;
pub mod transform;

#[cfg(test)]
mod tests;
