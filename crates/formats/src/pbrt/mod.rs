//! The text of the pbrt-v4 scene format.
//!
//! Reading order: [`lexer`] (tokens), [`params`] (typed parameters), [`directive`], [`arguments`], [`parser`] (text to
//! directives).

pub mod arguments;
pub mod directive;
pub mod lexer;
pub mod params;
pub mod parser;
