//! The pbrt-v4 scene format.
//!
//! Reading order: [`lexer`] (tokens), [`params`] (typed parameters), [`directive`], [`arguments`], [`parser`] (text to
//! directives); then [`state`] (the state machine) with a file for each kind of directive: [`transform`], [`options`],
//! [`settings`], [`film`], [`spectrum`], [`textures`], [`materials`], [`lights`], [`shapes`]; and [`finish`] (files are read, and the scene is put
//! together).

pub mod arguments;
pub mod directive;
pub mod film;
pub mod finish;
pub mod lexer;
pub mod lights;
pub mod materials;
pub mod options;
pub mod params;
pub mod parser;
pub mod settings;
pub mod shapes;
pub mod spectrum;
pub mod state;
pub mod textures;
pub mod transform;

#[cfg(test)]
mod tests;
